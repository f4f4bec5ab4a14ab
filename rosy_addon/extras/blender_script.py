"""Script that runs a command of the Python package in a Blender process; see `extras.blender`.

It loads the package from its folder. The parent folder is not added to `sys.path`, because the other
packages in it are installed for another Python::

    blender -b --factory-startup --python blender_script.py -- JOB

JOB is a JSON object:

package, folder
    Name of the package, and its folder.
arguments
    Arguments of the command.
handles
    File descriptors for the output of the command, for its errors, and for the report. The report is
    the word "begun", and then the exit status. On Windows they are handles.
encodings
    Two encodings: of the output and of the errors. Each is a name and an error handler.
"""

import importlib
import importlib.util
import json
import os
import signal
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO


def run(job: dict[str, Any]) -> None:
    """Run the command of a job, and report its exit status."""
    *descriptors, report = map(own_descriptor, job["handles"])
    output, errors = (
        os.fdopen(descriptor, "w", encoding=encoding, errors=handling)
        for descriptor, (encoding, handling) in zip(descriptors, job["encodings"], strict=True)
    )
    main_in_blender = import_main(job)  # an interrupt in an import may become another exception
    blender_errors, sys.stderr = sys.stderr, errors
    signal.signal(signal.SIGINT, interrupt)
    if hasattr(signal, "SIGPIPE"):
        # As in Python outside of Blender, a closed pipe raises an OSError.
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    os.write(report, b"begun\n")
    try:
        status = main_in_blender(job["arguments"], output)
    except BaseException:
        traceback.print_exc()
        status = 1
    # From here on, Ctrl-C is ignored.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.write(report, b"%d\n" % status)
    sys.stderr = blender_errors


def own_descriptor(handle: int) -> int:
    """Return the file descriptor of an inherited descriptor or handle. Child processes do not inherit it."""
    if sys.platform == "win32":
        import msvcrt

        handle = msvcrt.open_osfhandle(handle, os.O_APPEND)
    os.set_inheritable(handle, False)
    return handle


def interrupt(_number: int, _frame: object) -> None:
    """Handle Ctrl-C: stop the command, and ignore further signals, so that it can remove its files."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise KeyboardInterrupt


def import_main(job: dict[str, Any]) -> Callable[[list[str], TextIO], int]:
    """Import the package, and return the function that runs a command, given its arguments and its output."""
    name, file = job["package"], Path(job["folder"], "__init__.py")
    # As the file is an __init__.py, its folder is searched for submodules.
    spec = importlib.util.spec_from_file_location(name, file)
    package = importlib.util.module_from_spec(spec)
    sys.modules[name] = package
    spec.loader.exec_module(package)
    return importlib.import_module(f"{name}.extras.command_line").main_in_blender


if __name__ == "__main__":
    run(json.loads(sys.argv[sys.argv.index("--") + 1]))
