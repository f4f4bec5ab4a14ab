"""Arrowheads over the lines of fields in a picture, where lines have a direction.

Their places belong to the surface; see `surface_places`. Where a view is so near that these are far apart, points of
`projection.progressive_samples` are between them. All are taken in an order that does not depend on the view, as far
as they are visible and far enough from those before. Around each place, a field of N directions has N arrowheads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.cache import Cache
from ..core.progress import progress, report
from ..field.directional_field import evaluate_harmonics, field_symmetry
from ..field.frames import dot
from ..projection.camera import Camera
from ..projection.gbuffer import GBuffer, MeshInstance
from ..projection.pixel_neighbors import screen_jacobians
from ..projection.progressive_samples import matrix_scale, progressive_samples
from ..projection.project import surface_points
from ..projection.surface_points import SurfacePoints
from ..projection.visible_vertices import ProjectedPoints, project_points
from .surface_places import spaced_points, surface_places

#: Colors of arrowheads and of their outlines.
FILL_COLOR, OUTLINE_COLOR = "#141414", "#ffffff"

#: Width of an arrowhead, depth of the notch at its back, and width of its outline, in lengths.
WIDTH, NOTCH, OUTLINE = 0.78, 0.24, 0.1

#: Least width of the outline, pixels.
MIN_OUTLINE = 1.0

#: Most arrowheads of a picture, about: more are drawn farther apart.
MAX_COUNT = 1 << 16

#: Directions that are shortened to less than this fraction have no arrowhead.
MIN_FORESHORTENING = 0.3

#: Least cosine of the angle between the normal of the surface and the direction to the eye at places of one
#: arrowhead and of several: none reach far beyond silhouettes.
MIN_FACING, MIN_FACING_OF_SEVERAL = 0.15, 0.35

#: Least distance on the surface of places that are taken, in spacings: on screen most are nearer.
NEAREST_PLACES = 0.75

#: Distance from a place to the middles of its arrowheads, in lengths, if there are several, and the least distance
#: between neighbors, in widths.
REACH, MIN_GAP = 1.15, 1.2

#: A place is taken for hidden if another one, next to it in the picture, is nearer by more spacings than this.
HIDDEN_SPACINGS = 4.0


@dataclass(frozen=True, eq=False)
class ArrowMarks:
    """K arrowheads in a picture.

    Attributes
    ----------
    anchor : (K, 3) float64 ndarray
        Their places on surfaces, in world space.
    place : (K, 2) float64 ndarray
        The same in the picture, pixels from the lower left.
    position : (K, 2) float64 ndarray
        Their middles, pixels from the lower left.
    direction : (K, 2) float64 ndarray
        Unit vectors in the picture.
    size : float
        Length of an arrowhead, pixels.
    """

    anchor: np.ndarray
    place: np.ndarray
    position: np.ndarray
    direction: np.ndarray
    size: float

    def __len__(self) -> int:
        return len(self.position)

    @property
    def outline(self) -> float:
        """Width of their outlines, pixels."""
        return max(OUTLINE * self.size, MIN_OUTLINE)


def has_arrows(instance: MeshInstance) -> bool:
    """Return whether the lines of the field of an instance have a direction."""
    return instance.field is not None and not field_symmetry(instance.field).has_opposites


def arrow_marks(
    instances: Sequence[MeshInstance],
    camera: Camera,
    spacing: float,
    size: float,
    *,
    display: str = "smooth",
    clip_planes: np.ndarray | None = None,
    cache: Cache | None = None,
    is_exact: bool = True,
) -> ArrowMarks:
    """Find the places and directions of arrowheads in a view.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Those without a field, or whose lines have no direction, only hide arrowheads.
    camera : Camera
        Of the picture.
    spacing : float
        Least distance between the places of arrowheads, pixels.
    size : float
        Length of an arrowhead, pixels.
    display : {"smooth", "flat"}
        As for `projection.project.project`.
    clip_planes : (6, 4) float64 ndarray, optional
        World space. The negative side of each plane is cut away.
    cache : Cache, optional
        Stores the places, and corner fields.
    is_exact : bool
        Whether no place is hidden. If not, most hidden ones are left out, which is faster.

    Returns
    -------
    ArrowMarks
    """
    report(0.0, "finding places of arrowheads")
    frame = camera.width, camera.height
    degrees = [instance.field.degree for instance in instances if has_arrows(instance)]
    reach = _reach(max(degrees, default=1), size)
    spacing = max(spacing, 2 * reach + size, float(np.sqrt(frame[0] * frame[1] / MAX_COUNT)))
    cache = Cache() if cache is None else cache
    with progress(0.0, 0.2):
        points = _places_in_order(instances, camera, spacing, cache)
    with progress(0.2, 0.6):
        projected = project_points(instances, camera, points, clip_planes, finds_hidden=is_exact)
    kept = np.flatnonzero(projected.is_visible)
    points, projected = points.part(kept), projected.part(kept)
    with progress(0.6, 0.9):
        gbuffer = surface_points(instances, camera, display, points, projected.position, cache)
    directions = _screen_directions(gbuffer)
    is_usable = (np.abs(directions) >= MIN_FORESHORTENING).any(axis=1) & _faces_camera(gbuffer)
    if not is_exact:
        is_usable &= ~_seems_hidden(projected, gbuffer, spacing)
    usable = np.flatnonzero(is_usable)
    chosen = usable[spaced_points(projected.position[usable], spacing)]
    # The arrowheads of a place are one after the other.
    place, member = np.nonzero(np.abs(directions[chosen]) >= MIN_FORESHORTENING)
    place = chosen[place]
    unit = directions[place, member] / np.abs(directions[place, member])
    direction = np.stack([unit.real, unit.imag], axis=1)
    reach = np.array([_reach(degree, size) for degree in gbuffer.instance_degrees])
    position = projected.position[place] + reach[points.instance_id[place], None] * direction
    return ArrowMarks(projected.world[place], projected.position[place], position, direction, size)


def _places_in_order(
    instances: Sequence[MeshInstance], camera: Camera, spacing: float, cache: Cache
) -> SurfacePoints:
    """Return places on all surfaces with arrowheads, and points between them, in the order of preference.

    The places do not depend on the view. The points are where the view is so near that it needs more.
    """
    parts = [SurfacePoints.of(0, np.empty(0, np.int32), np.empty((0, 3)))]
    # Places come first, those with the largest distances before others; then points by their ranks.
    is_between, keys = [np.empty(0, dtype=bool)], [np.empty(0)]
    for number, instance in enumerate(instances):
        scale = matrix_scale(instance)
        if not has_arrows(instance) or not scale:
            continue
        smallest = NEAREST_PLACES * spacing * _smallest_pixel(instance, camera) / scale
        places = surface_places(instance.surface, smallest, cache)
        points = SurfacePoints.of(number, places.triangle, places.barycentric)
        needed = _needed_distances(instance, camera, points, spacing)
        kept = np.flatnonzero(places.distance * scale >= needed)
        parts.append(points.part(kept))
        is_between.append(np.zeros(len(kept), dtype=bool))
        keys.append(-places.distance[kept] * scale)
        if places.finest <= smallest:
            continue
        *samples, rank = progressive_samples(instance, camera, spacing)
        points = SurfacePoints.of(number, *samples)
        needed = _needed_distances(instance, camera, points, spacing)
        kept = np.flatnonzero(needed < places.finest * scale)
        parts.append(points.part(kept))
        is_between.append(np.ones(len(kept), dtype=bool))
        keys.append(rank[kept])
    order = np.lexsort([np.concatenate(keys), np.concatenate(is_between)])
    return SurfacePoints.concatenate(parts).part(order)


def _needed_distances(
    instance: MeshInstance, camera: Camera, points: SurfacePoints, spacing: float
) -> np.ndarray:
    """(P,) float64: how far points have to be from each other, in Blender units; infinite behind the eye."""
    world = instance.points_in_triangles(points.triangle, points.barycentric)
    result = np.full(len(world), NEAREST_PLACES * spacing / camera.pixels_per_unit)
    if camera.is_perspective:
        depth = camera.depths(world)
        result *= np.where(depth > 0, depth, np.inf)
    return result


def _smallest_pixel(instance: MeshInstance, camera: Camera) -> float:
    """Return the size of a pixel at the nearest point of an instance, in Blender units.

    0 if the instance reaches behind the eye.
    """
    pixel = 1 / camera.pixels_per_unit
    if not camera.is_perspective:
        return pixel
    return pixel * max(float(camera.depths(instance.world_bounds()).min()), 0.0)


def _reach(degree: int, size: float) -> float:
    """Return the distance from a place to the middles of its N arrowheads, pixels."""
    if degree <= 1:
        return 0.0
    return max(REACH, MIN_GAP * WIDTH / (2 * np.sin(np.pi / degree))) * size


def _screen_directions(gbuffer: GBuffer) -> np.ndarray:
    """(P, M) complex128: the directions of the field on screen, as long as they are seen.

    M is the largest degree. A point with fewer directions, or without any, has zeros.
    """
    jacobian = screen_jacobians(gbuffer).astype(np.complex128)
    degree = np.asarray(gbuffer.instance_degrees)[gbuffer.instance_id]
    result = np.zeros((len(degree), int(degree.max(initial=1))), dtype=np.complex128)
    for number in np.unique(degree).tolist():
        of_degree = np.flatnonzero((degree == number) & (gbuffer.representation != 0))
        z = gbuffer.representation[of_degree].astype(np.complex128)
        member = np.exp(
            1j * np.angle(z)[:, None] / number + 2j * np.pi * np.arange(number) / number
        )
        harmonics = [
            (order, values[of_degree, None].astype(np.complex128))
            for (kind, order), values in gbuffer.channels.items()
            if kind == "deviation"
        ]
        if harmonics:
            member = member * evaluate_harmonics(harmonics, member)
            member /= np.maximum(np.abs(member), 1e-30)
        x, y = jacobian[of_degree].T[..., None]
        result[of_degree, :number] = x * member.real + y * member.imag
    return result


def _faces_camera(gbuffer: GBuffer) -> np.ndarray:
    """(P,) bool: whether the surface is not too slanted for arrowheads."""
    degree = np.asarray(gbuffer.instance_degrees)[gbuffer.instance_id]
    limit = np.where(degree == 1, MIN_FACING, MIN_FACING_OF_SEVERAL)
    return dot(gbuffer.geometric_normal, gbuffer.view_direction) >= limit


def _seems_hidden(projected: ProjectedPoints, gbuffer: GBuffer, spacing: float) -> np.ndarray:
    """(P,) bool: whether nearer points are next to points in the picture.

    Behind a point on a front side, any on a back side seems hidden.
    """
    column, row = (projected.position / spacing).astype(np.intp).T + 1
    shape = int(row.max(initial=0)) + 2, int(column.max(initial=0)) + 2
    nearest, nearest_front = np.full((2, *shape), np.inf)
    np.minimum.at(nearest, (row, column), projected.depth)
    front = np.flatnonzero(gbuffer.front_facing)
    np.minimum.at(nearest_front, (row[front], column[front]), projected.depth[front])
    nearest, nearest_front = (
        np.min([depth[row + dy, column + dx] for dy in (-1, 0, 1) for dx in (-1, 0, 1)], axis=0)
        for depth in (nearest, nearest_front)
    )
    pixel = 1 / gbuffer.camera.pixels_per_unit
    if gbuffer.camera.is_perspective:
        pixel = pixel * projected.depth
    is_far = projected.depth - nearest > HIDDEN_SPACINGS * spacing * pixel
    return is_far | (~gbuffer.front_facing & (projected.depth > nearest_front))
