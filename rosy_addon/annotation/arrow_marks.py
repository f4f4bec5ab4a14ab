"""Arrowheads in a picture of a field in which directions have no opposite direction, such as a vector field.

Arrowheads are drawn at points of the surface, called places, that do not depend on the view. So a moving
camera sees arrowheads at the same places. The places are ordered in levels: the distance between places
decreases from level to level, and the places of the first levels are spread evenly over the surface. A
picture takes places in this order, if they are visible and not too near to a place that was taken before. In
a close view, the places of the finest level are too far apart. Then points of
`progressive_samples` are taken after them. Around each place, a field of N directions has N
arrowheads.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..core.cache import Cache
from ..core.progress import progress, report
from ..field.blocks import joined
from ..field.directional_field import evaluate_harmonics, field_symmetry
from ..field.frames import dot
from ..field.surface import Surface
from ..projection.camera import Camera
from ..projection.field_channel import deviations
from ..projection.gbuffer import GBuffer, MeshInstance, SurfacePoints
from ..projection.pixel_blocks import part_of
from ..projection.pixel_neighbors import screen_jacobians
from ..projection.project import surface_points
from ..projection.rest_coordinates import matrix_scale
from ..projection.visible_vertices import ProjectedPoints, project_points
from .progressive_samples import progressive_samples, rest_areas, surface_samples

#: Colors of arrowheads and of their outlines.
FILL_COLOR, OUTLINE_COLOR = "#141414", "#ffffff"

#: Width of an arrowhead, depth of the notch at its back, and width of its outline, as fractions of its
#: length.
WIDTH, NOTCH, OUTLINE = 0.78, 0.24, 0.1

#: Smallest width of the outline, pixels.
MIN_OUTLINE = 1.0

#: Approximate limit for the number of arrowheads in a picture. The spacing is increased to meet it.
MAX_COUNT = 1 << 16

#: A direction has no arrowhead if it is foreshortened to less than this fraction of its length.
MIN_FORESHORTENING = 0.3

#: Smallest cosine of the angle between the normal of the surface and the direction to the eye, at places with
#: one arrowhead and at places with several. With these limits, no arrowhead reaches far beyond a silhouette.
MIN_FACING, MIN_FACING_OF_SEVERAL = 0.15, 0.35

#: Smallest distance between places on the surface, in spacings. On screen, distances may be smaller.
NEAREST_PLACES = 0.75

#: Distance from a place to the middles of its arrowheads, in lengths of an arrowhead, if there are several,
#: and the smallest distance between neighboring arrowheads of a place, in widths of an arrowhead.
REACH, MIN_GAP = 1.15, 1.2

#: A place counts as hidden if another place, next to it in the picture, is nearer to the camera by more than
#: this, in spacings.
HIDDEN_SPACINGS = 4.0

#: Number of levels over which the distance between places halves, and number of the finest level, which has
#: about 7000 places.
LEVELS_PER_OCTAVE, MAX_LEVEL = 3, 20

#: Number of random points from which the places of a level are chosen, for each square whose side is the
#: distance between places of the level.
CANDIDATES_PER_PLACE = 6


@dataclass(frozen=True, eq=False)
class ArrowMarks:
    """K arrowheads in a picture.

    Attributes
    ----------
    anchor : (K, 3) float64 ndarray
        Point of the surface at which each arrowhead is drawn, in world space.
    place : (K, 2) float64 ndarray
        The same point in the picture, pixels from the lower left.
    position : (K, 2) float64 ndarray
        Middle of each arrowhead in the picture, pixels from the lower left.
    direction : (K, 2) float64 ndarray
        Unit vector in the picture in which each arrowhead points.
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
        """Width of the outlines of arrowheads, pixels."""
        return max(OUTLINE * self.size, MIN_OUTLINE)


def has_arrows(instance: MeshInstance) -> bool:
    """Return whether an instance has a field that arrowheads can show.

    In such a field, directions have no opposite direction at the same point, as in a vector field.
    """
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
    """Find the positions and directions of arrowheads in a view.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Arrowheads are drawn on the instances for which `has_arrows` is true. All others only hide arrowheads.
    camera : Camera
        Camera of the picture.
    spacing : float
        Smallest distance, in pixels, between the points at which arrowheads are drawn. It is increased if
        arrowheads would overlap or be too many.
    size : float
        Length of an arrowhead, pixels.
    display : {"smooth", "flat"}
        Whether the field is interpolated, or constant on each face.
    clip_planes : (6, 4) float64 ndarray, optional
        Planes (a, b, c, d) in world space. Points with a x + b y + c z + d < 0 are cut away.
    cache : Cache, optional
        Cache for points of surfaces at which arrowheads are drawn, and for corner fields.
    is_exact : bool
        Whether all hidden arrowheads are removed. If false, most of them are removed, which is faster.

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
    points, projected = part_of(points, kept), part_of(projected, kept)
    with progress(0.6, 0.9):
        gbuffer = surface_points(instances, camera, display, points, projected.position, cache)
    directions = _screen_directions(gbuffer)
    degree = np.asarray(gbuffer.instance_degrees)[gbuffer.instance_id]
    least_facing = np.where(degree == 1, MIN_FACING, MIN_FACING_OF_SEVERAL)
    is_usable = (np.abs(directions) >= MIN_FORESHORTENING).any(axis=1)
    is_usable &= dot(gbuffer.geometric_normal, gbuffer.view_direction) >= least_facing
    if not is_exact:
        is_usable &= ~_seems_hidden(projected, gbuffer, spacing)
    usable = np.flatnonzero(is_usable)
    chosen = usable[spaced_points(projected.position[usable], spacing)]
    # The arrowheads at the same place are consecutive.
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
    """Return candidates for the points at which arrowheads are drawn on all surfaces, in order of preference.

    The first candidates are the points of `surface_places`, which do not depend on the view, from the largest
    distance between points to the smallest. In views so near that even the points of the finest level are too
    far apart, additional points between these follow. `spacing` is the smallest distance of arrowheads on
    screen, in pixels.
    """
    parts = [SurfacePoints.of(0, np.empty(0, np.int32), np.empty((0, 3)))]
    keys = [np.empty((2, 0))]
    for number, instance in enumerate(instances):
        if not has_arrows(instance):
            continue
        scale = matrix_scale(instance.matrix)
        # The size of a pixel is 0 if the instance reaches behind the eye.
        nearest = np.maximum(camera.depths(instance.world_bounds()).min(), 0.0)
        smallest = NEAREST_PLACES * spacing * float(camera.pixel_sizes(nearest)) / scale
        places = surface_places(instance.surface, smallest, cache)
        points = SurfacePoints.of(number, places.triangle, places.barycentric)
        needed = _needed_distances(instance, camera, points, spacing)
        kept = np.flatnonzero(places.distance * scale >= needed)
        parts.append(part_of(points, kept))
        keys.append(np.stack([-places.distance[kept] * scale, np.zeros(len(kept))]))
        if places.finest > smallest:
            *samples, rank = progressive_samples(instance, camera, spacing)
            points = SurfacePoints.of(number, *samples)
            needed = _needed_distances(instance, camera, points, spacing)
            kept = np.flatnonzero(needed < places.finest * scale)
            parts.append(part_of(points, kept))
            keys.append(np.stack([rank[kept], np.ones(len(kept))]))
    # Sort places by their distance, and the points between them, which are last, by their rank.
    return part_of(joined(parts), np.lexsort(np.concatenate(keys, axis=1)))


def _needed_distances(
    instance: MeshInstance, camera: Camera, points: SurfacePoints, spacing: float
) -> np.ndarray:
    """Return (P,) float64: the smallest distance between arrowheads near each point, in world space.

    `points` are P points of the instance. `spacing` is the distance of arrowheads on screen, in pixels. Behind
    the eye of a perspective camera, the result is infinite.
    """
    depth = camera.depths(instance.points_in_triangles(points.triangle, points.barycentric))
    return NEAREST_PLACES * spacing * camera.pixel_sizes(np.where(depth > 0, depth, np.inf))


def _reach(degree: int, size: float) -> float:
    """Return the distance, in pixels, from a point with N arrowheads to their middles.

    N is `degree`, and `size` the length of an arrowhead in pixels. The distance is 0 for one arrowhead.
    """
    if degree <= 1:
        return 0.0
    return max(REACH, MIN_GAP * WIDTH / (2 * np.sin(np.pi / degree))) * size


def _screen_directions(gbuffer: GBuffer) -> np.ndarray:
    """Return (P, M) complex128: the directions of the field at P points, foreshortened, on screen.

    A direction is right + i up. Its modulus is 1 if it is parallel to the picture. M is the largest degree of
    all fields. A point with fewer than M directions has zeros in their place.
    """
    jacobian = screen_jacobians(gbuffer).astype(np.complex128)
    degree = np.asarray(gbuffer.instance_degrees)[gbuffer.instance_id]
    result = np.zeros((len(degree), int(degree.max(initial=1))), dtype=np.complex128)
    for number in np.unique(degree).tolist():
        of_degree = np.flatnonzero((degree == number) & (gbuffer.representation != 0))
        z = gbuffer.representation[of_degree].astype(np.complex128)
        turns = 2j * np.pi * np.arange(number) / number
        member = np.exp(1j * np.angle(z)[:, None] / number + turns)
        harmonics = [
            (order, values[of_degree, None].astype(np.complex128))
            for order, values in deviations(gbuffer.channels)
        ]
        if harmonics:
            member = member * evaluate_harmonics(harmonics, member)
            member /= np.maximum(np.abs(member), 1e-30)
        x, y = jacobian[of_degree].T[..., None]
        result[of_degree, :number] = x * member.real + y * member.imag
    return result


def _seems_hidden(projected: ProjectedPoints, gbuffer: GBuffer, spacing: float) -> np.ndarray:
    """Return (P,) bool: whether points are probably hidden, judged only from the depths of the points around.

    The picture is divided into cells of `spacing` pixels. A point is compared with the points in its cell and
    the 8 cells around it. It counts as hidden if one of them is nearer to the camera by more than
    `HIDDEN_SPACINGS` times the spacing. A point on a back side also counts as hidden if it is behind one on a
    front side.
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
    pixel = gbuffer.camera.pixel_sizes(projected.depth)
    is_far = projected.depth - nearest > HIDDEN_SPACINGS * spacing * pixel
    return is_far | (~gbuffer.front_facing & (projected.depth > nearest_front))


# --- places ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class SurfacePlaces:
    """P evenly spread points of a surface, ordered in levels from coarse to fine.

    Attributes
    ----------
    triangle : (P,) int32 ndarray
        Triangle of each point.
    barycentric : (P, 3) float64 ndarray
        Barycentric coordinates of the point in this triangle.
    distance : (P,) float64 ndarray
        Smallest distance to the points before it, in Blender units of the rest shape.
    level : int
        Number of the finest level; -1 if there are no points.
    extent : float
        Distance between the points of level 0, in Blender units of the rest shape: the side of a square that
        has the area of the surface.
    """

    triangle: np.ndarray
    barycentric: np.ndarray
    distance: np.ndarray
    level: int
    extent: float

    @property
    def finest(self) -> float:
        """Distance between the points of the finest level, in Blender units of the rest shape."""
        return level_distance(self.extent, self.level)


def level_distance(extent: float, level: int) -> float:
    """Return the smallest distance between the points of a level, given the distance `extent` of level 0."""
    return extent * 2 ** (-level / LEVELS_PER_OCTAVE)


def surface_places(surface: Surface, distance: float, cache: Cache) -> SurfacePlaces:
    """Find evenly spread points of a surface, on levels from coarse to fine.

    Parameters
    ----------
    surface : Surface
    distance : float
        Distance between points, in Blender units of the rest shape. The result has all levels up to the first
        one with at most this distance, but none after `MAX_LEVEL`.
    cache : Cache
        Cache for the points. All deformations of a mesh have the same points.

    Returns
    -------
    SurfacePlaces
        It may have finer levels than requested, from earlier calls.
    """
    key = "places", surface.rest_shape_key
    places = cache.get(key)
    if places is None:
        extent = float(np.sqrt(rest_areas(surface).sum()))
        places = SurfacePlaces(np.empty(0, np.int32), np.empty((0, 3)), np.empty(0), -1, extent)
    # The first level whose points are at most `distance` apart, or `MAX_LEVEL` if none are.
    levels = level_distance(places.extent, np.arange(MAX_LEVEL + 1))
    last = min(int(np.count_nonzero(levels > distance)), MAX_LEVEL)
    if places.level >= last or not places.extent:  # a surface without area has no points
        return places
    report(0.0, "finding places of arrowheads")
    density = CANDIDATES_PER_PLACE / level_distance(places.extent, last) ** 2
    triangle, barycentric, rank = surface_samples(surface, density)
    order = np.argsort(rank, kind="stable")
    vertices = surface.in_rest_shape().vertices
    for level in range(places.level + 1, last + 1):
        report(level / (last + 1), "finding places of arrowheads")
        finest = level_distance(places.extent, level)
        # The candidates of a level are the first ones in the order of their ranks.
        new = order[: np.searchsorted(rank[order], CANDIDATES_PER_PLACE / finest**2)]
        triangles = np.concatenate([places.triangle, triangle[new]])
        weights = np.concatenate([places.barycentric, barycentric[new]])
        distance = np.concatenate([places.distance, np.full(len(new), finest)])
        corners = vertices[surface.triangle_vertex[triangles]]
        chosen = spaced_points(np.einsum("nk,nki->ni", weights, corners), finest)
        columns = triangles[chosen], weights[chosen], distance[chosen]
        places = SurfacePlaces(*columns, level, places.extent)
    return cache.put(key, places)


def spaced_points(position: np.ndarray, spacing: float) -> np.ndarray:
    """Choose points greedily, so that no two chosen points are nearer to each other than a spacing.

    Parameters
    ----------
    position : (n, d) float64 ndarray
        Points in d dimensions, in order of preference.
    spacing : float
        Smallest distance between chosen points.

    Returns
    -------
    (K,) intp ndarray
        Indices of the chosen points, in ascending order.

    Notes
    -----
    Points are sorted into a grid. The diagonal of a cell is the spacing, so a cell has at most one chosen
    point. In each round, all points that are the first of the 5^d cells around them are chosen, and the
    points near them are removed. The result is the same as if points were chosen one by one.
    """
    count, dimension = position.shape
    if not count:
        return np.empty(0, dtype=np.intp)
    cell, around = _cells(position, spacing / np.sqrt(dimension))
    cell_count = around.shape[1]
    chosen = []
    left = np.arange(count)
    while len(left):
        first = np.full(cell_count + 1, count)
        first[cell[left[::-1]]] = left[::-1]
        candidate = left[first[cell[left]] == left]
        earliest = np.full(len(candidate), count)
        for neighbor in around:
            np.minimum(earliest, first[neighbor[cell[candidate]]], out=earliest)
        new = candidate[earliest == candidate]
        chosen.append(new)
        taken = np.full(cell_count + 1, -1)
        taken[cell[new]] = new
        for neighbor in around:
            other = taken[neighbor[cell[left]]]
            near = np.flatnonzero(other >= 0)
            if not len(near):
                continue
            step = position[left[near]] - position[other[near]]
            left = np.delete(left, near[(step * step).sum(axis=1) < spacing**2])
    return np.sort(np.concatenate(chosen))


def _cells(position: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Sort points in d dimensions into the cells of a grid. Only the C cells with points are numbered.

    Returns
    -------
    cell : (n,) intp ndarray
        Cell of each point, from 0 to C - 1.
    around : (5^d, C) intp ndarray
        The 5^d cells around each cell; the first is the cell itself. C stands for cells without points.
    """
    index = ((position - position.min(axis=0)) / side).astype(np.int64) + 2
    stride = np.cumprod([1, *(index.max(axis=0) + 3)])[:-1]
    key, cell = np.unique(index @ stride, return_inverse=True)
    steps = np.array(list(product(range(-2, 3), repeat=position.shape[1])))
    steps = steps[np.argsort(np.abs(steps).sum(axis=1), kind="stable")]
    around = np.empty((len(steps), len(key)), dtype=np.intp)
    for step, out in zip(steps @ stride, around, strict=True):
        place = np.minimum(np.searchsorted(key, key + step), len(key) - 1)
        out[:] = np.where(key[place] == key + step, place, len(key))
    return cell.reshape(-1), around
