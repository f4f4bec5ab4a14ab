"""Vectors and their transforms, tangent frames, and the transport of tangent vectors by minimal rotations."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the (...) dot products of corresponding vectors in two (..., 3) arrays."""
    return np.einsum("...i,...i->...", a, b)


def coordinates(vectors: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the (F, N) complex coordinates v.x + i v.y of (F, N, 3) vectors v in (F, 3) frames x, y."""
    return dot(vectors, x[:, None]) + 1j * dot(vectors, y[:, None])


def transformed(points: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return (..., k) products of a (k, 4) matrix and (..., 3) points (x, y, z), as vectors (x, y, z, 1)."""
    return points @ matrix[:, :3].T + matrix[:, 3]


def quotient(numerator: np.ndarray | float, denominator: np.ndarray) -> np.ndarray:
    """Return numerator / denominator, and 0 where the denominator is not above 0.

    The result has the shape and dtype of the numerator or, if the numerator is a number, of the denominator.
    """
    zeros = np.zeros_like(denominator if isinstance(numerator, (int, float)) else numerator)
    return np.divide(numerator, denominator, out=zeros, where=denominator > 0)


def normalize(vectors: np.ndarray) -> np.ndarray:
    """Return (..., 3) vectors scaled to length 1; zero vectors stay zero."""
    return quotient(vectors, np.sqrt(dot(vectors, vectors))[..., None])


def unit_direction(vector: ArrayLike) -> np.ndarray | None:
    """Return a vector scaled to length 1, or None if it is not a direction.

    A direction has three finite components that are not all 0. They may be as large or as small as a
    floating-point number can be.
    """
    values = np.asarray(vector, dtype=np.float64).reshape(-1)
    largest = np.abs(values).max(initial=0.0)
    if values.shape != (3,) or not np.isfinite(largest) or largest == 0:
        return None
    # Scale by a power of 2 to about 1 (exactly), so that squares neither overflow nor underflow.
    values = np.ldexp(values, -np.frexp(largest)[1])
    return values / np.linalg.norm(values)


def transport(vectors: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Rotate tangent vectors by the minimal rotation that takes one normal to another.

    Parameters
    ----------
    vectors : (..., 3) ndarray
        Perpendicular to `source`.
    source, target : (..., 3) ndarray
        Unit normals, not opposite to each other.

    Returns
    -------
    (..., 3) ndarray
        v - (v.t) / (1 + s.t) (s + t) for each vector v, source s and target t, where . is the dot product.
        The vectors are perpendicular to `target` and have their original lengths.

    Notes
    -----
    Exchanging the two normals gives the inverse. For opposite normals the minimal rotation is not
    unique; the divisor is then bounded away from zero, and the result is finite but arbitrary.
    """
    denominator = np.maximum(1 + dot(source, target), np.finfo(vectors.dtype).eps)
    return vectors - (dot(vectors, target) / denominator)[..., None] * (source + target)


def dot_components(a: Sequence[np.ndarray], b: Sequence[np.ndarray]) -> np.ndarray:
    """Return dot products of vectors that are given as three arrays, of x, y and z.

    This is faster than `dot`, because each array is contiguous.
    """
    product = a[0] * b[0]
    product += a[1] * b[1]
    product += a[2] * b[2]
    return product


def transport_components(
    vectors: Sequence[np.ndarray], source: Sequence[np.ndarray], target: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Return the result of `transport` for vectors that are given as three arrays, of x, y and z."""
    factor = dot_components(vectors, target)
    factor /= np.maximum(1 + dot_components(source, target), np.finfo(factor.dtype).eps)
    return [v - factor * (s + t) for v, s, t in zip(vectors, source, target, strict=True)]


def transform_components(
    vectors: Sequence[np.ndarray], matrix: np.ndarray, offset: np.ndarray | None = None
) -> np.ndarray:
    """Multiply vectors that are given as three arrays, of x, y and z, by a matrix.

    Parameters
    ----------
    vectors : sequence of three (n,) ndarrays
    matrix : (m, 3) ndarray
    offset : (m,) ndarray, optional
        Vector that is added to each product.

    Returns
    -------
    (m, n) ndarray
        Array of the same dtype as the vectors.

    Notes
    -----
    This avoids numpy's matrix product. Even for a small product, the BLAS library would start threads on all
    cores, and these threads, while they wait, slow down the code that follows.
    """
    dtype = vectors[0].dtype
    result = np.empty((len(matrix), len(vectors[0])), dtype=dtype)
    for index, (row, out) in enumerate(zip(matrix.astype(dtype), result, strict=True)):
        np.multiply(vectors[0], row[0], out=out)
        out += vectors[1] * row[1]
        out += vectors[2] * row[2]
        if offset is not None:
            out += dtype.type(offset[index])
    return result


def tangent_frame(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit tangents x, y for each normal, with x cross y = normal.

    The frames vary smoothly with the normal on each of the two half-spheres, z > 0 and z < 0, but not
    across z = 0.

    Parameters
    ----------
    normals : (..., 3) ndarray
        Unit vectors.

    Returns
    -------
    x, y : (..., 3) ndarray

    References
    ----------
    Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
    """
    x, y = tangent_frame_components(np.moveaxis(normals, -1, 0))
    return np.stack(x, axis=-1), np.stack(y, axis=-1)


def tangent_frame_components(
    normal: Sequence[np.ndarray],
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the result of `tangent_frame` for normals that are given as three arrays, of x, y and z."""
    nx, ny, nz = normal
    sign = np.copysign(nz.dtype.type(1), nz)
    a = -1 / (sign + nz)
    b = nx * ny * a
    x = [1 + sign * nx * nx * a, sign * b, -sign * nx]
    return x, [b, sign + ny * ny * a, -ny]


def view_frame(toward_eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the camera's x and y axes, transported to the plane perpendicular to the ray of each pixel.

    The axes (1, 0, 0) and (0, 1, 0) of camera space are rotated by the minimal rotation from
    (0, 0, 1), the direction to the eye on the optical axis, to `toward_eye`. The resulting frames are
    continuous over the whole image. For an orthographic camera the frame is the same at every pixel.

    Parameters
    ----------
    toward_eye : (..., 3) ndarray
        Unit directions from the surface to the eye in camera space, z > -1.

    Returns
    -------
    x, y : (..., 3) ndarray
        Unit vectors in camera space.
    """
    wx, wy, wz = toward_eye[..., 0], toward_eye[..., 1], toward_eye[..., 2]
    a = 1 / (1 + wz)
    xy_term = -wx * wy * a
    x = np.stack([1 - wx * wx * a, xy_term, -wx])
    y = np.stack([xy_term, 1 - wy * wy * a, -wy])
    return np.moveaxis(x, 0, -1), np.moveaxis(y, 0, -1)


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the (...) angles in radians between corresponding vectors of two (..., 3) arrays.

    They are from 0 to pi, and 0 where a vector is zero.
    """
    cross = np.cross(a, b)
    return np.arctan2(np.sqrt(dot(cross, cross)), dot(a, b))
