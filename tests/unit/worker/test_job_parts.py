"""Jobs as parts of others, programs as parts of jobs, and calls that helpers make."""

import os
import signal
import sys
import time
from unittest.mock import Mock

import pytest
from harness.steps import each_step, finished
from listeners import CancelledError, cancel_at

from rosy_addon.core.errors import RosyError
from rosy_addon.core.progress import listening
from rosy_addon.worker.job import Call, Step, job, part, reverting, run
from rosy_addon.worker.program import run_program
from rosy_addon.worker.step_runner import StepRunner


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
    found = [step[-3:] if isinstance(step, Call) else step for step in each_step(whole())]
    assert found == [(0.2, 0.4, "dividing"), (0.4, "thinking"), (0.4, 0.6, None)]
    assert {step.label for step in each_step(part(halves.begin(6), 0, 1, "all"))} == {"all"}


def test_errors_pass_through_parts(error_of):
    assert error_of(run, part(halves.begin(5), 0.0, 1.0)) == "odd"
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


def test_a_job_without_a_result_is_reverted(error_of):
    """Also if it is cancelled before its first step, but not if it ends with a result."""
    for number, outcome in ((5, "failed"), (6, "done"), (5, "closed")):
        reverted = []
        steps = reverting(halves.begin(number), lambda reverted=reverted: reverted.append(True))
        if outcome == "closed":
            steps.close()
        elif outcome == "failed":
            assert error_of(run, steps) == "odd"
        else:
            assert run(steps) == 9
        assert reverted == ([] if outcome == "done" else [True])


def test_programs():
    labels = []
    with listening(lambda _, label: labels.append(label)):
        code = "import time; time.sleep(0.2); print('out'); raise SystemExit(3)"
        status, output = run_program([sys.executable, "-c", code], "working")
    assert (status, output.strip()) == (3, "out") and set(labels) == {"working"}


@pytest.mark.parametrize("by_listener", [False, True])
def test_a_cancelled_job_kills_its_program(tmp_path, by_listener):
    path = tmp_path / "late"
    code = f"import time; time.sleep(0.5); open({str(path)!r}, 'w')"
    command = [sys.executable, "-c", code]
    if by_listener:
        with listening(cancel_at(1)), pytest.raises(CancelledError):
            run_program(command, "working")
    else:
        steps = run_program.begin(command, "working")
        next(steps)
        steps.close()
    time.sleep(0.7)
    assert not path.exists()


def called(function, *arguments):
    return (yield Call(function, arguments, 0.2, 0.6, "adding"))


def test_a_helper_makes_the_calls_of_steps(helper, error_of):
    runner = StepRunner(halves.begin(6), helper)
    assert finished(runner, helper) == 9 and runner.is_done
    assert error_of(finished, StepRunner(halves.begin(5), helper), helper) == "odd"
    assert finished(StepRunner(halves.begin("six"), helper), helper) == "no number"


def test_runners_share_a_helper(helper):
    runners = [StepRunner(called(sum, [1, number]), helper) for number in range(3)]
    for runner in runners:
        runner.advance()
        assert runner.step == Step(0.2, "adding")
    assert not any(runner.poll() for runner in runners)
    assert [finished(runner, helper) for runner in runners] == [1, 2, 3]


@pytest.mark.slow
def test_a_call_is_made_again_if_its_helper_is_killed(helper, error_of):
    runner = StepRunner(called(time.sleep, 30.0), helper)
    runner.advance()
    for _ in range(2):
        runner.poll()
        while not helper._is_ready:
            assert not runner.poll()
            time.sleep(0.01)
        os.kill(helper.pid, signal.SIGKILL)
        helper._process.wait()
        runner.poll()
    assert "ended twice" in error_of(finished, runner, helper)


def test_calls_are_made_here_if_no_process_can_be_started(helper, monkeypatch):
    refuse = Mock(side_effect=OSError("too many processes"))
    monkeypatch.setattr("rosy_addon.worker.helper.start_module", refuse)
    runner = StepRunner(called(sum, [1, 2]), helper)
    runner.advance()
    assert runner.poll() and runner.is_in_place and not helper.is_usable
    assert finished(runner, helper) == 3
