"""Measurements of pictures: correlation, orientation spectra and persistence of streaks."""

import numpy as np
from scipy import ndimage

#: Frequency band of streaks with common grains, in cycles per pixel.
BAND = (0.05, 0.35)


def correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Return Pearson's correlation of two sets of values."""
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def orientation_spectrum(tone: np.ndarray, bins: int = 180) -> np.ndarray:
    """Return (bins,): the power of a patch by orientation of streaks, 0 to 180 degrees; mean 1.

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
    bin_index = (angle[used] * bins / 180).astype(int) % bins
    total = np.bincount(bin_index, power[used], bins)
    spectrum = total / np.maximum(np.bincount(bin_index, minlength=bins), 1)
    return spectrum / spectrum.mean()


def mean_spectrum(tone: np.ndarray, side: int, bins: int = 180) -> np.ndarray:
    """Return the mean orientation spectrum of patches of `side` pixels that cover a picture."""
    step = side // 2
    patches = [
        orientation_spectrum(tone[row : row + side, column : column + side], bins)
        for row in range(0, tone.shape[0] - side + 1, step)
        for column in range(0, tone.shape[1] - side + 1, step)
    ]
    return np.mean(patches, axis=0)


def peaks(spectrum: np.ndarray, min_height: float = 1.5) -> list[float]:
    """Return the orientations of the distinct maxima of a spectrum in degrees.

    The spectrum is smoothed over 5 degrees; a maximum counts if it is `min_height` times the mean. Its
    position is the center of the power within 6 degrees of it.
    """
    bins = len(spectrum)
    degree = 180 / bins
    smooth = ndimage.gaussian_filter1d(spectrum, 2.5 / degree, mode="wrap")
    orientations = []
    for peak in np.flatnonzero(
        (smooth > np.roll(smooth, 1)) & (smooth >= np.roll(smooth, -1)) & (smooth > min_height)
    ):
        half_width = round(6 / degree)
        offset = np.arange(-half_width, half_width + 1)
        weight = smooth[(peak + offset) % bins] - smooth[(peak + offset) % bins].min()
        orientations.append(float((peak + 0.5 + np.average(offset, weights=weight)) * degree % 180))
    return sorted(orientations)


def persistence(
    image: np.ndarray, direction: np.ndarray, selected: np.ndarray, max_distance: int
) -> np.ndarray:
    """Return the autocorrelations of an image along a direction, by distance in pixels.

    Parameters
    ----------
    image : (H, W) ndarray
    direction : (H, W) complex ndarray
        Unit directions.
    selected : (H, W) bool ndarray
        Pixels that are compared with others.
    max_distance : int

    Returns
    -------
    (max_distance + 1,) float64 ndarray
    """
    row, column = np.nonzero(selected)
    direction_at, values_at_start = direction[selected], image[selected]
    correlations = []
    for distance in range(max_distance + 1):
        position = [row + distance * direction_at.imag, column + distance * direction_at.real]
        values_at_distance = ndimage.map_coordinates(image, position, order=1, mode="nearest")
        correlations.append(correlation(values_at_start, values_at_distance))
    return np.array(correlations)


def local_correlation(
    a: np.ndarray, b: np.ndarray, weight: np.ndarray, deviation: float
) -> np.ndarray:
    """Return the (H, W) correlation of two (H, W) pictures under a Gaussian window around each pixel.

    `weight` is 1 where the pictures count and 0 where not; NaN is returned where it is 0.
    """

    def mean(values: np.ndarray) -> np.ndarray:
        return ndimage.gaussian_filter(values * weight, deviation, mode="constant")

    a, b = a.astype(np.float64), b.astype(np.float64)
    total_weight = mean(np.ones_like(a))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_a, mean_b = mean(a) / total_weight, mean(b) / total_weight
        product = mean(a * b) / total_weight - mean_a * mean_b
        spread_a = mean(a * a) / total_weight - mean_a**2
        spread_b = mean(b * b) / total_weight - mean_b**2
        result = product / np.sqrt(spread_a * spread_b)
    return np.where(weight > 0, result, np.nan)


def peak_to_floor(spectrum: np.ndarray, lines: int, first: float) -> float:
    """Return the power along the directions of a field relative to that midway between them.

    Parameters
    ----------
    spectrum : (bins,) ndarray
    lines : int
        Number of different orientations of the N members.
    first : float
        One of these orientations, in degrees.
    """
    bins = len(spectrum)
    smooth = ndimage.gaussian_filter1d(spectrum, 1.5 * bins / 180, mode="wrap")
    position = (first + 180 / lines * np.arange(lines)) * bins / 180
    on_lines = np.rint(position - 0.5).astype(int) % bins
    between = np.rint(position - 0.5 + bins / lines / 2).astype(int) % bins
    return float(smooth[on_lines].mean() / smooth[between].mean())
