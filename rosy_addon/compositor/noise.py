"""Binary white noise from an integer hash, and how much of it a streamline leaves."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

#: Mean and standard deviation of binary noise.
MEAN, DEVIATION = 0.5, 0.5

#: The lattice of noise cells stands askew to the pixels, so that no row of pixels beats with it.
TURN = 0.5

#: Deviation of the blur that is taken out of the noise, as a part of `Look.high_pass`.
BLUR = 0.5

#: Side of the tiles of the picture in which noise is made, pixels.
TILE = 256

#: So many pixels of noise are kept for the next picture.
KEPT = 1 << 22

#: Points along each side of a pixel at which the cells are averaged.
TAPS = 3


def hash_bits(x: np.ndarray, y: np.ndarray, seed: int, channel: int, density: float) -> np.ndarray:
    """One random bit for each cell of an integer lattice.

    Parameters
    ----------
    x, y : int ndarray
        Cell indices.
    seed, channel : int
    density : float
        Share of cells whose bit is set, to the nearest 2 ** -24.

    Returns
    -------
    bool ndarray

    References
    ----------
    The finaliser is `lowbias32` of Chris Wellons, "Prospecting for Hash Functions", 2018 (public
    domain).
    """
    return random_bits((x, y), seed, channel, density)


#: Odd numbers by which the indices of a cell are multiplied, one each.
FACTORS = (0x8DA6B343, 0xD8163841, 0xCB1AB31F, 0x165667B1, 0x9E3779B1)


def random_bits(index: Sequence[np.ndarray], seed: int, channel: int, density: float) -> np.ndarray:
    """`hash_bits` of cells with any number of indices, up to five."""
    start = (seed * 0x9E3779B9 + channel * 0x85EBCA6B) & 0xFFFFFFFF
    h = index[0].astype(np.uint32) * np.uint32(FACTORS[0])
    for number, factor in zip(index[1:], FACTORS[1:], strict=False):
        h = h ^ number.astype(np.uint32) * np.uint32(factor)
    h += np.uint32(start)
    h ^= h >> np.uint32(16)
    h *= np.uint32(0x7FEB352D)
    h ^= h >> np.uint32(15)
    h *= np.uint32(0x846CA68B)
    return h >> np.uint32(8) < np.uint32(round(density * 2**24))


def image_noise(
    pixel: np.ndarray,
    width: int,
    grain: float,
    seed: int,
    channels: int,
    *,
    density: float = 0.5,
    high_pass: float = 0.0,
) -> np.ndarray:
    """Noise anchored to the picture: square cells of one bit, averaged over each pixel.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices, ascending.
    width : int
        Of the frame.
    grain : float
        Side of a cell, pixels.
    seed : int
    channels : int
        1 or 3, independent of each other.
    density : float
        Share of cells that are bright.
    high_pass : float
        Pixels; variations broader than about this are taken out. 0 leaves the noise white.

    Returns
    -------
    (P, channels) float32 ndarray
        With mean `MEAN`; that of a cell has the standard deviation `DEVIATION`. At half density
        and without a high pass it is from 0 to 1.
    """
    row, column = np.divmod(pixel, np.int32(width))
    # The same for all views of a picture, so that noise is made once for a moving camera.
    left, right = tiled(int(column.min()), int(column.max()) + 1)
    bottom, top = tiled(int(row[0]), int(row[-1]) + 1)
    make = _tiles if (right - left) * (top - bottom) <= KEPT else _tiles.__wrapped__
    place = (row - bottom) * np.int32(right - left) + (column - left)
    noise = np.empty((channels, len(pixel)), dtype=np.float32)
    for channel in range(channels):
        tiles = make(left, right, bottom, top, grain, seed, channel, density, high_pass)
        tiles.take(place, out=noise[channel], mode="clip")
    return np.ascontiguousarray(noise.T)


def tiled(start: int, stop: int) -> tuple[int, int]:
    """The whole tiles that hold some rows or columns of pixels."""
    return start // TILE * TILE, -(-stop // TILE) * TILE


@lru_cache(maxsize=6)
def _tiles(
    left: int,
    right: int,
    bottom: int,
    top: int,
    grain: float,
    seed: int,
    channel: int,
    density: float,
    high_pass: float,
) -> np.ndarray:
    """(pixels,) float32 noise of a rectangle of the picture."""
    margin = int(np.ceil(3 * BLUR * high_pass))
    around = (left - margin, right + margin, bottom - margin, top + margin)
    cells = _cells(*around, grain, seed, channel, density)
    if high_pass:
        cells += MEAN - blurred(cells, BLUR * high_pass)
        cells = cells[margin : len(cells) - margin, margin : cells.shape[1] - margin]
    return np.ascontiguousarray(cells).reshape(-1)


def _cells(
    left: int,
    right: int,
    bottom: int,
    top: int,
    grain: float,
    seed: int,
    channel: int,
    density: float,
) -> np.ndarray:
    """(top - bottom, right - left) float32: the lattice of bits averaged over pixels, scaled."""
    cos, sin = np.cos(TURN) / grain, np.sin(TURN) / grain
    column = np.arange(left, right, dtype=np.float64)
    row = np.arange(bottom, top, dtype=np.float64)[:, None]
    taps = (np.arange(TAPS) + 0.5) / TAPS
    total = np.zeros((top - bottom, right - left), dtype=np.float32)
    for y in taps:
        for x in taps:
            px, py = column + x, row + y
            cell_x = np.floor(cos * px - sin * py).astype(np.int32)
            cell_y = np.floor(sin * px + cos * py).astype(np.int32)
            total += hash_bits(cell_x, cell_y, seed, channel, density)
    scale = DEVIATION / np.sqrt(density * (1 - density))
    return np.float32(MEAN - density * scale) + np.float32(scale / (TAPS * TAPS)) * total


def blur_reach(deviation: float) -> int:
    """How far on either side each of the three means of `blurred` reaches, pixels."""
    # A mean over w pixels has the variance (w^2 - 1) / 12.
    return max(int(np.rint((np.sqrt(4 * deviation**2 + 1) - 1) / 2)), 1)


def blurred(image: np.ndarray, deviation: float) -> np.ndarray:
    """Nearly a Gaussian blur, of the given deviation in pixels: three means over squares."""
    reach = blur_reach(deviation)
    for axis in (0, 1, 0, 1, 0, 1):
        image = _mean_along(image, reach, axis)
    return image


def _mean_along(image: np.ndarray, reach: int, axis: int) -> np.ndarray:
    """Mean over 2 * reach + 1 pixels along an axis, the outermost ones repeated."""
    pads = [(0, 0), (0, 0)]
    pads[axis] = (reach + 1, reach)
    total = np.cumsum(np.pad(image, pads, mode="edge"), axis=axis, dtype=np.float64)
    size, window = image.shape[axis], 2 * reach + 1
    after = total.take(range(window, window + size), axis=axis)
    before = total.take(range(size), axis=axis)
    return ((after - before) / window).astype(np.float32)


@lru_cache(maxsize=64)
def streak_statistics(
    length: float,
    grain: float,
    high_pass: float,
    images: int = 1,
    average: int = 1,
    tapered: bool = False,
) -> tuple[float, float]:
    """How much the noise averaged along straight streamlines varies, in closed form.

    Parameters
    ----------
    length : float
        Of the streamlines, pixels.
    grain, high_pass : float
        Of the noise, pixels.
    images : int
        M streamlines through a pixel, at multiples of pi / M.
    average : int
        Side of the squares of pixels over which the picture is averaged afterwards.
    tapered : bool
        Whether samples count the less the nearer they are to the ends.

    Returns
    -------
    deviation : float
        Standard deviation of one such mean.
    crossing : float
        Sum of the correlations of one of the M means with each of the others: they share the
        noise around the pixel where they cross.

    Notes
    -----
    With S(k) the power spectrum of the noise, the covariance of the means along two lines of
    length l through a point, in the directions u and v, is the integral of
    S(k) sinc(l k.u) sinc(l k.v). S is that of a lattice of bits with cells of side g, averaged
    over pixels, with a Gaussian taken out:
    g^2 / 4 [sinc(g kx) sinc(g ky) sinc(kx') sinc(ky') (1 - exp(-2 pi^2 s^2 k^2))]^2.
    It is averaged over all directions here, and the integral taken in polar coordinates. A mean of
    tapered weights is one of means over half the length: sinc(l k.u) becomes sinc(l k.u / 2)^2.
    """
    k, dk = np.linspace(0, 4 / (1 + grain), 700, retstep=True)
    angle = np.arange(1440) * np.pi / 1440
    kx, ky = np.outer(k, np.cos(angle)), np.outer(k, np.sin(angle))
    cx, cy = np.cos(TURN) * kx - np.sin(TURN) * ky, np.sin(TURN) * kx + np.cos(TURN) * ky
    amplitude = np.sinc(grain * cx) * np.sinc(grain * cy) * np.sinc(kx) * np.sinc(ky)
    if average > 1:
        amplitude *= np.sinc(average * kx) * np.sinc(average * ky)
    power = (grain * DEVIATION * amplitude) ** 2
    kept = 1 - np.exp(-2 * (np.pi * BLUR * high_pass * k) ** 2) if high_pass else 1.0
    weight = power.mean(axis=1) * kept**2 * k * dk * (2 * np.pi / len(angle))
    one = _passed(length * kx, tapered)
    variance = weight @ np.sum(one * one, axis=1)
    crossing = 0.0
    for other in range(1, images):
        turn = np.pi * other / images
        along = np.cos(turn) * kx + np.sin(turn) * ky
        crossing += weight @ np.sum(one * _passed(length * along, tapered), axis=1)
    return float(np.sqrt(variance)), float(crossing / variance)


def _passed(turns: np.ndarray, tapered: bool) -> np.ndarray:
    """What a mean along a line leaves of waves, by how many of them there are along it."""
    return np.sinc(turns / 2) ** 2 if tapered else np.sinc(turns)
