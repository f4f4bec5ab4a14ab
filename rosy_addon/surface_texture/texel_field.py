"""The field at the texels of a UV map, and the steps from texel to texel along the surface.

Inside of a chart, a streamline steps to neighboring texels. Across a seam, and across the border of a
tile, a step is a straight line on the surface: it is unfolded over the edges between the triangles, and
leads to the texel where it ends.
"""

from __future__ import annotations

import numpy as np

from ..compositor.pixel_field import NEIGHBOR_OFFSETS, PixelField, SeamSteps
from ..core.progress import progress, report
from ..field.blocks import row_blocks
from ..field.frames import dot
from ..field.representation import power, signed_power
from ..line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from ..line_drawing.tangent_mesh import unit
from ..projection.field_channel import FieldChannel, rotation_order
from ..projection.pixel_blocks import pixel_blocks
from .charts import UvCharts
from .texels import TexelSurface

#: Neighboring texels are also neighbors on the surface if their distance there is at most this many
#: times what the UV map stretches their distance to.
MAX_STRETCHED_STEP = 2.0

#: A step across a seam arrives if it covers at least this fraction of its length.
MIN_WALKED_RATIO = 0.999

#: Largest factor by which a step across a seam stretches displacements. Streamlines end where triangles
#: have nearly no area in the UV map.
MAX_SEAM_STRETCH = 64.0

#: Texels whose steps across seams are traced at once.
SEAM_BLOCK = 1 << 14

#: Label of the progress.
LABEL = "following the surface across seams"


def texel_field(on: TexelSurface, crease_angle: float | None) -> PixelField:
    """Compute the field at texels.

    Parameters
    ----------
    on : TexelSurface
    crease_angle : float or None
        Streamlines end where the normals of neighboring texels differ by more than this angle, in
        radians. None if they cross creases.

    Returns
    -------
    PixelField
        Its `screen_jacobian` maps unit tangents to steps in texels, which are foreshortened where the
        UV map is coarse.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    count, degree = len(texels), mesh.degree
    z = np.empty(count, dtype=np.complex64)
    jacobian = np.empty((2, count), dtype=np.complex64).T
    channels: dict[FieldChannel, np.ndarray] = {
        ("deviation", number): np.empty(count, dtype=np.complex64) for number, _ in mesh.harmonics
    }
    family = ("family", mesh.family_count)
    if mesh.family_z is not None:
        channels[family] = np.empty(count, dtype=np.complex64)
    to_texels = texels.frame.size * on.step
    corner_z = mesh.z.astype(np.complex64)
    corner_harmonics = [(number, values.astype(np.complex64)) for number, values in mesh.harmonics]
    for block in pixel_blocks(count):
        report(0.3 * block.start / count, "finding directions")
        triangle, weights = texels.triangle[block], texels.barycentric[block]
        frame = frames_at(charts, triangle, weights)
        z[block] = _interpolated(weights, corner_z, triangle) * power(frame.conj(), degree)
        for axis, tangent in enumerate((frame, 1j * frame)):
            jacobian[block, axis] = to_texels * charts.to_uv(triangle, tangent)
        for number, values in corner_harmonics:
            channel = ("deviation", number)
            turn = signed_power(frame.conj(), rotation_order(channel, degree))
            channels[channel][block] = _interpolated(weights, values, triangle) * turn
        if mesh.family_z is not None:
            turn = signed_power(frame.conj(), rotation_order(family, degree))
            channels[family][block] = mesh.family_z[triangle] * turn
    with progress(0.3, 0.7):
        mask = _neighbor_masks(on, z != 0, crease_angle)
    with progress(0.7, 1.0):
        seam_steps = _find_seam_steps(on, mask, z != 0)
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
    """(n,) values at (n, 3) barycentric coordinates, given those at the (T, 3) corners."""
    a, b, c = corners.take(triangle, axis=0).T
    return weights[:, 0] * a + weights[:, 1] * b + weights[:, 2] * c


def frames_at(charts: UvCharts, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return (n,) complex128: the unit tangents `UvCharts.frame` at (n, 3) barycentric coordinates."""
    frame = _interpolated(weights, charts.frame, triangle)
    norm = np.abs(frame)
    return np.divide(frame, norm, out=charts.frame[triangle, 0], where=norm > 1e-6)


def _neighbor_masks(
    on: TexelSurface, defined: np.ndarray, crease_angle: float | None
) -> np.ndarray:
    """(P,) uint16 `PixelField.neighbor_mask`: the neighbors in the same chart, near on the surface."""
    mesh, charts, texels = on.mesh, on.charts, on.texels
    masks = np.zeros(len(texels), dtype=np.uint16)
    # Squared length on the surface that a texel is stretched to at most.
    stretch = charts.stretch()[1] * texels.frame.size
    reach = np.divide(MAX_STRETCHED_STEP, stretch, out=np.zeros(len(stretch)), where=stretch > 0)
    reach_squared = (reach * reach).astype(np.float32)
    min_cosine = None if crease_angle is None else np.cos(crease_angle)
    width, height = texels.frame.width, texels.frame.height
    band_rows = max((1 << 16) // width, 1)
    corners, normals = mesh.points.astype(np.float32), mesh.corner_normal.astype(np.float32)
    for first_row in range(0, height, band_rows):
        report(first_row / height, LABEL)
        # One more row: the first of the next band, or an empty one.
        first, stop = np.searchsorted(
            texels.index, [first_row * width, (first_row + band_rows + 1) * width]
        ).tolist()
        place = texels.index[first:stop] - np.int32(first_row * width)
        triangle, weights = texels.triangle[first:stop], texels.barycentric[first:stop]
        point = np.einsum("nk,nki->ni", weights, corners.take(triangle, axis=0))
        normal = None
        if min_cosine is not None:
            normal = np.einsum("nk,nki->ni", weights, normals.take(triangle, axis=0))
            normal /= np.sqrt(np.maximum(dot(normal, normal), 1e-20))[:, None]
        shape = band_rows + 1, width
        texel_at, triangle_at = np.empty(shape, np.int32), np.full(shape, -1, np.int32)
        texel_at.reshape(-1)[place] = np.arange(len(place), dtype=np.int32)
        triangle_at.reshape(-1)[place] = np.where(defined[first:stop], triangle, np.int32(-1))
        mask_at = np.zeros(shape, np.uint16)
        for dx, dy in ((1, 0), (-1, 1), (0, 1), (1, 1)):
            left, right = max(-dx, 0), width - max(dx, 0)
            source = slice(0, band_rows + 1 - dy), slice(left, right)
            target = slice(dy, band_rows + 1), slice(left + dx, right + dx)
            a, b = triangle_at[source], triangle_at[target]
            linked = a == b
            linked &= a >= 0
            other = np.nonzero((a != b) & (a >= 0) & (b >= 0))
            own, neighbor = texel_at[source][other], texel_at[target][other]
            a, b = a[other], b[other]
            offset = point.take(own, axis=0) - point.take(neighbor, axis=0)
            near = dot(offset, offset) <= np.float32(dx * dx + dy * dy) * np.maximum(
                reach_squared.take(a), reach_squared.take(b)
            )
            near &= charts.chart.take(a) == charts.chart.take(b)
            if normal is not None:
                near &= dot(normal.take(own, axis=0), normal.take(neighbor, axis=0)) >= min_cosine
            linked[other] = near
            bit = NEIGHBOR_OFFSETS.index((dx, dy))
            linked = linked.astype(np.uint16)
            mask_at[source] |= linked << np.uint16(bit)
            mask_at[target] |= linked << np.uint16(8 - bit)
        masks[first:stop] |= mask_at.reshape(-1).take(place)
    masks[defined] |= np.uint16(1 << 4)
    return masks


def _find_seam_steps(on: TexelSurface, mask: np.ndarray, defined: np.ndarray) -> SeamSteps:
    """Trace the steps that `mask` does not have along the surface."""
    texels = on.texels
    entry = np.full(texels.frame.width * texels.frame.height, -1, dtype=np.int32)
    entry[texels.index] = np.arange(len(texels), dtype=np.int32)
    border = np.flatnonzero(defined & (mask != 0b111_111_111))
    source, bit = np.nonzero(mask[border, None] >> np.arange(9, dtype=np.uint16) & 1 == 0)
    source, bit = border[source].astype(np.int32), bit.astype(np.uint8)
    offsets = np.array([dx + 1j * dy for dx, dy in NEIGHBOR_OFFSETS])
    parts = []
    for part in row_blocks(len(source), SEAM_BLOCK):
        report(part.start / max(len(source), 1), LABEL)
        steps = source[part], bit[part], offsets[bit[part]]
        parts.append(_seam_steps(on, defined, entry, *steps))
    return SeamSteps(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _seam_steps(
    on: TexelSurface,
    defined: np.ndarray,
    entry: np.ndarray,
    source: np.ndarray,
    bit: np.ndarray,
    offset: np.ndarray,
) -> SeamSteps:
    """Return those of n steps that lead to a texel.

    Parameters
    ----------
    source, bit, offset : (n,) ndarrays
        Texels, and the steps from them, also as complex numbers in texels.
    entry : (H W,) int32 ndarray
        The texel at each place of the frame, or -1.
    """
    mesh, charts, texels = on.mesh, on.charts, on.texels
    size = texels.frame.size
    triangle = texels.triangle[source]
    weights = texels.barycentric[source].astype(np.float64)
    tangent = charts.to_surface(triangle, offset / size)
    length, ahead = np.abs(tangent), unit(tangent, np.ones_like(tangent))
    frame = frames_at(charts, triangle, weights)
    start = SurfaceParticles(triangle, weights, frame.copy(), np.ones(len(source)))
    end, direction, walked = trace_geodesics(mesh, start, ahead, length)
    arrived = (walked >= MIN_WALKED_RATIO * length) & (length > 0)
    uv = np.einsum("nk,nk->n", end.weights, charts.uv[end.triangle]) * size
    target, reached = _nearest_texels(on, entry, end.triangle, uv)
    arrived &= target >= 0
    arrived[arrived] &= defined[target[arrived]]
    # Tangents are rotated by this from the frame of the one triangle to that of the other.
    turn = direction * ahead.conj()
    back, back_conjugate = charts.inverse(triangle)
    ahead, ahead_conjugate = charts.linear[end.triangle], charts.conjugate[end.triangle]
    linear = ahead * turn * back + ahead_conjugate * (turn * back_conjugate).conj()
    conjugate = ahead * turn * back_conjugate + ahead_conjugate * (turn * back).conj()
    arrived &= np.abs(linear) + np.abs(conjugate) <= MAX_SEAM_STRETCH
    kept = np.flatnonzero(arrived)
    end_frame = frames_at(charts, end.triangle[kept], end.weights[kept])
    return SeamSteps(
        source=source[kept],
        bit=bit[kept],
        target=target[kept],
        offset=reached[kept].astype(np.complex64),
        linear=linear[kept].astype(np.complex64),
        conjugate=conjugate[kept].astype(np.complex64),
        rotation=np.angle(frame[kept] * turn[kept] * end_frame.conj()).astype(np.float32),
    )


def _nearest_texels(
    on: TexelSurface, entry: np.ndarray, triangle: np.ndarray, uv: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find the texel of the same chart that is nearest to each point of the UV plane.

    Parameters
    ----------
    triangle : (n,) int32 ndarray
        Triangles of the points.
    uv : (n,) complex128 ndarray
        The points, in texels.

    Returns
    -------
    texel : (n,) int32 ndarray
        -1 if none of the nine around the point is one.
    offset : (n,) complex128 ndarray
        The point, relative to the center of that texel.
    """
    column, row = np.floor(uv.real).astype(np.intp), np.floor(uv.imag).astype(np.intp)
    chart, best = on.charts.chart, np.full(len(uv), np.inf)
    texel, offset = np.full(len(uv), -1, dtype=np.int32), np.zeros(len(uv), dtype=np.complex128)
    for dx, dy in NEIGHBOR_OFFSETS:
        index = on.texels.frame.flat_indices(column + dx, row + dy)
        candidate = np.where(index >= 0, entry.take(np.maximum(index, 0)), -1)
        same = chart.take(on.texels.triangle.take(candidate)) == chart.take(triangle)
        delta = uv - (column + dx + 0.5 + 1j * (row + dy + 0.5))
        distance = np.where((candidate >= 0) & same, np.abs(delta), np.inf)
        nearer = distance < best
        for values, new in ((best, distance), (texel, candidate), (offset, delta)):
            values[nearer] = new[nearer]
    return texel, offset
