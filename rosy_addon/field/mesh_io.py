"""Read meshes from .obj, .off, .ply, .stl and .om files."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ..core.errors import RosyError
from ..core.file_io import check_parsing_memory
from .formats.obj import read_obj
from .formats.off import read_off
from .formats.openmesh import read_om_mesh
from .formats.ply import read_ply
from .formats.polygons import Polygons
from .formats.stl import read_stl

#: The function that reads files with each file name extension.
READERS: dict[str, Callable[[Path], Polygons]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
    ".om": read_om_mesh,
}

#: Peak memory in bytes per byte of a binary file, until its surface is built.
BINARY_MEMORY = {".ply": 20, ".stl": 10, ".om": 20}

#: Angle between face normals in radians above which an edge counts as sharp. Mesh files do not mark sharp
#: edges. In curved regions, angles rarely exceed 60 degrees, even in coarse meshes (45 in an octagonal
#: prism). Most edges that are meant to be sharp have 90 degrees.
SHARP_ANGLE = np.radians(60)


def must_end_in(suffixes: Sequence[str]) -> str:
    """Return the part of an error message that lists the allowed suffixes: "its name must end in .a, .b or .c"."""
    return f"its name must end in {', '.join(suffixes[:-1])} or {suffixes[-1]}"


def read_polygons(path: str | os.PathLike[str], other_suffixes: Sequence[str] = ()) -> Polygons:
    """Read the polygons of an .obj, .off, .ply, .stl or .om file.

    Vertices and faces keep the order of the file, because field files refer to them by number.
    Equal corners of an .stl file are merged into one vertex.

    Parameters
    ----------
    path : path-like
    other_suffixes : sequence of str
        Further file suffixes that the caller can read, for the error message.

    Returns
    -------
    Polygons

    Raises
    ------
    RosyError
        If the file is missing, malformed or truncated, has an unknown extension, or needs more memory than
        the computer has. The message names the file and, for text files, the line.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise RosyError(f"{path}: is not a mesh file: {must_end_in((*READERS, *other_suffixes))}")
    check_parsing_memory(path, BINARY_MEMORY.get(path.suffix.lower(), 1))
    return reader(path)
