"""Random polygon meshes: ordinary, odd, degenerate and far out of scale."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

#: Points (V, 3), and the faces as tuples of vertex indices.
Polygons = tuple[np.ndarray, list[tuple[int, ...]]]


def random_mesh(rng: Generator, *, faults: int | None = None) -> Polygons:
    """Return a random shape with random faults.

    Parameters
    ----------
    rng : Generator
    faults : int, optional
        Number of faults; by default none to three.
    """
    points, faces = _choice(rng, SHAPES)(rng)
    points = np.asarray(points, dtype=np.float64)
    for _ in range(rng.choice([0, 0, 1, 1, 2, 3]) if faults is None else faults):
        points, faces = _choice(rng, FAULTS)(rng, points, faces)
    return points, faces


def _choice(rng: Generator, functions: tuple[Callable, ...]) -> Callable:
    return functions[rng.integers(len(functions))]


def _grid(rng: Generator) -> Polygons:
    """A height field of quads."""
    columns, rows = rng.integers(1, 9, 2)
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1))
    z = rng.normal(0, rng.choice([0.0, 0.3]), x.shape)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    faces = [(int(a), int(a + 1), int(a + columns + 2), int(a + columns + 1)) for a in first]
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), faces


def _cube(rng: Generator) -> Polygons:
    points = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array(points) * rng.uniform(0.2, 3, 3), quads[: rng.integers(1, 7)]


def _tetrahedron(rng: Generator) -> Polygons:
    return rng.normal(size=(4, 3)), [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]


def _ring_solid(rng: Generator) -> Polygons:
    """A prism, antiprism-like tube or cone, with caps of many corners or none."""
    count, levels = int(rng.integers(3, 40)), int(rng.integers(1, 6))
    angle = np.arange(count) * 2 * np.pi / count
    radii = rng.choice([0.0, 0.3, 1.0, 1.0], levels + 1)
    points = [
        np.stack([r * np.cos(angle), r * np.sin(angle), np.full(count, float(level))], axis=1)
        for level, r in enumerate(radii)
    ]
    faces = []
    for level in range(levels):
        a, b = level * count, (level + 1) * count
        faces += [(a + i, a + (i + 1) % count, b + (i + 1) % count, b + i) for i in range(count)]
    if rng.random() < 0.6:
        faces += [tuple(range(count))[::-1], tuple(range(levels * count, (levels + 1) * count))]
    return np.concatenate(points), faces


def _torus(rng: Generator) -> Polygons:
    columns, rows = (int(count) for count in rng.integers(3, 14, 2))
    u, v = np.divmod(np.arange(columns * rows), rows)
    u, v = u * 2 * np.pi / columns, v * 2 * np.pi / rows
    ring = 1 + rng.uniform(0.1, 1.2) * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], axis=1)

    def at(i: int, j: int) -> int:
        return (i % columns) * rows + j % rows

    faces = [
        (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1))
        for i in range(columns)
        for j in range(rows)
    ]
    return points, faces


def _sphere(rng: Generator) -> Polygons:
    """A UV sphere with triangles at the poles, scaled along the axes."""
    columns, rows = int(rng.integers(3, 24)), int(rng.integers(2, 14))
    points = [(0.0, 0.0, 1.0)]
    for row in range(1, rows):
        polar = np.pi * row / rows
        for column in range(columns):
            angle = 2 * np.pi * column / columns
            points.append(
                (np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar))
            )
    points.append((0.0, 0.0, -1.0))
    last = len(points) - 1
    faces: list[tuple[int, ...]] = []
    for column in range(columns):
        right = (column + 1) % columns
        faces.append((0, 1 + column, 1 + right))
        for row in range(rows - 2):
            a, b = 1 + row * columns, 1 + (row + 1) * columns
            faces.append((a + column, b + column, b + right, a + right))
        a = 1 + (rows - 2) * columns
        faces.append((last, a + right, a + column))
    return np.array(points) * rng.choice([0.1, 1, 1, 4], 3), faces


def _star(rng: Generator) -> Polygons:
    """One concave polygon."""
    count = int(rng.choice([3, 5, 30, 300]))
    angle = np.arange(2 * count) * np.pi / count
    radius = np.where(np.arange(2 * count) % 2, rng.uniform(0.01, 0.9), 1.0)
    z = rng.choice([0.0, 0.05]) * rng.normal(size=2 * count)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    return points, [tuple(range(2 * count))]


def _comb(rng: Generator) -> Polygons:
    """One concave polygon with long narrow teeth."""
    teeth = int(rng.choice([2, 20, 400]))
    x = np.linspace(0, 2, 2 * teeth)
    y = np.where(np.arange(2 * teeth) % 2, 1.0, 0.1)
    points = np.stack([x, y, 0 * x], axis=1)
    points = np.concatenate([points, [[2, -0.1, 0], [0, -0.1, 0]]])
    return points, [tuple(range(len(points)))[::-1]]


def _soup(rng: Generator) -> Polygons:
    """Polygons between random points."""
    points = rng.normal(size=(int(rng.integers(3, 40)), 3))
    faces = []
    for _ in range(rng.integers(1, 60)):
        size = min(int(rng.choice([3, 3, 3, 4, 5, 9])), len(points))
        faces.append(tuple(rng.choice(len(points), size, replace=rng.random() < 0.1).tolist()))
    return points, faces


def _moebius(rng: Generator) -> Polygons:
    count = int(rng.integers(3, 30))
    angle = np.repeat(np.arange(count) * (2 * np.pi / count), 2)
    radius = 1 + np.tile([-0.3, 0.3], count) * np.cos(angle / 2)
    height = np.tile([-0.3, 0.3], count) * np.sin(angle / 2)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    faces = []
    for step in range(count):
        a, b = 2 * step, 2 * step + 1
        c, d = (a + 2, b + 2) if step < count - 1 else (1, 0)
        faces.append((a, c, d, b))
    return points, faces


def _fan(rng: Generator) -> Polygons:
    """Triangles that share one edge, which is nonmanifold."""
    count = int(rng.integers(1, 12))
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, 1.0), *rng.normal(size=(count, 3)).tolist()]
    faces = [(0, 1, 2 + i) if rng.random() < 0.5 else (1, 0, 2 + i) for i in range(count)]
    return np.array(points), faces


def _needles(rng: Generator) -> Polygons:
    """A fan of triangles thousands of times as long as wide."""
    count = int(rng.integers(2, 60))
    angle = np.linspace(0, 10.0 ** rng.uniform(-7, -2), count)
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return np.concatenate([[[0, 0, 0]], points]), [(0, i, i + 1) for i in range(1, count)]


def _staircase(rng: Generator) -> Polygons:
    """A strip of quads with right angles."""
    count = int(rng.integers(2, 30))
    steps = np.arange(count)
    profile = np.stack([(steps + 1) // 2, steps // 2], axis=1).astype(float)
    points = [(x, y, z) for y in (0.0, 1.0) for x, z in profile]
    return np.array(points), [(i, i + 1, count + i + 1, count + i) for i in range(count - 1)]


def _pieces(rng: Generator) -> Polygons:
    """Several shapes that are not connected, of sizes that differ by orders of magnitude."""
    points, faces = np.zeros((0, 3)), []
    for index in range(rng.integers(2, 5)):
        shape = (_cube, _tetrahedron, _grid, _sphere, _torus, _fan)[rng.integers(6)]
        more_points, more_faces = shape(rng)
        faces += [tuple(vertex + len(points) for vertex in face) for face in more_faces]
        size = 10.0 ** rng.choice([0, 0, 0, -3, -8])
        points = np.concatenate([points, np.asarray(more_points) * size + 3 * index])
    return points, faces


SHAPES: tuple[Callable[[Generator], Polygons], ...] = (
    _grid,
    _cube,
    _tetrahedron,
    _ring_solid,
    _torus,
    _sphere,
    _star,
    _comb,
    _soup,
    _moebius,
    _fan,
    _needles,
    _staircase,
    _pieces,
)


def _scale(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    return points * 10.0 ** rng.uniform(-14, 14), faces


def _stretch(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    return points * 10.0 ** rng.uniform(-6, 3, 3), faces


def _flatten(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    return points * rng.permutation([0.0, 1.0, rng.choice([0.0, 1.0])]), faces


def _move_away(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    return points + rng.normal(size=3) * 10.0 ** rng.uniform(0, 13), faces


def _jitter(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    return points + rng.normal(size=points.shape) * 10.0 ** rng.uniform(-9, -0.5), faces


def _repeat_faces(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    picked = [faces[i] for i in rng.integers(len(faces), size=rng.integers(1, 6))]
    return points, faces + [face[::-1] if rng.random() < 0.5 else face for face in picked]


def _flip_faces(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    return points, [face[::-1] if rng.random() < 0.4 else face for face in faces]


def _collapse_points(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    points = points.copy()
    picked = rng.integers(len(points), size=max(len(points) // 4, 2))
    points[picked] = points[picked[0]]
    return points, faces


def _unused_points(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    stray = rng.normal(size=(int(rng.integers(1, 5)), 3)) * 10.0 ** rng.uniform(0, 11)
    if rng.random() < 0.5:
        return np.concatenate([points, stray]), faces
    count = len(stray)
    shifted = [tuple(vertex + count for vertex in face) for face in faces]
    return np.concatenate([stray, points]), shifted


def _repeat_corner(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    faces = list(faces)
    index = int(rng.integers(len(faces)))
    corner = int(rng.integers(len(faces[index])))
    faces[index] = (*faces[index][:corner], faces[index][corner], *faces[index][corner:])
    return points, faces


def _weld_points(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    """Replace vertices by others, which makes nonmanifold edges and degenerate faces."""
    target = np.arange(len(points))
    picked = rng.integers(len(points), size=max(len(points) // 6, 1))
    target[picked] = rng.integers(len(points), size=len(picked))
    return points, [tuple(int(target[vertex]) for vertex in face) for face in faces]


def _tiny_face(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    corners = points[faces[0][0]] + rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-16, -3)
    count = len(points)
    return np.concatenate([points, corners]), [*faces, (count, count + 1, count + 2)]


def _remove_faces(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    kept = [face for face in faces if rng.random() < 0.6]
    return points, kept or faces[:1]


def _collinear_face(rng: Generator, points: np.ndarray, faces: list) -> Polygons:
    count, size = len(points), int(rng.integers(3, 8))
    line = points[0] + np.linspace(0, 1, size)[:, None] * rng.normal(size=3)
    return np.concatenate([points, line]), [*faces, tuple(range(count, count + size))]


FAULTS: tuple[Callable[[Generator, np.ndarray, list], Polygons], ...] = (
    _scale,
    _stretch,
    _flatten,
    _move_away,
    _jitter,
    _repeat_faces,
    _flip_faces,
    _collapse_points,
    _unused_points,
    _repeat_corner,
    _weld_points,
    _tiny_face,
    _remove_faces,
    _collinear_face,
)
