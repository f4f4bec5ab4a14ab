"""Seeds around singularities: one in each sector, all at the same distance.

Near a singularity of index i, the lines of the field are parallel lines on a cone, which
z -> z^(1 - i) unrolls. A line is nearest to the apex where its member is perpendicular to the
direction from the apex. If the nearest lines have the same distance in all sectors, the spacing is
consistent all around the singularity. Without these seeds, strokes would reach the singularity from
elsewhere, at different distances in different sectors.
"""

from __future__ import annotations

import numpy as np

from .point_grid import PointGrid
from .surface_particles import SurfaceParticles, trace_geodesics
from .tangent_mesh import TangentMesh

#: Geodesic rays that are traced from each singularity.
RAY_COUNT = 72

#: Distance from a singularity, in spacings, at which the strokes on both sides of a separatrix are
#: one spacing apart. The first is for positive indices, where strokes diverge; the second is for
#: negative ones.
DIVERGING_DISTANCE, CONVERGING_DISTANCE = 0.8, 1.0

#: Singularities get seeds only if the next one is at least this far away, in spacings.
MIN_ISOLATION = 6.0

#: A triangle can have a singularity only if twice the area that its three values z span in the
#: complex plane is more than this fraction of the sum of their squared magnitudes.
MIN_TURN_RATIO = 1e-6


def singularities(mesh: TangentMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the zeros of the interpolated field.

    Returns
    -------
    triangle : (n,) int32 ndarray
    weights : (n, 3) float64 ndarray
        Barycentric coordinates of the zero.
    index : (n,) float64 ndarray
        Singularity index, 1/N or -1/N: the turns of a member around the zero.
    """
    z = mesh.z
    # 0 divides the triangle of the three values z into three; these are twice their signed areas.
    sub_area = (z[:, [1, 2, 0]].conj() * z[:, [2, 0, 1]]).imag
    area = sub_area.sum(axis=1)
    is_turning = np.abs(area) > MIN_TURN_RATIO * (z.real**2 + z.imag**2).sum(axis=1)
    triangle = np.flatnonzero(is_turning & (sub_area * np.sign(area)[:, None] >= 0).all(axis=1))
    weights = sub_area[triangle] / area[triangle, None]
    return triangle.astype(np.int32), weights, np.sign(area[triangle]) / mesh.degree


def seeds_around_singularities(mesh: TangentMesh, spacing: np.ndarray) -> SurfaceParticles:
    """Return seeds around the singularities that are far from others.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : (T, 3) ndarray
        Spacing at the corners of the triangles, in world space.

    Returns
    -------
    SurfaceParticles
    """
    triangle, weights, index = singularities(mesh)
    local_spacing = np.einsum("nk,nk->n", weights, spacing[triangle])
    isolated = np.flatnonzero(
        _is_isolated(mesh.points_at(triangle, weights), MIN_ISOLATION * local_spacing) & (index < 1)
    )
    distance = (seed_distance(index[isolated]) * local_spacing[isolated]).repeat(RAY_COUNT)
    ray = np.tile(np.exp(2j * np.pi * np.arange(RAY_COUNT) / RAY_COUNT), len(isolated))
    triangle, weights = (
        triangle[isolated].repeat(RAY_COUNT),
        weights[isolated].repeat(RAY_COUNT, axis=0),
    )
    particles = SurfaceParticles(triangle, weights, 1j * ray, np.ones(len(ray)))
    arrived, _, walked = trace_geodesics(mesh, particles, ray, distance)
    radial = mesh.points_at(arrived.triangle, arrived.weights) - mesh.points_at(triangle, weights)
    tangential = 1j * mesh.to_frame(arrived.triangle, radial)
    tangential /= np.maximum(np.abs(tangential), 1e-300)
    arrived.member = mesh.members_at(arrived.triangle, arrived.weights, tangential)
    deviation = np.angle(arrived.member * tangential.conj())
    deviation[(walked < 0.999 * distance) | (arrived.member == 0)] = np.nan
    deviation = deviation.reshape(-1, RAY_COUNT)
    # Around the singularity, the angle from the tangent of the circle to the member decreases.
    # Seeds are where it is zero.
    next_deviation = np.roll(deviation, -1, axis=1)
    is_seed = (
        (deviation > 0) & (next_deviation <= 0) & (deviation - next_deviation < np.pi / mesh.degree)
    )
    return arrived.take(np.flatnonzero(is_seed))


def seed_distance(index: np.ndarray) -> np.ndarray:
    """Return (n,) float64: the distance from a singularity to the strokes around it, in spacings.

    On the cone, the strokes are half a line distance from the apex. If the index is 1/2 or more,
    they are a full line distance from it, with another stroke on the single separatrix.
    """
    ratio = np.where(index < 0.5, 0.5, 1.0)
    separation_distance = np.where(index > 0, DIVERGING_DISTANCE, CONVERGING_DISTANCE)
    return ((1 - index) * ratio * separation_distance**-index) ** (1 / (1 - index))


def _is_isolated(points: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return (n,) bool: whether no other point is within the (n,) radius."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    grid = PointGrid(float(np.median(radius)), len(points))
    grid.add(points, radius)
    query, other = grid.pairs_within(points, radius)
    isolated = np.ones(len(points), dtype=bool)
    isolated[query[query != other]] = False
    return isolated
