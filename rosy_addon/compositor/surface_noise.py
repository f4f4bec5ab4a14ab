"""Noise anchored to surfaces: solid white noise whose cells keep their size on screen.

A cell of the noise is a cube in the rest space of a mesh instance, so streaks do not slide over the
surface when the surface or the camera moves. The cells come in octaves of size. At each pixel three
octaves are blended around the one that matches the size of a pixel there, so that streaks also keep
their width on screen when the view zooms. The method is that of Benard, Bousseau and Thollot,
"Dynamic Solid Textures for Real-Time Coherent Stylization" (I3D 2009), with white noise and with
weights that keep the variance constant.
"""

import zlib
from collections import Counter
from collections.abc import Sequence

import numpy as np

from ..core.progress import progress
from ..projection.gbuffer import GBuffer
from ..projection.pixel_blocks import part_of, reported_blocks
from ..projection.rest_coordinates import RestCoordinates, matrix_scale, rest_coordinates
from .image_noise import (
    BLUR_FACTOR,
    NOISE_MEAN,
    NOISE_STD,
    NoiseSettings,
    box_radius,
    gaussian_blur,
    hash_bits,
)
from .pixel_field import pixel_window

#: Offsets (dx, dy) in pixels of the samples of a pixel from its center, on a rotated grid.
SUBPIXEL_OFFSETS = ((-0.375, -0.125), (0.125, -0.375), (0.375, 0.125), (-0.125, 0.375))

#: Side of a cube relative to the side of a cell on the surface. A plane cuts a lattice of unit
#: cubes into pieces with the mean area 2 / 3.
LATTICE_SCALE = 1.5**0.5

#: Rotation of the lattice about x, y and z, radians. Many models have faces that are parallel to
#: the axes, on which an unrotated lattice would be visible.
LATTICE_ANGLES = (0.61, 1.13, 0.37)

#: Number of octaves that are blended. With two, lines are a quarter thinner halfway between
#: octaves, and the noise changes more from one picture to the next. More than three improve
#: neither.
OCTAVES = 3

#: Range of the ratio of the size of cells to the parameter `cell` of `surface_noise`. Within it, the contrast
#: is corrected for the ratio.
CONTRAST_SCALE_RANGE = (0.25, 4.0)

#: Radius of curvature on screen, in cells, below which a feature is small; see `feature_scale`.
FEATURE_CELLS = 32.0

#: Maximum number of bits of the index of a cell.
MAX_CELL_BITS = 28

#: Label of all steps.
STEP_LABEL = "making noise"

#: Added to octave indices, so that positive integers are hashed.
OCTAVE_OFFSET = 64


def surface_noise(
    gbuffer: GBuffer,
    settings: NoiseSettings,
    pixel: float = 0.0,
    smallest: float = 0.0,
    detail: float = 0.0,
    curvature: np.ndarray | None = None,
) -> np.ndarray:
    """Make noise that is anchored to the surfaces of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        Its `instances` must be set.
    settings : NoiseSettings
        Settings of the cells. Cells of three sizes around the given side are blended.
    pixel : float
        Size in Blender units that replaces a pixel as the unit of the side of a cell: cells then have a fixed
        size on the surface. 0 gives cells of a fixed size on screen.
    smallest : float
        Minimum side of a cell on screen, in pixels. Only used if `pixel` is not 0.
    detail : float
        Cells on small features of the surface are smaller by up to this fraction (`feature_scale`).
    curvature : (P,) float32 ndarray, optional
        Curvature of the features (`field.feature_curvature`), in 1 / Blender unit of object space. Required
        if `detail` is not 0.

    Returns
    -------
    (P, channels) float32 ndarray
        The mean is `NOISE_MEAN`, as for `image_noise`.
    """
    cell, seed, channels, density, high_pass = settings
    with progress(0.0, 0.3):
        rest = rest_coordinates(gbuffer)
    units = instance_units(gbuffer, pixel)
    instance_hash = instance_hashes([instance.surface.name for instance in gbuffer.instances])
    total = np.zeros((channels, len(gbuffer.pixel)), dtype=np.float32)
    for block in reported_blocks(len(gbuffer.pixel), STEP_LABEL, 0.3, 0.6):
        block_rest = part_of(rest, (..., block))
        instance_id = gbuffer.instance_id[block]
        scale = cell_scale(units, instance_id, block_rest.pixel_size, smallest / cell)
        if detail:
            scale = scale * feature_scale(curvature[block], block_rest.pixel_size, cell, detail)
        size = np.maximum(block_rest.pixel_size * scale, 1e-30) * np.float32(cell)
        block_hash = instance_hash[instance_id]
        solid_noise(block_rest, size, block_hash, seed, density, out=total[:, block])
        # The variance of a mean along a streamline is proportional to the size of cells. After the division
        # it is the same as for cells of the size `cell`.
        total[:, block] /= np.sqrt(np.clip(scale, *CONTRAST_SCALE_RANGE))
    del rest  # as large as all other arrays together
    if high_pass:
        with progress(0.6, 1.0):
            _high_pass(gbuffer, total, BLUR_FACTOR * high_pass)
    return np.add(total.T, np.float32(NOISE_MEAN), order="C")


def solid_noise(
    rest: RestCoordinates,
    cell_size: np.ndarray,
    instance_hash: np.ndarray,
    seed: int,
    density: float,
    out: np.ndarray,
) -> None:
    """Make noise in the rest space of meshes, averaged over pixels.

    Parameters
    ----------
    rest : RestCoordinates
        Rest coordinates of n pixels.
    cell_size : (n,) float32 ndarray
        Side of a cell on the surface, in Blender units of rest space.
    instance_hash : (n,) uint32 ndarray
        Number that selects the noise of the mesh instance at each pixel, from `instance_hashes`.
    seed : int
        Seed of the noise.
    density : float
        Fraction of cells that are bright.
    out : (K, n) float32 ndarray
        Output: independent channels with the mean 0. The standard deviation of cells is `NOISE_STD`.
    """
    # Base-2 logarithm of the size of cells.
    level = np.log2(cell_size * np.float32(LATTICE_SCALE))
    lattice = [_to_lattice_space(rest.at_offset(*tap)) for tap in SUBPIXEL_OFFSETS]
    # Cells that are too small for float32 coordinates would have indices that are too large for integers.
    farthest = max(float(np.abs(position).max(initial=0)) for position in lattice)
    level = np.maximum(level, np.float32(np.log2(max(farthest, 1e-30)) - MAX_CELL_BITS))
    finest = np.floor(level - np.float32(OCTAVES / 2 - 1))
    out[...] = 0
    for index in range(OCTAVES):
        octave = finest + np.float32(index)
        weight = octave_weights(octave - level)
        scale = np.exp2(-octave)
        octave_index = (octave + OCTAVE_OFFSET).astype(np.int32)
        for position in lattice:
            cell = np.floor(position * scale).astype(np.int32)
            for channel, total in enumerate(out):
                bits = hash_bits((*cell, octave_index, instance_hash), seed, channel, density)
                total += weight * (bits - np.float32(density))
    out *= np.float32(NOISE_STD / np.sqrt(density * (1 - density)) / len(SUBPIXEL_OFFSETS))


def instance_units(gbuffer: GBuffer, unit: float) -> np.ndarray | None:
    """Convert a length from world space to the object space of each of B mesh instances.

    Parameters
    ----------
    gbuffer : GBuffer
        Its `instances` must be set.
    unit : float
        A length in Blender units of world space; 0 if lengths are in pixels.

    Returns
    -------
    (B,) float32 ndarray or None
        The same length in the object space of each instance. None if `unit` is 0.
    """
    if not unit:
        return None
    units = [unit / matrix_scale(instance.matrix) for instance in gbuffer.instances]
    return np.array(units, dtype=np.float32)


def cell_scale(
    units: np.ndarray | None, instance_id: np.ndarray, size: np.ndarray, min_scale: float
) -> np.ndarray | np.float32:
    """Compute the factor from lengths of a look to lengths in pixels on screen, at each pixel.

    It is 1 if lengths are in pixels. Otherwise the unit of lengths has a fixed size on the surface.

    Parameters
    ----------
    units : (B,) float32 ndarray or None
        The unit of lengths in the object space of each mesh instance (`instance_units`); None if lengths are
        in pixels.
    instance_id : (n,) int ndarray
        Index of the mesh instance of each of n pixels.
    size : (n,) float32 ndarray
        Size of a pixel on the surface at each pixel, in Blender units of rest space.
    min_scale : float
        Lower bound of the factor.

    Returns
    -------
    (n,) float32 ndarray, or 1 if lengths are in pixels
    """
    if units is None:
        return np.float32(1)
    return np.maximum(units[instance_id] / np.maximum(size, 1e-30), np.float32(min_scale))


def feature_scale(
    curvature: np.ndarray, pixel_size: np.ndarray, cell: float, detail: float
) -> np.ndarray:
    """Compute the factor, up to 1, by which cells are scaled down on small features of the surface.

    Where the radius of curvature on screen is below `FEATURE_CELLS` cells, the factor is proportional to it.

    Parameters
    ----------
    curvature : (n,) float32 ndarray
        Curvature in 1 / Blender unit of object space.
    pixel_size : (n,) float32 ndarray
        Size of a pixel on the surface, in Blender units of rest space.
    cell : float
        Side of a cell in pixels.
    detail : float
        The factor is at least 1 - detail.

    Returns
    -------
    (n,) float32 ndarray
    """
    bend = curvature * pixel_size * np.float32(FEATURE_CELLS * cell)
    return 1 / np.clip(bend, 1, np.float32(1 / (1 - detail)))


def octave_weights(octave_offset: np.ndarray) -> np.ndarray:
    """Compute the weights of octaves of noise in the blend.

    `octave_offset` is the base-2 logarithm of the cell size of the octave, relative to the cell size at the pixel.

    The squares of the weights of the `OCTAVES` octaves sum to 1, so the variance of the blend is
    the same as for a single octave.
    """
    return np.cos(octave_offset * np.float32(np.pi / OCTAVES)) * np.float32(np.sqrt(2 / OCTAVES))


def instance_hashes(names: Sequence[str]) -> np.ndarray:
    """Return the (B,) uint32 hashes of mesh instances, stable from picture to picture.

    A hash depends on the name of an instance and, if several instances have that name, on its
    position among them. The name of a mesh file is its path; the folder is ignored.
    """
    counts: Counter[str] = Counter()
    hashes = []
    for name in (name.replace("\\", "/").rpartition("/")[2] for name in names):
        hashes.append(zlib.crc32(f"{name} {counts[name]}".encode(errors="surrogatepass")))
        counts[name] += 1
    return np.array(hashes, dtype=np.uint32)


def lattice_axes() -> np.ndarray:
    """Return the (3, 3) float32 axes of the lattice in the rest space of a mesh instance, as rows."""
    rotation = np.eye(3)
    for axis, angle in enumerate(LATTICE_ANGLES):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        axis_rotation = np.eye(3)
        axis_rotation[first, first] = axis_rotation[second, second] = np.cos(angle)
        axis_rotation[first, second], axis_rotation[second, first] = -np.sin(angle), np.sin(angle)
        rotation = axis_rotation @ rotation
    return rotation.astype(np.float32)


def _to_lattice_space(position: np.ndarray) -> np.ndarray:
    """Return (3, P) positions in the space of the lattice, given (3, P) positions in rest space."""
    x, y, z = position
    return np.stack([row[0] * x + row[1] * y + row[2] * z for row in lattice_axes()])


def _high_pass(gbuffer: GBuffer, channels: np.ndarray, sigma: float) -> None:
    """Subtract a Gaussian blur of each of (K, P) `channels` from the channel, in place.

    `sigma` is its standard deviation in pixels. Pixels without a surface are ignored.
    """
    # The empty margin is as wide as the support of the blur.
    cell, shape = pixel_window(gbuffer.pixel, gbuffer.camera.width, 3 * box_radius(sigma))

    def blurred_image(values: np.ndarray | None) -> np.ndarray:
        """Return the blurred image of `values` (by default 1) at the pixels and 0 elsewhere, flat."""
        image = np.zeros(shape, dtype=np.float32)
        image.reshape(-1)[cell] = 1 if values is None else values
        return gaussian_blur(image, sigma).reshape(-1)

    images = len(channels) + 1
    with progress(0.0, 1 / images):
        weight = np.maximum(blurred_image(None).take(cell), 1e-3)
    for number, channel in enumerate(channels, start=1):
        with progress(number / images, (number + 1) / images):
            channel -= blurred_image(channel).take(cell) / weight
