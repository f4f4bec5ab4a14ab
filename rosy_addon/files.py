"""Files read whole and written whole, with errors that a user can read."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import RosyError


def read_bytes(
    path: str | os.PathLike[str], *, text: bool = False, limit: int | None = None
) -> bytes:
    """The contents of a file.

    Parameters
    ----------
    path : path-like
    text : bool
        Whether to refuse a file that begins like a binary one, before the rest of it is read.
    limit : int, optional
        Of bytes; no more than one above it is read.

    Raises
    ------
    RosyError
        If it is missing, a folder, may not be read, is larger than the limit, or is binary where
        text is wanted.
    """
    try:
        with open(path, "rb") as file:
            head = file.read(4096)
            if text and b"\0" in head:
                raise RosyError(f"{path}: holds binary data, text is wanted")
            data = head + file.read(-1 if limit is None else max(limit + 1 - len(head), 0))
        if limit is not None and len(data) > limit:
            raise RosyError(f"{path}: is too large: {limit:,} bytes at most")
        return data
    except RosyError:
        raise
    except (OSError, ValueError) as reason:
        raise RosyError(f"{path}: cannot be read: {_reason(reason)}") from reason


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file so that a reader finds either all of it or what was there before.

    Raises
    ------
    RosyError
        If its folder is missing or it may not be written. What was there stays.
    """
    target = Path(path)
    temporary = None
    try:
        check_writable(target)
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(temporary, _mode(target))
        os.replace(temporary, target)
    except (OSError, ValueError) as reason:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        if isinstance(reason, RosyError):
            raise
        raise RosyError(f"{path}: cannot be written: {_reason(reason)}") from reason


def check_writable(path: str | os.PathLike[str]) -> None:
    """Find out before long work whether its result could be written.

    Raises
    ------
    RosyError
        If the path is a folder, or its folder is missing or may not be written.
    """
    target = Path(path)
    if target.is_dir():
        raise RosyError(f"{path}: cannot be written: it is a folder")
    if not target.parent.is_dir():
        raise RosyError(f"{path}: cannot be written: there is no folder {target.parent}")
    if not os.access(target.parent, os.W_OK) or (
        target.exists() and not os.access(target, os.W_OK)
    ):
        raise RosyError(f"{path}: cannot be written: permission denied")


def _mode(target: Path) -> int:
    """The permissions of the file to be replaced, or those that a new one gets."""
    if target.exists():
        return target.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _reason(error: OSError | ValueError) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()
