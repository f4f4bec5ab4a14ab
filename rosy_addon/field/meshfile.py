"""Meshes from files."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..errors import RosyError
from .formats.obj import read_obj
from .formats.off import read_off
from .formats.ply import read_ply
from .formats.polygons import Polygons
from .formats.stl import read_stl
from .surface import Surface, build_surface

READERS: dict[str, Callable[[Path], Polygons]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}

#: Files do not say which edges are sharp. Faces of curved parts seldom meet at more than 60 degrees
#: even in coarse meshes (an octagonal prism has 45), while edges that are meant have mostly 90.
SHARP_ANGLE = np.radians(60)


def read_mesh(path: str | os.PathLike[str]) -> Surface:
    """Read a mesh file: .obj, .off, .ply or .stl.

    Vertices and faces keep the order of the file, which is what field files count by (the equal
    corners of an .stl are made one vertex). Edges sharper than `SHARP_ANGLE` are sharp.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    Surface
        Named after the file.

    Raises
    ------
    RosyError
        If the file is missing, of another kind, truncated, or not a mesh with faces: with the
        file, the line where there are lines, what was found and what was wanted.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        kinds = ", ".join(READERS)
        raise RosyError(f"{path}: meshes are read from {kinds}, not from '{path.suffix}' files")
    polygons = reader(path)
    return build_surface(*polygons, name=str(path), sharp_angle=SHARP_ANGLE)
