"""Exceptions whose messages are shown to the user, and the grammar of messages."""


class RosyError(ValueError):
    """An error that the user can correct, with a message of one line.

    The message says where the error is (object, attribute, file or line), what was found and what
    was expected. Operators report it. The command line prints it and exits with status 2.
    """


class NothingInViewError(RosyError):
    """No object with a field is visible from the camera."""


class DeviceError(RosyError):
    """There is no usable graphics card, or the shaders do not compile on it."""


def counted(count: int, singular: str, plural: str = "") -> str:
    """Return a number with its noun, for messages.

    Examples
    --------
    >>> counted(1, "face"), counted(2000, "face"), counted(0, "vertex", "vertices")
    ('1 face', '2,000 faces', '0 vertices')
    """
    return f"{count:,} {singular if count == 1 else plural or singular + 's'}"


#: The errors that end a command or an operator with a message of one line; see `error_text`.
REPORTED_ERRORS = (RosyError, MemoryError)


def error_text(error: Exception) -> str:
    """Return the message of one line to the user, for one of `REPORTED_ERRORS`."""
    if isinstance(error, MemoryError):
        return "there is not enough memory: choose a smaller size or a smaller mesh"
    return str(error)
