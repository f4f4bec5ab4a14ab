"""Reading and atomic writing of whole files, with errors as `RosyError`."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import RosyError


def read_bytes(
    path: str | os.PathLike[str], *, reject_binary: bool = False, max_bytes: int | None = None
) -> bytes:
    """Return the contents of a file.

    Parameters
    ----------
    path : path-like
    reject_binary : bool
        Raise an error if the first 4096 bytes contain a zero byte. The rest is then not read.
    max_bytes : int, optional
        Largest permitted size of the file. At most one byte more is read.

    Raises
    ------
    RosyError
        If the file is missing, is a folder, cannot be read, is larger than `max_bytes`, or is
        binary and `reject_binary` is set.
    """
    try:
        with open(path, "rb") as file:
            head = file.read(4096)
            if reject_binary and b"\0" in head:
                raise RosyError(f"{path}: expected text, found binary data")
            data = head + file.read(-1 if max_bytes is None else max(max_bytes + 1 - len(head), 0))
        if max_bytes is not None and len(data) > max_bytes:
            raise RosyError(f"{path}: is larger than the limit of {max_bytes:,} bytes")
        return data
    except RosyError:
        raise
    except (OSError, ValueError) as error:
        raise RosyError(f"{path}: cannot be read: {_error_text(error)}") from error


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file atomically: a reader finds either the old contents or all of the new.

    The data is written to a temporary file in the same folder, which then replaces the target. The
    permissions of an existing file are kept.

    Raises
    ------
    RosyError
        If the folder is missing, or the file cannot be written. An existing file stays unchanged.
    """
    target = Path(path)
    temporary = None
    try:
        check_writable(target)
        descriptor, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        os.chmod(temporary, _file_permissions(target))
        os.replace(temporary, target)
    except (OSError, ValueError) as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        if isinstance(error, RosyError):
            raise
        raise RosyError(f"{path}: cannot be written: {_error_text(error)}") from error


def check_writable(path: str | os.PathLike[str]) -> None:
    """Check that a file could be written, before a long task computes its contents.

    Raises
    ------
    RosyError
        If the path is a folder, its folder is missing, or the folder or the file is not writable.
    """
    target = Path(path)
    if target.is_dir():
        raise RosyError(f"{path}: cannot be written: it is a folder")
    if not target.parent.is_dir():
        raise RosyError(f"{path}: cannot be written: the folder {target.parent} does not exist")
    if not os.access(target.parent, os.W_OK) or (
        target.exists() and not os.access(target, os.W_OK)
    ):
        raise RosyError(f"{path}: cannot be written: permission denied")


def _file_permissions(target: Path) -> int:
    """Return the permission bits of an existing file, or those of a new file by the umask."""
    if target.exists():
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _error_text(error: OSError | ValueError) -> str:
    """Return the reason of an error in lower case, without number and path."""
    return (getattr(error, "strerror", None) or str(error)).lower()
