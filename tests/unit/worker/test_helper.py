"""A helper process, as it is started by Blender and by the command line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import ROOT

from rosy_addon.core.errors import RosyError
from rosy_addon.worker import start as module
from rosy_addon.worker.helper import Helper, HelperLostError

sys.path.append(str(Path(__file__).parent))
import calls


@pytest.fixture(scope="module")
def helper():
    helper = Helper()
    yield helper
    helper.close()


def waited(helper: Helper, function, *arguments, seconds: float = 20.0):
    deadline = time.monotonic() + seconds
    helper.submit(function, *arguments)
    while (outcome := helper.poll()) is None:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    return outcome()


def is_running(pid: int) -> bool:
    """Whether a process exists and is not a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def has_ended(pid: int, seconds: float) -> bool:
    deadline = time.monotonic() + seconds
    while is_running(pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    return not is_running(pid)


def test_it_returns_results_and_stays_for_the_next_call(helper):
    assert waited(helper, max, 3, 4) == 4
    pid = helper.pid
    assert waited(helper, sorted, [3, 1]) == [1, 3] and helper.pid == pid


def test_progress_arrives(helper):
    helper.submit(calls.count, 60)
    seen = []
    while (outcome := helper.poll()) is None:
        seen.append((helper.fraction, helper.label))
        time.sleep(0.005)
    fractions = [fraction for fraction, _ in seen]
    assert fractions == sorted(fractions) and len(set(fractions)) > 5
    assert any(label.startswith("step ") for _, label in seen) and outcome() == 60


def test_errors_are_those_of_the_function_with_its_traceback(helper):
    with pytest.raises(RosyError, match="no faces") as caught:
        waited(helper, calls.fail, "no faces")
    assert "calls.py" in str(caught.value.__cause__)


def test_results_that_cannot_be_sent_are_an_error(helper):
    with pytest.raises(RuntimeError, match="pickle"):
        waited(helper, calls.answer_with_a_function)


def test_cancelling_ends_the_process_at_once(helper):
    helper.submit(calls.count, 10_000)
    while helper.fraction == 0:
        helper.poll()
    pid, start = helper.pid, time.monotonic()
    helper.close()
    assert not is_running(pid) and time.monotonic() - start < 0.2 and waited(helper, max, 3, 4) == 4


def test_a_process_that_ends_is_lost(helper):
    with pytest.raises(HelperLostError, match="has ended") as caught:
        waited(helper, calls.end)
    assert caught.value.has_started and waited(helper, max, 3, 4) == 4


@pytest.mark.parametrize("program", ["/no/such/program", "/bin/false"])
def test_processes_that_cannot_be_started_are_lost(program, monkeypatch):
    monkeypatch.setattr(module.sys, "executable", program)
    with pytest.raises(HelperLostError, match="can") as caught:
        waited(Helper(), max, 3, 4)
    assert not caught.value.has_started


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the list of processes")
@pytest.mark.parametrize(
    ("number", "is_busy"), [(signal.SIGKILL, True), (signal.SIGKILL, False), (signal.SIGTERM, True)]
)
def test_no_helper_outlives_the_process_that_started_it(number, is_busy):
    program = f"""
import sys, time
sys.path[:0] = [{str(ROOT)!r}, {str(Path(__file__).parent)!r}]
import calls
from rosy_addon.worker.helper import Helper
helper = Helper()
helper.submit(calls.count, 1 if not {is_busy} else 100_000, 0.01)
while helper.poll() is None and helper.fraction == 0:
    pass
print(helper.pid, flush=True)
time.sleep(100)
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as process:
        pid = int(process.stdout.readline())
        assert is_running(pid)
        os.kill(process.pid, number)
        process.wait()
        assert has_ended(pid, 2.0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the list of processes")
def test_no_frame_worker_outlives_the_command_that_started_it(tmp_path):
    program = f"""
import sys
sys.path[:0] = [{str(ROOT)!r}]
from rosy_addon.worker.frame_workers import run_local
code = "import os, time; print(os.getpid(), flush=True); time.sleep(100)"
for line in run_local([sys.executable, "-c", code], range(2), 2):
    print(line, flush=True)
"""
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
        pids = [int(process.stdout.readline()) for _ in range(2)]
        process.kill()
        process.wait()
        assert all(has_ended(pid, 2.0) for pid in pids)
    assert not list(tmp_path.iterdir())
