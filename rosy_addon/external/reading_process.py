"""`read_in_helper`: read files with other libraries in a helper process, with limits of time and memory.

Damaged files make VTK and meshio crash, wait forever, or take all memory.
"""

import contextlib
import os
import re
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from ..core.errors import RosyError
from ..core.file_io import open_file
from ..core.memory import available_memory, limit_memory
from ..worker.helper import Helper, HelperLostError

#: Seconds after which reading is given up, and seconds that are added for each megabyte of the files. meshio, the
#: slowest reader, takes 0.2 s for a megabyte of Abaqus' format.
READ_SECONDS, SECONDS_PER_MEGABYTE = 50.0, 5.0

#: Number of bytes at the beginning of a file in which names of other files are looked for.
NAMED_BYTES = 1 << 18

#: Pattern of the names of other files in a file: attributes in XML, items in JSON, options of Abaqus, and texts in
#: XML, in which the name of an HDF5 file ends before a colon.
NAMES = re.compile(
    rb"""(?:\b(?:file|href|source)\s*=\s*["']|"uri"\s*:\s*"|\binput\s*=\s*|>\s*)([^"'<>:\r\n]{1,4096})""",
    re.IGNORECASE,
)

_Result = TypeVar("_Result")

#: The helper process. It is kept, as it takes longer to import VTK than to read most files.
HELPER = Helper()


def read_in_helper(
    paths: Sequence[Path], function: Callable[..., _Result], *arguments: Any
) -> _Result:
    """Let the helper process call a function that reads files, and return its result.

    The function may use all free memory (on Linux), and has a time limit that depends on the size of the files.
    If no helper process can be started, this process calls the function, without limits.

    Parameters
    ----------
    paths : sequence of Path
        The files. Messages name the first one.
    function : function
        A function of a module of this package.
    *arguments
        Its arguments, which are pickled.

    Raises
    ------
    RosyError
        If the function raises it, if a file cannot be read or refers to a pipe or a device, or if the helper
        process ends or reaches a limit.
    """
    free = available_memory()
    seconds = READ_SECONDS + SECONDS_PER_MEGABYTE * 1e-6 * _size_with_named_files(paths)
    end, outcome = time.monotonic() + seconds, None
    try:
        HELPER.submit(_call_with_limit, os.getcwd(), free, function, *arguments)
        while outcome is None and time.monotonic() < end:
            HELPER.wait(end - time.monotonic())
            outcome = HELPER.poll()
        if outcome is not None:
            return outcome()
        reason = f"its reader did not end in {seconds:.0f} seconds: it is damaged: write it again"
    except MemoryError:
        reason = "it needs more memory than is free: choose a smaller file"
    except HelperLostError as error:
        if not error.has_started:
            return function(*arguments)
        reason = (
            "its reader crashed: it is damaged, or needs more memory than is free: write it again"
        )
    finally:
        if outcome is None:
            HELPER.close()
    raise RosyError(f"{paths[0]}: cannot be read: {reason}")


def _call_with_limit(
    folder: str, free: int | None, function: Callable[..., _Result], *arguments: Any
) -> _Result:
    """Return the result of a function, which may take `free` more bytes of memory (None: any number).

    `folder` is the folder to which relative paths refer.
    """
    os.chdir(folder)
    limit_memory(free)
    return function(*arguments)


def _size_with_named_files(paths: Sequence[Path]) -> int:
    """Return the total size in bytes of files and of all files that they refer to, directly or indirectly.

    Raises
    ------
    RosyError
        If one of the files cannot be read, or is a pipe or a device.
    """
    size, waiting, found = 0, list(paths), set(paths)
    while waiting:
        path = waiting.pop()
        with open_file(path) as file:
            size += os.fstat(file.fileno()).st_size
            names = {os.fsdecode(name.strip()) for name in NAMES.findall(file.read(NAMED_BYTES))}
        # Abaqus' files are also looked for in the working directory.
        named = {folder / name for name in names for folder in (path.parent, Path())} - found
        for other in named:
            with contextlib.suppress(OSError, ValueError):  # a name that no file can have
                if other.exists() and not other.is_dir():
                    waiting.append(other)
        found |= named
    return size
