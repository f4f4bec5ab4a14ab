"""Writing whole files, and what processes leave behind that are killed meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from rosy_addon.core.errors import RosyError
from rosy_addon.core.file_io import LEFTOVER_SECONDS, check_folder, replacing, write_bytes

WRITER = """
import sys, time
from rosy_addon.core.file_io import replacing
with replacing(sys.argv[1]) as temporary:
    temporary.write_bytes(b"half")
    print("writing", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def writer(tmp_path):
    """A process in the midst of writing a file."""
    command = [sys.executable, "-c", WRITER, tmp_path / "a.png"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "writing\n"
    yield process
    process.kill()
    process.communicate()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="only there a process can be asked for")
def test_what_a_killed_process_leaves_is_deleted_by_the_next_one(writer, tmp_path):
    write_bytes(tmp_path / "b.png", b"whole")
    (left, *_) = names(tmp_path)
    assert left.startswith(".rosy-")  # its process is running
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    write_bytes(tmp_path / "b.png", b"whole")
    assert names(tmp_path) == ["b.png"]


def test_leftovers_of_other_machines_are_deleted_after_a_day(tmp_path):
    left = tmp_path / f".rosy-00000000-1-{0:016x}.png"
    others = [tmp_path / ".rosy-notes.txt", tmp_path / ".rosy-00000000-1-0.png"]
    for path in (left, *others):
        path.write_bytes(b"")
        os.utime(path, (0, time.time() - LEFTOVER_SECONDS + 100))
    with replacing(tmp_path / "a.png") as temporary:
        temporary.write_bytes(b"whole")
    assert left.exists()
    for path in (left, *others):
        os.utime(path, (0, time.time() - LEFTOVER_SECONDS - 100))
    write_bytes(tmp_path / "a.png", b"whole")
    assert names(tmp_path) == sorted(["a.png", *(path.name for path in others)])


@pytest.mark.skipif(os.sep == "\\", reason="the backslash is a separator")
def test_a_folder_that_blender_would_look_for_elsewhere_is_refused(tmp_path):
    with pytest.raises(RosyError, match="takes the backslash"):
        check_folder(tmp_path / "a\\b" / "c")
