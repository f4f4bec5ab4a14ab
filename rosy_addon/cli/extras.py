"""What the Python package adds to the commands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Extras:
    """What the commands can do besides. The extension for Blender has none of it.

    Attributes
    ----------
    program : tuple of str
        The program that runs the commands and its first arguments.
    run_on_cluster : function, optional
        Runs a command for frames on a cluster, given the command, the frames and the address of the
        cluster, and yields the lines that it prints.
    """

    program: tuple[str, ...] = ()
    run_on_cluster: Callable[[Sequence[str], Sequence[int], str], Iterator[str]] | None = None


NO_EXTRAS = Extras()
