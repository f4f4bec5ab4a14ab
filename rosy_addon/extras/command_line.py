"""Run commands of the Python package, including those that the extension for Blender lacks."""

import sys
from collections.abc import Sequence
from functools import partial
from typing import TextIO

from ..cli.parser import Extras
from ..cli.parser import main as cli_main
from ..cli.streams import use_output
from .blender import PACKAGE, blender_encoder, run_in_blender
from .cluster import run_on_cluster
from .film import add_film_command


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit status.

    `argv` holds the arguments without the name of the program; by default, `sys.argv[1:]`.
    """
    arguments = sys.argv[1:] if argv is None else argv
    extras = Extras(
        program=(sys.executable, "-m", PACKAGE),
        run_on_cluster=run_on_cluster,
        add_commands=(add_film_command,),
        find_blender_encoder=blender_encoder,
        run_in_blender=partial(run_in_blender, arguments),
    )
    return cli_main(arguments, f"python -m {PACKAGE}", extras)


def main_in_blender(argv: Sequence[str], output: TextIO) -> int:
    """Run a command in the Blender process that `main` has started, and return the exit status.

    Parameters
    ----------
    argv : sequence of str
        The arguments of `main`.
    output : text file
        Standard output of the command. `sys.stdout` is not used, as Blender also prints to it.
    """
    use_output(output)
    hooks = {"run_on_cluster": run_on_cluster, "run_in_blender": lambda *_: None}
    extras = Extras(is_in_blender=True, **hooks)
    return cli_main(argv, f"python -m {PACKAGE}", extras)
