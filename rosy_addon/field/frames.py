"""Tangent frames, and the minimal rotation that carries vectors from one to another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(...) scalar products of two (..., 3) arrays."""
    return np.einsum("...i,...i->...", a, b)


def unit(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors scaled to length 1; zero vectors stay zero."""
    length = np.sqrt(dot(vectors, vectors))[..., None]
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def carry(vectors: np.ndarray, source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Rotate tangent vectors along the shortest arc that takes one normal to another.

    Parameters
    ----------
    vectors : (..., 3) ndarray
        Perpendicular to `source`.
    source, target : (..., 3) ndarray
        Unit normals, not opposite to each other.

    Returns
    -------
    (..., 3) ndarray
        v - (v.t) / (1 + s.t) (s + t): perpendicular to `target`, of unchanged length.

    Notes
    -----
    The map is its own inverse with the two normals exchanged. Opposite normals have no shortest
    arc; there the divisor is kept away from zero and the result is finite but arbitrary.
    """
    divisor = np.maximum(1 + dot(source, target), np.finfo(vectors.dtype).eps)
    return vectors - (dot(vectors, target) / divisor)[..., None] * (source + target)


def dot_components(a: Sequence[np.ndarray], b: Sequence[np.ndarray]) -> np.ndarray:
    """`dot` of vectors given by their three components: quicker, as these lie in a row."""
    product = a[0] * b[0]
    product += a[1] * b[1]
    product += a[2] * b[2]
    return product


def carry_components(
    vectors: Sequence[np.ndarray], source: Sequence[np.ndarray], target: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """`carry` of vectors given by their three components."""
    share = dot_components(vectors, target)
    share /= np.maximum(1 + dot_components(source, target), np.finfo(share.dtype).eps)
    return [v - share * (s + t) for v, s, t in zip(vectors, source, target, strict=True)]


def transformed(
    vectors: Sequence[np.ndarray], matrix: np.ndarray, shift: np.ndarray | None = None
) -> np.ndarray:
    """Vectors given by their three components, times a matrix, in the precision of the vectors.

    Parameters
    ----------
    vectors : 3 (n,) ndarrays
    matrix : (m, 3) ndarray
    shift : (m,) ndarray, optional
        Added.

    Returns
    -------
    (m, n) ndarray

    Notes
    -----
    A matrix product would do, but that of a linear algebra library wakes all cores for so little,
    and they keep each other waiting long after.
    """
    kind = vectors[0].dtype
    result = np.empty((len(matrix), len(vectors[0])), dtype=kind)
    for number, (row, out) in enumerate(zip(matrix.astype(kind), result, strict=True)):
        np.multiply(vectors[0], row[0], out=out)
        out += vectors[1] * row[1]
        out += vectors[2] * row[2]
        if shift is not None:
            out += kind.type(shift[number])
    return result


def tangent_frame(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit tangents x, y with x cross y = normal, a smooth choice for z > 0 and for z < 0.

    Parameters
    ----------
    normals : (..., 3) ndarray
        Unit vectors.

    References
    ----------
    Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
    """
    nx, ny, nz = normals[..., 0], normals[..., 1], normals[..., 2]
    sign = np.copysign(np.ones_like(nz), nz)
    a = -1 / (sign + nz)
    b = nx * ny * a
    x = np.stack([1 + sign * nx * nx * a, sign * b, -sign * nx], axis=-1)
    y = np.stack([b, sign + ny * ny * a, -ny], axis=-1)
    return x, y


def view_frame(toward_eye: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The camera's x and y axes carried to the plane across each pixel's ray.

    In camera space the camera's own direction to the eye is (0, 0, 1); its x axis (1, 0, 0) and y
    axis (0, 1, 0) are carried by the minimal rotation from there to `toward_eye`, which is
    continuous over the whole image. For an orthographic camera they stay as they are.

    Parameters
    ----------
    toward_eye : (..., 3) ndarray
        Unit, camera space, z > -1.

    Returns
    -------
    x, y : (..., 3) ndarray
    """
    wx, wy, wz = toward_eye[..., 0], toward_eye[..., 1], toward_eye[..., 2]
    a = 1 / (1 + wz)
    across = -wx * wy * a
    x = np.stack([1 - wx * wx * a, across, -wx])
    y = np.stack([across, 1 - wy * wy * a, -wy])
    return np.moveaxis(x, 0, -1), np.moveaxis(y, 0, -1)
