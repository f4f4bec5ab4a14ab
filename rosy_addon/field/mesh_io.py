"""Read meshes from .obj, .off, .ply and .stl files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..core.errors import RosyError
from ..core.file_io import check_parsing_memory
from ..core.progress import progress
from .formats.obj import read_obj
from .formats.off import read_off
from .formats.ply import read_ply
from .formats.polygons import Polygons
from .formats.stl import read_stl
from .surface import Surface, build_surface

#: The reader of each file name extension.
READERS: dict[str, Callable[[Path], Polygons]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}

#: Bytes of memory that a byte of a binary file takes until its surface is built.
BINARY_MEMORY = {".ply": 20, ".stl": 10}

#: Angle between face normals in radians above which an edge counts as sharp, because files do not
#: mark sharp edges. Curved regions rarely exceed 60 degrees even in coarse meshes (an octagonal
#: prism has 45), and most intended edges have 90.
SHARP_ANGLE = np.radians(60)


def read_mesh(path: str | os.PathLike[str]) -> Surface:
    """Read a mesh from an .obj, .off, .ply or .stl file.

    Edges with an angle above `SHARP_ANGLE` are sharp.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Surface
        Its name is the path of the file.

    Raises
    ------
    RosyError
        If the file has another extension, cannot be read or is malformed, or is not a mesh with faces.
    """
    with progress(0.0, 0.5):
        polygons = read_polygons(path)
    with progress(0.5, 1.0):
        return build_surface(*polygons, name=str(path), sharp_angle=SHARP_ANGLE)


def read_polygons(path: str | os.PathLike[str]) -> Polygons:
    """Read the polygons of an .obj, .off, .ply or .stl file.

    Vertices and faces keep the order of the file, because field files refer to them by number.
    Equal corners of an .stl file are merged into one vertex.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Polygons

    Raises
    ------
    RosyError
        If the file is missing, has another extension, is malformed or truncated, or needs more memory
        than there is. The message names the file and, in text files, the line.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        *suffixes, last = READERS
        raise RosyError(
            f"{path}: is not a mesh file: its name must end in {', '.join(suffixes)} or {last}"
        )
    check_parsing_memory(path, BINARY_MEMORY.get(path.suffix.lower(), 1))
    return reader(path)
