"""`PixelField`: the field at a list of pixels, and the neighbors that streamlines may step to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from typing import NamedTuple

import numpy as np

from ..core.progress import progress
from ..field.directional_field import evaluate_harmonics
from ..field.symmetry import FieldSymmetry
from ..projection.field_channel import FieldChannel, deviations
from ..projection.gbuffer import GBuffer
from ..projection.pixel_blocks import BLOCK_PIXELS, part_of, reported_blocks
from ..projection.pixel_neighbors import neighbor_masks, screen_jacobians

#: Offsets (dx, dy) of the 3 x 3 neighbors, in the order of the bits of `neighbor_masks`.
NEIGHBOR_OFFSETS = tuple((dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1))


class SeamSteps(NamedTuple):
    """Steps across the seams of a UV map, to surface neighbors that are elsewhere in the picture.

    The K steps are in ascending order of `source` and `bit`. A displacement d in the picture before the step,
    as a complex number, becomes `linear` d + `conjugate` conj(d) after the step.

    Attributes
    ----------
    source : (K,) int32 ndarray
        Pixel before the step, as an index into the list of pixels.
    bit : (K,) uint8 ndarray
        The step, as an index into `NEIGHBOR_OFFSETS`.
    target : (K,) int32 ndarray
        Pixel after the step.
    offset : (K,) complex64 ndarray
        The point that is reached, relative to the center of the target pixel, in pixels.
    linear, conjugate : (K,) complex64 ndarray
        Coefficients of the linear map of displacements.
    rotation : (K,) float32 ndarray
        Angle that a direction gains, relative to the frames of the field, in radians.
    """

    source: np.ndarray
    bit: np.ndarray
    target: np.ndarray
    offset: np.ndarray
    linear: np.ndarray
    conjugate: np.ndarray
    rotation: np.ndarray

    def displaced(self, step: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Return the (n,) complex64 displacements after crossing seams, given displacements before.

        `step` holds the index of the step of each displacement.
        """
        linear, conjugate = self.linear.take(step), self.conjugate.take(step)
        return linear * displacement + conjugate * displacement.conj()


@dataclass(frozen=True, eq=False)
class PixelField:
    """A field of one degree at a list of P pixels, with all that LIC needs and no reference to meshes.

    Attributes
    ----------
    degree : int
    width, height : int
        Size of the frame in pixels.
    pixel : (P,) int32 ndarray
        Flat indices into the frame, ascending, from the lower left.
    representation : (P,) complex64 ndarray
        z = rho exp(i N t), where rho is the magnitude and t is the angle of a member in the view plane:
        the plane perpendicular to the ray from the eye. The frame of angles is described in
        `GBuffer.representation`. z is 0 where the field is undefined.
    screen_jacobian : (P, 2) complex64 ndarray
        For each axis of the view plane: the displacement on screen, x + i y in pixels, of a step on the
        surface along that axis. A step that is parallel to the picture is one pixel long. For textures, the
        tangent plane takes the place of the view plane (`surface_texture.texel_field`).
    neighbor_mask : (P,) uint16 ndarray
        Neighbors that streamlines may step to. Bit i stands for `NEIGHBOR_OFFSETS[i]`. No bit is
        set where the field is undefined.
    channels : dict of FieldChannel to (P,) complex64 ndarray
        Further complex values of the field, in the frames of the view plane. If its directions are not at
        equal angles: the harmonics C_j (see `field.directional_field`). If the field distinguishes m
        families of lines: the representation, of degree N / m, of the line of family 0.
    gbuffer_index : slice or (P,) intp ndarray
        Indices of the pixels in the arrays of the G-buffer. A slice if the pixels are all or adjacent
        pixels of the G-buffer.
    seam_steps : SeamSteps or None
        Steps across seams, to pixels that are not neighbors in the picture. None if there are no seams.
    map_position : (P,) float32 ndarray or None
        Position in the color map of the color value at each pixel, 0 to 1; NaN where the surface has none.
        None if color values are not shown.
    """

    degree: int
    width: int
    height: int
    pixel: np.ndarray
    representation: np.ndarray
    screen_jacobian: np.ndarray
    neighbor_mask: np.ndarray
    channels: dict[FieldChannel, np.ndarray] = dataclass_field(default_factory=dict)
    gbuffer_index: slice | np.ndarray = dataclass_field(default_factory=lambda: slice(None))
    seam_steps: SeamSteps | None = None
    map_position: np.ndarray | None = None

    @property
    def harmonics(self) -> list[tuple[int, np.ndarray]]:
        """The harmonics of the field, as pairs (j, C_j) with (P,) complex64 C_j. Empty for a RoSy.

        See `field.directional_field`.
        """
        return deviations(self.channels)

    @property
    def symmetry(self) -> FieldSymmetry:
        """The symmetry of the field, which says which of its directions are opposite to each other."""
        return FieldSymmetry(self.degree, tuple(j for j, _ in self.harmonics))

    @property
    def line_count(self) -> int:
        """M, the number of lines through a pixel, and of member images.

        A line is a pair of opposite directions of the field, or one direction without an opposite.
        """
        return self.symmetry.line_count

    @property
    def family_count(self) -> int:
        """Number of families of lines. 1 if the field does not distinguish its lines."""
        return next((number for kind, number in self.channels if kind == "family"), 1)

    def part(self, extent: slice | np.ndarray) -> PixelField:
        """Return the field at the pixels `extent`, without `seam_steps`.

        The `neighbor_mask` of the result may refer to pixels that are left out.
        """
        part = part_of(self, extent)
        index = part.gbuffer_index
        if isinstance(index, slice):
            first = index.start or 0
            if isinstance(extent, slice):
                index = slice(first + extent.start, first + extent.stop)
            else:
                index = first + extent
        return replace(part, gbuffer_index=index, seam_steps=None)

    def member_direction(self, member: np.ndarray) -> np.ndarray:
        """Compute the directions of the field from the members of the RoSy that they deviate from.

        Parameters
        ----------
        member : (P,) complex ndarray
            Unit vectors in the frame of the view plane.

        Returns
        -------
        (P,) complex ndarray
            Unit vectors in the same frame. If the field is a RoSy, they are `member` itself.
        """
        if not self.harmonics:
            return member
        member = member.astype(np.complex128)
        return normalized(member * evaluate_harmonics(self.harmonics, member))

    def to_screen(self, member: np.ndarray, foreshorten: bool = False) -> np.ndarray:
        """Project directions from the view plane to the screen.

        Parameters
        ----------
        member : (P,) complex ndarray
            Unit vectors in the frame of the view plane.
        foreshorten : bool
            Keep the projected length instead of scaling it to 1.

        Returns
        -------
        (P,) complex64 ndarray
            x + i y: unit vectors or, with `foreshorten`, displacements in pixels of a step on the surface
            (see `screen_jacobian`).
        """
        # Double precision makes the float32 result the same with all versions of numpy.
        x, y = self.screen_jacobian.astype(np.complex128).T
        direction = x * member.real + y * member.imag
        return direction.astype(np.complex64) if foreshorten else normalized(direction)


def normalized(values: np.ndarray) -> np.ndarray:
    """Scale complex numbers to the modulus 1, as complex64. 0 stays 0."""
    values = values.astype(np.complex128)
    norm = np.sqrt(values.real**2 + values.imag**2)
    return np.divide(values, norm, out=values, where=norm > 0).astype(np.complex64)


def surface_pixel_field(gbuffer: GBuffer, degree: int, crease_angle: float | None) -> PixelField:
    """Extract the field of one degree from a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
    degree : int
    crease_angle : float or None
        Streamlines end where the normals of neighboring pixels differ by more than this angle,
        in radians. If None, they cross all creases.

    Returns
    -------
    PixelField
        The pixels whose mesh instances have a field of that degree.
    """
    count = len(gbuffer.pixel)
    with progress(0.0, 0.5):
        mask = neighbor_masks(gbuffer, crease_angle)
    jacobians = np.empty((2, count), dtype=np.complex64).T
    instance_selected = np.asarray(gbuffer.instance_degrees) == degree
    selected = np.empty(count, dtype=bool)
    for block in reported_blocks(count, "finding directions", 0.5, 0.9):
        jacobians[block] = screen_jacobians(gbuffer.part(block))
        selected[block] = instance_selected[gbuffer.instance_id[block]]
    selected = slice(None) if selected.all() else np.flatnonzero(selected)
    channels = {channel: values[selected] for channel, values in gbuffer.channels.items()}
    field = PixelField(
        degree=degree,
        width=gbuffer.camera.width,
        height=gbuffer.camera.height,
        pixel=gbuffer.pixel[selected],
        representation=gbuffer.representation[selected],
        screen_jacobian=jacobians[selected],
        neighbor_mask=mask[selected],
        channels=_channels_of_degree(channels),
        gbuffer_index=selected,
    )
    if field.representation.all():
        return field
    with progress(0.9, 1.0):
        return without_undefined_neighbors(field)


def _channels_of_degree(channels: dict[FieldChannel, np.ndarray]) -> dict[FieldChannel, np.ndarray]:
    """Return the channels that the fields of one degree have.

    `channels` holds the values of all channels of the G-buffer at the pixels of these fields. Where a field
    does not have a channel, the harmonic C_0 is 1, and all other channels are 0. A channel that has these
    values at all pixels is left out.
    """
    constant = ("deviation", 0)
    present = {
        channel for channel, values in channels.items() if channel != constant and values.any()
    }
    has_deviations = any(kind == "deviation" for kind, _ in present)
    if constant in channels and (has_deviations or (channels[constant] != 1).any()):
        present.add(constant)
    return {channel: values for channel, values in channels.items() if channel in present}


def entries_of_rows(pixel: np.ndarray, width: int, rows: tuple[int, int]) -> slice:
    """Return the slice of `pixel`, (P,) ascending flat indices, that is in a range of rows of the frame.

    `rows` is the first row, and the row after the last one.
    """
    first_pixels = np.array([max(rows[0], 0) * width, rows[1] * width])
    return slice(*np.searchsorted(pixel, first_pixels.astype(pixel.dtype)).tolist())


def pixel_window(pixel: np.ndarray, width: int, margin: int) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the indices of pixels in the smallest window around them with an empty margin.

    Parameters
    ----------
    pixel : (P,) int32 ndarray
        Flat indices of at least one pixel of a frame, ascending.
    width : int
        Width of the frame.
    margin : int
        Width of the margin on each side, in pixels.

    Returns
    -------
    cell : (P,) int32 ndarray
        Flat indices into the window.
    shape : (int, int)
        Rows and columns of the window.
    """
    row, column = np.divmod(pixel, np.int32(width))
    bottom, left = row[0] - margin, column.min() - margin
    columns = int(column.max() - left) + 1 + margin
    cell = (row - bottom) * np.int32(columns) + (column - left)
    return cell, (int(row[-1] - bottom) + 1 + margin, columns)


def without_undefined_neighbors(field: PixelField) -> PixelField:
    """Return a field whose `neighbor_mask` links only pixels where the field is defined.

    Pixels beyond the frame are undefined.
    """
    pixel, mask, width = field.pixel, field.neighbor_mask, field.width
    is_defined = np.zeros((field.height + 2, width + 2), dtype=bool)
    row, column = np.divmod(pixel, np.int32(width))
    is_defined[row + 1, column + 1] = field.representation != 0
    result = np.empty_like(mask)
    band_rows = max(BLOCK_PIXELS // width, 1)
    for rows in reported_blocks(field.height, "finding neighbors", size=band_rows):
        padded = is_defined[rows.start : rows.stop + 2].astype(np.uint16)
        # Three neighbors of a row are three bits, in the order of `NEIGHBOR_OFFSETS`.
        row_bits = padded[:, :-2] | padded[:, 1:-1] << 1 | padded[:, 2:] << 2
        open_bits = row_bits[:-2] | row_bits[1:-1] << 3 | row_bits[2:] << 6
        open_bits *= padded[1:-1, 1:-1]
        band = entries_of_rows(pixel, width, (rows.start, rows.stop))
        result[band] = mask[band] & open_bits[row[band] - rows.start, column[band]]
    return replace(field, neighbor_mask=result)


def nearest_member(field: PixelField, guiding_angle: float) -> np.ndarray:
    """Return the (P,) complex64 member nearest to a guiding angle, in the view plane (equations 3 and 4).

    It is a unit vector; 0 where the field is undefined. The angle is in radians. If two members are equally
    near, the one on the counter-clockwise side is returned. Equations and this choice are from Palacios and
    Zhang, IEEE TVCG 2011.
    """
    relative = field.representation.astype(np.complex128)
    relative *= np.exp(-1j * field.degree * guiding_angle)
    member = np.exp(1j * (np.angle(relative) / field.degree + guiding_angle))
    member[field.representation == 0] = 0
    return member.astype(np.complex64)


def rotated(values: np.ndarray, angle: float) -> np.ndarray:
    """Rotate complex numbers counter-clockwise by an angle in radians, as complex64."""
    return product(values, np.complex128(np.exp(1j * angle)))


def product(a: np.ndarray, b: np.ndarray | np.complex128) -> np.ndarray:
    """Multiply complex numbers, as complex64. They are rounded once, so all versions of numpy agree."""
    return (a.astype(np.complex128) * b).astype(np.complex64)


def all_members(field: PixelField, guiding_angle: float) -> list[np.ndarray]:
    """Return the N members of a field in the view plane, as (P,) complex64 arrays.

    They are unit vectors, 0 where the field is undefined. The first is the member nearest to the guiding
    angle, the others follow counter-clockwise, 2 pi / N apart.
    """
    nearest = nearest_member(field, guiding_angle)
    return [rotated(nearest, 2 * np.pi * k / field.degree) for k in range(field.degree)]
