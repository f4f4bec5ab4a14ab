"""Write the input files of cases: meshes, fields and images. The code of a case names them after `@`."""

import importlib.util
import itertools
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from outputs.run_cases import TABLES

#: A mesh: (V, 3) vertices, and faces as tuples of vertex indices.
Mesh = tuple[np.ndarray, list[tuple[int, ...]]]


def write_inputs(folder: Path, data: Path) -> None:
    """Write all input files. If the folder `data` exists, the files in its subfolders are copied too."""
    folder.mkdir()
    ring, bumpy = torus(), bumpy_sphere(18)
    texts = TABLES["inputs"] | {
        "torus.obj": obj_text(ring),
        "wave.obj": obj_text(wavy_sheet(), grid(24, 18, False, lambda u, v: (u, v))[0]),
        "pair.stl": stl_text(two_parts()),
        "bumpy.ply": ply_text(bumpy),
    }
    if importlib.util.find_spec("bpy"):
        texts["suzanne.obj"] = obj_text(suzanne())
    for name, text in (texts | field_texts(ring, folder)).items():
        (folder / name).write_text(text)
    write_tone(folder / "tone.png")
    for path in sorted(data.glob("*/*")):
        shutil.copy(path, folder)


def write_tone(path: Path) -> None:
    """Write a PNG file of dark and light bands, with the aspect ratio of the renders of the scene."""
    from rosy_addon.image_io.png import write_png

    v, u = np.mgrid[:48, :64] / 48
    gray = 0.5 + 0.5 * np.sin(9 * u + 4 * v * v)
    write_png(path, np.stack([gray, gray, gray, np.ones_like(gray)], axis=-1))


def grid(columns: int, rows: int, wrap: bool, shape: Callable[..., Sequence[Any]]) -> Mesh:
    """Return a grid of quads over the unit square, with vertices mapped by ``shape(u, v)``.

    If `wrap`, opposite sides of the square are connected.
    """
    nu, nv = (columns, rows) if wrap else (columns + 1, rows + 1)
    u, v = np.divmod(np.arange(nu * nv), nv)
    faces = [
        tuple((i + a) % nu * nv + (j + b) % nv for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)))
        for i, j in itertools.product(range(columns), range(rows))
    ]
    return np.stack(shape(u / columns, v / rows), axis=1), faces


def torus() -> Mesh:
    """Return a torus of triangles around the y axis."""

    def shape(u: np.ndarray, v: np.ndarray) -> Sequence[np.ndarray]:
        u, v = 2 * np.pi * u, 2 * np.pi * v
        ring = 1 + 0.4 * np.cos(v)
        return ring * np.sin(u), 0.4 * np.sin(v), ring * np.cos(u)

    return triangulated(grid(36, 18, True, shape))


def box(count: int) -> Mesh:
    """Return a cube whose sides are `count` x `count` quads."""
    side, side_faces = grid(count, count, False, lambda u, v: (2 * u - 1, 2 * v - 1, u * 0 + 1))
    turned = [side, side * (-1, 1, -1)]
    corners = np.concatenate([np.roll(each, k, axis=1) for each in turned for k in range(3)])
    vertices, index = np.unique(np.round(corners, 9) + 0.0, axis=0, return_inverse=True)
    starts = range(0, len(corners), len(side))
    faces = [
        tuple(index.ravel()[start + i] for i in face) for start in starts for face in side_faces
    ]
    return vertices, faces


def bumpy_sphere(count: int) -> Mesh:
    """Return a sphere of quads whose radius varies."""
    points, faces = box(count)
    x, y, z = points = unit(points).T
    radius = 1 + 0.15 * np.sin(4 * x) * np.cos(3 * y) + 0.1 * np.sin(5 * z + y)
    return (points * radius).T, faces


def wavy_sheet() -> Mesh:
    """Return an open sheet of quads."""

    def shape(u: np.ndarray, v: np.ndarray) -> Sequence[np.ndarray]:
        return 2 * u - 1, 1.4 * v - 0.7, 0.2 * np.sin(7 * u) * np.cos(5 * v)

    return grid(24, 18, False, shape)


def two_parts() -> Mesh:
    """Return a mesh of triangles with two parts that are not connected: a bumpy sphere and a torus."""
    (first, first_faces), (second, second_faces) = triangulated(bumpy_sphere(9)), torus()
    moved = second[:, [0, 2, 1]] * 0.6 + (1.3, -0.4, 0.2)
    faces = [tuple(len(first) + i for i in face) for face in second_faces]
    return np.concatenate([first * 0.8, moved]), first_faces + faces


def suzanne() -> Mesh:
    """Return Blender's monkey."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add()
    mesh = bpy.context.object.data
    vertices = np.array([[v.co.x, v.co.z, -v.co.y] for v in mesh.vertices])
    return vertices, [tuple(face.vertices) for face in mesh.polygons]


def triangulated(mesh: Mesh) -> Mesh:
    """Return the mesh with its polygons divided into fans of triangles."""
    return mesh[0], [(f[0], f[k], f[k + 1]) for f in mesh[1] for k in range(1, len(f) - 1)]


def field_texts(ring: Mesh, folder: Path) -> dict[str, str]:
    """Return the contents of text files with fields on the torus, by name. Write fields as .npy files."""
    faces = np.array(ring[1])
    corners = ring[0][faces]
    normal = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    member, free = tangents(normal)
    x = corners[:, 0, :1]
    member *= np.where(np.abs(x) < 0.1, 0.0, 1 + 0.5 * np.sin(3 * x))
    tensors = np.einsum("fni,fnj,n->fij", free[:, :2], free[:, :2], (1.0, 0.4))
    undefined, guides = member.copy(), np.zeros_like(member)
    undefined[5:9], guides[::50] = np.nan, member[::50]
    normal_sums = np.zeros_like(ring[0])
    np.add.at(normal_sums, faces, normal[:, None])
    order = np.argsort(np.sin(7.3 * np.arange(len(faces))), kind="stable")
    np.save(folder / "member.npy", member)
    np.save(folder / "guides.npy", guides)
    rows = {
        "member.rosy": [f"{len(faces)} 3", *rows_of(member)],
        "shuffled.rosy": [f"{len(faces)} 3", *rows_of(member[order])],
        "member.txt": rows_of(member),
        "undefined.txt": rows_of(undefined),
        "free.rawfield": [f"4 {len(faces)}", *rows_of(free)],
        "vertices.txt": rows_of(tangents(unit(normal_sums))[1]),
        "tensors.txt": rows_of(tensors),
        "strokes.txt": [*rows_of(ring[0][:300:19]), "", *rows_of(corners[40])],
    }
    texts = {name: "\n".join([*lines, ""]) for name, lines in rows.items()}
    return texts | {"shuffled.off": off_text((ring[0], [ring[1][i] for i in order]))}


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return the vectors scaled to length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def tangents(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return tangents (F, 3) at normals (F, 3), and two pairs of opposite ones that are not perpendicular."""
    first = np.cross(normal, (0.3, 1.0, 0.1))
    second = 0.6 * np.cross(normal, first) + 0.5 * first
    return first, np.stack([first, second, -first, -second], axis=1)


def rows_of(values: Any) -> list[str]:
    """Return rows of numbers as text, with as many digits as float64 needs."""
    return [" ".join(f"{x:.17g}" for x in np.ravel(row)) for row in values]


def obj_text(mesh: Mesh, uv: np.ndarray | None = None) -> str:
    """Return the text of an .obj file, with UV coordinates at the vertices if they are given."""
    corner = "{0}" if uv is None else "{0}/{0}"
    lines = [f"v {row}" for row in rows_of(mesh[0])]
    lines += [f"vt {row}" for row in rows_of([] if uv is None else uv)]
    lines += ["f " + " ".join(corner.format(i + 1) for i in face) for face in mesh[1]]
    return "\n".join([*lines, ""])


def off_text(mesh: Mesh) -> str:
    """Return the text of an .off file."""
    faces = [" ".join(map(str, (len(face), *face))) for face in mesh[1]]
    return "\n".join(["OFF", f"{len(mesh[0])} {len(faces)} 0", *rows_of(mesh[0]), *faces, ""])


def ply_text(mesh: Mesh) -> str:
    """Return the text of a .ply file with a scalar `weight` and a color at each vertex."""
    vertices, faces = mesh
    properties = [f"property double {name}" for name in ("x", "y", "z", "weight")]
    properties += [f"property uchar {name}" for name in ("red", "green", "blue")]
    numbers = rows_of(np.column_stack([vertices, np.sin(4 * vertices[:, 0])]))
    colors = rows_of((127.5 + 127.5 * np.sin(3 * vertices)).astype(int))
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}", *properties]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [f"{number} {color}" for number, color in zip(numbers, colors, strict=True)]
    lines += [" ".join(map(str, (len(face), *face))) for face in faces]
    return "\n".join([*lines, ""])


def stl_text(mesh: Mesh) -> str:
    """Return the text of an .stl file of a mesh of triangles."""
    lines = ["solid mesh"]
    for face in mesh[1]:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {row}" for row in rows_of(mesh[0][list(face)])]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid mesh", ""])
