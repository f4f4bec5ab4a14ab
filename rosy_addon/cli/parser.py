"""The parser of all commands, and `main`."""

import re
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.errors import REPORTED_ERRORS, error_text, telling_warnings
from ..core.file_io import guarding_inputs, os_error_text
from ..rendering.turntable import Encoder
from .bake import add_bake_command
from .field import add_compare_command, add_field_command, add_info_command
from .options import CommandParser, Options
from .pictures import add_render_command, add_texture_command, add_turntable_command
from .presets import add_presets_command
from .streams import OutputError, discard_output, output_stream, print_error, writing_output
from .strokes import add_strokes_command

#: Commands that may need Blender.
BLENDER_VERBS = {"bake", "strokes", "turntable", "film"}

#: Exit statuses: success, standard output cannot be written, error in the user's input, interrupted by
#: Ctrl-C, and standard output closed by its reader.
EXIT_OK, EXIT_OUTPUT_ERROR, EXIT_USER_ERROR, EXIT_INTERRUPTED, EXIT_BROKEN_PIPE = 0, 1, 2, 130, 141


@dataclass(frozen=True)
class Extras:
    """Additions to the commands in the Python package. The extension for Blender has none of them.

    Attributes
    ----------
    program : tuple of str
        The program that runs the commands, with its first arguments.
    run_on_cluster : function, optional
        Function that runs a command for some frames on a cluster. It takes the arguments of the command,
        the frames and the address of the cluster, and yields the printed lines.
    add_commands : tuple of function
        Functions that each add a command to the subparsers.
    find_blender_encoder : function, optional
        Function that returns an encoder of videos that runs Blender, or None if there is no Blender. It
        takes the program that the user named, or None.
    run_in_blender : function, optional
        Function that runs the command in a Blender process and exits with its status. It takes the options,
        the name of the command and the .blend file. It returns if the command can run in this process.
    is_in_blender : bool
        Whether this process is the Blender that `run_in_blender` starts. It then draws no frames that the
        options leave to other processes (--jobs), because they were drawn before Blender was started.
    """

    program: tuple[str, ...] = ()
    run_on_cluster: Callable[[Sequence[str], Sequence[int], str], Iterator[str]] | None = None
    add_commands: tuple[Callable[[Any], None], ...] = ()
    find_blender_encoder: Callable[[str | None], Encoder | None] | None = None
    run_in_blender: Callable[[Options, str, Path | None], None] | None = None
    is_in_blender: bool = False


NO_EXTRAS = Extras()


def main(
    argv: Sequence[str] | None = None,
    prog: str = "blender -b --command rosy",
    extras: Extras = NO_EXTRAS,
) -> int:
    """Run a command.

    Parameters
    ----------
    argv : sequence of str, optional
        Without the program name; `sys.argv[1:]` by default.
    prog : str
        How the user starts the program, for the help.
    extras : Extras
        Additions to the commands.

    Returns
    -------
    int
        Exit status: 0 only if all outputs were written.
    """
    arguments = sys.argv[1:] if argv is None else argv
    try:
        parser = _build_parser(prog, extras)
        options = parser.parse_args(_join_negative_values(arguments), Options())
        with guarding_inputs(), telling_warnings(print_error):
            options.run(options)
        with writing_output():
            output_stream().flush()
    except REPORTED_ERRORS as error:
        print_error(error_text(error))
        return EXIT_USER_ERROR
    except KeyboardInterrupt:
        print_error("stopped")
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the program that reads the output has ended
        discard_output()
        return EXIT_BROKEN_PIPE
    except OutputError as error:
        print_error(str(error))
        discard_output()
        return EXIT_OUTPUT_ERROR
    except OSError as error:  # an error that no function has converted to a `RosyError`
        where = "" if error.filename is None else f"{error.filename}: "
        print_error(f"{where}{os_error_text(error)}")
        return EXIT_USER_ERROR
    except SystemExit as exit_request:  # argparse: 0 after the help, 2 for a usage error
        return int(exit_request.code)
    return EXIT_OK


def main_in_extension(argv: Sequence[str]) -> int:
    """Run a command of Blender's own command line, and return its exit status.

    It restores Python's handling of Ctrl-C, which Blender ignores if it has no window.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    return main(argv)


def _build_parser(prog: str, extras: Extras = NO_EXTRAS) -> CommandParser:
    """Return the parser of all commands."""
    text = "Draw N-way rotational symmetry fields on meshes."
    parser = CommandParser(prog=prog, description=text)
    parser.set_defaults(extras=extras)
    subparsers = parser.add_subparsers(metavar="VERB", required=True)
    add_bake_command(subparsers, extras.run_on_cluster is not None)
    drawing = add_render_command, add_strokes_command, add_turntable_command, add_texture_command
    of_fields = add_field_command, add_info_command, add_compare_command
    for add_command in (*drawing, *of_fields, *extras.add_commands, add_presets_command):
        add_command(subparsers)
    if extras.run_in_blender is not None:
        text = "Blender to run; by default Python's module bpy, or a Blender that is installed"
        for verb in BLENDER_VERBS & subparsers.choices.keys():
            subparsers.choices[verb].add_value("--blender", "PATH", text)
    return parser


def _join_negative_values(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with `--view -30,20` as `--view=-30,20`.

    Otherwise argparse reads the negative number as an option. No option begins with a digit.
    """
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch("--[a-z-]+", joined[-1]) and re.match(r"-[\d.]", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
