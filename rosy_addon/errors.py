"""The one exception that users see as a line of text."""


class RosyError(ValueError):
    """Something the user can put right, said in one line.

    The message names the thing (object, attribute, file and line), what was found and what
    was wanted. Operators report it, the command line prints it and exits with status 2.
    """
