"""Meshes that are unusual or not closed manifolds, as points and faces; also for Blender."""

import numpy as np


def cube():
    points = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return points, quads


def moebius(count=24):
    angle = np.repeat(np.arange(count) * (2 * np.pi / count), 2)
    radius = 1 + np.tile([-0.3, 0.3], count) * np.cos(angle / 2)
    height = np.tile([-0.3, 0.3], count) * np.sin(angle / 2)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)
    triangles = []
    for step in range(count):
        a, b = 2 * step, 2 * step + 1
        c, d = (a + 2, b + 2) if step < count - 1 else (1, 0)
        triangles += [(a, c, b), (b, c, d)]
    return points.tolist(), triangles


def grid(count=4):
    points = [(x, y, 0) for y in range(count + 1) for x in range(count + 1)]
    row = count + 1
    first_corners = [y * row + x for y in range(count) for x in range(count)]
    return points, [(a, a + 1, a + row + 1, a + row) for a in first_corners]


def octahedron():
    points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    top = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4)]
    return points, [*top, *((b, a, 5) for a, b, _ in top)]


def pieces():
    """A cube, an octahedron and a grid, which are not connected."""
    points, faces = [], []
    for index, (part_points, part_faces) in enumerate((cube(), octahedron(), grid())):
        faces += [tuple(vertex + len(points) for vertex in face) for face in part_faces]
        points += [(x + 3 * index, y, z + index) for x, y, z in part_points]
    return points, faces


def fan():
    """Three triangles that share one edge, which is nonmanifold."""
    points = [(0, 0, 0), (0, 0, 1), (1, 0, 0), (-1, 0.5, 0), (-1, -0.5, 0)]
    return points, [(0, 1, 2), (0, 1, 3), (1, 0, 4)]


def faces_without_area(count=1000):
    """An octahedron, and `count` triangles without area."""
    points, faces = octahedron()
    points += [(0.1 * index, 0.0, 2.0) for index in range(count + 2)]
    return points, faces + [(6 + index, 7 + index, 8 + index) for index in range(count)]


def triangle():
    return [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]


MAKERS = cube, moebius, grid, pieces, fan, faces_without_area, triangle
AWKWARD = {make.__name__: make for make in MAKERS}
