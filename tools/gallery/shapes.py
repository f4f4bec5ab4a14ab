"""Make meshes that are free of license restrictions: computed ones, and the monkey of Blender."""

from functools import partial

import numpy as np
from skimage.measure import marching_cubes

from rosy_addon.field.surface import Surface, build_surface


def plane(cells: int = 8) -> Surface:
    """Return the square from -1 to 1 in x and y, whose normals point up."""
    axis = np.linspace(-1, 1, cells + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    return grid_surface("plane", np.stack([x, y, 0 * x], axis=-1), closed=(False, False))


def torus(radius: float = 1.0, tube: float = 0.45, around: int = 144, across: int = 72) -> Surface:
    """Return a torus around the z axis."""
    u = np.arange(around)[:, None] * (2 * np.pi / around)
    v = np.arange(across) * (2 * np.pi / across)
    ring_radius = radius + tube * np.cos(v)
    point = np.stack(
        np.broadcast_arrays(ring_radius * np.cos(u), ring_radius * np.sin(u), tube * np.sin(v)), -1
    )
    return grid_surface("torus", point, closed=(True, True))


def noisy_torus() -> Surface:
    """Return a torus whose vertices have noise of 0.2 % of its size."""
    ring = torus()
    size = np.linalg.norm(np.ptp(ring.vertices, axis=0))
    noise = 0.002 * size * np.random.default_rng(0).standard_normal(ring.vertices.shape)
    return build_surface(ring.vertices + noise, ring.corner_vertex, ring.face_start)


def box() -> Surface:
    """Return a leaning box, made by projecting a sphere to a cube."""
    ball = sphere()
    points = ball.vertices / np.abs(ball.vertices).max(axis=1)[:, None]
    points[:, 0] += 0.6 * points[:, 2]
    return build_surface(points, ball.corner_vertex, ball.face_start, name="box", sharp_angle=0.7)


def knot(tube: float = 0.34, around: int = 384, across: int = 36) -> Surface:
    """Return a tube around a trefoil knot."""
    t = np.arange(around) * (2 * np.pi / around)
    curve, tangent = _trefoil(t), _trefoil(t + 1e-4) - _trefoil(t - 1e-4)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    # The knot winds around a torus. The normal of the torus is never parallel to the knot, so it spans a
    # frame with it.
    torus_center = np.stack([np.cos(2 * t), np.sin(2 * t), 0 * t], axis=1) * 2
    outward = curve - torus_center
    outward -= np.sum(outward * tangent, axis=1)[:, None] * tangent
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    binormal = np.cross(tangent, outward)
    v = np.arange(across)[:, None] * (2 * np.pi / across)
    ring = np.cos(v)[None] * outward[:, None] + np.sin(v)[None] * binormal[:, None]
    return grid_surface("knot", curve[:, None] + tube * ring, closed=(True, True))


def _trefoil(t: np.ndarray) -> np.ndarray:
    radius = 2 + np.cos(3 * t)
    return np.stack([radius * np.cos(2 * t), radius * np.sin(2 * t), np.sin(3 * t)], axis=1)


def sphere(cells: int = 48) -> Surface:
    """Return the unit sphere, as the projection of a cube whose faces are divided at equal angles."""
    coordinates = np.tan(np.linspace(-np.pi / 4, np.pi / 4, cells + 1))
    u, v = np.meshgrid(coordinates, coordinates, indexing="ij")
    sides = []
    for axis in range(3):
        for sign in (1, -1):
            side = np.empty((cells + 1, cells + 1, 3))
            side[..., axis], side[..., axis - 2], side[..., axis - 1] = sign, u, sign * v
            sides.append(side)
    vertices = np.concatenate([side.reshape(-1, 3) for side in sides])
    cell = _cells(cells + 1, cells + 1, (False, False))
    faces = np.concatenate([cell + index * (cells + 1) ** 2 for index in range(6)])
    # Merge the vertices along the edges of the cube, which two sides share.
    _, first, same = np.unique(
        np.rint(vertices * 1e6), axis=0, return_index=True, return_inverse=True
    )
    vertices = vertices[first] / np.linalg.norm(vertices[first], axis=1)[:, None]
    return _polygons("sphere", vertices, same.ravel()[faces])


def triple_torus(cells: int = 110) -> Surface:
    """Return a torus with three holes: three merged rings, as a level set of a smooth function."""
    low, high = np.array([-2.8, -2.8, -0.8]), np.array([2.8, 2.8, 0.8])
    spacing = (high[0] - low[0]) / cells
    counts = np.rint((high - low) / spacing).astype(int) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) * spacing for n in counts), indexing="ij"), axis=-1)
    level = _rings((grid + low).reshape(-1, 3)).reshape(counts)
    vertices, faces, _, _ = marching_cubes(level, 0.0, spacing=(spacing,) * 3)
    vertices = vertices.astype(np.float64) + low
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = np.bincount(ends[:, 0], minlength=len(vertices))[:, None]
    # Marching cubes make thin triangles. Smooth the vertices, and project them back to the level set.
    for _ in range(12):
        neighbor_sum = np.zeros_like(vertices)
        np.add.at(neighbor_sum, ends[:, 0], vertices[ends[:, 1]])
        vertices = _onto_level(0.5 * vertices + 0.5 * neighbor_sum / count)
    surface = _polygons("triple torus", vertices, faces)
    outward = np.sum(surface.face_normal * _gradient(surface.face_center)) > 0
    return surface if outward else _polygons("triple torus", vertices, faces[:, ::-1])


def _rings(points: np.ndarray, tube: float = 0.43, blend: float = 0.16) -> np.ndarray:
    """Return the approximate (P,) signed distances of points from three smoothly merged rings of radius 1."""
    total = np.zeros(len(points))
    for angle in (0.5, 0.5 + 4 / 3, 0.5 + 2 / 3):
        center = 1.2 * np.array([np.cos(angle * np.pi), np.sin(angle * np.pi)])
        ring_distance = np.hypot(points[:, 0] - center[0], points[:, 1] - center[1]) - 1
        total += np.exp(-np.hypot(ring_distance, points[:, 2]) / blend)
    return -blend * np.log(total) - tube


def _gradient(points: np.ndarray) -> np.ndarray:
    small = 1e-5
    return np.stack(
        [
            (_rings(points + step) - _rings(points - step)) / (2 * small)
            for step in small * np.eye(3)
        ],
        axis=1,
    )


def _onto_level(points: np.ndarray) -> np.ndarray:
    for _ in range(2):
        slope = _gradient(points)
        points = points - (_rings(points) / np.sum(slope * slope, axis=1))[:, None] * slope
    return points


def suzanne(subdivisions: int = 3) -> Surface:
    """Return Blender's monkey, subdivided."""
    import bpy

    from .in_blender import evaluated_surface

    add = bpy.ops.mesh.primitive_monkey_add
    return evaluated_surface(add, "SUBSURF", name="Suzanne", levels=subdivisions)


def prism() -> Surface:
    """Return a prism with seven sides. Its creases are not equally sharp."""
    import bpy

    from .in_blender import evaluated_surface

    return evaluated_surface(partial(bpy.ops.mesh.primitive_cylinder_add, vertices=7))


def _polygons(name: str, vertices: np.ndarray, faces: np.ndarray, **options: float) -> Surface:
    """Return a surface whose faces all have the same number of corners."""
    start = np.arange(len(faces) + 1) * faces.shape[1]
    return build_surface(vertices, faces.ravel(), start, name=name, **options)


def grid_surface(
    name: str, point: np.ndarray, closed: tuple[bool, bool], **options: float
) -> Surface:
    """Return a surface of quads through an (A, B, 3) grid of points, closed or open in each direction."""
    cells = _cells(*point.shape[:2], closed)
    return _polygons(name, point.reshape(-1, 3), cells, **options)


def _cells(a: int, b: int, closed: tuple[bool, bool]) -> np.ndarray:
    """Return the (n, 4) point indices of the cells of an a x b grid, closed or open in each direction."""
    index = np.arange(a * b).reshape(a, b)
    right, up = np.roll(index, -1, axis=0), np.roll(index, -1, axis=1)
    corners = np.stack([index, right, np.roll(right, -1, axis=1), up], axis=-1)
    return corners[: a if closed[0] else a - 1, : b if closed[1] else b - 1].reshape(-1, 4)
