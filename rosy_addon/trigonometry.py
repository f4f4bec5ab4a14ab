"""Angles in single precision by polynomials: a few passes over arrays, the same bits everywhere.

numpy's own functions go to the system's library or to vector code of the processor, which round
differently; a streamline may then step into another pixel. Sums, products, quotients and roots of
IEEE numbers round alike on all of them.
"""

from __future__ import annotations

import numpy as np

# Interpolation at Chebyshev's nodes: of atan(a) / a in a^2 from 0 to 1, of sin(x) / x and cos(x) in
# x^2 from 0 to (pi / 2)^2. Errors are below 1e-8, 1e-10 and 1e-9.
_ATAN = (
    0.00276628, -0.01573125, 0.04213762, -0.07456855, 0.10618371, -0.14197798, 0.19991872,
    -0.33333037, 0.99999998,
)  # fmt: skip
_SIN = (-2.38892170e-08, 2.75252698e-06, -1.98408612e-04, 8.33333097e-03, -1.66666666e-01, 1.0)
_COS = (
    -2.60506573e-07, 2.47601097e-05, -1.38883603e-03, 4.16666362e-02, -4.99999994e-01, 1.0,
)  # fmt: skip


def angle_of(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Angles of vectors.

    Parameters
    ----------
    x, y : float32 ndarray

    Returns
    -------
    float32 ndarray
        Radians, from -pi to pi, within 5e-7; 0 for the zero vector.
    """
    across, up = np.abs(x), np.abs(y)
    longer = np.maximum(across, up)
    np.maximum(longer, np.float32(1e-30), out=longer)
    slope = np.minimum(across, up)
    slope /= longer
    angle = _polynomial(_ATAN, slope * slope)
    angle *= slope
    angle = np.where(up > across, np.float32(np.pi / 2) - angle, angle)
    angle = np.where(x < 0, np.float32(np.pi) - angle, angle)
    return np.copysign(angle, y)


def cosine_sine(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine.

    Parameters
    ----------
    angle : float32 ndarray
        Radians, from -pi / 2 to pi / 2.

    Returns
    -------
    cosine, sine : float32 ndarray
        Within 3e-7.
    """
    square = angle * angle
    sine = _polynomial(_SIN, square)
    sine *= angle
    return _polynomial(_COS, square), sine


def phase_of(angle: np.ndarray) -> np.ndarray:
    """exp(i angle).

    Parameters
    ----------
    angle : float64 ndarray
        Radians; a million turns leave single precision what it is.

    Returns
    -------
    complex64 ndarray
        Within 4e-7.
    """
    half_turns = angle * (1 / np.pi)
    whole = np.rint(half_turns)
    half_turns -= whole
    phase = np.empty(angle.shape, dtype=np.complex64)
    phase.real, phase.imag = cosine_sine((half_turns * np.pi).astype(np.float32))
    np.negative(phase, out=phase, where=whole.astype(np.int64) & 1 == 1)
    return phase


def _polynomial(coefficients: tuple[float, ...], x: np.ndarray) -> np.ndarray:
    """Horner's scheme, highest power first."""
    total = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        total *= x
        total += np.float32(coefficient)
    return total
