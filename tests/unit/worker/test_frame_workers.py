"""Processes for frames: all that they print arrives, while they run, and none is left."""

import os
import sys
import time

import pytest

from rosy_addon.worker.frame_workers import format_frames, parse_frames, run_local


def command(script):
    return [sys.executable, "-c", "import os, sys, time\nframes = sys.argv[1]\n" + script]


def test_all_lines_arrive():
    """Also more than a pipe holds, errors, bytes that are no text, and a last line without an end."""
    script = (
        "print(frames, flush=True)\n"
        "for number in range(20_000): print('line', number)\n"
        "sys.stdout.flush()\n"
        "os.write(2, b'caf\\xe9\\r\\nlast')"
    )
    lines = list(run_local(command(script), range(1, 6), 2))
    assert len(lines) == 2 * 20_003 and {"--frames=1-5:2", "--frames=2-4:2"} <= set(lines)
    assert lines.count("line 19999") == lines.count("caf\N{REPLACEMENT CHARACTER}") == 2
    assert lines.count("last") == 2


def test_lines_arrive_while_processes_run_which_end_with_the_generator():
    script = "print(os.getpid(), flush=True)\ntime.sleep(60)"
    start = time.monotonic()
    lines = run_local(command(script), range(1, 4), 3)
    pids = [int(next(lines)) for _ in range(3)]
    lines.close()
    assert time.monotonic() - start < 30
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_each_process_that_fails_is_named(error_of):
    script = "print('rosy: frame 2: no camera')\nsys.exit(2 if frames[-1] == '2' else 0)"
    assert error_of(list, run_local(command(script), [1, 2], 2)) == "frames 2: no camera"


def test_ranges(error_of):
    assert parse_frames("7") == range(7, 8) and parse_frames("1-5") == range(1, 6)
    assert list(parse_frames("-2-4:3")) == [-2, 1, 4] and list(parse_frames("3,5,6")) == [3, 5, 6]
    for text in ("5-1", "a", "1-5:0", "", "1-", "1-1048575", "9" * 5000, "1_0", "\u0663"):
        message = error_of(parse_frames, text)
        assert "expected" in message and len(message) < 200
    for frames in (range(3, 4), range(1, 9), range(-4, 9, 3)):
        assert parse_frames(format_frames(frames)) == range(frames[0], frames[-1] + 1, frames.step)
