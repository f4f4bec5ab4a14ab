"""Outlines: ink lines along silhouettes, borders and sharp creases that are found in the G-buffer.

Silhouettes and borders lie between two adjacent pixels if the surface does not continue from one to
the other (`pixel_neighbors.neighbor_masks`). Where one surface occludes the other, the line is drawn
only on the nearer one. Creases are chains of edges of the mesh (`field.creases`), drawn where they
are visible. A group of connected pixels at edges (a *mark*) is not drawn if it is too short, unless the
background is next to it, or it surrounds a part of a mesh.
"""

import numpy as np

from ..core.cache import Cache
from ..core.progress import progress
from ..field.blocks import mask
from ..field.connectivity import connected_components
from ..field.frames import dot
from ..projection.crease_pixels import crease_pixels
from ..projection.gbuffer import GBuffer
from ..projection.outline_mesh import cached_outline_mesh
from ..projection.pixel_blocks import reported_blocks
from ..projection.pixel_neighbors import PixelTable, depth_slopes, neighbor_masks
from ..projection.project import project_samples
from .look import crease_angle_of
from .look_units import PixelLook
from .pixel_field import pixel_window

#: Minimum depth difference at an occlusion, in multiples of the depth tolerance per pixel (see
#: `pixel_neighbors.depth_slopes`).
DEPTH_JUMP = 2.0

#: Minimum depth difference at a step, in multiples of the depth tolerance, and relative to the changes
#: of depth from the pixels at the step to the next ones.
MIN_STEP, STEP_RATIO = 6.0, 2.0

#: Lengths of marks, in pixels of the finished picture. Marks shorter than the first are not drawn, marks longer
#: than the second have their full width, and the width grows in between, so that marks do not flicker.
MIN_MARK_LENGTH, FULL_MARK_LENGTH = 6, 12

#: Maximum number of samples of pixels in a band that is processed at once.
MAX_OUTLINE_SAMPLES = 1 << 20

#: Bits of a pixel at an edge: whether another part of a mesh or another instance is next to it, and whether
#: there is no surface next to it.
PART_BORDER, EMPTY_BORDER = 1, 2

#: The settings of a look that an outline depends on.
OUTLINE_SETTINGS = ("outline", "crease_angle", "supersampling", "display")

#: Label of all steps.
STEP_LABEL = "drawing outlines"

#: (dx, dy, bit) of the four nearest neighbors. The bit refers to `neighbor_masks`.
NEIGHBORS_4 = ((1, 0, 5), (-1, 0, 3), (0, 1, 7), (0, -1, 1))


def outline_coverage(gbuffer: GBuffer, look: PixelLook, cache: Cache | None = None) -> np.ndarray:
    """Compute the coverage of each pixel by outlines.

    Parameters
    ----------
    gbuffer : GBuffer
        Creases are drawn if its `instances` are set. If its pixels have several samples, the coverage is
        computed at samples near outlines, and averaged.
    look : PixelLook
        Its `outline`, `crease_angle`, `supersampling` and `display` are used.
    cache : Cache, optional
        Stores the creases and the parts of meshes, which do not depend on the view.

    Returns
    -------
    (P,) float32 ndarray
        0 to 1.
    """
    with progress(0.0, 0.8 if gbuffer.samples is None else 0.3):
        edges = _Edges(gbuffer, look, cache)
    if gbuffer.samples is None:
        with progress(0.8, 1.0):
            return edges.coverage()
    is_start = (edges.line_width > 0) | (gbuffer.coverage.own < 1)
    reach = int(np.ceil(look.outline)) + 1
    is_near = _dilated(gbuffer, is_start, reach)
    # The samples at the border of this part lack neighbors, so the part is a pixel larger than needed.
    entries = np.flatnonzero(_dilated(gbuffer, is_near, 1))
    sums, counts = np.zeros((2, len(gbuffer.pixel)))
    for band, core in _bands(gbuffer, entries, reach + FULL_MARK_LENGTH):
        start, stop = (0.3 + 0.7 * end / len(entries) for end in (core.start, core.stop))
        with progress(start, stop, STEP_LABEL):
            home, shown, coverage = _sample_outline(gbuffer, look, entries[band], is_near, cache)
        first, last = entries[core.start], entries[core.stop - 1]
        is_core = (home >= first) & (home <= last)
        sums += np.bincount(shown[is_core], coverage[is_core], minlength=len(sums))
        counts += np.bincount(shown[is_core], minlength=len(sums))
    return (sums / np.maximum(counts, 1)).astype(np.float32)


def _bands(gbuffer: GBuffer, entries: np.ndarray, margin: int) -> list[tuple[slice, slice]]:
    """Divide pixels of a G-buffer into bands of rows with about `MAX_OUTLINE_SAMPLES` samples at most.

    `entries` are the (n,) ascending indices of the pixels in the G-buffer.

    Returns
    -------
    list of (band, core)
        Slices of `entries`. The cores divide all entries. A band is its core with `margin` more rows below
        and above.
    """
    row = gbuffer.pixel[entries] // np.int32(gbuffer.camera.width)
    limit = max(MAX_OUTLINE_SAMPLES // gbuffer.samples.side**2, 1)
    bands, start = [], 0
    while start < len(row):
        last_row = row[min(start + limit, len(row)) - 1]
        ends = np.array([row[start] - margin, last_row + 1, last_row + 1 + margin], row.dtype)
        first, stop, band_stop = np.searchsorted(row, ends).tolist()
        bands.append((slice(first, band_stop), slice(start, stop)))
        start = stop
    return bands


def _sample_outline(
    gbuffer: GBuffer, look: PixelLook, entries: np.ndarray, is_near: np.ndarray, cache: Cache | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute the coverage of samples by outlines.

    Parameters
    ----------
    gbuffer : GBuffer
        Its pixels have several samples.
    look : PixelLook
    entries : (n,) intp ndarray
        Indices of the pixels whose samples are computed.
    is_near : (P,) bool ndarray
        Pixels at whose samples edges are drawn.
    cache : Cache, optional

    Returns
    -------
    home : (Q,) int32 ndarray
        For each sample, the index of the pixel of the G-buffer in which the sample lies.
    shown : (Q,) int32 ndarray
        For each sample, the index of the pixel whose surface it shows: a pixel of the G-buffer has one
        surface, but a neighbor's surface may show at some of its samples.
    coverage : (Q,) float32 ndarray
        Coverage of each sample by outlines, 0 to 1.
    """
    with progress(0.0, 0.4):
        samples, home, shown = project_samples(gbuffer, entries, look.display, cache)
    look = look.in_samples(gbuffer.samples.side)
    with progress(0.4, 0.8):
        edges = _Edges(samples, look, cache)
    edges.line_width[~is_near[home]] = 0
    with progress(0.8, 1.0):
        return home, shown, edges.coverage()


def _dilated(gbuffer: GBuffer, is_marked: np.ndarray, radius: int) -> np.ndarray:
    """Return a (P,) bool mask of the pixels within `radius` columns and rows of a marked pixel."""
    cell, shape = pixel_window(gbuffer.pixel, gbuffer.camera.width, radius)
    padded = mask(shape[0] * shape[1], cell[is_marked]).reshape(shape)
    for axis in (0, 1):
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * radius + 1, axis=axis)
        padded = windows.any(axis=-1)
    row, column = np.divmod(cell, np.int32(shape[1]))
    return padded[row - radius, column - radius]


class _Edges:
    """The edges in a G-buffer: the pixels at silhouettes, borders and creases.

    Parameters
    ----------
    gbuffer : GBuffer
    look : PixelLook
    cache : Cache, optional

    Attributes
    ----------
    line_width : (P,) float32 ndarray
        Largest width of the lines that are drawn at each pixel, on its own side of the edge, in pixels of the
        frame; 0 where there is no edge.
    """

    def __init__(self, gbuffer: GBuffer, look: PixelLook, cache: Cache | None) -> None:
        self._gbuffer, self._look = gbuffer, look
        self._count = count = len(gbuffer.pixel)
        self._defined = gbuffer.representation != 0
        # The margin of the frame is wider than the lines.
        self._table = PixelTable(gbuffer, int(np.ceil(look.outline)) + 1)
        # Larger values of `_depth` are nearer to the camera.
        self._depth, _, _, self._tolerance = depth_slopes(gbuffer, slice(None))
        with progress(0.0, 0.6, STEP_LABEL):
            #: The `neighbor_masks` of the surface, with links across creases.
            self._mask = neighbor_masks(gbuffer, None)
        self.line_width = np.zeros(count, dtype=np.float32)
        #: (P,) bits `PART_BORDER` and `EMPTY_BORDER`.
        self._border = np.zeros(count, dtype=np.uint8)
        for instance_id in np.flatnonzero(np.bincount(gbuffer.instance_id)):
            with progress(0.6, 0.7, STEP_LABEL):
                self._find_creases_and_parts(int(instance_id), cache)
        with progress(0.7, 0.9, STEP_LABEL):
            self._find_occlusions()
        with progress(0.9, 1.0, STEP_LABEL):
            self._find_steps()

    def coverage(self) -> np.ndarray:
        """Return the (P,) float32 coverage of each pixel by the lines that are drawn at edges."""
        gbuffer, look, depth = self._gbuffer, self._look, self._depth
        edge = np.flatnonzero(self.line_width)
        with progress(0.0, 0.5, STEP_LABEL):
            marks = gbuffer.pixel[edge], self._border[edge]
            strength = _mark_strength(*marks, gbuffer.camera.width, look.supersampling)
        edge, strength = edge[strength > 0], strength[strength > 0]
        line_width = np.minimum(self.line_width[edge], np.float32(look.outline) * strength)
        depth_slack = np.float32(DEPTH_JUMP) * self._tolerance[edge]
        coverage = np.zeros(self._count, dtype=np.float32)
        for distance, dx, dy in _disc_offsets(int(np.ceil(look.outline))):
            neighbor = self._table.beside(edge, dx, dy)
            paintable = neighbor >= 0
            paintable &= gbuffer.instance_id.take(neighbor) == gbuffer.instance_id[edge]
            slack = depth_slack * np.float32(max(distance, 1.0))
            paintable &= depth.take(neighbor) >= depth[edge] - slack
            pixel_coverage = np.clip(line_width[paintable] - np.float32(distance), 0, 1)
            neighbor = neighbor[paintable]
            coverage[neighbor] = np.maximum(coverage[neighbor], pixel_coverage)
        return coverage

    def _is_linked(self, entry: np.ndarray | slice, bit: int) -> np.ndarray:
        """Return an (n,) bool mask: whether the surface continues from each pixel to its neighbor.

        `entry` are indices of pixels in the G-buffer, `bit` is the number of the neighbor in
        `neighbor_masks`.
        """
        return self._mask[entry] >> np.uint16(bit) & 1 == 1

    def _find_creases_and_parts(self, instance_id: int, cache: Cache | None) -> None:
        """Set the width of lines along the creases of an instance, and where its parts intersect.

        Parts are connected components of the mesh. A line is drawn where two of them intersect if their
        normals differ by the crease angle. The bit `PART_BORDER` is set at pixels next to another part.
        """
        gbuffer, look, defined = self._gbuffer, self._look, self._defined
        instance = gbuffer.instances[instance_id]
        crease_angle = crease_angle_of(look)
        with progress(0.0, 0.5):
            mesh = cached_outline_mesh(instance.surface, instance.matrix, crease_angle, cache)
        if len(mesh.crease_ends):
            points = mesh.crease_points(instance.surface, instance.matrix)
            points += np.asarray(instance.matrix, dtype=np.float64)[:3, 3]
            with progress(0.5, 0.8):
                marks = crease_pixels(gbuffer, instance_id, points, self._table)
            self.line_width[marks & defined] = look.outline / 2
        if mesh.triangle_part is None:
            return
        min_cosine = -2.0 if crease_angle is None else np.float32(np.cos(crease_angle))
        for block in reported_blocks(self._count, STEP_LABEL, 0.8, 1.0):
            entry = np.flatnonzero(gbuffer.instance_id[block] == instance_id) + block.start
            part = mesh.triangle_part.take(gbuffer.triangle[entry])
            for dx, dy, bit in NEIGHBORS_4:
                neighbor = self._table.beside(entry, dx, dy)
                pair = np.flatnonzero(neighbor >= 0)
                pair = pair[gbuffer.instance_id[neighbor[pair]] == instance_id]
                other = mesh.triangle_part.take(gbuffer.triangle[neighbor[pair]])
                pair = pair[other != part[pair]]
                a, b = entry[pair], neighbor[pair]
                self._border[a] |= PART_BORDER
                meet = self._is_linked(a, bit) & defined[a] & defined[b]
                meet &= dot(gbuffer.normal[a], gbuffer.normal[b]) < min_cosine
                self.line_width[a[meet]] = look.outline / 2

    def _find_occlusions(self) -> None:
        """Set the width of lines at pixels where their surface ends, unless the neighbor occludes them.

        There is no edge at the border of the frame, and none where the surface continues but the field
        ends. The bit `PART_BORDER` is set next to another instance, `EMPTY_BORDER` next to the background.
        """
        gbuffer, depth, outline = self._gbuffer, self._depth, np.float32(self._look.outline)
        for block in reported_blocks(self._count, STEP_LABEL):
            row, column = np.divmod(gbuffer.pixel[block], np.int32(gbuffer.camera.width))
            for dx, dy, bit in NEIGHBORS_4:
                inside = (column + dx >= 0) & (column + dx < gbuffer.camera.width)
                inside &= (row + dy >= 0) & (row + dy < gbuffer.camera.height)
                is_edge = inside & self._defined[block] & ~self._is_linked(block, bit)
                edge = np.flatnonzero(is_edge) + block.start
                neighbor = self._table.beside(edge, dx, dy)
                jump_limit = np.float32(DEPTH_JUMP) * self._tolerance[edge]
                jump = (depth.take(neighbor) - depth[edge]) / jump_limit
                is_empty = neighbor < 0
                same_instance = gbuffer.instance_id.take(neighbor) == gbuffer.instance_id[edge]
                width = np.where(np.abs(jump) <= 1, outline / 2, outline)
                width[jump > 1] = 0
                width[same_instance & ~self._defined.take(neighbor)] = 0
                width[is_empty] = outline
                self.line_width[edge] = np.maximum(self.line_width[edge], width)
                self._border[edge[is_empty]] |= EMPTY_BORDER
                self._border[edge[~is_empty & ~same_instance]] |= PART_BORDER

    def _find_steps(self) -> None:
        """Set the width of lines at the nearer pixel of steps in the depth of a surface.

        `pixel_neighbors` tells by depth which neighbor pixels show the same piece of surface. On a surface
        that is seen nearly edge-on it may miss a silhouette, as any difference in depth is plausible there.
        Here it is found: between two pixels of a row or a column, the depth changes much more than it does
        from each of them to its other neighbor in that row or column.
        """
        depth, tolerance, defined = self._depth, self._tolerance, self._defined
        for block in reported_blocks(self._count, STEP_LABEL):
            for dx, dy, bit in ((1, 0, 5), (0, 1, 7)):
                first = np.flatnonzero(self._is_linked(block, bit)) + block.start
                second = self._table.beside(first, dx, dy)
                jump = np.abs(depth[second] - depth[first])
                least = np.minimum(tolerance[first], tolerance[second])
                steep = jump > np.float32(MIN_STEP) * least
                first, second, jump = first[steep], second[steep], jump[steep]
                is_step = np.ones(len(first), dtype=bool)
                for near, side in ((first, -1), (second, 1)):
                    neighbor = self._table.beside(near, side * dx, side * dy)
                    change = np.abs(depth.take(neighbor) - depth[near])
                    change[neighbor < 0] = 0
                    is_step &= jump > np.float32(STEP_RATIO) * change
                first, second = first[is_step], second[is_step]
                nearer = np.where(depth[first] > depth[second], first, second)
                self.line_width[nearer[defined[first] & defined[second]]] = self._look.outline


def _mark_strength(
    pixel: np.ndarray, border: np.ndarray, width: int, block_side: int
) -> np.ndarray:
    """Return the fraction of the full width with which each mark is drawn, by the length of the mark.

    Marks are connected pixels of the finished picture; diagonal neighbors are connected. The length
    of a mark is the longer side of its bounding box. A short mark still has its full width if it is next to
    the background, or if it surrounds a part of a mesh. It counts as surrounding one if its pixels at borders
    of parts are at least half as many as the perimeter of its bounding box is long, in pixels.

    Parameters
    ----------
    pixel : (n,) int32 ndarray
        Pixels at edges, in ascending order.
    border : (n,) uint8 ndarray
        For each of these pixels, the bits `PART_BORDER` (next to another part of a mesh) and `EMPTY_BORDER`
        (next to the background).
    width : int
        Width of the frame.
    block_side : int
        Number of pixels of the frame along a side of a pixel of the finished picture.

    Returns
    -------
    (n,) float32 ndarray
        For each of these pixels, the fraction for its mark, 0 to 1.
    """
    row, column = np.divmod(pixel.astype(np.int64), width)
    stride = width // block_side + 2
    block = row // block_side * stride + column // block_side
    block, block_of_pixel = np.unique(block, return_inverse=True)
    pairs = []
    for offset in (1, stride - 1, stride, stride + 1):
        target = np.searchsorted(block, block + offset)
        target[target == len(block)] = 0
        source = np.flatnonzero(block[target] == block + offset)
        pairs.append(np.stack([source, target[source]], axis=1))
    mark = connected_components(len(block), np.concatenate(pairs))
    sides = [_extent_per_label(values, mark) for values in (block // stride, block % stride)]
    is_part_border = mask(len(block), block_of_pixel[border & PART_BORDER != 0])
    borders = np.bincount(mark[is_part_border], minlength=len(sides[0]))
    has_full_width = (borders >= sides[0] + sides[1]) & (np.minimum(*sides) > 1)
    has_full_width[mark[block_of_pixel[border & EMPTY_BORDER != 0]]] = True
    hidden = MIN_MARK_LENGTH - 1
    strength = (np.maximum(*sides) - hidden) / (FULL_MARK_LENGTH - hidden)
    strength = np.where(has_full_width, 1, np.clip(strength, 0, 1)).astype(np.float32)
    return strength[mark][block_of_pixel]


def _extent_per_label(values: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Return, for each of K labels, its largest minus its smallest value plus 1, (K,).

    `label[i]`, from 0 to K - 1, is the label of `values[i]`. Each label occurs.
    """
    order = np.argsort(label, kind="stable")
    start = np.flatnonzero(np.diff(label[order], prepend=-1))
    ordered = values[order]
    return np.maximum.reduceat(ordered, start) - np.minimum.reduceat(ordered, start) + 1


def _disc_offsets(radius: int) -> list[tuple[float, int, int]]:
    """Return (distance, dx, dy) of the pixels within `radius` pixels of a pixel, itself included."""
    steps = range(-radius, radius + 1)
    offsets = [(float(np.hypot(dx, dy)), dx, dy) for dy in steps for dx in steps]
    return [offset for offset in offsets if offset[0] <= radius]
