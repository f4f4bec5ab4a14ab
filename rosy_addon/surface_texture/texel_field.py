"""Compute the field and the noise at the texels of a UV map, and steps between texels on the surface.

Inside a chart, a streamline steps to neighboring texels. Across a seam, and across the border of a tile, a
step is a straight line on the surface. It is unfolded over the edges between triangles, and leads to the
texel in which it ends.

The noise is fixed to the surface. Its cells have the same size, in Blender units, everywhere.
"""

from collections.abc import Iterator

import numpy as np

from ..compositor.image_noise import BLUR_FACTOR, NOISE_MEAN, NoiseSettings
from ..compositor.pixel_field import NEIGHBOR_OFFSETS, PixelField, SeamSteps
from ..compositor.surface_noise import instance_hashes, solid_noise
from ..core.progress import progress, report
from ..field.blocks import row_blocks
from ..field.frames import dot, quotient
from ..field.representation import signed_power, unit_complex
from ..line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from ..projection.field_channel import REPRESENTATION, FieldChannel, rotation_order
from ..projection.pixel_blocks import reported_blocks
from ..projection.rest_coordinates import RestCoordinates, matrix_scale, rest_positions
from .charts import UvCharts
from .texels import TexelSurface, neighbor_places

#: Neighboring texels count as neighbors on the surface if their distance there is at most this many
#: times the distance that follows from the stretch of the UV map.
MAX_STRETCHED_STEP = 2.0

#: A step across a seam reaches its target only if it covers at least this fraction of its length on the
#: surface.
MIN_WALKED_RATIO = 0.999

#: Largest factor by which a step across a seam stretches displacements. Streamlines end where triangles
#: have nearly no area in the UV map.
MAX_SEAM_STRETCH = 64.0

#: Number of steps across seams that are traced at once. It bounds memory.
SEAM_BLOCK = 1 << 14

#: Smallest side of a cell of the noise, in texels, in the direction in which texels are larger on the
#: surface.
MIN_CELL_TEXELS = 1.0

#: Largest number of points along each side of the grid of local means, which a high pass subtracts.
MAX_GRID_SIDE = 256

#: Side of a cell of that grid, in standard deviations of the blur. Values at texels are added to the corners
#: of their cell with linear weights, and means are interpolated linearly from the corners.
GRID_CELL_SIGMAS = 3**0.5

#: Only one of this number of texels is added to the grid.
SAMPLE_STRIDE = 3

#: Number of texels that are handled at once for the grid. It bounds memory.
GRID_BLOCK = 1 << 18

#: Label of the progress.
LABEL = "following the surface across seams"


def texel_field(on: TexelSurface, crease_angle: float | None) -> PixelField:
    """Compute the field at texels, in the form in which streamlines are traced in pictures.

    Parameters
    ----------
    on : TexelSurface
    crease_angle : float or None
        Streamlines end where the normals of neighboring texels differ by more than this angle, in
        radians. If None, streamlines cross creases.

    Returns
    -------
    PixelField
        Its pixels are the texels. Angles are measured from the unit tangents `frames_at`. Its
        `screen_jacobian` maps unit tangents to steps in texels. These are foreshortened where the UV map is
        coarse.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    count, degree = len(texels), mesh.degree
    jacobian = np.empty((2, count), dtype=np.complex64).T
    # Values at the corners of triangles, (T, 3), or on triangles, (T,).
    sources: dict[FieldChannel, np.ndarray] = {REPRESENTATION: mesh.z.astype(np.complex64)}
    for number, values in mesh.harmonics:
        sources["deviation", number] = values.astype(np.complex64)
    if mesh.family_z is not None:
        sources["family", mesh.family_count] = mesh.family_z
    channels = {channel: np.empty(count, dtype=np.complex64) for channel in sources}
    to_texels = texels.frame.size * on.step
    for block in reported_blocks(count, "finding directions", 0.0, 0.3):
        triangle, weights = texels.triangle[block], texels.barycentric[block]
        frame = frames_at(charts, triangle, weights)
        for axis, tangent in enumerate((frame, 1j * frame)):
            jacobian[block, axis] = to_texels * charts.to_uv(triangle, tangent)
        for channel, source in sources.items():
            turn = signed_power(frame.conj(), rotation_order(channel, degree))
            z = _interpolated(weights, source, triangle) if source.ndim == 2 else source[triangle]
            if channel == REPRESENTATION:  # its modulus is the magnitude, as in pictures
                z = unit_complex(z) * _interpolated(weights, mesh.magnitude, triangle)
            channels[channel][block] = z * turn
    z = channels.pop(REPRESENTATION)
    # The texel at each flat index of the frame, or -1. The last element is for the index -1.
    entry = np.full(texels.frame.width * texels.frame.height + 1, -1, dtype=np.int32)
    entry[texels.index] = np.arange(count, dtype=np.int32)
    with progress(0.3, 0.7):
        mask = _neighbor_masks(on, entry, z != 0, crease_angle)
    with progress(0.7, 1.0):
        seam_steps = _find_seam_steps(on, entry, mask, z != 0)
    return PixelField(
        degree=degree,
        width=texels.frame.width,
        height=texels.frame.height,
        pixel=texels.index,
        representation=z,
        screen_jacobian=jacobian,
        neighbor_mask=mask,
        channels=channels,
        seam_steps=seam_steps,
    )


def _interpolated(weights: np.ndarray, corners: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Interpolate (T, 3) values at corners to (n,) values at (n, 3) barycentric coordinates in triangles."""
    a, b, c = corners.take(triangle, axis=0).T
    return weights[:, 0] * a + weights[:, 1] * b + weights[:, 2] * c


def frames_at(charts: UvCharts, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the (n,) complex128 unit tangents from which angles are measured at points of the surface.

    They are in the frames of the triangles, interpolated between `UvCharts.frame` at the corners. The points
    are given by (n,) triangles and (n, 3) barycentric coordinates.
    """
    frame = _interpolated(weights, charts.frame, triangle)
    norm = np.abs(frame)
    return np.divide(frame, norm, out=charts.frame[triangle, 0], where=norm > 1e-6)


def _neighbor_masks(
    on: TexelSurface, entry: np.ndarray, defined: np.ndarray, crease_angle: float | None
) -> np.ndarray:
    """Return (P,) uint16: `PixelField.neighbor_mask`, with a bit for each linked neighbor of a texel.

    A neighboring texel is linked if it is in the same chart and near on the surface. `entry`, (H W + 1,)
    int32, holds the texel at each flat index of the frame, or -1. `defined`, (P,) bool, is true where the
    field is not zero. Texels whose normals differ by more than `crease_angle` (radians, or None) are not
    linked.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    masks = defined.astype(np.uint16) << np.uint16(NEIGHBOR_OFFSETS.index((0, 0)))
    # Squared limit for the distance of neighbors on the surface, for each triangle.
    reach = quotient(MAX_STRETCHED_STEP, charts.stretch()[1] * texels.frame.size)
    reach_squared = (reach * reach).astype(np.float32)
    corners, normals = mesh.points.astype(np.float32), mesh.corner_normal.astype(np.float32)
    min_cosine = -2.0 if crease_angle is None else np.cos(crease_angle)
    for block in reported_blocks(len(texels), LABEL):
        start = block.start
        # The block, and the neighbors of its texels in the next row.
        around = slice(start, block.stop + texels.frame.width + 1)
        triangle, weights = texels.triangle[around], texels.barycentric[around]
        point, normal = (
            np.einsum("nk,nki->ni", weights, values.take(triangle, axis=0))
            for values in (corners, normals)
        )
        normal /= np.sqrt(np.maximum(dot(normal, normal), 1e-20))[:, None]
        for dx, dy in ((1, 0), (-1, 1), (0, 1), (1, 1)):
            other = entry[neighbor_places(texels.frame, texels.index[block], dx, dy)]
            own = np.flatnonzero((other >= 0) & defined[block] & defined[other])
            other = other[own] - start
            linked = triangle[own] == triangle[other]
            apart = np.flatnonzero(~linked)
            first, second = own[apart], other[apart]
            a, b = triangle[first], triangle[second]
            offset = point.take(first, axis=0) - point.take(second, axis=0)
            reach = np.maximum(reach_squared.take(a), reach_squared.take(b))
            near = dot(offset, offset) <= np.float32(dx * dx + dy * dy) * reach
            near &= charts.chart.take(a) == charts.chart.take(b)
            near &= dot(normal.take(first, axis=0), normal.take(second, axis=0)) >= min_cosine
            linked[apart] = near
            bit = NEIGHBOR_OFFSETS.index((dx, dy))
            masks[start + own[linked]] |= np.uint16(1 << bit)
            masks[start + other[linked]] |= np.uint16(1 << (8 - bit))
    return masks


def _find_seam_steps(
    on: TexelSurface, entry: np.ndarray, mask: np.ndarray, defined: np.ndarray
) -> SeamSteps:
    """Trace the steps to neighbors that are not linked in `mask`, as straight lines on the surface.

    `entry`, (H W + 1,) int32, holds the texel at each flat index of the frame, or -1. `mask`, (P,) uint16,
    has a bit for each linked neighbor of a texel. `defined`, (P,) bool, is true where the field is not zero.
    """
    border = np.flatnonzero(defined & (mask != 0b111_111_111))
    source, bit = np.nonzero(mask[border, None] >> np.arange(9, dtype=np.uint16) & 1 == 0)
    source, bit = border[source].astype(np.int32), bit.astype(np.uint8)
    parts = []
    for part in row_blocks(len(source), SEAM_BLOCK):
        report(part.start / max(len(source), 1), LABEL)
        parts.append(_seam_steps(on, defined, entry, source[part], bit[part]))
    return SeamSteps(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _seam_steps(
    on: TexelSurface, defined: np.ndarray, entry: np.ndarray, source: np.ndarray, bit: np.ndarray
) -> SeamSteps:
    """Trace n steps as straight lines on the surface, and return the steps that lead to a texel.

    Parameters
    ----------
    on : TexelSurface
    defined : (P,) bool ndarray
        Whether the field is not zero at each texel.
    entry : (H W + 1,) int32 ndarray
        The texel at each flat index of the frame, or -1.
    source : (n,) int32 ndarray
        Texel at which each step starts.
    bit : (n,) uint8 ndarray
        Index of the step in `NEIGHBOR_OFFSETS`.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    size = texels.frame.size
    triangle = texels.triangle[source]
    weights = texels.barycentric[source].astype(np.float64)
    offset = np.array([dx + 1j * dy for dx, dy in NEIGHBOR_OFFSETS])[bit]
    tangent = charts.to_surface(triangle, offset / size)
    length, ahead = np.abs(tangent), unit_complex(tangent, otherwise=1)
    frame = frames_at(charts, triangle, weights)
    start = SurfaceParticles(triangle, weights, frame.copy(), np.ones(len(source)))
    end, direction, walked = trace_geodesics(mesh, start, ahead, length)
    arrived = (walked >= MIN_WALKED_RATIO * length) & (length > 0)
    uv = np.einsum("nk,nk->n", end.weights, charts.uv[end.triangle]) * size
    target, reached = _nearest_texels(on, entry, end.triangle, uv)
    arrived &= target >= 0
    arrived[arrived] &= defined[target[arrived]]
    # The rotation of tangents from the frame of the first triangle to the frame of the last one.
    turn = direction * ahead.conj()
    back, back_conjugate = charts.inverse(triangle)
    ahead, ahead_conjugate = charts.linear[end.triangle], charts.conjugate[end.triangle]
    linear = ahead * turn * back + ahead_conjugate * (turn * back_conjugate).conj()
    conjugate = ahead * turn * back_conjugate + ahead_conjugate * (turn * back).conj()
    arrived &= np.abs(linear) + np.abs(conjugate) <= MAX_SEAM_STRETCH
    kept = np.flatnonzero(arrived)
    end_frame = frames_at(charts, end.triangle[kept], end.weights[kept])
    rotation = np.angle(frame[kept] * turn[kept] * end_frame.conj()).astype(np.float32)
    maps = (values[kept].astype(np.complex64) for values in (reached, linear, conjugate))
    return SeamSteps(source[kept], bit[kept], target[kept], *maps, rotation)


def _nearest_texels(
    on: TexelSurface, entry: np.ndarray, triangle: np.ndarray, uv: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the nearest texel of the same chart for each point of the UV plane.

    Parameters
    ----------
    on : TexelSurface
    entry : (H W + 1,) int32 ndarray
        The texel at each flat index of the frame, or -1.
    triangle : (n,) int32 ndarray
        Triangle of the surface that contains each point.
    uv : (n,) complex128 ndarray
        Points of the UV plane, in texels.

    Returns
    -------
    texel : (n,) int32 ndarray
        Nearest texel; -1 if none of the nine texels around the point is in the chart.
    offset : (n,) complex128 ndarray
        Position of the point relative to the center of that texel, in texels.
    """
    column, row = np.floor(uv.real).astype(np.intp), np.floor(uv.imag).astype(np.intp)
    chart, best = on.charts.chart, np.full(len(uv), np.inf)
    texel, offset = np.full(len(uv), -1, dtype=np.int32), np.zeros(len(uv), dtype=np.complex128)
    for dx, dy in NEIGHBOR_OFFSETS:
        candidate = entry[on.texels.frame.flat_indices(column + dx, row + dy)]
        same = chart.take(on.texels.triangle.take(candidate)) == chart.take(triangle)
        delta = uv - (column + dx + 0.5 + 1j * (row + dy + 0.5))
        distance = np.where((candidate >= 0) & same, np.abs(delta), np.inf)
        nearer = distance < best
        for values, new in ((best, distance), (texel, candidate), (offset, delta)):
            values[nearer] = new[nearer]
    return texel, offset


# --- noise -------------------------------------------------------------------------------------------


def texel_noise(on: TexelSurface, settings: NoiseSettings) -> np.ndarray:
    """Make noise at texels that is fixed to the surface.

    Parameters
    ----------
    on : TexelSurface
        The P texels, and the surface that they show.
    settings : NoiseSettings
        Lengths are in steps of streamlines.

    Returns
    -------
    (P, K) float32 ndarray
        Noise with the mean `NOISE_MEAN`.
    """
    surface, charts, texels, step = on.instance.surface, on.charts, on.texels, on.step
    cell, seed, channels, density, high_pass = settings
    # Length in world space of one Blender unit of object space.
    scale = matrix_scale(on.instance.matrix)
    rest = rest_positions(surface).astype(np.float32)
    gradient = (charts.gradient / texels.frame.size).astype(np.complex64)
    coarse = quotient(MIN_CELL_TEXELS, charts.stretch()[1] * (texels.frame.size * scale))
    cell_size = np.maximum(cell * step / scale, coarse).astype(np.float32)
    instance_hash = instance_hashes([surface.name])
    total = np.empty((channels, len(texels)), dtype=np.float32)
    for block in reported_blocks(len(texels), "making noise", 0.0, 0.7):
        triangle = texels.triangle[block]
        vertices = surface.triangle_vertex.take(triangle, axis=0).T
        corners = tuple(rest.take(vertex, axis=0).T for vertex in vertices)
        change = gradient.take(triangle, axis=0).T
        size, weights = cell_size.take(triangle), texels.barycentric[block].T
        coordinates = RestCoordinates(weights, change.real, change.imag, corners, size)
        block_hash = np.broadcast_to(instance_hash, len(triangle))
        solid_noise(coordinates, size, block_hash, seed, density, out=total[:, block])
    if high_pass:
        _subtract_local_means(on, rest, total, BLUR_FACTOR * high_pass * step / scale)
    return np.add(total.T, np.float32(NOISE_MEAN), order="C")


def _subtract_local_means(
    on: TexelSurface, rest: np.ndarray, channels: np.ndarray, sigma: float
) -> None:
    """Subtract local means over the surface from values at texels, in place.

    The means are a blur in three dimensions: values are added to a grid in space, and means are interpolated
    from it. So they do not depend on the charts.

    Parameters
    ----------
    on : TexelSurface
    rest : (V, 3) float32 ndarray
        Vertices of the surface in rest space (before modifiers and animation).
    channels : (K, P) float32 ndarray
        Values at the texels, which are changed.
    sigma : float
        Standard deviation of the blur, in Blender units of rest space.
    """
    texels = on.texels
    used = rest[on.instance.surface.used_vertices]
    low, extent = used.min(axis=0), float(np.ptp(used, axis=0).max())
    side = max(GRID_CELL_SIGMAS * sigma, extent / (MAX_GRID_SIDE - 2))
    shape = (np.ptp(used, axis=0) / side).astype(np.intp) + 2
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    area = quotient(1, np.abs(on.charts.density))

    def cells(block: slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the grid cells of texels and the positions in them.

        A cell is given by the index of its lowest grid point, (n,). Positions are (n, 3), from 0 to 1.
        """
        position = (on.interpolated(rest, block) - low) / np.float32(side)
        cell = np.clip(position.astype(np.intp), 0, shape - 2)
        return cell @ stride, np.clip(position - cell, 0, 1).astype(np.float32)

    sums = np.zeros((1 + len(channels), int(shape.prod())))
    for block in reported_blocks(len(texels), "making noise", 0.7, 0.85, GRID_BLOCK):
        block = slice(block.start, block.stop, SAMPLE_STRIDE)
        first, place = cells(block)
        weight = area[texels.triangle[block]]
        for offset, share in _corner_shares(place, stride):
            point, share = first + offset, share * weight
            sums[0] += np.bincount(point, share, sums.shape[1])
            for values, out in zip(channels, sums[1:], strict=True):
                out += np.bincount(point, share * values[block], sums.shape[1])
    means = (sums[1:] / np.maximum(sums[0], np.finfo(float).tiny)).astype(np.float32)
    for block in reported_blocks(len(texels), "making noise", 0.85, 1.0, GRID_BLOCK):
        first, place = cells(block)
        for offset, share in _corner_shares(place, stride):
            for values, mean in zip(channels, means, strict=True):
                values[block] -= share * mean.take(first + offset)


def _corner_shares(place: np.ndarray, stride: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Iterate over the eight corners of grid cells: their index offsets, and (n,) linear weights.

    `place`, (n, 3), holds positions in cells, from 0 to 1. `stride` holds the index differences of grid
    points that are neighbors along each axis.
    """
    x, y, z = np.stack([1 - place, place]).transpose(2, 0, 1)
    return ((int(np.dot((i, j, k), stride)), x[i] * y[j] * z[k]) for i, j, k in np.ndindex(2, 2, 2))
