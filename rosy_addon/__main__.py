"""``python -m rosy_addon VERB ...``: the command line in plain Python."""

import os
import signal
import sys


def _stop_at_once(*_: object) -> None:
    """Handle Ctrl-C while modules are imported or Python ends: end the process at once. No file is open then."""
    os.write(2, b"rosy: stopped\n")
    os._exit(130)


def run() -> int:
    """Run the command of `sys.argv`, and return its exit status."""
    # A KeyboardInterrupt inside an import may become another exception.
    signal.signal(signal.SIGINT, _stop_at_once)
    from .extras.command_line import main

    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return main()
    finally:
        # Python would print the traceback of a KeyboardInterrupt while it ends.
        signal.signal(signal.SIGINT, _stop_at_once)


if __name__ == "__main__":
    sys.exit(run())
