"""Surfaces in closed form, instances with fields, and matrices, for tests."""

from itertools import combinations, product

import awkward
import numpy as np
from numpy.typing import ArrayLike

from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.field.validate import vertex_normals
from rosy_addon.projection.gbuffer import MeshInstance


def grid_of_quads(
    columns: int, rows: int, wrap_columns: bool, wrap_rows: bool
) -> tuple[np.ndarray, int]:
    """(F, 4) vertex indices of a lattice of quads, and its number of vertices."""
    nu = columns if wrap_columns else columns + 1
    nv = rows if wrap_rows else rows + 1
    i, j = (a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij"))
    corner = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
    return np.stack([(a % nu) * nv + b % nv for a, b in corner], axis=1), nu * nv


def from_quads(vertices: np.ndarray, quads: np.ndarray, **settings) -> Surface:
    """A surface of quads."""
    return build_surface(vertices, quads.ravel(), np.arange(0, quads.size + 1, 4), **settings)


def from_triangles(vertices: ArrayLike, triangles: ArrayLike, **settings) -> Surface:
    """A surface of triangles."""
    starts = np.arange(0, np.size(triangles) + 1, 3)
    return build_surface(vertices, np.ravel(triangles), starts, **settings)


def rebuilt(surface: Surface, vertices: ArrayLike | None = None, **settings) -> Surface:
    """The same polygons with normals computed anew, at other positions or with other settings."""
    vertices = surface.vertices if vertices is None else vertices
    return build_surface(vertices, surface.corner_vertex, surface.face_start, **settings)


def joined(*surfaces: Surface, **settings) -> Surface:
    """The polygons of several surfaces as one mesh."""
    points, corners, sizes = [], [], [[0]]
    for surface in surfaces:
        corners.append(surface.corner_vertex + sum(map(len, points)))
        points.append(surface.vertices)
        sizes.append(np.diff(surface.face_start))
    starts = np.cumsum(np.concatenate(sizes))
    return build_surface(np.concatenate(points), np.concatenate(corners), starts, **settings)


def walls_of(solid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertices and the quads between the unit cells of a solid, (X, Y, Z) bool, and the space around it."""
    solid = np.pad(solid, 1)
    quads = []
    for axis, side in product(range(3), (0, 1)):
        cells = np.argwhere(solid & ~np.roll(solid, 1 - 2 * side, axis=axis))
        steps = np.zeros((4, 3), dtype=int)
        steps[:, axis] = side
        steps[1:3, (axis + 1) % 3], steps[2:, (axis + 2) % 3] = 1, 1
        quads.append(cells[:, None] + (steps if side else steps[::-1]))
    vertices, quads = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    return vertices.astype(float), quads.reshape(-1, 4)


def roughened(surface: Surface, amplitude: float, seed: int = 3, **settings) -> Surface:
    """The same polygons with random displacements along the vertex normals, of a standard deviation."""
    noise = np.random.default_rng(seed).standard_normal((len(surface.vertices), 1))
    displaced = surface.vertices + amplitude * noise * vertex_normals(surface)
    return rebuilt(surface, displaced, **settings)


def globe(rows: int = 24, columns: int = 48) -> Surface:
    """A sphere of meridians and parallels; its poles are the first and the last vertex."""
    polar = np.linspace(0, np.pi, rows + 1)[1:-1, None]
    azimuth = np.arange(columns) * 2 * np.pi / columns
    x, y = np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth)
    rings = np.stack([x, y, np.cos(polar) + 0 * x], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([[[0, 0, 1]], rings, [[0, 0, -1]]])
    number = 1 + np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    following = np.roll(number, -1, axis=1)
    caps = [(0, a, b) for a, b in zip(number[0], following[0], strict=True)]
    caps += [(len(vertices) - 1, b, a) for a, b in zip(number[-1], following[-1], strict=True)]
    quads = np.stack([number[:-1], number[1:], following[1:], following[:-1]], axis=-1)
    faces = [*caps, *quads.reshape(-1, 4).tolist()]
    start = np.cumsum([0, *map(len, faces)])
    return build_surface(vertices, np.array([v for face in faces for v in face]), start)


def torus(columns: int = 96, rows: int = 48, major: float = 1.0, minor: float = 0.4) -> Surface:
    """A torus about z; quads, the first edge of each along the large circle."""
    quads, count = grid_of_quads(columns, rows, True, True)
    u, v = np.divmod(np.arange(count), rows)
    u, v = u * 2 * np.pi / columns, v * 2 * np.pi / rows
    ring = major + minor * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), minor * np.sin(v)], axis=1)
    return from_quads(vertices, quads, name="torus")


def plane(columns: int = 4, rows: int = 4, size: float = 2.0) -> Surface:
    """A square in z = 0 around the origin, facing up."""
    quads, count = grid_of_quads(columns, rows, False, False)
    u, v = np.divmod(np.arange(count), rows + 1)
    x, y = (u / columns - 0.5) * size, (v / rows - 0.5) * size
    return from_quads(np.stack([x, y, 0 * x], axis=1), quads, name="plane")


def cylinder(
    columns: int = 96, rows: int = 24, radius: float = 1.0, height: float = 2.0
) -> Surface:
    """An open tube about z, facing out."""
    quads, count = grid_of_quads(columns, rows, True, False)
    u, v = np.divmod(np.arange(count), rows + 1)
    angle = u * 2 * np.pi / columns
    vertices = [radius * np.cos(angle), radius * np.sin(angle), (v / rows - 0.5) * height]
    return from_quads(np.stack(vertices, axis=1), quads, name="cylinder")


def capped_cylinder(columns: int) -> Surface:
    """A cylinder of quads with a polygon at each end, without vertices between them."""
    tube = cylinder(columns, 1)
    low = np.arange(0, 2 * columns, 2)
    corners = np.concatenate([tube.corner_vertex, low[::-1], low + 1])
    start = 4 * columns + columns * np.arange(3)
    return build_surface(tube.vertices, corners, np.concatenate([tube.face_start, start[1:]]))


def icosphere(subdivisions: int = 3, radius: float = 1.0) -> Surface:
    """A sphere of 20 * 4^n triangles."""
    golden = (1 + np.sqrt(5)) / 2
    ends = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    vertices = np.array([np.roll(p, shift) for shift in range(3) for p in ends], dtype=float)
    distance = np.linalg.norm(vertices[:, None] - vertices[None], axis=2)
    is_adjacent = np.isclose(distance, 2.0)
    triples = np.array(list(combinations(range(12), 3)))
    triangles = triples[is_adjacent[triples, np.roll(triples, 1, axis=1)].all(axis=1)]
    is_inward = np.linalg.det(vertices[triangles]) < 0
    triangles[is_inward] = triangles[is_inward][:, ::-1]
    for _ in range(subdivisions):
        edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
        edges, midpoint = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
        ab, bc, ca = midpoint.reshape(3, -1) + len(vertices)
        vertices = np.concatenate([vertices, vertices[edges].mean(axis=1)])
        a, b, c = triangles.T
        quarters = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(q, axis=1) for q in quarters])
    vertices *= radius / np.linalg.norm(vertices, axis=1, keepdims=True)
    return from_triangles(vertices, triangles, name="sphere")


def placed(linear: ArrayLike = 1.0, shift: ArrayLike = (0, 0, 0)) -> np.ndarray:
    """The (4, 4) matrix with a linear part, or a scale, and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = linear * np.eye(3) if np.ndim(linear) == 0 else linear
    matrix[:3, 3] = shift
    return matrix


def moved(x=0.0, y=0.0, z=0.0) -> np.ndarray:
    """The (4, 4) matrix of a translation."""
    return placed(shift=(x, y, z))


def cube() -> Surface:
    """A unit cube of six quads."""
    points, faces = awkward.cube()
    return build_surface(points, np.concatenate(faces), range(0, 25, 4), name="cube")


def tetrahedron() -> Surface:
    points = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
    return from_triangles(points, [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def sharp_cube() -> Surface:
    """A unit cube whose twelve edges are sharp."""
    return rebuilt(cube(), name="cube", sharp_angle=0.5)


def instance_of(
    surface: Surface,
    degree: int,
    kind: GeneratorSettings | str | tuple[float, float, float] = "smoothest",
    matrix: np.ndarray | None = None,
) -> MeshInstance:
    """A surface with a generated field, or with one along an axis, at its place or moved."""
    kind = GeneratorSettings("axis", kind) if isinstance(kind, tuple) else kind
    matrix = np.eye(4) if matrix is None else matrix
    return MeshInstance(surface, matrix, generate(surface, kind, degree))
