"""Reading and atomic writing of whole files, with errors as `RosyError`."""

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

#: Bytes at the beginning of a file that show whether it is binary.
HEAD_BYTES = 4096

#: Bytes at the beginning of a text file in which words and lines are counted, and bytes of memory
#: that each takes while the file is parsed.
COUNTED_BYTES, WORD_MEMORY, LINE_MEMORY = 1 << 16, 110, 200

#: Names of temporary files: the machine and the process that writes them, and a random number.
TEMPORARY_NAME = re.compile(r"\.rosy-(?P<host>[0-9a-f]{8})-(?P<pid>\d{1,10})-[0-9a-f]{16}(\.\w+)?$")

#: Age in seconds of a temporary file that nothing writes to any more.
LEFTOVER_SECONDS = 24 * 3600


def read_bytes(
    path: str | os.PathLike[str], *, reject_binary: bool = False, max_bytes: int | None = None
) -> bytes:
    """Return the contents of a file.

    Parameters
    ----------
    path : path-like
    reject_binary : bool
        Raise an error if the first `HEAD_BYTES` contain a zero byte. The rest is then not read.
    max_bytes : int, optional
        Largest permitted size of the file. At most one byte more is read.

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
        if max_bytes is None:
            check_memory(os.fstat(file.fileno()).st_size, f"{path}", "choose a smaller file")
        data = head + file.read(-1 if max_bytes is None else max(max_bytes + 1 - len(head), 0))
    if max_bytes is not None and len(data) > max_bytes:
        raise RosyError(f"{path}: is larger than the limit of {max_bytes:,} bytes")
    return data


@contextmanager
def open_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for reading. A pipe or a device, which may never end, is not opened.

    Raises
    ------
    RosyError
        If the file is missing, is not a regular file, or cannot be read.
    """
    with _system_errors(path, "cannot be read"):
        if not stat.S_ISREG(os.stat(path).st_mode) and not os.path.isdir(path):
            raise RosyError(f"{path}: cannot be read: it is not a regular file")
        with open(path, "rb") as file:
            yield file


@contextmanager
def _system_errors(path: str | os.PathLike[str], what: str) -> Iterator[None]:
    """Raise the errors of the system in a ``with`` block as `RosyError`, which says what fails."""
    try:
        yield
    except RosyError:
        raise
    except (OSError, ValueError) as error:
        raise RosyError(f"{path}: {what}: {os_error_text(error)}") from error


def check_readable(path: str | os.PathLike[str]) -> None:
    """Check that a file can be read, before something that would wait for a pipe opens it.

    Raises
    ------
    RosyError
        As `open_file`.
    """
    with open_file(path):
        pass


def check_parsing_memory(path: str | os.PathLike[str], binary_memory: float) -> None:
    """Check that a file of numbers can take the memory that it needs, by its size.

    Parameters
    ----------
    path : path-like
    binary_memory : float
        Bytes of memory that a byte of the file takes if it is binary.

    Raises
    ------
    RosyError
        If it needs more than `available_memory`.
    """
    head = b""
    with suppress(OSError):  # the error is raised where the file is read
        if os.path.isfile(path):
            with open(path, "rb") as file:
                head, size = file.read(COUNTED_BYTES), os.path.getsize(path)
    if not head:
        return
    memory_per_byte = binary_memory
    if b"\0" not in head[:HEAD_BYTES]:
        words, lines = len(head.split()), head.count(b"\n")
        memory_per_byte = (WORD_MEMORY * words + LINE_MEMORY * lines) / len(head)
    check_memory(
        size * memory_per_byte, f"{path}: a file of {format_bytes(size)}", "choose a smaller file"
    )


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file atomically; see `replacing`.

    Raises
    ------
    RosyError
        If the folder is missing, or the file cannot be written. An existing file stays unchanged.
    """
    with replacing(path) as temporary, open(temporary, "xb") as file:
        file.write(data)


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Replace a file atomically: a reader finds either the old contents or all of the new.

    Links are followed. The permissions of an existing file are kept.

    Yields
    ------
    Path
        A temporary path in the same folder, with the same suffix, to write the new contents to. The
        file replaces the target at the end of the block. If there is an error, it is deleted.

    Raises
    ------
    RosyError
        As `check_writable`, or if an `OSError` is raised in the block.
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
    """Delete the temporary files in a folder whose process was killed while it wrote them.

    Those of processes that are running, or may run on another machine, are kept, unless they are
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
    """Return a token of this machine."""
    return f"{zlib.crc32(platform.node().encode()):08x}"


def _is_running(pid: int) -> bool:
    """Whether a process of this machine is running, or may be."""
    if os.name != "posix":
        return True  # elsewhere the signal 0 ends a process
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that a file could be written, before long work computes its contents.

    Raises
    ------
    RosyError
        If the path is a folder, a device or anything else but a regular file, its name is too long,
        its folder is missing, or the folder or the file is not writable.
    """
    with _system_errors(path, "cannot be written"):
        target = Path(os.path.realpath(path))
        # From Python 3.14 on, the methods of Path hide errors, such as a name that is too long.
        with suppress(FileNotFoundError, NotADirectoryError):
            os.lstat(target)
        folder = (target if Path(path).is_symlink() else Path(path)).parent
        if target.is_symlink():  # still, so it leads to itself
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
    """Check that Blender can store pictures in a folder. It may be missing if it can be created.

    Call this before long work.

    Raises
    ------
    RosyError
        If the folder cannot be created or written, or its path has a backslash in the name of a
        folder, which Blender takes for a separator.
    """
    if os.sep != "\\" and "\\" in os.path.abspath(folder):
        raise RosyError(
            f"{folder}: Blender takes the backslash in its path for a separator: choose another folder"
        )
    with _system_errors(folder, "cannot be written"):
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


def make_folder(folder: str | os.PathLike[str]) -> None:
    """Create a folder and its parents if they are missing.

    Raises
    ------
    RosyError
        If that fails.
    """
    with _system_errors(folder, "cannot be created"):
        os.makedirs(folder, exist_ok=True)


def os_error_text(error: OSError | ValueError) -> str:
    """Return the reason of an error in lower case, without number and path."""
    return (getattr(error, "strerror", None) or str(error)).lower()
