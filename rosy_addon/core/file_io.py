"""Read whole files and write them atomically. All errors are raised as `RosyError`."""

from __future__ import annotations

import os
import platform
import re
import secrets
import stat
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import RosyError
from .memory import check_memory, format_bytes

#: A file counts as binary if one of this number of bytes at its beginning is zero.
HEAD_BYTES = 4096

#: Number of bytes at the beginning of a text file in which words and lines are counted, and memory in bytes
#: that each word and each line takes while the file is parsed.
COUNTED_BYTES, WORD_MEMORY, LINE_MEMORY = 1 << 16, 110, 200

#: Pattern of the names of temporary files. They contain a hash of the name of the machine, the id of the
#: process that writes the file, and a random number.
TEMPORARY_NAME = re.compile(r"\.rosy-(?P<host>[0-9a-f]{8})-(?P<pid>\d{1,10})-[0-9a-f]{16}(\.\w+)?$")

#: Age in seconds above which a temporary file counts as abandoned.
LEFTOVER_SECONDS = 24 * 3600


def read_bytes(
    path: str | os.PathLike[str], *, reject_binary: bool = False, max_bytes: int | None = None
) -> bytes:
    """Return the contents of a file.

    Parameters
    ----------
    path : path-like
    reject_binary : bool
        Raise an error if the first `HEAD_BYTES` bytes contain a zero byte. The rest is then not read.
    max_bytes : int, optional
        Largest permitted size of the file. A larger file is refused before it is read.

    Raises
    ------
    RosyError
        If the file is missing, is a folder, cannot be read, is larger than `max_bytes` or than the
        free memory, or is binary and `reject_binary` is set.
    """
    with open_file(path) as file:
        head = file.read(HEAD_BYTES)
        if reject_binary and b"\0" in head:
            raise RosyError(f"{path}: expected text, found binary data")
        size = os.fstat(file.fileno()).st_size
        if max_bytes is not None and size > max_bytes:
            raise RosyError(f"{path}: is larger than the limit of {max_bytes:,} bytes")
        check_memory(size, f"{path}", "choose a smaller file")
        return head + file.read()


@contextmanager
def open_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Context manager: open a file for reading. A pipe or a device, which may never end, is refused.

    Raises
    ------
    RosyError
        If the file is missing, is not a regular file, or cannot be read.
    """
    with system_errors(path, "cannot be read"):
        if not stat.S_ISREG(os.stat(path).st_mode) and not os.path.isdir(path):
            raise RosyError(f"{path}: cannot be read: it is not a regular file")
        with open(path, "rb") as file:
            yield file


@contextmanager
def system_errors(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Context manager: raise errors of the operating system as `RosyError`.

    The message consists of the path, what went wrong (`what`, for example "cannot be read") and the reason.
    """
    try:
        yield
    except RosyError:
        raise
    except (OSError, ValueError) as error:
        raise RosyError(f"{path}: {what}: {os_error_text(error)}") from error


def check_readable(path: str | os.PathLike[str]) -> None:
    """Check that a file can be read.

    Call this before another library opens the file, as it could wait forever for a pipe.

    Raises
    ------
    RosyError
        If the file is missing, is not a regular file, or cannot be read.
    """
    with open_file(path):
        pass


def check_parsing_memory(path: str | os.PathLike[str], binary_memory: float) -> None:
    """Check that there is enough memory to parse a file of numbers. The need is estimated from its size.

    Parameters
    ----------
    path : path-like
    binary_memory : float
        Bytes of memory that are needed for each byte of the file if it is binary.

    Raises
    ------
    RosyError
        If the file cannot be read, or more memory is needed than `available_memory`.
    """
    with open_file(path) as file:
        head, size = file.read(COUNTED_BYTES), os.fstat(file.fileno()).st_size
    memory_per_byte = binary_memory
    if b"\0" not in head[:HEAD_BYTES]:
        words, lines = len(head.split()), head.count(b"\n")
        memory_per_byte = (WORD_MEMORY * words + LINE_MEMORY * lines) / max(len(head), 1)
    subject = f"{path}: a file of {format_bytes(size)}"
    check_memory(size * memory_per_byte, subject, "choose a smaller file")


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file atomically: a reader finds either the old contents or all new contents.

    Raises
    ------
    RosyError
        If the folder is missing, or the file cannot be written. An existing file is then not changed.
    """
    with replacing(path) as temporary, open(temporary, "xb") as file:
        file.write(data)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Context manager: replace a file atomically. A reader finds either the old contents or all new contents.

    Links are followed. The permissions of an existing file are kept.

    Yields
    ------
    Path
        A temporary path in the same folder, with the same suffix. The block writes the new contents to it. At
        the end of the block, the temporary file replaces the target. If there is an error, it is deleted.

    Raises
    ------
    RosyError
        If `check_writable` raises it, or if an `OSError` is raised in the block.
    """
    check_writable(path)
    target = Path(os.path.realpath(path))
    remove_leftovers(target.parent)
    token = f"{_host_token()}-{os.getpid()}-{secrets.token_hex(8)}"
    temporary = target.with_name(f".rosy-{token}{target.suffix}")
    try:
        yield temporary
        if target.exists():
            os.chmod(temporary, target.stat().st_mode & 0o777)
        os.replace(temporary, target)
    except BaseException as error:  # an interrupt as well
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise RosyError(f"{path}: cannot be written: {os_error_text(error)}") from error
        raise


def remove_leftovers(folder: str | os.PathLike[str]) -> None:
    """Delete the temporary files that processes left in a folder because they were killed while writing.

    Files of processes that are running, or that may be running on another machine, are kept, unless they are
    older than `LEFTOVER_SECONDS`.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            match = TEMPORARY_NAME.match(entry.name)
            if match is None:
                continue
            with suppress(OSError):
                age = time.time() - entry.stat(follow_symlinks=False).st_mtime
                is_own_host = match["host"] == _host_token()
                if age > LEFTOVER_SECONDS or (is_own_host and not _is_running(int(match["pid"]))):
                    os.unlink(entry.path)


def _host_token() -> str:
    """Return 8 hexadecimal digits that identify this machine: a hash of its name."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def _is_running(pid: int) -> bool:
    """Return whether a process of this machine is running. Return True if this is not known."""
    if os.name != "posix":
        return True  # on other systems, the signal 0 ends a process
    try:
        os.kill(pid, 0)
    except (OSError, OverflowError) as error:
        return not isinstance(error, ProcessLookupError)
    return True


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that a file could be written. Call this before long work that computes its contents.

    Raises
    ------
    RosyError
        If the path exists and is not a regular file, if its name is too long, if its folder is missing, or if
        the folder or the file is not writable.
    """
    with system_errors(path, "cannot be written"):
        target = Path(os.path.realpath(path))
        # From Python 3.14 on, the methods of Path hide errors, such as a name that is too long.
        with suppress(FileNotFoundError, NotADirectoryError):
            os.lstat(target)
        folder = (target if Path(path).is_symlink() else Path(path)).parent
        if target.is_symlink():  # even after it was resolved, so it leads to itself
            raise RosyError(f"{path}: cannot be written: it is a link to itself")
        if target.is_dir():
            raise RosyError(f"{path}: cannot be written: it is a folder")
        if target.exists() and not target.is_file():
            raise RosyError(f"{path}: cannot be written: it is not a regular file")
        if not folder.is_dir():
            raise RosyError(f"{path}: cannot be written: the folder {folder} does not exist")
        if not os.access(folder, os.W_OK) or (target.exists() and not os.access(target, os.W_OK)):
            raise RosyError(f"{path}: cannot be written: permission denied")


def check_folder(folder: str | os.PathLike[str]) -> None:
    """Check that Blender can store pictures in a folder. The folder may be missing if it can be created.

    Call this before long work.

    Raises
    ------
    RosyError
        If the folder cannot be created or written to, or if a folder name in its path contains a
        backslash, which Blender takes for a separator.
    """
    if os.sep != "\\" and "\\" in os.path.abspath(folder):
        raise RosyError(
            f"{folder}: Blender takes the backslash in its path for a separator: choose another folder"
        )
    with system_errors(folder, "cannot be written"):
        try:
            if not stat.S_ISDIR(os.stat(folder).st_mode):
                raise RosyError(f"{folder}: is not a folder")
        except FileNotFoundError:
            parents = Path(folder).absolute().parents
            parent = next(parent for parent in parents if os.path.exists(parent))
            if not os.access(parent, os.W_OK):
                raise RosyError(
                    f"{folder}: cannot be created: no permission to write to {parent}"
                ) from None
            return
    check_writable(Path(folder) / "picture.png")


def file_stamp(path: Path) -> tuple[int, ...]:
    """Return the time of the last change (ns) and the size of a file or folder; () if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return ()
    return status.st_mtime_ns, status.st_size


def make_folder(folder: str | os.PathLike[str]) -> None:
    """Create a folder and its parents if they are missing.

    Raises
    ------
    RosyError
        If a folder cannot be created.
    """
    with system_errors(folder, "cannot be created"):
        os.makedirs(folder, exist_ok=True)


def os_error_text(error: OSError | ValueError) -> str:
    """Return the reason of an error of the operating system in lower case, without its number and path."""
    return (getattr(error, "strerror", None) or str(error)).lower()
