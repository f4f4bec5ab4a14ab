"""The exceptions that users see as a line of text."""


class RosyError(ValueError):
    """Something the user can put right, said in one line.

    The message names the thing (object, attribute, file and line), what was found and what
    was wanted. Operators report it, the command line prints it and exits with status 2.
    """


class NothingInViewError(RosyError):
    """A camera sees none of the RoSy objects."""


class DeviceError(RosyError):
    """There is no graphics card to draw with, or it does not take the shaders."""
