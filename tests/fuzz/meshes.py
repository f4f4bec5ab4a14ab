"""Random polygon meshes: ordinary, odd, degenerate and far out of scale; and their files."""

import struct
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from ..unit.awkward import cube

#: Points (V, 3), and the faces as tuples of vertex indices.
Polygons = tuple[np.ndarray, list[tuple[int, ...]]]
Writer = Callable[[Generator, np.ndarray, list], bytes]


def random_mesh(rng: Generator, *, faults: int | None = None) -> Polygons:
    """Return a random shape with random faults: `faults` of them, by default none to three."""
    points, faces = SHAPES[rng.integers(len(SHAPES))](rng)
    for _ in range(rng.choice([0, 0, 1, 1, 2, 3]) if faults is None else faults):
        points, faces = FAULTS[rng.integers(len(FAULTS))](rng, points, faces)
    return points, faces


def _sheet(rng: Generator) -> Polygons:
    """A grid of quads that is bent to a height field, tube, cone, torus, sphere or Möbius strip."""
    columns, rows = (int(count) for count in rng.integers(3, 24, 2))
    kind = rng.integers(5)
    u, v = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    height, angle = v.ravel() / (rows - 1), 2 * np.pi * u.ravel() / columns
    around, radius = 2 * np.pi * v.ravel() / rows, np.ones(columns * rows)
    if kind == 0:
        bumps = rng.choice([0.0, 0.3]) * rng.normal(size=columns * rows)
        points = np.stack([u.ravel(), v.ravel(), bumps], axis=1)
    else:
        radius = (radius, rng.choice([0.0, 0.3, 1.0], rows)[v.ravel()], 1 + 0.4 * np.cos(around))[
            kind % 3
        ]
        z = 0.4 * np.sin(around) if kind % 3 == 2 else height
        if kind == 4:  # a sphere with poles of many points
            radius, z = np.sin(np.pi * height), np.cos(np.pi * height)
        points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    last_column, last_row = columns - (kind == 0), rows - (kind % 3 != 2)
    twist = kind == 3 and rng.random() < 0.5
    faces = []
    for i in range(last_column):
        for j in range(last_row):
            right, top = (i + 1) % columns, (j + 1) % rows
            flip = twist and right == 0
            a, b = (rows - 1 - j, rows - 1 - top) if flip else (j, top)
            faces.append((i * rows + j, right * rows + a, right * rows + b, i * rows + top))
    return points * rng.choice([0.1, 1, 1, 4], 3), faces


def _cube(rng: Generator) -> Polygons:
    points, quads = cube()
    return np.array(points) * rng.uniform(0.2, 3, 3), quads[: rng.integers(1, 7)]


def _star(rng: Generator) -> Polygons:
    """One concave polygon."""
    count = int(rng.choice([3, 5, 30, 300]))
    angle = np.arange(2 * count) * np.pi / count
    radius = np.where(np.arange(2 * count) % 2, rng.uniform(0.01, 0.9), 1.0)
    z = rng.choice([0.0, 0.05]) * rng.normal(size=2 * count)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    return points, [tuple(range(2 * count))]


def _soup(rng: Generator) -> Polygons:
    """Polygons between random points."""
    points, faces = rng.normal(size=(int(rng.integers(3, 40)), 3)), []
    for _ in range(rng.integers(1, 60)):
        size = min(int(rng.choice([3, 3, 3, 4, 5, 9])), len(points))
        faces.append(tuple(rng.choice(len(points), size, replace=rng.random() < 0.1).tolist()))
    return points, faces


def _fan(rng: Generator) -> Polygons:
    """Triangles, some much longer than wide, that share one edge, which is nonmanifold."""
    count = int(rng.integers(1, 30))
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), *rng.normal(size=(count, 3)).tolist()]
    faces = [(0, 1, 2 + i) if rng.random() < 0.5 else (1, 0, 2 + i) for i in range(count)]
    return np.array(points) * (1, 1, 10.0 ** rng.uniform(-7, 0)), faces


def _pieces(rng: Generator) -> Polygons:
    """Several shapes that are not connected, of sizes that differ by orders of magnitude."""
    points, faces = np.zeros((0, 3)), []
    for index in range(rng.integers(2, 5)):
        more_points, more_faces = (_cube, _sheet, _fan)[rng.integers(3)](rng)
        faces += [tuple(vertex + len(points) for vertex in face) for face in more_faces]
        size = 10.0 ** rng.choice([0, 0, 0, -3, -8])
        points = np.concatenate([points, more_points * size + 3 * index])
    return points, faces


def closed_mesh(rng: Generator) -> Polygons:
    """Return one or two closed surfaces with few or some faces, which may share a vertex, moved at random."""
    points, faces = CLOSED[rng.integers(len(CLOSED))](rng)
    if rng.random() < 0.3:
        more_points, more_faces = CLOSED[rng.integers(len(CLOSED))](rng)
        number = np.arange(len(more_points)) + len(points)
        if rng.random() < 0.5:
            number[rng.integers(len(more_points))] = rng.integers(len(points))
        faces += [tuple(number[list(face)].tolist()) for face in more_faces]
        points = np.concatenate([points, more_points + 4])
    noise = rng.choice([0.0, 0.0, 0.03, 0.2]) * rng.normal(size=points.shape)
    return points + noise, faces


def _prism(rng: Generator) -> Polygons:
    """A prism of several stories whose ends are polygons, or points, from which triangles go out."""
    count, stories = int(rng.choice([3, 3, 4, 5, 6, 9, 15])), int(rng.choice([0, 1, 1, 2, 5, 9]))
    angle = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    points = np.concatenate([ring + (0, 0, z) for z in range(stories + 1)])
    corner = np.arange(count)
    step = np.stack([corner, np.roll(corner, -1), np.roll(corner, -1) + count, corner + count], 1)
    faces = [tuple(face) for z in range(stories) for face in (step + z * count).tolist()]
    for end, first in ((-1, 0), (1, stories * count)):
        polygon = (corner + first)[:: -1 if end < 0 else 1].tolist()
        if stories and rng.random() < 0.5:
            faces.append(tuple(polygon))
            continue
        apex = len(points)
        points = np.concatenate([points, [(0, 0, stories * (end > 0) + end)]])
        faces += [(polygon[i - 1], polygon[i], apex) for i in range(count)]
    return points, faces


def _ring(rng: Generator) -> Polygons:
    return torus(*rng.integers(3, 16, 2).tolist())


def torus(columns: int, rows: int) -> Polygons:
    """Return a torus of quads."""
    u, v = (part.ravel() for part in np.indices((columns, rows)))
    tube = 2 * np.pi * v / rows
    radius, around = 2 + np.cos(tube), 2 * np.pi * u / columns
    points = np.stack([radius * np.cos(around), radius * np.sin(around), np.sin(tube)], axis=1)
    right, top = (u + 1) % columns, (v + 1) % rows
    corners = [u * rows + v, right * rows + v, right * rows + top, u * rows + top]
    return points, [tuple(face) for face in np.stack(corners, axis=1).tolist()]


def _tetrahedron(rng: Generator) -> Polygons:
    points = np.array([(1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)], dtype=float)
    return points, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


CLOSED: tuple[Callable[[Generator], Polygons], ...] = (_prism, _prism, _ring, _tetrahedron)

SHAPES: tuple[Callable[[Generator], Polygons], ...] = (
    *(_sheet, _sheet, _sheet, _cube, _star, _soup, _fan, _pieces),
)


def _move_points(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    """Scale, stretch, flatten, move far away, or jitter."""
    flat = rng.permutation([0.0, 1.0, rng.choice([0.0, 1.0])])
    moved = (
        points * 10.0 ** rng.uniform(-14, 14),
        points * 10.0 ** rng.uniform(-6, 3, 3),
        points * flat,
        points + rng.normal(size=3) * 10.0 ** rng.uniform(0, 13),
        points + rng.normal(size=points.shape) * 10.0 ** rng.uniform(-9, -0.5),
    )
    return moved[rng.integers(5)], faces


def _change_faces(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    """Repeat, turn over, or remove faces, or repeat a corner."""
    picked = [faces[i] for i in rng.integers(len(faces), size=rng.integers(1, 6))]
    corner = int(rng.integers(len(faces[0])))
    changed = (
        faces + [face[::-1] if rng.random() < 0.5 else face for face in picked],
        [face[::-1] if rng.random() < 0.4 else face for face in faces],
        picked,
        [(*faces[0][: corner + 1], *faces[0][corner:]), *faces[1:]],
    )
    return points, changed[rng.integers(4)]


def _add_points(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    """Add points that no face uses, a tiny face, or a face whose corners are on a line."""
    count, size = len(points), int(rng.integers(3, 8))
    line = points[0] + np.linspace(0, 1, size)[:, None] * rng.normal(size=3)
    tiny = points[0] + rng.normal(size=(size, 3)) * 10.0 ** rng.uniform(-16, -3)
    stray = rng.normal(size=(size, 3)) * 10.0 ** rng.uniform(0, 11)
    added, is_face = ((line, True), (tiny, True), (stray, False))[rng.integers(3)]
    more = [tuple(range(count, count + size))] if is_face else []
    return np.concatenate([points, added]), faces + more


def _weld(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    """Move points to others, or replace them, which makes nonmanifold edges and degenerate faces."""
    target = np.arange(len(points))
    picked = rng.integers(len(points), size=max(len(points) // 6, 1))
    target[picked] = rng.integers(len(points), size=len(picked))
    if rng.random() < 0.5:
        return points[target], faces
    return points, [tuple(int(target[vertex]) for vertex in face) for face in faces]


FAULTS: tuple[Callable[[Generator, np.ndarray, list], Polygons], ...] = (
    *(_move_points, _move_points, _change_faces, _add_points, _weld),
)

# --- files ----------------------------------------------------------------------------------------

#: Numpy type of each PLY type.
_PLY_TYPES = {"uchar": "u1", "ushort": "u2", "int": "i4", "float": "f4", "double": "f8"}


def mesh_bytes(rng: Generator, suffix: str, mesh: Polygons) -> bytes:
    """Return the contents of a mesh file with one of the extensions in `WRITERS`."""
    return WRITERS[suffix](rng, *mesh)


def with_texture_rows(obj: bytes, rows: np.ndarray) -> bytes:
    """Return an `.obj` file whose texture coordinates are these (n, 2) rows, over and over."""
    texts, lines = [b"vt %.9g %.9g" % tuple(row) for row in rows], obj.split(b"\n")
    is_row = [line.startswith(b"vt") for line in lines]
    return b"\n".join(texts[i % len(texts)] if is_row[i] else line for i, line in enumerate(lines))


def _obj(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    lines = ["# a mesh", "mtllib scene.mtl", "o part"] if rng.random() < 0.5 else []
    lines += ["v {!r} {!r} {!r}".format(*point) for point in points.tolist()]
    lines += ["vt {:.6g} {:.6g}".format(*pair) for pair in rng.uniform(-1, 2, (len(points), 2))]
    lines += ["vn 0 0 1"]
    form = ("{0}/{0}", "{0}/{0}/1", "{0}", "{0}//1")[rng.choice(4, p=[0.5, 0.3, 0.1, 0.1])]
    start = -len(points) if rng.random() < 0.15 else 1
    lines += ["f " + " ".join(form.format(v + start) for v in face) for face in faces]
    if rng.random() < 0.2:
        lines += ["# degree 4", *(f"# field {i} 1 0 0" for i in range(len(points)))]
    return "\n".join(lines).encode() + b"\n"


def _off(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    lines = ["OFF", "# a comment", f"{len(points)} {len(faces)} 0"]
    lines += ["{!r} {!r} {!r}".format(*point) for point in points.tolist()]
    color = " 255 0 0" if rng.random() < 0.2 else ""
    lines += [" ".join(map(str, (len(face), *face))) + color for face in faces]
    return "\n".join(lines).encode() + b"\n"


def _ply(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    """A mesh with colors at its vertices, as text or in either byte order."""
    real = ("float", "double")[rng.integers(2)]
    count = ("uchar", "int", "ushort")[rng.integers(3)]
    count = "int" if max(map(len, faces)) > 255 else count
    order = ("ascii", "binary_little_endian", "binary_big_endian")[rng.integers(3)]
    header = ["ply", f"format {order} 1.0", "comment a mesh", f"element vertex {len(points)}"]
    header += [f"property {real} {axis}" for axis in "xyz"]
    header += [f"property uchar {name}" for name in ("red", "green", "blue")]
    header += [f"element face {len(faces)}", f"property list {count} int vertex_indices"]
    head = "\n".join([*header, "end_header"]).encode() + b"\n"
    tones = rng.integers(256, size=(len(points), 3))
    if order == "ascii":
        rows = [[*p, *t] for p, t in zip(points.tolist(), tones.tolist(), strict=True)]
        rows += [[len(face), *face] for face in faces]
        return head + "\n".join(" ".join(map(str, row)) for row in rows).encode() + b"\n"
    end = "<" if "little" in order else ">"
    table = np.zeros(len(points), dtype=[("xyz", end + _PLY_TYPES[real], 3), ("rgb", "u1", 3)])
    with np.errstate(over="ignore"):
        table["xyz"], table["rgb"] = points, tones
    data = head + table.tobytes()
    for face in faces:
        data += np.array(len(face), end + _PLY_TYPES[count]).tobytes()
        data += np.array(face, end + "i4").tobytes()
    return data


def _stl(rng: Generator, points: np.ndarray, faces: list) -> bytes:
    """Triangles in single precision, as text or binary, with the normals of the text left out."""
    with np.errstate(over="ignore"):
        corners = points.astype("<f4")
    triangles = [corners[[f[0], f[i], f[i + 1]]] for f in faces for i in range(1, len(f) - 1)]
    if rng.random() < 0.5:
        rows = [bytes(12) + triangle.tobytes() + bytes(2) for triangle in triangles]
        return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)
    form = "facet normal 0 0 1\nouter loop\n" + 3 * "vertex {} {} {}\n" + "endloop\nendfacet\n"
    body = "".join(form.format(*triangle.ravel().tolist()) for triangle in triangles)
    return f"solid part\n{body}endsolid part\n".encode()


#: The writer of each extension.
WRITERS: dict[str, Writer] = {".obj": _obj, ".off": _off, ".ply": _ply, ".stl": _stl}
