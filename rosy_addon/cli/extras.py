"""What the Python package adds to the commands."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..turntable_video import Encoder


@dataclass(frozen=True)
class Extras:
    """What the commands can do besides. The extension for Blender has none of it.

    Attributes
    ----------
    program : tuple of str
        The program that runs the commands and its first arguments.
    run_on_cluster : function, optional
        Runs a command for frames on a cluster, given its arguments, the frames and the address of the
        cluster, and yields the lines that it prints.
    simulation_suffixes : tuple of str
        Of the files of simulations that can be read.
    add_commands : tuple of function
        Each adds a command to the subparsers.
    find_blender_encoder : function, optional
        Returns an encoder of videos by a Blender, or None, given the Blender that the user named, or
        None.
    run_in_blender : function, optional
        Runs the command in a Blender and exits with its status, given the options, the verb and the
        .blend file. Returns if the command can run in this process.
    frames_are_drawn : bool
        Whether other processes have drawn the frames of this command.
    """

    program: tuple[str, ...] = ()
    run_on_cluster: Callable[[Sequence[str], Sequence[int], str], Iterator[str]] | None = None
    simulation_suffixes: tuple[str, ...] = ()
    add_commands: tuple[Callable[[Any], None], ...] = ()
    find_blender_encoder: Callable[[str | None], Encoder | None] | None = None
    run_in_blender: Callable[[argparse.Namespace, str, Path | None], None] | None = None
    frames_are_drawn: bool = False


NO_EXTRAS = Extras()
