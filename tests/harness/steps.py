"""Run the steps of jobs, here or beside a helper process."""

from contextlib import closing, suppress


def each_step(steps):
    """Yield what a job yields, and make its calls. Closing this generator cancels the job."""
    answer = None
    with closing(steps), suppress(StopIteration):
        while True:
            step = steps.send(answer)
            yield step
            answer = step() if callable(step) else None


def finished(runner, helper):
    """Run the steps of a `StepRunner` to their end, and return their result."""
    while True:
        while not runner.poll():
            helper.wait(0.1)
        try:
            runner.advance()
        except StopIteration as end:
            return end.value
