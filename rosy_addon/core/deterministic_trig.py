"""Trigonometric functions in single precision, with bit-identical results on all machines.

numpy's own functions call the system's math library or vector code for the processor. Their results are
rounded differently on different machines, and a streamline could step into another pixel. The functions here
evaluate polynomials. They use only sums, products, quotients and square roots, whose rounding is defined by
IEEE 754.
"""

import numpy as np

# Coefficients of three polynomials, highest power first. They interpolate, at Chebyshev nodes, atan(a) / a as
# a function of a^2 from 0 to 1, and sin(x) / x and cos(x) as functions of x^2 from 0 to (pi / 2)^2. Their
# errors are below 1e-8, 1e-10 and 1e-9.
_ATAN_TERMS = (
    0.00276628, -0.01573125, 0.04213762, -0.07456855, 0.10618371, -0.14197798, 0.19991872,
    -0.33333037, 0.99999998,
)  # fmt: skip
_SIN_TERMS = (-2.3889217e-8, 2.75252698e-6, -1.98408612e-4, 8.33333097e-3, -0.166666666, 1.0)
_COS_TERMS = (-2.60506573e-7, 2.47601097e-5, -1.38883603e-3, 4.16666362e-2, -0.499999994, 1.0)


def vector_angle(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the angle of each vector (x, y) to the x axis, like ``arctan2(y, x)``.

    Parameters
    ----------
    x, y : float32 ndarray
        Components of the vectors, of equal shape.

    Returns
    -------
    float32 ndarray
        Angles in radians, from -pi to pi; 0 for the zero vector. The error is below 5e-7.
    """
    abs_x, abs_y = np.abs(x), np.abs(y)
    larger = np.maximum(abs_x, abs_y)
    np.maximum(larger, np.float32(1e-30), out=larger)
    ratio = np.minimum(abs_x, abs_y)
    ratio /= larger
    angle = _horner(_ATAN_TERMS, ratio * ratio)
    angle *= ratio
    angle = np.where(abs_y > abs_x, np.float32(np.pi / 2) - angle, angle)
    angle = np.where(x < 0, np.float32(np.pi) - angle, angle)
    return np.copysign(angle, y)


def cos_sin(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the cosine and the sine of angles.

    Parameters
    ----------
    angle : float32 ndarray
        Angles in radians, from -pi / 2 to pi / 2.

    Returns
    -------
    cosine, sine : float32 ndarray
        Their errors are below 3e-7.
    """
    square = angle * angle
    sine = _horner(_SIN_TERMS, square)
    sine *= angle
    return _horner(_COS_TERMS, square), sine


def unit_phasor(angle: np.ndarray) -> np.ndarray:
    """Return exp(i angle) for angles of any size.

    Parameters
    ----------
    angle : float64 ndarray
        Angles in radians.

    Returns
    -------
    complex64 ndarray
        The error is below 4e-7 for angles of up to a million full rotations.
    """
    half_turns = angle * (1 / np.pi)
    nearest = np.rint(half_turns)
    half_turns -= nearest
    phasor = np.empty(angle.shape, dtype=np.complex64)
    phasor.real, phasor.imag = cos_sin((half_turns * np.pi).astype(np.float32))
    np.negative(phasor, out=phasor, where=nearest.astype(np.int64) & 1 == 1)
    return phasor


def _horner(coefficients: tuple[float, ...], x: np.ndarray) -> np.ndarray:
    """Evaluate a polynomial by Horner's scheme; the coefficient of the highest power is first."""
    total = np.full_like(x, coefficients[0])
    for coefficient in coefficients[1:]:
        total *= x
        total += np.float32(coefficient)
    return total
