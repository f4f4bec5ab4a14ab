"""Read meshes from .obj, .off, .ply and .stl files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..errors import RosyError
from ..file_io import check_parsing_memory
from ..progress import Task, run_to_completion, subtask
from .formats.obj import read_obj_task
from .formats.off import read_off_task
from .formats.ply import read_ply_task
from .formats.polygons import Polygons
from .formats.stl import read_stl_task
from .surface import Surface, surface_task

#: The reader of each file name extension.
READERS: dict[str, Callable[[Path], Task[Polygons]]] = {
    ".obj": read_obj_task,
    ".off": read_off_task,
    ".ply": read_ply_task,
    ".stl": read_stl_task,
}

#: Bytes of memory that a byte of a binary file takes until its surface is built.
BINARY_MEMORY = {".ply": 20, ".stl": 10}

#: Angle between face normals in radians above which an edge counts as sharp, because files do not
#: mark sharp edges. Curved regions rarely exceed 60 degrees even in coarse meshes (an octagonal
#: prism has 45), and most intended edges have 90.
SHARP_ANGLE = np.radians(60)


def read_mesh(
    path: str | os.PathLike[str],
    sharp_angle: float | None = None,
    sharp_edges: ArrayLike | None = None,
) -> Surface:
    """Read a mesh from a file; see `read_mesh_task`.

    Examples
    --------
    >>> surface = read_mesh("bunny.obj")
    """
    return run_to_completion(read_mesh_task(path, sharp_angle, sharp_edges))


def read_mesh_task(
    path: str | os.PathLike[str],
    sharp_angle: float | None = None,
    sharp_edges: ArrayLike | None = None,
) -> Task[Surface]:
    """Read a mesh from an .obj, .off, .ply or .stl file.

    Vertices and faces keep the order of the file, because field files refer to them by number.
    Equal corners of an .stl file are merged into one vertex.

    Parameters
    ----------
    path : path-like
    sharp_angle : float, optional
        Edges with a larger angle, in radians, are sharp. By default `SHARP_ANGLE`.
    sharp_edges : (E, 2) array_like of int, optional
        Pairs of vertices, further sharp edges.

    Returns
    -------
    Surface
        Its name is the path of the file.

    Raises
    ------
    RosyError
        If the file is missing, has another extension, is malformed or truncated, needs more memory
        than there is, or is not a mesh with faces. The message names the file and, in text files, the line.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        *suffixes, last = READERS
        raise RosyError(
            f"{path}: is not a mesh file: its name must end in {', '.join(suffixes)} or {last}"
        )
    check_parsing_memory(path, BINARY_MEMORY.get(path.suffix.lower(), 1))
    polygons = yield from subtask(reader(path), 0.0, 0.5)
    sharp_angle = SHARP_ANGLE if sharp_angle is None else sharp_angle
    task = surface_task(*polygons, name=str(path), sharp_angle=sharp_angle, sharp_edges=sharp_edges)
    return (yield from subtask(task, 0.5, 1.0))
