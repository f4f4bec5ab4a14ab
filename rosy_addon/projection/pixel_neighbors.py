"""Stepping over the pixels of a G-buffer: directions on screen, and continuity between neighbors.

`screen_jacobians` maps tangents of the surface to directions on screen. `neighbor_masks` marks the
neighboring pixels on which the surface continues, without a silhouette in between.
"""

from typing import NamedTuple

import numpy as np

from ..core.progress import report
from ..field.frames import dot_components, transport_components, view_frame
from .gbuffer import GBuffer
from .pixel_blocks import BLOCK_PIXELS

#: Upper bound of the slope of a tangent plane against the picture, in pixels of depth per pixel.
#: Corresponds to 88 degrees.
MAX_SLOPE = 30.0

#: Largest deviation of the depth difference between neighbors from the prediction of the tangent planes,
#: in pixels: on a surface that faces the eye, and its increase for each unit of slope.
DEPTH_TOLERANCE, SLOPE_TOLERANCE = 0.5, 0.5


class PixelTable:
    """A table of the pixels of a G-buffer by row and column of the frame, for steps from pixel to pixel.

    Parameters
    ----------
    gbuffer : GBuffer
    margin : int
        How many rows and columns outside of the frame can be queried on each side. No pixels are there.
    """

    def __init__(self, gbuffer: GBuffer, margin: int) -> None:
        width, height = gbuffer.camera.size
        self._margin, self._stride = margin, width + 2 * margin
        row, column = np.divmod(gbuffer.pixel, np.int32(width))
        self._cell = (row + margin) * np.int32(self._stride) + column + np.int32(margin)
        self._entry = np.full((height + 2 * margin) * self._stride, -1, dtype=np.int32)
        self._entry[self._cell] = np.arange(len(self._cell), dtype=np.int32)

    def beside(self, entry: np.ndarray, dx: int, dy: int) -> np.ndarray:
        """Return the pixels `dx` columns to the right of, and `dy` rows above, the pixels `entry`.

        All are indices into the G-buffer. The result is -1 where there is no pixel.
        """
        return self._entry.take(self._cell[entry] + (dy * self._stride + dx))

    def at(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the indices of the pixels in rows and columns of the frame; -1 where there is none.

        They are indices into the G-buffer.
        """
        return self._entry.take((row + self._margin) * self._stride + column + self._margin)


def screen_jacobians(gbuffer: GBuffer) -> np.ndarray:
    """Return the linear maps from tangents of the surface to displacements on screen.

    Parameters
    ----------
    gbuffer : GBuffer

    Returns
    -------
    (P, 2) complex64 ndarray
        Displacement on screen, right + i up, of each axis of the view frame after it is transported
        from the view plane to the tangent plane. It is relative to the displacement of a unit
        vector that is parallel to the picture at the same depth. A member at angle t of the
        representation points along ``jacobians @ (cos t, sin t)`` on screen.
    """
    camera = gbuffer.camera
    to_pixels = camera.view_to_pixels.astype(np.float32)
    jacobians = np.empty((2, len(gbuffer.pixel)), dtype=np.complex64)
    view_direction, normal = gbuffer.view_direction.T, gbuffer.normal.T
    ray = view_direction[:2] / view_direction[2] if camera.is_perspective else None
    frame = (axis.T for axis in view_frame(gbuffer.view_direction))
    for axis, out in zip(frame, jacobians, strict=True):
        x, y, depth = transport_components(axis, view_direction, normal)
        if ray is not None:
            # Subtract the motion along the ray, which does not move the projected point.
            x -= depth * ray[0]
            y -= depth * ray[1]
        out.real = x * to_pixels[0, 0] + y * to_pixels[0, 1]
        out.imag = x * to_pixels[1, 0] + y * to_pixels[1, 1]
    return jacobians.T


def neighbor_masks(gbuffer: GBuffer, crease_angle: float | None) -> np.ndarray:
    """Find, for each pixel, the neighbors to which a streamline may step.

    Parameters
    ----------
    gbuffer : GBuffer
    crease_angle : float or None
        Radians. If the normals of neighboring pixels differ by more, there is a crease between
        them. If it is None, there are no creases.

    Returns
    -------
    (P,) uint16 ndarray
        Bit ``(dy + 1) * 3 + (dx + 1)`` is set if the surface continues on the neighbor at (dx, dy).
        Then the neighbor shows the same mesh instance, and they are separated neither by a
        silhouette nor by a crease. Bit 4, the pixel itself, is
        always set. The relation is symmetric.

    Notes
    -----
    Over the line from a pixel to its neighbor, the depth of the surface is a curve, and the tangent
    planes at both ends are two straight lines. If the curve is convex or concave, the lines cross
    between the ends, however steep the curve is: the difference in depth is then between the two
    predictions of the lines. At a silhouette it is outside of them by more than a tolerance. The
    tolerance is large enough for inflections and irregular meshes, and small enough to separate
    parallel layers whose distance is one pixel. Depth is measured in a quantity that is linear on
    screen for planes: z, or -1 / z under perspective.
    """
    label = "finding neighbors"
    count = len(gbuffer.pixel)
    masks = np.full(count, 1 << 4, dtype=np.uint16)
    if not count:
        return masks
    row, column = np.divmod(gbuffer.pixel, np.int32(gbuffer.camera.width))
    left_column, right_column = int(column.min()), int(column.max())
    # One empty column on either side.
    width = right_column - left_column + 3
    min_normal_cosine = None if crease_angle is None else np.float32(np.cos(crease_angle))
    band_rows = max(BLOCK_PIXELS // width, 1)
    first_row, row_count = int(row[0]), int(row[-1] - row[0]) + 1
    for row_start in range(first_row, first_row + row_count, band_rows):
        report((row_start - first_row) / row_count, label)
        # The grid has one more row: the first row of the next band, or an empty row.
        ends = np.array([row_start, row_start + band_rows + 1], row.dtype)
        first, stop = np.searchsorted(row, ends).tolist()
        grid_index = (row[first:stop] - row_start) * width
        grid_index += column[first:stop] - (left_column - 1)
        grid = _pixel_grid(gbuffer, slice(first, stop), grid_index, (band_rows + 1, width))
        grid_masks = np.zeros((band_rows + 1, width), dtype=np.uint16)
        for dx, dy in grid.steps:
            # The cells that have a neighbor at (dx, dy), and these neighbors.
            left, right = max(-dx, 0), max(dx, 0)
            source = slice(0, band_rows + 1 - dy), slice(left, width - right)
            target = slice(dy, band_rows + 1), slice(right, width - left)
            continuous = _is_continuous(grid, source, target, (dx, dy), min_normal_cosine)
            continuous = continuous.astype(np.uint16)
            bit = (dy + 1) * 3 + (dx + 1)
            grid_masks[source] |= continuous << np.uint16(bit)
            grid_masks[target] |= continuous << np.uint16(8 - bit)
        # Links within the last row of the grid are computed again in the next band.
        masks[first:stop] |= grid_masks.reshape(-1).take(grid_index)
    return masks


class _PixelGrid(NamedTuple):
    """Some rows of the frame as 2D arrays, limited to the columns that the G-buffer covers.

    Attributes
    ----------
    depth : (h, w) float32 ndarray
        A quantity that is linear on screen for planes: z if orthographic, -1 / z if perspective.
        NaN at empty pixels.
    steps : dict of (int, int) to (h, w) float32 ndarray
        Change of `depth` on the tangent plane to the neighbor at (dx, dy). Only one of each two opposite
        neighbors has a key, because the changes to both differ only in their signs.
    tolerance : (h, w) float32 ndarray
        Permitted deviation of `depth` from the prediction, one pixel away.
    normal : 3 (h, w) float32 ndarrays
        Components of the unit shading normal.
    instance_id : (h, w) int32 ndarray or None
        Index of the visible mesh instance. None if there is only one.
    front_facing : (h, w) bool ndarray or None
        Whether the visible triangle faces the camera. None if all of them do.
    """

    depth: np.ndarray
    steps: dict[tuple[int, int], np.ndarray]
    tolerance: np.ndarray
    normal: tuple[np.ndarray, ...]
    instance_id: np.ndarray | None
    front_facing: np.ndarray | None


def _pixel_grid(
    gbuffer: GBuffer, pixels: slice, grid_index: np.ndarray, shape: tuple[int, int]
) -> _PixelGrid:
    """Return some pixels of a G-buffer as a grid of the given `shape`, rows and columns.

    `grid_index` holds the flat index of each of these pixels into the grid.
    """

    def scatter(values: np.ndarray, fill_value: float = 0) -> np.ndarray:
        grid = np.full(shape, fill_value, dtype=values.dtype)
        grid.reshape(-1)[grid_index] = values
        return grid

    depth, slope_x, slope_y, tolerance = depth_slopes(gbuffer, pixels)
    x, y = scatter(slope_x), scatter(slope_y)
    return _PixelGrid(
        depth=scatter(depth, np.nan),
        steps={(1, 0): x, (-1, 1): y - x, (0, 1): y, (1, 1): y + x},
        tolerance=scatter(tolerance),
        normal=tuple(scatter(component) for component in gbuffer.normal[pixels].T),
        instance_id=scatter(gbuffer.instance_id[pixels]) if len(gbuffer.instances) > 1 else None,
        front_facing=None if gbuffer.front_facing.all() else scatter(gbuffer.front_facing[pixels]),
    )


def depth_slopes(
    gbuffer: GBuffer, pixels: slice | np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the depth of the surface at pixels, its slopes on screen, and its tolerance.

    Parameters
    ----------
    gbuffer : GBuffer
    pixels : slice or ndarray of int
        Indices into the G-buffer.

    Returns
    -------
    depth : (n,) float32 ndarray
        z if orthographic, -1 / z if perspective; larger values are nearer to the eye.
    slope_x, slope_y : (n,) float32 ndarray
        Changes of the depth to the next column and to the next row, on the tangent plane.
    tolerance : (n,) float32 ndarray
        Permitted deviation from the prediction of the tangent plane, one pixel away.
    """
    camera, z = gbuffer.camera, gbuffer.position[pixels, 2]
    normal = gbuffer.geometric_normal[pixels].T
    pixel_to_camera = camera.clip_to_camera_xy * (2.0 / camera.width, 2.0 / camera.height)
    pixel_to_camera = pixel_to_camera.astype(np.float32)
    slope_x = normal[0] * pixel_to_camera[0, 0] + normal[1] * pixel_to_camera[1, 0]
    slope_y = normal[0] * pixel_to_camera[0, 1] + normal[1] * pixel_to_camera[1, 1]
    per_unit = np.float32(camera.pixels_per_unit)
    if camera.is_perspective:
        # A ray r, with depth 1, meets the plane n.x = c at depth d, where 1 / d = n.r / c.
        divisor, depth = dot_components(normal, gbuffer.position[pixels].T), -1 / z
        scale = -z * per_unit
    else:
        divisor, depth, scale = -normal[2], z, per_unit
    epsilon = np.float32(1e-12)
    divisor[np.abs(divisor) < epsilon] = -epsilon
    np.divide(1, divisor, out=divisor)
    slope_x *= divisor
    slope_y *= divisor
    steepness = np.sqrt(slope_x * slope_x + slope_y * slope_y)
    steepness *= scale
    limit = np.minimum(1, np.float32(MAX_SLOPE) / np.maximum(steepness, epsilon))
    slope_x *= limit
    slope_y *= limit
    steepness *= limit
    # From here on, `steepness` becomes the tolerance, in place.
    steepness *= np.float32(SLOPE_TOLERANCE)
    steepness += np.float32(DEPTH_TOLERANCE)
    steepness /= scale
    return depth, slope_x, slope_y, steepness


def _is_continuous(
    grid: _PixelGrid,
    source: tuple[slice, slice],
    target: tuple[slice, slice],
    step: tuple[int, int],
    min_normal_cosine: np.float32 | None,
) -> np.ndarray:
    """Return whether the surface continues from the source cells to the target cells.

    Parameters
    ----------
    grid : _PixelGrid
    source, target : (slice, slice)
        Rows and columns of the grid. Both select the same number of cells.
    step : (int, int)
        dx and dy from source to target.
    min_normal_cosine : float32 or None
        Cosine of the crease angle, or None if creases may be crossed.

    Returns
    -------
    (h', w') bool ndarray
    """
    jump = grid.depth[target] - grid.depth[source]
    source_prediction, target_prediction = grid.steps[step][source], grid.steps[step][target]
    tolerance = np.minimum(grid.tolerance[source], grid.tolerance[target])
    if all(step):
        tolerance *= np.float32(np.sqrt(2))
    with np.errstate(invalid="ignore"):
        continuous = jump <= np.maximum(source_prediction, target_prediction) + tolerance
        continuous &= jump >= np.minimum(source_prediction, target_prediction) - tolerance
        if grid.front_facing is not None:
            # A change between front and back faces is a silhouette, unless both planes predict the
            # difference in depth: then the orientation of the faces is inconsistent.
            same_side = np.abs(jump - source_prediction) <= tolerance
            same_side &= np.abs(jump - target_prediction) <= tolerance
            same_side |= grid.front_facing[source] == grid.front_facing[target]
            continuous &= same_side
    if grid.instance_id is not None:
        continuous &= grid.instance_id[source] == grid.instance_id[target]
    if min_normal_cosine is not None:
        normal_cosine = grid.normal[0][source] * grid.normal[0][target]
        normal_cosine += grid.normal[1][source] * grid.normal[1][target]
        normal_cosine += grid.normal[2][source] * grid.normal[2][target]
        continuous &= normal_cosine >= min_normal_cosine
    return continuous
