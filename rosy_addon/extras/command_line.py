"""The command line of the Python package: the commands, with what is not in the extension."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ..cli.extras import Extras
from ..cli.parser import main as cli_main
from ..external.simulation_files import SUFFIXES
from .cluster import run_on_cluster
from .film import add_film_command
from .simulations import load_simulation


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit status. See `cli.parser.main`."""
    package = __package__.split(".")[0]
    extras = Extras(
        program=(sys.executable, "-m", package),
        run_on_cluster=run_on_cluster,
        simulation_suffixes=SUFFIXES,
        load_simulation=load_simulation,
        add_commands=(add_film_command,),
    )
    return cli_main(argv, f"python -m {package}", extras)
