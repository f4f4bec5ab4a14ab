"""Print the output of commands so that it is safe on any terminal."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

from ..core.errors import escape_unsafe, one_line
from ..core.file_io import os_error_text

#: The stream that commands print to. None: `sys.stdout`.
_own_output: TextIO | None = None


class OutputError(Exception):
    """The error that standard output cannot be written."""


@contextmanager
def writing_output() -> Iterator[None]:
    """Context manager for a block that writes output: raise its `OSError` as an `OutputError`.

    A `BrokenPipeError` (the reader of the output has ended) is not changed.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output: {os_error_text(error)}") from error


def output_stream() -> TextIO:
    """Return the stream that commands print to: standard output, or the one given to `use_output`."""
    return sys.stdout if _own_output is None else _own_output


def use_output(stream: TextIO) -> None:
    """Let commands print to a stream instead of `sys.stdout`. This separates their output from Blender's."""
    global _own_output
    _own_output = stream


def printable(text: str, encoding: str | None = None) -> str:
    """Return a text in which control characters, and those a terminal cannot encode, are escaped (``\\x1b``).

    Parameters
    ----------
    text : str
    encoding : str, optional
        Encoding of the terminal; UTF-8 by default.

    Examples
    --------
    >>> printable("a\\x1b[31mb")
    'a\\\\x1b[31mb'
    """
    encoding = encoding or "utf-8"
    return escape_unsafe(text).encode(encoding, "backslashreplace").decode(encoding)


def print_line(text: str, file: TextIO | None = None) -> None:
    """Print a text, escaped by `printable`, to a stream (by default standard output), and flush it."""
    file = output_stream() if file is None else file
    with writing_output():
        print(printable(text, getattr(file, "encoding", None)), file=file, flush=True)


def print_error(text: str) -> None:
    """Print a line to the error stream: ``rosy:`` and a message."""
    print_line("rosy: " + one_line(text), sys.stderr)


def discard_output() -> None:
    """Redirect standard output to the null device, because the rest of its buffer cannot be written."""
    descriptor = os.open(os.devnull, os.O_WRONLY)
    os.dup2(descriptor, output_stream().fileno())
    os.close(descriptor)
