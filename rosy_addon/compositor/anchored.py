"""Noise that stays where it is on a surface, however the surface, the camera or the lens move.

A cell of the noise is a cube of the space in which the body is at rest. Its size follows that of a
pixel there in octaves: at each pixel three of them are mixed, and as one comes nearer to the surface
finer ones take over from coarser ones, so that streaks neither swim nor change their width. That is
a solid texture made dynamic (Benard, Bousseau, Thollot, "Dynamic Solid Textures for Real-Time
Coherent Stylization", I3D 2009), of white noise, and mixed so that its variance stays.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..projection.gbuffer import GBuffer
from ..projection.rest import growth, rest_places
from .noise import BLUR, DEVIATION, MEAN, blur_reach, blurred, random_bits
from .streamlines import blocks

#: Parts of a pixel at which the cells are looked up: no two in a row or a column.
TAPS = ((-0.375, -0.125), (0.125, -0.375), (0.375, 0.125), (-0.125, 0.375))

#: A plane cuts a lattice of cubes into pieces of two thirds of their side's area, on average.
SIDE = 1.5**0.5

#: The lattice stands askew to the axes, along which people build: three rotations by odd angles.
ANGLES = (0.61, 1.13, 0.37)

#: So many octaves are mixed. With two, lines are a quarter thinner half way between them, and more
#: of them is new from one picture to the next; more than three make neither better.
OCTAVES = 3

#: How much larger or smaller than what is asked for cells may be, for their contrast to be evened out.
EVENED = (0.25, 4.0)

#: Octaves are counted from here, for hashes of whole numbers above 0.
LOWEST = 64


def surface_noise(
    gbuffer: GBuffer,
    grain: float,
    seed: int,
    channels: int,
    *,
    density: float,
    high_pass: float,
    pixel: float = 0.0,
    smallest: float = 0.0,
) -> np.ndarray:
    """Noise anchored to the surfaces of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        With its bodies.
    grain : float
        Side of a cell as it is seen, about, pixels.
    seed : int
    channels : int
        1 or 3, independent of each other.
    density : float
        Share of cells that are bright.
    high_pass : float
        Pixels; variations broader than about this are taken out. 0 leaves the noise white.
    pixel : float
        Blender units: a cell is as wide as it would be seen where a pixel is as wide. 0: where it is.
    smallest : float
        Side that such a cell is seen of at least, pixels.

    Returns
    -------
    (P, channels) float32 ndarray
        With mean `MEAN`, as `image_noise`.
    """
    places = rest_places(gbuffer)
    larger = how_much_larger(gbuffer, places.size, pixel, smallest / grain)
    level = np.log2(np.maximum(places.size * larger, 1e-30) * np.float32(grain * SIDE))
    identity = identities(gbuffer.names)[gbuffer.body]
    total = np.zeros((channels, len(gbuffer.pixel)), dtype=np.float32)
    for block in blocks(len(gbuffer.pixel)):
        part = places.block(block)
        lattice = [_turned(part.at(*tap)) for tap in TAPS]
        _add_cells(total[:, block], lattice, level[block], identity[block], seed, density)
    # Means over so many cells vary as those over as many of the size that is asked for.
    spread = np.float32(DEVIATION / np.sqrt(density * (1 - density)) / len(TAPS))
    total *= spread / np.sqrt(np.clip(larger, *EVENED))
    if high_pass:
        for values in total:
            values -= _broad(gbuffer, values, BLUR * high_pass)
    return np.ascontiguousarray(total.T) + np.float32(MEAN)


def how_much_larger(
    gbuffer: GBuffer, size: np.ndarray, pixel: float, least: float
) -> np.ndarray | np.float32:
    """By how much things are larger than if they were counted in pixels as these are seen.

    Parameters
    ----------
    gbuffer : GBuffer
        With its bodies.
    size : (P,) float32 ndarray
        `RestPlaces.size`.
    pixel : float
        Blender units that they take for a pixel; 0 takes pixels as they are.
    least : float
        That much at least.

    Returns
    -------
    (P,) float32 ndarray, or 1
    """
    if not pixel:
        return np.float32(1)
    own = np.array([pixel / growth(body.matrix) for body in gbuffer.bodies], dtype=np.float32)
    return np.maximum(own[gbuffer.body] / np.maximum(size, 1e-30), np.float32(least))


def _add_cells(
    total: np.ndarray,
    lattice: Sequence[np.ndarray],
    level: np.ndarray,
    identity: np.ndarray,
    seed: int,
    density: float,
) -> None:
    """Add the bits of the cells of all octaves to (K, n) sums.

    Parameters
    ----------
    total : (K, n) float32 ndarray
        Changed.
    lattice : sequence of (3, n) float32 ndarray
        Places at which cells are looked up.
    level : (n,) float32 ndarray
        The octave of the size of cell that is asked for, with its fraction.
    identity : (n,) uint32 ndarray
        Of the bodies.
    seed, density
        As of `surface_noise`.
    """
    finest = np.floor(level - np.float32(OCTAVES / 2 - 1))
    for number in range(OCTAVES):
        octave = finest + np.float32(number)
        weight = octave_shares(octave - level)
        scale = np.exp2(-octave)
        turn = (octave + LOWEST).astype(np.int32)
        for place in lattice:
            cell = np.floor(place * scale).astype(np.int32)
            for channel, out in enumerate(total):
                bits = random_bits((*cell, turn, identity), seed, channel, density)
                out += weight * (bits - np.float32(density))


def octave_shares(away: np.ndarray) -> np.ndarray:
    """How much octaves have to say that are so far from that of the size which is asked for.

    The squares of those of all `OCTAVES` sum to 1, so that the variance is that of one.
    """
    return np.cos(away * np.float32(np.pi / OCTAVES)) * np.float32(np.sqrt(2 / OCTAVES))


def identities(names: Sequence[str]) -> np.ndarray:
    """(B,) uint32: numbers for bodies, the same from picture to picture.

    By their names; instances of one have numbers of their own, in their order.
    """
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        found.append(zlib.crc32(f"{name} {seen[name]}".encode()))
        seen[name] += 1
    return np.array(found, dtype=np.uint32)


def lattice_axes() -> np.ndarray:
    """(3, 3) float32 rows: the axes of the lattice in the space of a body at rest."""
    turn = np.eye(3)
    for axis, angle in enumerate(ANGLES):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3)
        step[one, one] = step[other, other] = np.cos(angle)
        step[one, other], step[other, one] = -np.sin(angle), np.sin(angle)
        turn = step @ turn
    return turn.astype(np.float32)


def _turned(place: np.ndarray) -> np.ndarray:
    """(3, P) places along the axes of the lattice."""
    x, y, z = place
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in lattice_axes()])


def _broad(gbuffer: GBuffer, values: np.ndarray, deviation: float) -> np.ndarray:
    """(P,) what is left of values after a blur over the pixels that are seen."""
    row, column = np.divmod(gbuffer.pixel, np.int32(gbuffer.camera.width))
    # With as much of nothing around as the blur reaches.
    margin = 3 * blur_reach(deviation)
    low, left = int(row[0]) - margin, int(column.min()) - margin
    shape = int(row[-1]) - low + 1 + margin, int(column.max()) - left + 1 + margin
    place = (row - low) * np.int32(shape[1]) + (column - left)
    sums, seen = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
    sums.reshape(-1)[place], seen.reshape(-1)[place] = values, 1
    sums, seen = blurred(sums, deviation), blurred(seen, deviation)
    return sums.reshape(-1).take(place) / np.maximum(seen.reshape(-1).take(place), 1e-3)
