"""Jobs as parts of others, programs as parts of jobs, and calls that helpers make."""

from __future__ import annotations

import os
import signal
import sys
import time

import pytest

from rosy_addon.errors import RosyError
from rosy_addon.progress import listening
from rosy_addon.worker.helper import Helper, HelperLostError
from rosy_addon.worker.job import Call, Step, job, part, run
from rosy_addon.worker.pending_call import PendingCall
from rosy_addon.worker.program import run_program


@job
def halves(number):
    """A job of two calls and a step, which ends with an error if the number is odd."""
    try:
        first = yield Call(divmod, (number, 2), 0.0, 0.5, "dividing")
    except TypeError:
        return "no number"
    yield Step(0.5, "thinking")
    if first[1]:
        raise RosyError("odd")
    return (yield Call(pow, (first[0], 2), 0.5))


def test_a_part_gives_the_same_result_with_scaled_progress():
    def whole():
        return (yield from part(halves.begin(6), 0.2, 0.6))

    assert run(whole()) == halves(6) == 9
    steps = list_steps(whole())
    assert [step[-3:] for step in steps if isinstance(step, Call)] == [
        (0.2, 0.4, "dividing"),
        (0.4, 0.6, None),
    ]
    assert [step for step in steps if isinstance(step, Step)] == [(0.4, "thinking")]
    assert {step.label for step in list_steps(part(halves.begin(6), 0, 1, "all"))} == {"all"}


def list_steps(steps):
    answer, found = None, []
    while True:
        try:
            found.append(steps.send(answer))
        except StopIteration:
            return found
        answer = found[-1]() if isinstance(found[-1], Call) else None


def test_errors_pass_through_parts():
    with pytest.raises(RosyError, match="odd"):
        run(part(halves.begin(5), 0.0, 1.0))
    assert run(part(halves.begin("six"), 0.0, 1.0)) == "no number"


def test_closing_a_whole_closes_its_parts():
    closed = []

    def inner():
        try:
            yield Step(0.0, "waiting")
        finally:
            closed.append(True)

    steps = part(inner(), 0.0, 1.0)
    next(steps)
    steps.close()
    assert closed


def test_programs():
    labels = []
    with listening(lambda _, label: labels.append(label)):
        code = "import time; time.sleep(0.2); print('out'); raise SystemExit(3)"
        status, output = run_program([sys.executable, "-c", code], "working")
    assert (status, output.strip()) == (3, "out") and set(labels) == {"working"}


def test_a_cancelled_job_kills_its_program(tmp_path):
    path = tmp_path / "late"
    code = f"import time; time.sleep(1); open({str(path)!r}, 'w')"
    steps = run_program.begin([sys.executable, "-c", code], "working")
    next(steps)
    steps.close()
    time.sleep(1.2)
    assert not path.exists()


@pytest.fixture
def helper():
    helper = Helper()
    yield helper
    helper.close()


def wait_for(pending, helper):
    while not pending.poll():
        helper.wait(5.0)
    return pending.result()


def test_a_call_is_made_again_if_its_helper_is_killed(helper):
    pending = PendingCall(Call(sum, ([1, 2],), 0.2, 0.6, "adding"), helper)
    assert pending.progress == Step(0.2, "adding")
    assert wait_for(pending, helper) == 3
    pending = PendingCall(Call(time.sleep, (30.0,)), helper)
    for is_last in (False, True):
        while not helper._is_ready:
            pending.poll()
            time.sleep(0.01)
        pending.poll()
        os.kill(helper._process.pid, signal.SIGKILL)
        helper._process.wait()
        if is_last:
            with pytest.raises(RosyError, match="ended twice"):
                pending.poll()
        else:
            assert not pending.poll()


def test_no_process_can_be_started(helper, monkeypatch):
    monkeypatch.setattr("rosy_addon.worker.helper.start_module", refuse)
    with pytest.raises(HelperLostError) as caught:
        PendingCall(Call(sum, ([1, 2],)), helper)
    assert not caught.value.has_started


def refuse(*_, **__):
    raise OSError("too many processes")
