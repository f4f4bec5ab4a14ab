"""Run the steps of jobs beside a helper process."""


def finished(runner, helper):
    """Run the steps of a `StepRunner` to their end, and return their result."""
    while True:
        while not runner.poll():
            helper.wait(0.1)
        try:
            runner.advance()
        except StopIteration as end:
            return end.value
