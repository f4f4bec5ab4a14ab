"""Read whole files and write them atomically. All errors are raised as `RosyError`.

No file is replaced that is an input: `check_writable` compares each output with all inputs. These are the files
that were read in a `guarding_inputs` block, and the files that `INPUT_LISTERS` return.
"""

import os
import platform
import re
import secrets
import stat
import sys
import time
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import BinaryIO

from .errors import RosyError
from .memory import check_memory, format_bytes

if sys.platform != "win32":
    import fcntl

#: A file counts as binary if one of this number of bytes at its beginning is zero.
HEAD_BYTES = 4096

#: Number of bytes at the beginning of a text file in which words and lines are counted, and memory in bytes
#: that each word and each line takes while the file is parsed.
COUNTED_BYTES, WORD_MEMORY, LINE_MEMORY = 1 << 16, 110, 200

#: Pattern of the names of temporary files. They contain a hash that identifies the machine, and a random
#: number.
TEMPORARY_NAME = re.compile(r"\.rosy-(?P<machine>[0-9a-f]{8})-[0-9a-f]{16}(\.\w+)?$")

#: Age in seconds above which a temporary file counts as abandoned.
LEFTOVER_SECONDS = 24 * 3600

#: Seconds before each attempt to lock a folder. Another process locks it exclusively only while it deletes
#: leftovers, which takes milliseconds.
LOCK_PAUSES = (0.0, *[0.02] * 9)

#: Functions that return paths of further inputs: in Blender, the open file and what it links.
INPUT_LISTERS: list[Callable[[], Iterable[str]]] = []

#: Paths of the files that were read in a `guarding_inputs` block; None outside of one.
_read_files: ContextVar[set[str] | None] = ContextVar("rosy_read_files", default=None)


@contextmanager
def guarding_inputs() -> Iterator[None]:
    """Context manager: in its block, no file is replaced that was read in the block before."""
    token = _read_files.set(set())
    try:
        yield
    finally:
        _read_files.reset(token)


def add_input(path: str | os.PathLike[str]) -> None:
    """Note that a file is an input. `guarding_inputs` then guards it, also if it has not been read yet."""
    read_files = _read_files.get()
    if read_files is not None:
        read_files.add(os.fspath(path))


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
            add_input(path)
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


def write_bytes(path: str | os.PathLike[str], data: bytes, *, follow_links: bool = False) -> None:
    """Write a file atomically: a reader finds either the old contents or all new contents.

    `follow_links` is as for `replacing`.

    Raises
    ------
    RosyError
        If the folder is missing, or the file cannot be written. An existing file is then not changed.
    """
    with replacing(path, follow_links=follow_links) as (temporary,), open(temporary, "xb") as file:
        file.write(data)


@contextmanager
def replacing(*paths: str | os.PathLike[str], follow_links: bool = False) -> Iterator[list[Path]]:
    """Context manager: replace files atomically. A reader finds either the old contents or all new contents.

    All files are checked before one is written, and all are written before one is replaced. The permissions
    of existing files are kept.

    Parameters
    ----------
    *paths : path-like
    follow_links : bool
        Whether the target of a link is replaced, and not the link itself. It is meant for paths that the user
        has named. The name of a file that RoSy has chosen may be a link that somebody else has made.

    Yields
    ------
    list of Path
        For each path, a temporary path in the same folder, with the same suffix. The block writes the new
        contents to it. At the end of the block, the temporary files replace their targets. If there is an
        error, they are deleted.

    Raises
    ------
    RosyError
        If `check_writable` raises it, or if an `OSError` is raised in the block.
    """
    for path in paths:
        check_writable(path, follow_links=follow_links)
    targets = [_target(path, follow_links) for path in paths]
    names = (f"{_own_prefix()}{secrets.token_hex(8)}{target.suffix}" for target in targets)
    temporaries = [target.with_name(name) for target, name in zip(targets, names, strict=True)]
    with ExitStack() as locks:
        for folder in {target.parent for target in targets}:
            remove_leftovers(folder)
            locks.enter_context(folder_lock(folder))
        try:
            yield temporaries
            for temporary, target in zip(temporaries, targets, strict=True):
                if target.is_file() and not target.is_symlink():
                    os.chmod(temporary, target.stat().st_mode & 0o777)
            for temporary, target in zip(temporaries, targets, strict=True):
                os.replace(temporary, target)
        except BaseException as error:  # an interrupt as well
            for temporary in temporaries:
                temporary.unlink(missing_ok=True)
            if isinstance(error, OSError):
                reason = os_error_text(error)
                raise RosyError(f"{paths[0]}: cannot be written: {reason}") from error
            raise


def _target(path: str | os.PathLike[str], follow_links: bool) -> Path:
    """Return the path of the file that is replaced when `path` is written."""
    return Path(os.path.realpath(path) if follow_links else path)


@contextmanager
def folder_lock(folder: str | os.PathLike[str], *, exclusive: bool = False) -> Iterator[bool]:
    """Context manager: lock a folder, and yield whether it is locked.

    Processes that write to the folder share the lock. A process that gets the lock exclusively knows that none
    of them runs. The lock holds on the whole machine, also for processes in other containers, which cannot see
    each other, and ends with its process. Windows has no such lock.
    """
    if sys.platform == "win32":
        yield False
        return
    operation = fcntl.LOCK_NB | (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH)
    is_locked = False
    with ExitStack() as stack:
        with suppress(OSError):
            descriptor = os.open(folder, os.O_RDONLY)
            stack.callback(os.close, descriptor)
            # It does not wait for long, as the lock may be of the program that has started this one.
            for pause in LOCK_PAUSES[: 1 if exclusive else None]:
                time.sleep(pause)
                with suppress(BlockingIOError):
                    fcntl.flock(descriptor, operation)
                    is_locked = True
                    break
        yield is_locked


def remove_leftovers(folder: str | os.PathLike[str]) -> None:
    """Delete the temporary files that processes left in a folder because they were killed while writing.

    Files of processes that are running, or that may be running on another machine, are kept, unless they are
    older than `LEFTOVER_SECONDS`.
    """
    names: list[str] = []
    with suppress(OSError):
        names = [name for name in os.listdir(folder) if TEMPORARY_NAME.match(name)]
    if not names:
        return
    own_prefix = _own_prefix()
    with folder_lock(folder, exclusive=True) as is_unused:
        for name in names:
            path = os.path.join(folder, name)
            with suppress(OSError):
                age = time.time() - os.lstat(path).st_mtime
                if age > LEFTOVER_SECONDS or (is_unused and name.startswith(own_prefix)):
                    os.unlink(path)


def _own_prefix() -> str:
    """Return the prefix of the names of all temporary files that this machine has made since it was booted.

    It contains a hash: on Linux of the boot ID, which is the same in all containers, elsewhere of the name of the
    machine.
    """
    identity = platform.node()
    with suppress(OSError):
        identity = Path("/proc/sys/kernel/random/boot_id").read_text()
    return f".rosy-{zlib.crc32(identity.encode()):08x}-"


def check_writable(path: str | os.PathLike[str], *, follow_links: bool = False) -> None:
    """Check that a file could be written. Call this before long work that computes its contents.

    `follow_links` is as for `replacing`.

    Raises
    ------
    RosyError
        If the path exists and is not a regular file, or is an input, if its name is too long, if its folder is
        missing, or if the folder or the file is not writable.
    """
    with system_errors(path, "cannot be written"):
        target, mode = _target(path, follow_links), 0
        # From Python 3.14 on, the methods of Path hide errors, such as a name that is too long.
        with suppress(FileNotFoundError, NotADirectoryError):
            mode = os.lstat(target).st_mode
        folder = (target if Path(path).is_symlink() else Path(path)).parent
        is_file, is_link = stat.S_ISREG(mode), stat.S_ISLNK(mode)
        if is_link and follow_links:  # even after it was resolved, so it leads to itself
            raise RosyError(f"{path}: cannot be written: it is a link to itself")
        if stat.S_ISDIR(mode):
            raise RosyError(f"{path}: cannot be written: it is a folder")
        if mode and not is_file and not is_link:
            raise RosyError(f"{path}: cannot be written: it is not a regular file")
        if not folder.is_dir():
            raise RosyError(f"{path}: cannot be written: the folder {folder} does not exist")
        if not os.access(folder, os.W_OK) or (is_file and not os.access(target, os.W_OK)):
            raise RosyError(f"{path}: cannot be written: permission denied")
        if mode and _is_input(target):
            raise RosyError(f"{path}: is also an input: choose another output file")


def _is_input(path: Path) -> bool:
    """Return whether an existing file is an input. The input may have another path that leads to the file."""
    status = os.lstat(path)
    inputs = {*(_read_files.get() or ()), *(name for names in INPUT_LISTERS for name in names())}
    for name in inputs:
        for status_of in (os.stat, os.lstat):
            with suppress(OSError, ValueError):
                if os.path.samestat(status_of(name), status):
                    return True
    return False


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
