"""Round numbers for ticks and scale bars, and numbers as text."""

import math

import numpy as np

#: Mantissas of round numbers.
MANTISSAS = (1, 2, 5)

#: Numbers with these decimal exponents are written without a power of ten.
PLAIN_EXPONENTS = range(-4, 6)

#: The minus sign, and digits as exponents.
MINUS = "\N{MINUS SIGN}"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def round_below(largest: float) -> float:
    """Return the largest round number (1, 2 or 5 times a power of ten) not above a positive number."""
    return max(value for value in _round_near(largest) if value <= largest * (1 + 1e-9))


def round_above(least: float) -> float:
    """Return the smallest round number (1, 2 or 5 times a power of ten) not below a positive number."""
    return min(value for value in _round_near(least) if value >= least * (1 - 1e-9))


def _round_near(number: float) -> list[float]:
    """Return nine round numbers (1, 2 or 5 times a power of ten), ascending.

    They are in three decades: the decade of `number`, which is positive, the one before it and the one after.
    """
    exponent = math.floor(math.log10(number))
    powers = (exponent - 1, exponent, exponent + 1)
    return [float(f"{mantissa}e{power}") for power in powers for mantissa in MANTISSAS]


def tick_values(low: float, high: float, max_steps: int) -> np.ndarray:
    """Return the multiples of a round step between `low` and `high`.

    Parameters
    ----------
    low, high : float
        Ends of the range; `low` must be below `high`.
    max_steps : int
        Largest number of steps in the range. The step is the smallest round number that meets this limit.

    Returns
    -------
    (n,) float64 ndarray
    """
    step = round_above((high - low) / max_steps)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return np.arange(first, last + 1) * step


def tick_labels(low: float, high: float, max_steps: int, gap: float) -> list[tuple[float, str]]:
    """Return the ticks of a range, at both ends and at round numbers between them.

    Parameters
    ----------
    low, high : float
        Ends of the range; `low` must not be above `high`. If they are equal, there is one tick.
    max_steps : int
        Largest number of steps from one round number to the next in the range.
    gap : float
        Smallest distance between a round number and the ends, as a fraction of the range.

    Returns
    -------
    list of (float, str)
        Values of the ticks, in ascending order, and their labels. Labels of the ends have three significant
        digits.
    """
    if not low < high:
        return [(low, format_number(low))]
    values = tick_values(low, high, max_steps)
    margin = gap * (high - low)
    between = values[(values > low + margin) & (values < high - margin)].tolist()
    step = values[1] - values[0] if len(values) > 1 else high - low
    decimals = max(-math.floor(math.log10(step) + 1e-9), 0)
    largest = math.floor(math.log10(max(abs(low), abs(high))))
    if largest in PLAIN_EXPONENTS:
        labels = [f"{value:.{decimals}f}".replace("-", MINUS) for value in between]
    else:
        labels = [format_number(value) for value in between]
    labels = [format_number(low), *labels, format_number(high)]
    return list(zip([low, *between, high], labels, strict=True))


def format_number(value: float, digits: int = 3) -> str:
    """Return a value as text with the given number of significant digits, without trailing zeros.

    Very large and very small values are written with a power of ten.
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
