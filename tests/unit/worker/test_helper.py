"""A helper process, as it is started by Blender and by the command line."""

import os
import sys
import time
from pathlib import Path

import pytest
from harness.processes import is_running

from rosy_addon.core.errors import RosyError
from rosy_addon.worker import start as module
from rosy_addon.worker.frame_workers import parse_frames
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
    with pytest.raises(RosyError, match="expected") as caught:
        waited(helper, parse_frames, "no frames")
    assert "frame_workers.py" in str(caught.value.__cause__)


def test_results_that_cannot_be_sent_are_an_error(helper):
    with pytest.raises(RuntimeError, match="pickle"):
        waited(helper, eval, "lambda: 0")


def test_cancelling_ends_the_process_at_once(helper):
    helper.submit(calls.count, 10_000)
    while helper.fraction == 0:
        helper.poll()
    pid, start = helper.pid, time.monotonic()
    helper.close()
    assert not is_running(pid) and time.monotonic() - start < 0.2 and waited(helper, max, 3, 4) == 4


def test_a_process_that_ends_is_lost(helper):
    with pytest.raises(HelperLostError, match="has ended") as caught:
        waited(helper, os._exit, 3)
    assert caught.value.has_started and waited(helper, max, 3, 4) == 4


@pytest.mark.parametrize("program", ["/no/such/program", "/bin/false"])
def test_processes_that_cannot_be_started_are_lost(program, monkeypatch):
    monkeypatch.setattr(module.sys, "executable", program)
    with pytest.raises(HelperLostError, match="can") as caught:
        waited(Helper(), max, 3, 4)
    assert not caught.value.has_started
