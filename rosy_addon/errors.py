"""Exceptions whose messages are shown to the user."""


class RosyError(ValueError):
    """An error that the user can correct, with a message of one line.

    The message says where the error is (object, attribute, file or line), what was found and what
    was expected. Operators report it. The command line prints it and exits with status 2.
    """


class NothingInViewError(RosyError):
    """No object with a field is visible from the camera."""


class DeviceError(RosyError):
    """There is no usable graphics card, or the shaders do not compile on it."""
