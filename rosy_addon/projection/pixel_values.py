"""Normals and field values at pixels, interpolated from the corners of triangles."""

from collections.abc import Sequence

import numpy as np

from ..field.frames import dot_components, quotient, transport_components
from ..field.representation import signed_power
from .corner_field import CornerField
from .field_channel import REPRESENTATION, FieldChannel, rotation_order
from .gbuffer import GBuffer

#: Largest holonomy over a triangle, in radians, that is neglected in the interpolation of values.
HOLONOMY_EPS = 3e-4


def _channel_pixels(gbuffer: GBuffer, channel: FieldChannel) -> np.ndarray:
    """Return the (P,) values of a channel in a G-buffer.

    If the G-buffer does not have the channel yet, it is added, with the values for evenly spaced directions
    without labels: 1 for the harmonic of order 0, otherwise 0.
    """
    if channel == REPRESENTATION:
        return gbuffer.representation
    if channel not in gbuffer.channels:
        default = 1 if channel == ("deviation", 0) else 0
        gbuffer.channels[channel] = np.full(len(gbuffer.pixel), default, dtype=np.complex64)
    return gbuffer.channels[channel]


def fill_pixels(
    gbuffer: GBuffer, pixels: slice | np.ndarray, triangle: np.ndarray, corner_field: CornerField
) -> None:
    """Write the normals, the representation and the other channels of the field at pixels of one instance.

    `pixels` are indices into the G-buffer, and `triangle` holds the visible triangle of each of them.
    `corner_field` must be in camera space.
    """
    triangle = triangle.astype(np.intp)
    weights = gbuffer.barycentric[pixels].T
    view_direction = gbuffer.view_direction[pixels].T
    front_facing = gbuffer.front_facing[pixels]
    geometric_normal = corner_field.geometric_normal.take(triangle, axis=1)
    corners = corner_field.corner_normals.take(triangle, axis=2)
    normal, length = _interpolated_normal(corners, weights)
    if not length.all():
        degenerate = length == 0
        normal[:, degenerate] = geometric_normal[:, degenerate]
    tangent = corner_field.reference_tangent.take(triangle, axis=1)
    tangent = transport_components(tangent, corners[0], normal)
    if not front_facing.all():
        np.negative(normal, out=normal, where=~front_facing)
        np.negative(geometric_normal, out=geometric_normal, where=~front_facing)
    rotation = view_plane_rotation(tangent, normal, view_direction)
    for channel, corner_values in corner_field.channels.items():
        order = rotation_order(channel, corner_field.degree)
        z = _interpolated_values(corner_field, corner_values, triangle, weights, length, order)
        if not front_facing.all():
            # Members keep their direction in space. Seen from behind, angles have the other sign.
            np.conjugate(z, out=z, where=~front_facing)
        z *= signed_power(rotation, order)
        if channel == REPRESENTATION:
            # The modulus of z is smaller where directions differ, as around singularities.
            corners = zip(weights, corner_field.magnitude, strict=True)
            magnitude = sum(weight * corner.take(triangle) for weight, corner in corners)
            z *= quotient(magnitude, np.abs(z))
        _channel_pixels(gbuffer, channel)[pixels] = z
    gbuffer.normal[pixels] = normal.T
    gbuffer.geometric_normal[pixels] = geometric_normal.T


def _interpolated_normal(corners: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the (3, P) unit vectors along m = sum b_i n_i, and the (P,) lengths of m.

    b_i are the barycentric `weights`, (3, P). n_i are the normals at the three corners: `corners`, (3, 3, P),
    has the corner as its first axis and the component as its second. Where a length is below 1e-6, the vector
    and the length are set to 0.
    """
    normal = np.empty_like(weights)
    for component, out in enumerate(normal):
        np.multiply(weights[0], corners[0][component], out=out)
        out += weights[1] * corners[1][component]
        out += weights[2] * corners[2][component]
    length = np.sqrt(dot_components(normal, normal))
    length[length < 1e-6] = np.inf
    normal *= 1 / length
    length[np.isinf(length)] = 0
    return normal, length


def _interpolated_values(
    corner_field: CornerField,
    corner_values: np.ndarray,
    triangle: np.ndarray,
    weights: np.ndarray,
    length: np.ndarray,
    order: int,
) -> np.ndarray:
    """Interpolate corner values at pixels, after parallel transport from the corner normals.

    Parameters
    ----------
    corner_field : CornerField
    corner_values : (3, T) complex64 ndarray
        Values of one channel of `corner_field`.
    triangle : (P,) ndarray of int
        Triangle at each pixel.
    weights : (3, P) float32 ndarray
        Barycentric coordinates b_i of the pixel in it.
    length : (P,) float32 ndarray
        Length of sum b_i n_i, from `_interpolated_normal`.
    order : int
        Power by which the values rotate with the frame (see `field_channel.rotation_order`).

    Returns
    -------
    (P,) complex64 ndarray
        Relative to `corner_field.reference_tangent` after transport from n_0 to the interpolated
        normal n.

    Notes
    -----
    Each corner value has to be transported along the arc n_i -> n. Then values at an edge depend
    only on its two ends, and are continuous across edges. The stored values were transported along
    n_i -> n_0, and continue along n_0 -> n. The two paths differ by the rotation by the signed area
    A of the spherical triangle (n_0, n_i, n), and

        exp(i A / 2) ~ 1 + n_0.n_i + n_i.n + n.n_0 + i n_0 . (n_i x n)

    up to a positive factor (Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle",
    1983). All products follow from the products of the corner normals, because n is a combination
    of these normals. The spherical triangle is contained in the spherical triangle of the corner normals.
    The area of the latter is about half of the triple product of the corner normals. If it is small
    everywhere, the correction is skipped.
    """
    b0, b1, b2 = weights
    z0, z1, z2 = (corner.take(triangle) for corner in corner_values)
    triple_product = corner_field.normal_triple_product.take(triangle)
    if np.abs(triple_product).max(initial=0) < 2 * HOLONOMY_EPS:
        return z0 * b0 + z1 * b1 + z2 * b2
    d01, d02, d12 = (products.take(triangle) for products in corner_field.normal_dots)
    n0 = b0 + b1 * d01 + b2 * d02
    half1, half2 = np.empty_like(z0), np.empty_like(z0)
    half1.real = length * (1 + d01) + n0 + (b0 * d01 + b1 + b2 * d12)
    half1.imag = b2 * triple_product
    half2.real = length * (1 + d02) + n0 + (b0 * d02 + b1 * d12 + b2)
    half2.imag = -b1 * triple_product
    z1 *= signed_power(_squared_phase(half1), order)
    z2 *= signed_power(_squared_phase(half2), order)
    z0 *= b0
    z1 *= b1
    z2 *= b2
    z0 += z1
    z0 += z2
    return z0


def _squared_phase(half: np.ndarray) -> np.ndarray:
    """Return half^2 / |half|^2, the phase of the square; 0 where `half` is 0."""
    squared_modulus = half.real * half.real
    squared_modulus += half.imag * half.imag
    np.maximum(squared_modulus, np.float32(1e-30), out=squared_modulus)
    half = half * half
    half *= 1 / squared_modulus
    return half


def view_plane_rotation(
    tangent: Sequence[np.ndarray], normal: np.ndarray, view_direction: np.ndarray
) -> np.ndarray:
    """Return the directions of tangents after transport to the view plane.

    Parameters
    ----------
    tangent, normal, view_direction : 3 (P,) ndarrays
        Components in camera space: tangents of any length, the unit normals to which they are perpendicular,
        and the unit directions to the eye.

    Returns
    -------
    (P,) complex64 ndarray
        Unit complex numbers in the frame `field.frames.view_frame` of the view plane.
    """
    x, y, z = transport_components(tangent, normal, view_direction)
    # Coordinates in `view_frame`: apply the minimal rotation from `view_direction` to (0, 0, 1).
    z /= 1 + view_direction[2]
    rotation = np.empty(len(z), dtype=np.complex64)
    rotation.real = x - z * view_direction[0]
    rotation.imag = y - z * view_direction[1]
    modulus = np.sqrt(rotation.real * rotation.real + rotation.imag * rotation.imag)
    modulus[modulus == 0] = np.inf
    rotation *= 1 / modulus
    return rotation
