"""Write polygon meshes as .obj, .off, .ply and .stl files, in the varieties that programs write."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from .shapes import Polygons

#: Numpy type of each PLY type.
_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_PLY_TYPES |= {"float": "f4", "double": "f8", "int32": "i4", "float32": "f4", "float64": "f8"}


def mesh_bytes(rng: Generator, suffix: str, mesh: Polygons) -> bytes:
    """Return the contents of a mesh file with one of the extensions in `WRITERS`."""
    return WRITERS[suffix](rng, *mesh)


def _obj(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    lines = ["# a mesh", "mtllib scene.mtl", "o part"] if rng.random() < 0.5 else []
    number = "{:.9g} {:.9g} {:.9g}" if rng.random() < 0.5 else "{!r} {!r} {!r}"
    lines += ["v " + number.format(*point) for point in points.tolist()]
    uv = rng.random() < 0.7
    if uv:
        lines += ["vt {:.6g} {:.6g}".format(*pair) for pair in rng.uniform(-1, 2, (len(points), 2))]
    relative = rng.random() < 0.15
    form = (
        ("{0}/{0}" if rng.random() < 0.7 else "{0}/{0}/1")
        if uv
        else ("{0}", "{0}//1")[rng.integers(2)]
    )
    if "//1" in form or "/1" in form[3:]:
        lines.append("vn 0 0 1")
    for face in faces:
        if rng.random() < 0.03:
            lines += ["g group", "s off", "usemtl red"]
        words = [form.format(v - len(points) if relative else v + 1) for v in face]
        lines.append("f " + " ".join(words))
    if rng.random() < 0.2:
        lines += ["# degree 4", *(f"# field {i} 1 0 0" for i in range(len(points)))]
    return "\n".join(lines).encode() + b"\n"


def _off(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    counts = f"{len(points)} {len(faces)} 0"
    lines = [f"OFF {counts}"] if rng.random() < 0.2 else ["OFF", counts]
    if rng.random() < 0.2:
        lines.insert(1, "# a comment")
    lines += ["{!r} {!r} {!r}".format(*point) for point in points.tolist()]
    color = " 255 0 0" if rng.random() < 0.2 else ""
    lines += [" ".join(map(str, (len(face), *face))) + color for face in faces]
    return "\n".join(lines).encode() + b"\n"


def _ply(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    real = ("float", "double", "float32", "float64")[rng.integers(4)]
    count = ("uchar", "int", "ushort")[rng.integers(3)]
    if count == "uchar" and max(map(len, faces)) > 255:
        count = "int"
    index = ("int", "uint", "int32")[rng.integers(3)]
    order = ("ascii", "binary_little_endian", "binary_big_endian")[rng.integers(3)]
    columns = [(axis, real) for axis in "xyz"]
    tones = rng.integers(256, size=(len(points), 3))
    if colored := rng.random() < 0.5:
        columns += [(name, "uchar") for name in ("red", "green", "blue")]
    if rng.random() < 0.2:
        columns = [columns[i] for i in rng.permutation(len(columns))]
    header = ["ply", f"format {order} 1.0", "comment a mesh", f"element vertex {len(points)}"]
    header += [f"property {kind} {name}" for name, kind in columns]
    header += [f"element face {len(faces)}", f"property list {count} {index} vertex_indices"]
    header.append("end_header\n")
    with np.errstate(over="ignore"):
        values = dict(zip("xyz", points.T.astype(_PLY_TYPES[real]), strict=True))
    if colored:
        values |= dict(zip(("red", "green", "blue"), tones.T, strict=True))
    head = "\n".join(header).encode()
    if order == "ascii":
        rows = zip(*(values[name].tolist() for name, _ in columns), strict=True)
        lines = [" ".join(map(repr, row)) for row in rows]
        lines += [" ".join(map(str, (len(face), *face))) for face in faces]
        return head + "\n".join(lines).encode() + b"\n"
    end = "<" if order == "binary_little_endian" else ">"
    table = np.empty(len(points), dtype=[(name, end + _PLY_TYPES[kind]) for name, kind in columns])
    for name, _ in columns:
        table[name] = values[name]
    body = [table.tobytes()]
    for face in faces:
        body.append(np.array([len(face)], end + _PLY_TYPES[count]).tobytes())
        body.append(np.array(face, end + _PLY_TYPES[index]).tobytes())
    return head + b"".join(body)


def _stl(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    with np.errstate(over="ignore"):
        points = points.astype(np.float32)
    triangles = [(face[0], face[i], face[i + 1]) for face in faces for i in range(1, len(face) - 1)]
    if rng.random() < 0.5:
        data = b"made by a program".ljust(80) + struct.pack("<I", len(triangles))
        return data + b"".join(
            struct.pack("<12fH", 0, 0, 1, *points[list(triangle)].ravel().tolist(), 0)
            for triangle in triangles
        )
    lines = ["solid part"]
    for triangle in triangles:
        lines += ["facet normal 0 0 1", " outer loop"]
        lines += ["  vertex {!r} {!r} {!r}".format(*points[v].tolist()) for v in triangle]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, "endsolid part", ""]).encode()


#: Writer of each extension.
WRITERS: dict[str, Callable[[Generator, np.ndarray, list], bytes]] = {
    ".obj": _obj,
    ".off": _off,
    ".ply": _ply,
    ".stl": _stl,
}
