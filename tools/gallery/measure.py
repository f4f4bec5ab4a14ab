"""Measurements of pictures: correlation, orientation spectra and persistence of streaks."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

#: Frequency band of streaks with common grains, in cycles per pixel.
BAND = (0.05, 0.35)


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Pearson's correlation of two sets of values."""
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def local_correlation(
    a: np.ndarray, b: np.ndarray, weight: np.ndarray, deviation: float
) -> np.ndarray:
    """(H, W) correlation of two (H, W) pictures under a Gaussian window around each pixel.

    `weight` is 1 where the pictures count and 0 where not; NaN is returned where it is 0.
    """

    def mean(values: np.ndarray) -> np.ndarray:
        return ndimage.gaussian_filter(values * weight, deviation, mode="constant")

    a, b = a.astype(np.float64), b.astype(np.float64)
    share = mean(np.ones_like(a))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_a, mean_b = mean(a) / share, mean(b) / share
        product = mean(a * b) / share - mean_a * mean_b
        spread_a, spread_b = mean(a * a) / share - mean_a**2, mean(b * b) / share - mean_b**2
        result = product / np.sqrt(spread_a * spread_b)
    return np.where(weight > 0, result, np.nan)


def orientation_spectrum(tone: np.ndarray, bins: int = 180) -> np.ndarray:
    """(bins,) power of a patch in streaks of each orientation, 0 to 180 degrees; mean 1.

    Parameters
    ----------
    tone : (H, W) ndarray
        Rows from the bottom. Orientations are counter-clockwise from the rows.
    bins : int
    """
    height, width = tone.shape
    window = np.outer(np.hanning(height), np.hanning(width))
    power = np.abs(np.fft.fft2((tone - tone.mean()) * window)) ** 2
    ky, kx = np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)
    radius = np.hypot(kx, ky)
    # A streak is long and narrow, so its spectrum is perpendicular to it.
    angle = np.degrees(np.arctan2(ky, kx) + np.pi / 2) % 180
    used = (radius > BAND[0]) & (radius < BAND[1])
    place = (angle[used] * bins / 180).astype(int) % bins
    total = np.bincount(place, power[used], bins)
    count = np.bincount(place, minlength=bins)
    spectrum = total / np.maximum(count, 1)
    return spectrum / spectrum.mean()


def mean_spectrum(tone: np.ndarray, side: int, bins: int = 180) -> np.ndarray:
    """The orientation spectrum of patches of `side` pixels that cover a picture, averaged."""
    step = side // 2
    patches = [
        orientation_spectrum(tone[row : row + side, column : column + side], bins)
        for row in range(0, tone.shape[0] - side + 1, step)
        for column in range(0, tone.shape[1] - side + 1, step)
    ]
    return np.mean(patches, axis=0)


def peaks(spectrum: np.ndarray, least: float = 1.5) -> list[float]:
    """Return the orientations of the distinct maxima of a spectrum in degrees.

    The spectrum is smoothed over 5 degrees; a maximum counts if it is `least` times the mean. Its
    place is the center of the power within 6 degrees of it.
    """
    bins = len(spectrum)
    degree = 180 / bins
    smooth = ndimage.gaussian_filter1d(spectrum, 2.5 / degree, mode="wrap")
    found = []
    for place in np.flatnonzero(
        (smooth > np.roll(smooth, 1)) & (smooth >= np.roll(smooth, -1)) & (smooth > least)
    ):
        reach = round(6 / degree)
        around = np.arange(-reach, reach + 1)
        weight = smooth[(place + around) % bins] - smooth[(place + around) % bins].min()
        found.append(float((place + 0.5 + np.average(around, weights=weight)) * degree % 180))
    return sorted(found)


def peak_to_floor(spectrum: np.ndarray, lines: int, first: float) -> float:
    """Return the power along the directions of a field relative to that midway between them.

    Parameters
    ----------
    spectrum : (bins,) ndarray
    lines : int
        Different orientations of the N members.
    first : float
        One of them, degrees.
    """
    bins = len(spectrum)
    smooth = ndimage.gaussian_filter1d(spectrum, 1.5 * bins / 180, mode="wrap")
    place = (first + 180 / lines * np.arange(lines)) * bins / 180
    here = np.rint(place - 0.5).astype(int) % bins
    between = np.rint(place - 0.5 + bins / lines / 2).astype(int) % bins
    return float(smooth[here].mean() / smooth[between].mean())


def persistence(
    image: np.ndarray, direction: np.ndarray, chosen: np.ndarray, farthest: int
) -> np.ndarray:
    """(farthest + 1,) correlation of an image with itself some pixels on along a direction.

    Parameters
    ----------
    image : (H, W) ndarray
    direction : (H, W) complex ndarray
        Unit.
    chosen : (H, W) bool ndarray
        From which pixels.
    farthest : int
    """
    row, column = np.nonzero(chosen)
    ahead, here = direction[chosen], image[chosen]
    values = []
    for distance in range(farthest + 1):
        place = [row + distance * ahead.imag, column + distance * ahead.real]
        there = ndimage.map_coordinates(image, place, order=1, mode="nearest")
        values.append(correlation(here, there))
    return np.array(values)
