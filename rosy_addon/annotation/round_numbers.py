"""Round numbers for ticks and scale bars, and numbers as text."""

from __future__ import annotations

import math

import numpy as np

#: Mantissas of round numbers.
MANTISSAS = (1, 2, 5)

#: Exponents of 10 of numbers that are written without one.
PLAIN_EXPONENTS = range(-4, 6)

#: The minus sign, and digits as exponents.
MINUS = "\N{MINUS SIGN}"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def round_below(largest: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above a positive number."""
    return max(value for value in _round_near(largest) if value <= largest * (1 + 1e-9))


def round_above(least: float) -> float:
    """Return the least of 1, 2 and 5 times a power of ten that is not below a positive number."""
    return min(value for value in _round_near(least) if value >= least * (1 - 1e-9))


def _round_near(number: float) -> list[float]:
    """Return the floats that are nearest to 1, 2 and 5 times some powers of ten, around a number."""
    exponent = math.floor(math.log10(number))
    powers = (exponent - 1, exponent, exponent + 1)
    return [float(f"{mantissa}e{power}") for power in powers for mantissa in MANTISSAS]


def tick_values(low: float, high: float, max_steps: int) -> np.ndarray:
    """Return the multiples of a round step in a range.

    Parameters
    ----------
    low, high : float
        `low` is below `high`.
    max_steps : int
        The range has at most this number of steps.

    Returns
    -------
    (n,) float64 ndarray
    """
    step = round_above((high - low) / max_steps)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return np.arange(first, last + 1) * step


def tick_labels(low: float, high: float, max_steps: int, gap: float) -> list[tuple[float, str]]:
    """Return the ticks of a range: both ends, and round numbers between them.

    Parameters
    ----------
    low, high : float
        `low` is not above `high`.
    max_steps : int
        As in `tick_values`.
    gap : float
        Smallest distance of a round number from the ends, as a fraction of the range.

    Returns
    -------
    list of (float, str)
        Values and their labels, ascending. The ends have three digits.
    """
    if not low < high:
        return [(low, format_number(low))]
    values = tick_values(low, high, max_steps)
    between = values[(values > low + gap * (high - low)) & (values < high - gap * (high - low))]
    step = values[1] - values[0] if len(values) > 1 else high - low
    decimals = max(-math.floor(math.log10(step) + 1e-9), 0)
    largest = math.floor(math.log10(max(abs(low), abs(high))))
    labels = [
        f"{value:.{decimals}f}".replace("-", MINUS)
        if largest in PLAIN_EXPONENTS
        else format_number(value)
        for value in between.tolist()
    ]
    return [
        (low, format_number(low)),
        *zip(between.tolist(), labels, strict=True),
        (high, format_number(high)),
    ]


def format_number(value: float, digits: int = 3) -> str:
    """Return a number with a number of significant digits, without zeros at its end.

    Very large and very small ones are written with a power of ten.
    """
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    power = int(exponent)
    if float(mantissa) == 0:
        return "0"
    if power in PLAIN_EXPONENTS:
        text = f"{value:.{max(digits - 1 - power, 0)}f}"
        text = text.rstrip("0").rstrip(".") if "." in text else text
        return text.replace("-", MINUS)
    text = mantissa.rstrip("0").rstrip(".")
    return f"{text}×10{str(power).translate(_SUPERSCRIPTS)}".replace("-", MINUS)
