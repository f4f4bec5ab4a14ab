"""Binary white noise from an integer hash, and how much of it a streamline leaves."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

#: Mean and standard deviation of binary noise.
MEAN, DEVIATION = 0.5, 0.5

#: The lattice of noise cells stands askew to the pixels, so that no row of pixels beats with it.
TURN = 0.5

#: Points along each side of a pixel at which the cells are averaged.
TAPS = 3


def hash_bits(x: np.ndarray, y: np.ndarray, seed: int, channel: int) -> np.ndarray:
    """One random bit for each cell of an integer lattice.

    Parameters
    ----------
    x, y : int ndarray
        Cell indices.
    seed, channel : int

    Returns
    -------
    float32 ndarray
        0 or 1.

    References
    ----------
    The finaliser is `lowbias32` of Chris Wellons, "Prospecting for Hash Functions", 2018 (public
    domain).
    """
    start = (seed * 0x9E3779B9 + channel * 0x85EBCA6B) & 0xFFFFFFFF
    h = x.astype(np.uint32) * np.uint32(0x8DA6B343)
    h ^= y.astype(np.uint32) * np.uint32(0xD8163841)
    h += np.uint32(start)
    h ^= h >> np.uint32(16)
    h *= np.uint32(0x7FEB352D)
    h ^= h >> np.uint32(15)
    h *= np.uint32(0x846CA68B)
    return (h >> np.uint32(31)).astype(np.float32)


def image_noise(
    pixel: np.ndarray, width: int, grain: float, seed: int, channels: int
) -> np.ndarray:
    """Noise anchored to the picture: square cells of one bit, averaged over each pixel.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices.
    width : int
        Of the frame.
    grain : float
        Side of a cell, pixels.
    seed : int
    channels : int
        1 or 3, independent of each other.

    Returns
    -------
    (P, channels) float32 ndarray
        From 0 to 1, with mean `MEAN`.
    """
    cos, sin = np.cos(TURN) / grain, np.sin(TURN) / grain
    column, row = (pixel % width).astype(np.float32), (pixel // width).astype(np.float32)
    noise = np.zeros((len(pixel), channels), dtype=np.float32)
    taps = (np.arange(TAPS, dtype=np.float32) + 0.5) / TAPS
    for ty in taps:
        for tx in taps:
            px, py = column + tx, row + ty
            # Away from the origin, where the truncation of floats would mirror the lattice.
            cell_x = np.floor(cos * px - sin * py).astype(np.int32)
            cell_y = np.floor(sin * px + cos * py).astype(np.int32)
            for channel in range(channels):
                noise[:, channel] += hash_bits(cell_x, cell_y, seed, channel)
    noise /= TAPS * TAPS
    return noise


@lru_cache(maxsize=64)
def correlation_length(grain: float) -> float:
    """Length over which the noise along a straight streamline stays alike, in pixels.

    The integral of the autocovariance of `image_noise` along a line, over the variance of a bit,
    averaged over the directions of the line. The mean of the noise over a length l of streamline
    then has the variance ``DEVIATION**2 * correlation_length / l``.

    Notes
    -----
    By the projection-slice theorem the integral along a line is that of the power spectrum along
    the perpendicular through the origin; the spectrum of cells of side g averaged over pixels is
    g^2 sinc^2(g kx') sinc^2(g ky') sinc^2(kx) sinc^2(ky), primes for the turned lattice.
    """
    angle = (np.arange(180) + 0.5) * np.pi / 180
    k = (np.arange(4000) + 0.5) * (8 / min(grain, 1.0) / 4000)
    kx, ky = np.outer(np.cos(angle), k), np.outer(np.sin(angle), k)
    cx = np.cos(TURN) * kx - np.sin(TURN) * ky
    cy = np.sin(TURN) * kx + np.cos(TURN) * ky
    spectrum = (np.sinc(grain * cx) * np.sinc(grain * cy) * np.sinc(kx) * np.sinc(ky)) ** 2
    return float(2 * grain**2 * spectrum.mean(axis=0).sum() * (k[1] - k[0]))
