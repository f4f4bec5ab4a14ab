"""Image-space noise from an integer hash, and the variance of its mean along a streamline.

Noise that is anchored to the picture is computed for whole tiles. The set of tiles often stays the same when
the visible region changes a little, so they can be reused for later pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache, partial
from typing import Literal, NamedTuple

import numpy as np

from ..core.cache import Cache
from ..core.progress import progress, report
from ..field.blocks import row_blocks
from .filter_kernel import Kernel

#: Mean and standard deviation of binary noise.
NOISE_MEAN, NOISE_STD = 0.5, 0.5

#: Rotation of the lattice of noise cells against the pixels, radians. It avoids moire patterns.
LATTICE_ANGLE = 0.5

#: Standard deviation of the blur that the high pass subtracts, as a fraction of `Look.high_pass`.
BLUR_FACTOR = 0.5

#: Largest margin in pixels around the picture whose noise is computed for the high pass. A wider margin
#: would take longer than the picture, and its mean hardly differs from `NOISE_MEAN`.
MAX_MARGIN = 512

#: Label of all steps.
STEP_LABEL = "making noise"

#: Values are rounded to multiples of this before they are summed. Sums in double precision are then
#: exact, and do not depend on where they begin.
BLUR_QUANTUM = 2.0**-32

#: Rows or columns that are blurred together. Their sums fit into the caches of the processor.
BLUR_LINES = 32

#: Rows of cells that are hashed at once. Their intermediate results fit into the cache.
BLOCK_ROWS = 32

#: Sample points along each side of a pixel. Noise is averaged over their square grid.
TAPS_PER_SIDE = 3

#: Odd factors of the hash for the indices of a cell, the seed, the channel and the finalizer.
HASH_FACTORS = (0x8DA6B343, 0xD8163841, 0xCB1AB31F, 0x165667B1, 0x9E3779B1)
SEED_FACTOR, CHANNEL_FACTOR = 0x9E3779B9, 0x85EBCA6B
FINALIZER_FACTORS = (0x7FEB352D, 0x846CA68B)

#: Side of a tile in pixels.
TILE_PIXELS = 256

#: Maximum number of pixels of an image that is cached for the next picture.
MAX_CACHED_PIXELS = 1 << 22

#: Cache of noise images. It has room for eight images of the maximum size.
TILE_CACHE = Cache(max_bytes=8 * 4 * MAX_CACHED_PIXELS)


def hash_bits(
    cell_index: Sequence[np.ndarray], seed: int, channel: int, density: float
) -> np.ndarray:
    """Hash the cells of an integer lattice to random bits.

    Parameters
    ----------
    cell_index : sequence of int ndarray
        Up to five arrays of one shape: the indices of the cells along each axis of the lattice, and further
        integers that tell lattices apart.
    seed, channel : int
        Other values give independent bits.
    density : float
        Fraction of cells whose bit is set, to the nearest 2 ** -24.

    Returns
    -------
    bool ndarray
        The random bit of each cell.

    References
    ----------
    The finalizer is `lowbias32` of Chris Wellons, "Prospecting for Hash Functions", 2018 (public
    domain).
    """
    start = (seed * SEED_FACTOR + channel * CHANNEL_FACTOR) & 0xFFFFFFFF
    h = cell_index[0].astype(np.uint32) * np.uint32(HASH_FACTORS[0])
    for component, factor in zip(cell_index[1:], HASH_FACTORS[1:], strict=False):
        h = h ^ component.astype(np.uint32) * np.uint32(factor)
    h += np.uint32(start)
    h ^= h >> np.uint32(16)
    h *= np.uint32(FINALIZER_FACTORS[0])
    h ^= h >> np.uint32(15)
    h *= np.uint32(FINALIZER_FACTORS[1])
    return h >> np.uint32(8) < np.uint32(round(density * 2**24))


class NoiseSettings(NamedTuple):
    """Settings of noise that consists of random binary cells.

    Attributes
    ----------
    cell : float
        Side of a cell: in pixels, or in steps of streamlines on the texels of a texture.
    seed : int
    channels : int
        Number of independent channels.
    density : float
        Fraction of cells that are bright.
    high_pass : float
        Variations wider than about this length, in the unit of `cell`, are removed. 0 leaves the noise white.
    """

    cell: float
    seed: int
    channels: int = 1
    density: float = 0.5
    high_pass: float = 0.0


class TileRectangle(NamedTuple):
    """A rectangle of the picture that consists of whole tiles: its columns and rows of pixels.

    Rows are counted from the bottom. `right` and `top` are the column and the row after the last ones.
    """

    left: int
    right: int
    bottom: int
    top: int

    def index(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return the flat indices in the rectangle of pixels, given their rows and columns in the picture."""
        return (row - self.bottom) * np.int32(self.right - self.left) + (column - self.left)


def tile_rectangle(
    pixel: np.ndarray, width: int, subpixels: int = 1, extra_columns: int = 0
) -> TileRectangle:
    """Return the smallest rectangle of whole tiles that contains some pixels.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices into a supersampled frame, ascending.
    width : int
        Width of that frame in pixels.
    subpixels : int
        Subpixels along each side of a pixel. The rectangle is in pixels, not in subpixels.
    extra_columns : int
        Columns that are added at the right.
    """
    column = pixel % np.int32(width)
    left, right = int(column.min()) // subpixels, int(column.max()) // subpixels + 1
    bottom, top = (int(end) // width // subpixels for end in pixel[[0, -1]])
    columns, rows = _round_outward(left, right + extra_columns), _round_outward(bottom, top + 1)
    return TileRectangle(*columns, *rows)


def _round_outward(start: int, stop: int) -> tuple[int, int]:
    """Round a range of rows or columns outward to whole tiles."""
    return start // TILE_PIXELS * TILE_PIXELS, -(-stop // TILE_PIXELS) * TILE_PIXELS


def cached_tiles(
    create: Callable[..., np.ndarray], rectangle: TileRectangle, *settings: Hashable
) -> np.ndarray:
    """Return the result of ``create(rectangle, *settings)``, from the cache if it is there.

    `create` makes an image of the rectangle: one value for each pixel, row by row, as a flat array. It is
    stored unless it has more than `MAX_CACHED_PIXELS`.
    """
    left, right, bottom, top = rectangle
    if (right - left) * (top - bottom) > MAX_CACHED_PIXELS:
        return create(rectangle, *settings)
    key = create.__name__, rectangle, settings
    image = TILE_CACHE.get_or_create(key, partial(create, rectangle, *settings))
    TILE_CACHE.evict_over_limit()
    return image


def image_noise(pixel: np.ndarray, width: int, settings: NoiseSettings) -> np.ndarray:
    """Make noise that is anchored to the picture: random binary square cells, filtered to pixels.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat pixel indices, ascending.
    width : int
        Width of the frame in pixels.
    settings : NoiseSettings

    Returns
    -------
    (P, channels) float32 ndarray
        The mean is `NOISE_MEAN`. The standard deviation of cells, before they are filtered, is
        `NOISE_STD`. With the density 0.5 and without a high pass, values are from 0 to 1.
    """
    cell, seed, channels, density, high_pass = settings
    rectangle = tile_rectangle(pixel, width)
    index = rectangle.index(*np.divmod(pixel, np.int32(width)))
    noise = np.empty((len(pixel), channels), dtype=np.float32)
    for channel in range(channels):
        arguments = cell, seed, channel, density, high_pass
        with progress(channel / channels, (channel + 1) / channels):
            noise[:, channel] = cached_tiles(_noise_tiles, rectangle, *arguments).take(index)
    return noise


def _noise_tiles(
    rectangle: TileRectangle, cell: float, seed: int, channel: int, density: float, high_pass: float
) -> np.ndarray:
    """Return the flat float32 noise of one channel in a rectangle, row by row, averaged over each pixel.

    `channel` is the number of the channel. The other settings are attributes of `NoiseSettings`.
    """
    full_margin = high_pass_margin(high_pass)
    margin = min(full_margin, MAX_MARGIN)
    left, right, bottom, top = rectangle
    cos, sin = np.cos(LATTICE_ANGLE) / cell, np.sin(LATTICE_ANGLE) / cell
    column = np.arange(left - margin, right + margin, dtype=np.float64)
    row = np.arange(bottom - margin, top + margin, dtype=np.float64)[:, None]
    taps = (np.arange(TAPS_PER_SIDE) + 0.5) / TAPS_PER_SIDE
    total = np.zeros((len(row), len(column)), dtype=np.float32)
    for block in row_blocks(len(row), BLOCK_ROWS):
        for y in taps:
            for x in taps:
                px, py = column + x, row[block] + y
                cell_x = np.floor(cos * px - sin * py).astype(np.int32)
                cell_y = np.floor(sin * px + cos * py).astype(np.int32)
                total[block] += hash_bits((cell_x, cell_y), seed, channel, density)
    scale = NOISE_STD / np.sqrt(density * (1 - density))
    cells = np.float32(NOISE_MEAN - density * scale) + np.float32(scale / len(taps) ** 2) * total
    if high_pass:
        outside = "edge" if margin == full_margin else "mean"
        cells += NOISE_MEAN - gaussian_blur(cells, BLUR_FACTOR * high_pass, outside)
        cells = cells[margin : len(cells) - margin, margin : cells.shape[1] - margin]
    return np.ascontiguousarray(cells).reshape(-1)


def high_pass_margin(high_pass: float) -> int:
    """Return the radius of the high-pass filter: up to which distance in pixels it reads other pixels."""
    return int(np.ceil(3 * BLUR_FACTOR * high_pass))


def box_radius(sigma: float) -> int:
    """Return the radius in pixels of the three box filters that make up `gaussian_blur`."""
    # A box filter of the width w has the variance (w^2 - 1) / 12.
    return max(int(np.rint((np.sqrt(4 * sigma**2 + 1) - 1) / 2)), 1)


def gaussian_blur(
    image: np.ndarray, sigma: float, outside: Literal["edge", "mean"] = "edge"
) -> np.ndarray:
    """Approximate a Gaussian blur by three box filters.

    Parameters
    ----------
    image : (H, W) ndarray
    sigma : float
        Standard deviation in pixels.
    outside : {"edge", "mean"}
        Values outside the image: its border pixels, repeated, or `NOISE_MEAN`.

    Returns
    -------
    (H, W) float32 ndarray
    """
    radius = box_radius(sigma)
    for index in range(6):
        # Blur along the columns, and transpose.
        blurred = np.empty(image.shape[::-1], dtype=np.float32)
        for lines in row_blocks(image.shape[1], BLUR_LINES):
            report((index + lines.start / image.shape[1]) / 6, STEP_LABEL)
            blurred[lines] = _box_filter(image[:, lines], radius, outside).T
        image = blurred
    return image


def _box_filter(image: np.ndarray, radius: int, outside: str) -> np.ndarray:
    """Return the (H, W) float64 means over 2 `radius` + 1 rows: each pixel with those above and below it.

    `outside` sets the rows outside of the image: "edge" repeats its border rows, "mean" is `NOISE_MEAN`.
    """
    low, high = (image[0], image[-1]) if outside == "edge" else (NOISE_MEAN, NOISE_MEAN)
    window = 2 * radius + 1
    prefix_sum = np.empty((len(image) + window, image.shape[1]))
    prefix_sum[: radius + 1], prefix_sum[-radius:] = low, high
    prefix_sum[radius + 1 : -radius] = image
    prefix_sum *= 1 / BLUR_QUANTUM
    np.rint(prefix_sum, out=prefix_sum)
    np.cumsum(prefix_sum, axis=0, out=prefix_sum)
    mean = prefix_sum[window:] - prefix_sum[:-window]
    mean *= BLUR_QUANTUM / window
    return mean


@lru_cache(maxsize=64)
def streak_moments(
    length: float,
    cell: float,
    high_pass: float,
    images: int = 1,
    average: int = 1,
    kernel: Kernel = "box",
) -> tuple[float, float]:
    """Compute the standard deviation and correlation of noise averaged along straight streamlines.

    The values are integrals over the power spectrum of the noise; nothing is sampled at random.

    Parameters
    ----------
    length : float
        Length of the streamlines in pixels.
    cell, high_pass : float
        Cell size and high-pass width of the noise, in pixels.
    images : int
        M, the number of streamlines through a pixel, at angles of multiples of pi / M.
    average : int
        Side in pixels of the squares that are averaged when the picture is downsampled.
    kernel : {"box", "taper", "ramp"}
        The weights of the samples (see `filter_kernel`). With "ramp", the streamlines are those of a field of
        odd degree: every other one runs in the direction opposite to its angle.

    Returns
    -------
    std : float
        Standard deviation of the mean along one streamline.
    correlation_sum : float
        Sum of the correlations of one of the M means with each of the others. The means are correlated
        because their streamlines share the noise around the pixel where they cross.

    Notes
    -----
    Let S(k) be the power spectrum of the noise at the frequency k, in cycles per pixel. The covariance of
    the means along two lines of length l through a point, in the directions of the unit vectors u and v, is
    the integral of S(k) sinc(l k.u) sinc(l k.v). For a lattice of bits with cells of side g, averaged over
    pixels, minus a Gaussian blur with the standard deviation s, S is
    g^2 / 4 [sinc(g cx) sinc(g cy) sinc(kx) sinc(ky) (1 - exp(-2 pi^2 s^2 k^2))]^2,
    where (kx, ky) are the components of k along the rows and columns of pixels, and (cx, cy) are its
    components along the axes of the lattice.
    Here it is averaged over all directions, and the integral is taken in polar coordinates. Tapered
    weights are a box filter of half the length applied twice: sinc(l k.u) becomes
    sinc(l k.u / 2)^2. The response of a ramp is complex, with the derivative of the sinc.
    """
    k, dk = np.linspace(0, 4 / (1 + cell), 700, retstep=True)
    angle = np.arange(1440) * np.pi / 1440
    kx, ky = np.outer(k, np.cos(angle)), np.outer(k, np.sin(angle))
    cosine, sine = np.cos(LATTICE_ANGLE), np.sin(LATTICE_ANGLE)
    cx, cy = cosine * kx - sine * ky, sine * kx + cosine * ky
    amplitude = np.sinc(cell * cx) * np.sinc(cell * cy) * np.sinc(kx) * np.sinc(ky)
    if average > 1:
        amplitude *= np.sinc(average * kx) * np.sinc(average * ky)
    power = (cell * NOISE_STD * amplitude) ** 2
    blur = np.exp(-2 * (np.pi * BLUR_FACTOR * high_pass * k) ** 2) if high_pass else 0.0
    weight = power.mean(axis=1) * (1 - blur) ** 2 * k * dk * (2 * np.pi / len(angle))
    response = _line_response(length * kx, kernel)
    variance = weight @ np.sum(np.abs(response) ** 2, axis=1)
    correlation_sum = 0.0
    for line in range(1, images):
        line_angle = np.pi * line / images
        projected = np.cos(line_angle) * kx + np.sin(line_angle) * ky
        other = _line_response((-1) ** line * length * projected, kernel)
        correlation_sum += weight @ np.sum((response * other.conj()).real, axis=1)
    return float(np.sqrt(variance)), float(correlation_sum / variance)


def _line_response(cycles: np.ndarray, kernel: Kernel) -> np.ndarray:
    """Return the factor by which the mean along a streamline changes the amplitude of a wave of noise.

    `cycles` is the number of cycles of the wave along the streamline. The result has the shape of `cycles`,
    and is complex for the kernel "ramp".
    """
    if kernel == "taper":
        return np.sinc(cycles / 2) ** 2
    if kernel == "box":
        return np.sinc(cycles)
    # The mean of (1 - x) exp(i a x) over x from -1 to 1, with a = pi cycles. Near 0, the sine and the
    # cosine cancel.
    a = np.pi * cycles
    small = np.abs(a) < 1e-3
    safe = np.where(small, 1.0, a)
    slope = np.where(small, -a / 3, (np.cos(safe) - np.sinc(safe / np.pi)) / safe)
    return np.sinc(cycles) + 1j * slope
