"""Exceptions whose messages are shown to the user, and functions that word messages."""

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

#: Characters that could change how a terminal shows a message, or that files of figures cannot hold: control
#: characters except tab and newline, characters that change the direction of text, bytes of names that are not
#: UTF-8 (lone surrogates), the byte order mark, and noncharacters. Names in files may contain them.
UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff\ufffe\uffff]"
)

#: Patterns of a quoted name in a message, and of a message that begins with an English word, not with the
#: name of a file, a setting or an attribute.
QUOTED = re.compile("'[^']*'")
FIRST_WORD = re.compile(r"[a-z-]+(?![\w.])")


def escape_unsafe(text: str) -> str:
    """Return a text in which `UNSAFE` characters are replaced by escapes, such as ``\\x1b``."""
    return UNSAFE.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def one_line(text: str) -> str:
    """Return a text as one line that is safe to print: line breaks, tabs and `UNSAFE` characters are escaped.

    Examples
    --------
    >>> one_line("two\\nlines")
    'two\\\\nlines'
    """
    return escape_unsafe(text.replace("\n", "\\n").replace("\t", "\\t"))


class RosyError(ValueError):
    """An error that the user can correct, with a message of one line.

    The message says where the error is (object, attribute, file or line), what was found and what
    was expected. Operators report it in Blender. The command line prints it and exits with status 2. Line
    breaks and other control characters, which may occur in names, are escaped.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class RosyWarning(UserWarning):
    """A warning about a result, with a message of one line for the user."""


@contextmanager
def telling_warnings(tell: Callable[[str], None]) -> Iterator[None]:
    """Context manager: call `tell` with the text of each `RosyWarning` of its block. Drop other warnings.

    Warnings with the same text are told once.
    """
    told = set()

    def show(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        text = str(message)
        if issubclass(category, RosyWarning) and text not in told:
            told.add(text)
            tell(text)

    with warnings.catch_warnings():
        warnings.simplefilter("always", RosyWarning)
        warnings.showwarning = show
        yield


class NothingInViewError(RosyError):
    """The error that no object with a field is visible from the camera."""


class NoFeaturesError(RosyError):
    """The error that a mesh has no edges that a field can follow."""


class RowCountError(RosyError):
    """The error that a field has another number of rows than a mesh has faces or vertices."""


class DeviceError(RosyError):
    """The error that there is no usable graphics card, or that the shaders do not compile on it."""


def counted(count: int, singular: str, plural: str = "") -> str:
    """Return a count with its noun, in singular or plural, for messages.

    Examples
    --------
    >>> counted(1, "face"), counted(2000, "face"), counted(0, "vertex", "vertices")
    ('1 face', '2,000 faces', '0 vertices')
    """
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"


def as_sentence(message: str) -> str:
    """Return a message as the interface of Blender shows it: with a capital letter at the beginning.

    Messages begin with a small letter, because they follow ``rosy: error:`` on the command line. A path
    or a name at the beginning is not changed.

    Examples
    --------
    >>> as_sentence("no visible object has a field"), as_sentence("fields/a.rosy: is damaged")
    ('No visible object has a field', 'fields/a.rosy: is damaged')
    """
    head = QUOTED.sub("", message).partition(":")[0]
    is_path = "/" in head or "\\" in head
    if is_path or not FIRST_WORD.match(message):
        return message
    return message[0].upper() + message[1:]


#: The errors that end a command or an operator with a message of one line; see `error_text`.
REPORTED_ERRORS = (RosyError, MemoryError)


def error_text(error: Exception) -> str:
    """Return the message of one line that is shown to the user for an exception.

    Exceptions other than `REPORTED_ERRORS` are described as a fault of RoSy.
    """
    if isinstance(error, MemoryError):
        return "there is not enough memory: choose a smaller size or a smaller mesh"
    if isinstance(error, RosyError):
        return str(error)
    return escape_unsafe(" ".join(f"a fault of RoSy, {type(error).__name__}: {error}".split()))
