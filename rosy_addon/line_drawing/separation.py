"""Cut strokes of the same family where they are nearer than the minimum separation.

Placement compares samples that are half a spacing apart. This misses some pairs that are too near:

- Where strokes bend strongly, above all at singularities, they may be nearer between samples. Two
  neighbors may also be of different families at one sample and of the same family at the next.
- At folds, the distance in space is smaller than along the surface.

After placement, strokes are compared at smaller steps near such points and near their ends. Of two strokes
that are too near to each other, the shorter one is cut.
"""

from dataclasses import replace

import numpy as np

from ..core.progress import progress
from ..field.blocks import concatenated_ranges, mask
from ..field.frames import dot, normalize, transport
from ..projection.pixel_blocks import reported_blocks
from .lateral_neighbors import MAX_SLOPE, MIN_NORMAL_COSINE, MIN_SELF_ARC
from .point_grid import PointGrid
from .stroke_set import Strokes
from .tangent_mesh import TangentMesh

#: Minimum separation in spacings. It is a little more than half a spacing, which is guaranteed, because
#: strokes may be nearer to each other between the points that are compared.
MIN_SEPARATION = 0.52

#: Tolerance in radians that is added to the largest angle between members of the same family.
FAMILY_TOLERANCE = np.radians(10)

#: Distance between the points that are compared, in spacings.
REFINED_STEP = 0.1

#: Strokes are compared at steps of `REFINED_STEP` where they or the field rotate by more than this within a
#: spacing, in radians. The points at which this is so are called suspect.
MAX_TURN = np.radians(18)

#: Points are also suspect where the normals of the surface rotate by more than `FOLD_ANGLE` within a spacing.
#: For ends of strokes, the limit is `END_FOLD_ANGLE`.
FOLD_ANGLE, END_FOLD_ANGLE = np.radians(40), np.radians(12)

#: Number of points that are examined at once. It bounds memory.
BLOCK_POINTS = 1 << 14

#: Radius around suspect points in which strokes are subdivided, in spacings.
CHECK_RADIUS = 1.0


def enforce_separation(mesh: TangentMesh, strokes: Strokes, min_length: float) -> Strokes:
    """Remove the parts of strokes that are nearer than `MIN_SEPARATION` to a stroke of the same family.

    Two strokes are of the same family where the angle between their directions is less than half the angle
    between two line directions of the field.

    Parameters
    ----------
    mesh : TangentMesh
        The mesh on which the strokes were traced.
    strokes : Strokes
        Strokes before `label_families`, all with the same value of `Strokes.family`.
    min_length : float
        Remaining parts of cut strokes that are shorter than this are removed, in spacings.

    Returns
    -------
    Strokes
        The strokes that were not cut, followed by the remaining parts of the others.
    """
    with progress(0.0, 0.3):
        suspect = _suspect_points(mesh, strokes)
    if not suspect.any():
        return strokes
    near_suspect = _points_near(strokes, suspect)
    candidates = np.unique(strokes.stroke[near_suspect])
    point = concatenated_ranges(strokes.start[candidates], np.diff(strokes.start)[candidates])
    refined, source = _refine(strokes.select(candidates), np.isin(point, near_suspect))
    with progress(0.4, 0.8):
        too_close = _too_close(mesh, refined, suspect[point][source], strokes.length[candidates])
    if not too_close.any():
        return strokes
    # Loops that are cut are also cut at their first point, where they were closed.
    opened = np.flatnonzero(refined.closed & (np.bincount(refined.stroke, too_close) > 0))
    too_close[refined.start[:-1][opened]] = too_close[refined.start[1:][opened] - 1] = True
    too_close = _dilate(refined, too_close)
    cut = np.unique(refined.stroke[too_close])
    # Strokes that were not cut stay as they were, so their runs are left out.
    is_cut = mask(len(candidates), cut)
    numbered = replace(refined, family=np.arange(len(refined), dtype=np.int32))
    remaining = numbered.runs_where(~too_close, free_at_removed=False)
    remaining = remaining.select(is_cut[remaining.family])
    remaining = replace(remaining, family=np.zeros(len(remaining), dtype=np.int32))
    remaining = replace(remaining, weights=mesh.weights_at(remaining.triangle, remaining.points))
    least = min_length * remaining.spacing[remaining.start[:-1]]
    remaining = remaining.select(remaining.length >= least)
    untouched = ~mask(len(strokes), candidates[cut])
    return Strokes.join([strokes.select(untouched), remaining])


def _suspect_points(mesh: TangentMesh, strokes: Strokes) -> np.ndarray:
    """Return (n,) bool: whether strokes may be closer than the minimum separation near a point."""
    surface_turn = np.empty(len(strokes.points))
    suspect = _stroke_turn_per_spacing(strokes) > MAX_TURN
    for block in reported_blocks(len(suspect), "separating strokes", size=BLOCK_POINTS):
        surface_turn[block], field_turn = _turns_per_spacing(mesh, strokes, block)
        suspect[block] |= field_turn > MAX_TURN
    suspect |= surface_turn > FOLD_ANGLE
    ends = np.stack([strokes.start[:-1], strokes.start[1:] - 1], axis=1)
    gap = strokes.points[ends[:, 1]] - strokes.points[ends[:, 0]]
    self_distance = MIN_SELF_ARC * strokes.spacing[ends[:, 1]]
    nearly_closed = (dot(gap, gap) < self_distance**2) & (strokes.length > 2 * self_distance)
    nearly_closed &= ~strokes.closed
    suspect[ends] |= (surface_turn[ends] > END_FOLD_ANGLE) | nearly_closed[:, None]
    return suspect


def _turns_per_spacing(
    mesh: TangentMesh, strokes: Strokes, block: slice
) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles, in radians, by which the shading normal and the field rotate within a spacing.

    Both have a value for each point in `block`. The first is the norm of the derivatives of the normal in
    two perpendicular directions. The second is measured in the direction in which the field rotates most.
    """
    triangle, spacing = strokes.triangle[block], strokes.spacing[block]
    gradient, z = mesh.gradient[triangle], mesh.z[triangle]
    turn_squared, rates = 0.0, []
    value = mesh.z_at(triangle, strokes.weights[block])
    for part in (gradient.real, gradient.imag):
        turn = np.einsum("nk,nki->ni", part, mesh.corner_normal[triangle])
        turn_squared = turn_squared + dot(turn, turn)
        rates.append((np.einsum("nk,nk->n", part, z) * value.conj()).imag)
    scale = np.maximum(mesh.degree * np.abs(value) ** 2, 1e-300)
    return spacing * np.sqrt(turn_squared), spacing * np.hypot(*rates) / scale


def _stroke_turn_per_spacing(strokes: Strokes) -> np.ndarray:
    """Return (n,) angles, in radians, by which strokes turn within a spacing around each point.

    The directions of a stroke half a spacing before and after the point are compared.
    """
    arc, stroke = strokes.arc, strokes.stroke
    stride = 2 * (float(arc.max(initial=0)) + float(strokes.spacing.max(initial=0)))
    key = stroke * stride + arc
    first, last = strokes.start[stroke], strokes.start[stroke + 1] - 1
    half_window = 0.5 * strokes.spacing
    before = np.clip(np.searchsorted(key, key - half_window), first, last)
    after = np.clip(np.searchsorted(key, key + half_window), first, last)
    return np.arccos(np.clip(dot(strokes.member[before], strokes.member[after]), -1, 1))


def _points_near(strokes: Strokes, suspect: np.ndarray) -> np.ndarray:
    """Return the indices of all points within `CHECK_RADIUS` spacings of suspect points.

    `suspect` is (n,) bool. Whole grid cells are selected, so some points that are farther away are included.
    """
    cell = CHECK_RADIUS * float(strokes.spacing.max())
    cells = np.floor((strokes.points - strokes.points.min(axis=0)) / cell).astype(np.int64) + 1
    grid_shape = cells.max(axis=0) + 2
    stride = np.array([grid_shape[1] * grid_shape[2], grid_shape[2], 1])
    step = np.arange(-1, 2)
    offset = np.stack(np.meshgrid(step, step, step), axis=-1).reshape(-1, 3) @ stride
    suspect_cells = np.unique(cells[suspect] @ stride)
    return np.flatnonzero(np.isin(cells @ stride, np.unique(suspect_cells[:, None] + offset)))


def _refine(strokes: Strokes, near_suspect: np.ndarray) -> tuple[Strokes, np.ndarray]:
    """Divide segments of strokes into parts of at most `REFINED_STEP` spacings next to some points.

    Parameters
    ----------
    strokes : Strokes
    near_suspect : (n,) bool ndarray
        Whether the segments next to a point are divided.

    Returns
    -------
    refined : Strokes
        The strokes after division, with m points.
    source : (m,) int64 ndarray
        For each point of `refined`, the index of the original point at or after it.
    """
    step = np.diff(strokes.arc, prepend=0)
    step[strokes.start[:-1]] = 0
    step[1:][~(near_suspect[1:] | near_suspect[:-1])] = 0
    counts = np.ceil(step / (REFINED_STEP * strokes.spacing)).clip(1, 1000).astype(np.int64)
    return strokes.subdivided(counts), np.repeat(np.arange(len(counts)), counts)


def _too_close(
    mesh: TangentMesh, refined: Strokes, suspect: np.ndarray, length: np.ndarray
) -> np.ndarray:
    """Return (m,) bool: which points of refined strokes to remove, as they are too near to another stroke.

    Parameters
    ----------
    mesh : TangentMesh
    refined : Strokes
        Strokes with m points in all.
    suspect : (m,) bool ndarray
        Whether a point is compared with all others.
    length : (S,) float64 ndarray
        Lengths of the strokes, in world space.
    """
    arc, stroke, spacing = refined.arc, refined.stroke, refined.spacing
    grid = PointGrid(1.01 * MIN_SEPARATION * float(np.median(spacing)), len(stroke))
    grid.add(refined.points, MIN_SEPARATION * spacing)
    end_distance = np.minimum(arc, length[stroke] - arc)
    queries = np.flatnonzero(suspect)
    rejected = np.zeros(len(stroke), dtype=bool)
    for block in reported_blocks(len(queries), "separating strokes", size=BLOCK_POINTS):
        query = queries[block]
        point, other = grid.pairs_within(refined.points[query], MIN_SEPARATION * spacing[query])
        point = query[point]
        arc_gap = np.abs(arc[point] - arc[other])
        around = np.where(refined.closed, length, np.inf)[stroke[point]] - arc_gap
        arc_gap = np.minimum(arc_gap, np.abs(around))
        distinct = (stroke[point] != stroke[other]) | (arc_gap > MIN_SELF_ARC * spacing[point])
        point, other = _pairs_of_one_family(mesh, refined, point[distinct], other[distinct])
        # Cut the shorter stroke, or within one stroke the point that is nearer to an end.
        same_stroke = stroke[point] == stroke[other]
        priority = np.where(same_stroke, end_distance[point], length[stroke[point]])
        other_priority = np.where(same_stroke, end_distance[other], length[stroke[other]])
        yields = (priority < other_priority) | ((priority == other_priority) & (point > other))
        rejected[np.where(yields, point, other)] = True
    return rejected


def _pairs_of_one_family(
    mesh: TangentMesh, refined: Strokes, point: np.ndarray, other: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of points that are of the same family and on the same side of a fold.

    `point` and `other` hold the indices of the two points of each pair, row by row. The result is these two
    arrays without the other pairs.
    """
    normal_a, normal_b = refined.normal[point], refined.normal[other]
    normal_sum, delta = normal_a + normal_b, refined.points[point] - refined.points[other]
    same_family = dot(normal_a, normal_b) > MIN_NORMAL_COSINE
    limit = MAX_SLOPE**2 * dot(delta, delta) * dot(normal_sum, normal_sum)
    same_family &= dot(delta, normal_sum) ** 2 <= limit
    members = refined.member[point], refined.member[other]
    member_a = transport(members[0], mesh.normal[refined.triangle[point]], normal_a)
    member_b = transport(members[1], mesh.normal[refined.triangle[other]], normal_b)
    # At sharp bends, the result depends on how directions are compared. Accept a match by transport
    # or by projection along the mean normal.
    mean = normalize(normal_sum)
    projected = [normalize(member - dot(member, mean)[:, None] * mean) for member in members]
    matches = mesh.is_same_family(member_a, normal_a, member_b, normal_b, FAMILY_TOLERANCE)
    matches |= mesh.is_same_family(projected[0], mean, projected[1], mean, FAMILY_TOLERANCE)
    same_family &= matches
    return point[same_family], other[same_family]


def _dilate(refined: Strokes, removed: np.ndarray) -> np.ndarray:
    """Return (m,) bool: `removed`, with each run of removed points widened to a minimum length.

    Otherwise the remaining parts of a stroke on both sides of a run could be too near to each other.
    """
    arc, stroke = refined.arc, refined.stroke
    stride = 2 * (float(arc.max()) + float(refined.spacing.max()))
    key = stroke * stride + arc
    changes = np.flatnonzero(np.diff(np.concatenate([[0], removed * (stroke + 1), [0]])))
    # A run at the end of a stroke and a run at the start of the next stroke share one change.
    first = changes[removed[np.minimum(changes, len(removed) - 1)] & (changes < len(removed))]
    last = changes[(changes > 0) & removed[np.maximum(changes - 1, 0)]] - 1
    min_extent = (MIN_SEPARATION + 2 * REFINED_STEP) * refined.spacing[first]
    padding = np.maximum(min_extent - (arc[last] - arc[first]), 0) / 2
    coverage = np.zeros(len(removed) + 1, dtype=np.int64)
    np.add.at(coverage, np.searchsorted(key, key[first] - padding), 1)
    np.add.at(coverage, np.searchsorted(key, key[last] + padding, side="right"), -1)
    return np.cumsum(coverage[:-1]) > 0
