"""The covering surface of a field, and a compact table of its states for tracing streamlines.

A *state* is a pixel and a *sheet* k. Sheet k is the direction at the angle t + 2 pi k / S, where t is the
angle of the member nearest to the guiding angle (a setting of the look: an angle in the picture that selects
the first member), and S is N for even N and 2 N for odd N. The states form an S-fold covering of the surface.
On it the field is a single vector field, without jumps from one member to another. A step from (p, k) to the
pixel q leads to the sheet

    k' = k + round((t(p) - t(q)) S / 2 pi)  mod S,

which is the best match of all members in closed form. Sheets k and k + S / 2 are the two directions
of one streamline, so M = S / 2 *lines* pass through a pixel, one per member image.

Directions that are not a RoSy are matched like the members of the RoSy that they deviate from. If
they have no opposites, the forward and backward directions are two separate coverings of N sheets,
and a streamline stays on one of them. A full turn then passes N sheets, not S.

Tracing is bound by memory accesses, not by arithmetic. So the row of a state in the table is short.
Pixels are stored as *cells* of a rectangular window of the frame with an empty border. The index of a
neighbor is then the index of the cell plus a constant, and no table of neighbors is read.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..core.deterministic_trig import cos_sin, vector_angle
from ..field.directional_field import evaluate_harmonics
from ..projection.pixel_blocks import reported_blocks
from .flow import forward_share
from .look_units import PixelLook
from .pixel_field import NEIGHBOR_OFFSETS, PixelField, SeamSteps, normalized, pixel_window

#: The largest value of an integer in `Covering.state_table`.
INT16_MAX = 32767

#: Squared lengths between these bounds are normal float32 numbers: they do not underflow or overflow.
MIN_SQUARE, MAX_SQUARE = np.float32(1e-30), np.float32(1e30)

#: Length in pixels of a foreshortened step, below which derivatives of the noise count less.
SHORT_STEP = 0.125

#: `PixelField.neighbor_mask` of a pixel that is linked to all neighbors.
ALL_NEIGHBORS = 0b111_111_111

#: The cell that streamlines stay in after their end: a corner of the border.
SINK_CELL = 0


class SeamTable:
    """A lookup table of the steps between pixels that cross a seam of a texture (`pixel_field.SeamSteps`).

    Parameters
    ----------
    steps : SeamSteps
    cell_of_pixel : (P,) int32 ndarray
        The cell of each pixel.
    sheets_per_turn : int
        Sheets that a full turn passes; see `Covering`.
    """

    def __init__(self, steps: SeamSteps, cell_of_pixel: np.ndarray, sheets_per_turn: int) -> None:
        self.steps = steps
        # Cells ascend with pixels, so the keys are sorted.
        self._key = cell_of_pixel.take(steps.source).astype(np.int64) * 9 + steps.bit
        self.target_cell = cell_of_pixel.take(steps.target)
        self.sheet_shift = steps.rotation * np.float32(sheets_per_turn / (2 * np.pi))

    def find(self, cell: np.ndarray, bit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find which steps of streamlines cross a seam.

        Parameters
        ----------
        cell : (n,) ndarray of int
            Cells where the steps start.
        bit : (n,) ndarray of int
            Which neighbor each step leads to: the number of its bit in the neighbor mask, 0 to 8.

        Returns
        -------
        crosses : (n,) bool ndarray
            Whether the step crosses a seam.
        seam : (k,) intp ndarray
            For each step that crosses a seam, in the same order: its index in the `SeamSteps`.
        """
        key = cell.astype(np.int64) * 9 + bit
        place = np.minimum(np.searchsorted(self._key, key), len(self._key) - 1)
        crosses = self._key.take(place) == key
        return crosses, place[crosses]


@dataclass(frozen=True, eq=False)
class Covering:
    """The covering surface of a pixel field: all its states (a pixel and one direction of the field there).

    There are P pixels, C cells and S sheets. The *index* of the state of cell c and sheet k is k C + c: its
    row in `state_table`. Line l of a cell is the pair of its opposite sheets l and l + S / 2, and has the
    index l C + c.

    Attributes
    ----------
    line_count : int
        M = S / 2, the number of lines (pairs of opposite directions) through a cell.
    sheets_per_turn : int
        Sheets that a full turn passes: S, or N if forward and backward directions are two coverings.
    width : int
        Number of cells in a row of the window. The cell above the cell c is c + width.
    cell_of_pixel : (P,) int32 ndarray
        The cell of each pixel.
    packed_phase : (C,) float32 ndarray
        t S / (2 pi) + 2, where S is `sheets_per_turn`, and t is the angle in radians of the member nearest
        to the guiding angle, measured from that angle. The result is from 1 to 3, so the last nine bits of
        the mantissa are below 2e-4. They hold the neighbor mask instead (see `unpack_neighbor_mask`): every
        step reads both, so they are stored together.
    state_table : (S C, 2 + 2 K) int16 ndarray
        The step on screen, x and y; then for each of the K channels, the noise and its derivative to the
        left of the step.
    state_scales : (3,) tuple of float
        Factors by which integers of the table are multiplied: for the step (in pixels), for the noise, and
        for its derivative.
    seams : SeamTable or None
        Steps across the seams of a texture; None if there are no seams.
    has_directions : bool
        Whether the directions of the field have no opposites in the field (as for a RoSy of odd degree).
    """

    line_count: int
    sheets_per_turn: int
    width: int
    cell_of_pixel: np.ndarray
    packed_phase: np.ndarray
    state_table: np.ndarray
    state_scales: tuple[float, float, float]
    seams: SeamTable | None = None
    has_directions: bool = False

    @property
    def cell_count(self) -> int:
        """C, the number of cells."""
        return len(self.packed_phase)

    @property
    def noise_channels(self) -> int:
        """K, the number of noise channels."""
        return self.state_table.shape[1] // 2 - 1

    def sheet_offsets(self, max_winding: int) -> tuple[np.ndarray, int]:
        """Tabulate the index of the first state of each sheet, for sheet numbers beyond a full turn, too.

        Parameters
        ----------
        max_winding : int
            Maximum number of full turns that a streamline makes, clockwise or counter-clockwise.

        Returns
        -------
        offsets : (n,) intp ndarray
            A table of 2 `max_winding` turns. Element k, plus any multiple of `sheets_per_turn`, is the index
            of the first state of sheet k. A streamline starts in the middle of the table. If opposite
            directions are a separate covering, a second table for that covering follows.
        backward : int
            Offset in the table: the opposite of the sheet at element i is at element i + backward.
        """
        forward = np.tile(np.arange(self.sheets_per_turn) * self.cell_count, 2 * max_winding)
        if self.sheets_per_turn == 2 * self.line_count:
            return forward, self.line_count
        return np.concatenate([forward, forward + self.line_count * self.cell_count]), len(forward)

    def fold_to_line(self, state: np.ndarray) -> np.ndarray:
        """Replace (n,) indices of states by the indices of their lines (pairs of opposite states), in place.

        The same array is returned.
        """
        entry_count = self.line_count * self.cell_count
        return np.subtract(state, entry_count, out=state, where=state >= entry_count)

    def is_along_member(self, state: np.ndarray) -> np.ndarray:
        """Return an (n,) bool mask: whether each state is a member of a field without opposites.

        `state` holds (n,) indices of states. The other states are the opposite directions of members.
        """
        sheet = state // np.int32(self.cell_count)
        if self.sheets_per_turn == 2 * self.line_count:
            return sheet % 2 == 0
        return sheet < self.line_count

    def forward_share(self, state: np.ndarray) -> np.ndarray:
        """Return the fraction of the filter kernel that moves along the direction of each of (n,) states.

        `state` holds indices of states. The result is float32, 0 to 1; the rest of the kernel moves in the
        opposite direction (streaks drift by moving kernels, see `flow`). In a field without opposites, the
        kernel moves along the directions of the field. In other fields, the fraction depends on the angle to
        the guiding angle; on a texture with seams, where angles in different charts cannot be compared, it is
        0.5.
        """
        if self.has_directions:
            return self.is_along_member(state).astype(np.float32)
        if self.seams is not None:
            return np.full(len(state), 0.5, dtype=np.float32)
        sheet, cell = np.divmod(state, np.int32(self.cell_count))
        spacing = np.float32(2 * np.pi / self.sheets_per_turn)
        angle = (self.packed_phase.take(cell) - np.float32(2) + sheet) * spacing
        return forward_share(np.cos(angle))

    def neighbor_lines(
        self, line: np.ndarray, offsets: Sequence[tuple[int, int]]
    ) -> list[np.ndarray]:
        """Find in neighboring cells the lines that continue the given lines.

        A line is a pair of opposite directions of the field in a cell.

        Parameters
        ----------
        line : (n,) intp ndarray
            Indices of lines.
        offsets : sequence of (int, int)
            Offset of each neighbor: pixels forward along the line, and pixels to the left of it. Forward is
            the direction of the sheet with the number of the line. The sum is rounded to a neighboring pixel.

        Returns
        -------
        list of (n,) intp ndarray
            The indices of the lines that match, one array for each offset. Where streamlines may not step to
            the neighbor, the line is in `SINK_CELL`, an empty cell of the border.
        """
        sheet, cell = np.divmod(line, self.cell_count)
        step = self.state_table.take(line, axis=0)[:, :2].astype(np.float32)
        x, y = step[:, 0], step[:, 1]
        norm = np.sqrt(x * x + y * y)
        norm[norm == 0] = 1
        x, y = x / norm, y / norm
        phase_bits = self.packed_phase.take(cell)
        mask = unpack_neighbor_mask(phase_bits)
        neighbors = []
        for forward, left in offsets:
            column = np.rint(forward * x - left * y).astype(np.intp)
            row = np.rint(forward * y + left * x).astype(np.intp)
            linked = mask >> (column + 3 * row + 4).astype(np.uint32) & 1
            neighbor = np.where(linked, cell + row * self.width + column, SINK_CELL)
            matching = np.rint(phase_bits - self.packed_phase.take(neighbor)).astype(np.intp)
            neighbors.append((sheet + matching) % self.line_count * self.cell_count + neighbor)
        return neighbors


def member_lines(field: PixelField) -> np.ndarray:
    """Return the (M,) intp number of the line of each member image.

    Lines are pairs of opposite sheets of the covering surface, numbered from 0 to M - 1. For an even degree,
    line i is member i of the field and its opposite. For an odd degree N, sheet 2 i is member i of the field,
    and sheet 2 i - N is the opposite direction.
    """
    spacing = field.symmetry.sheets_per_turn // field.degree
    return np.arange(field.line_count) * spacing % field.line_count


def build_covering(field: PixelField, look: PixelLook, noise: np.ndarray) -> Covering:
    """Build the covering surface of a pixel field. Sheet 0 is the member nearest to the guiding angle.

    Parameters
    ----------
    field : PixelField
        It has at least one pixel.
    look : PixelLook
        Its `guiding_angle` and `is_on_surface` are used.
    noise : (P, K) float32 ndarray
        Noise of the K channels, which streamlines average.

    Returns
    -------
    Covering
    """
    degree, (count, channels) = field.degree, noise.shape
    line_count, per_turn = field.line_count, field.symmetry.sheets_per_turn
    cell_of_pixel, (height, width) = pixel_window(field.pixel, field.width, 1)
    cell_count = height * width
    # Streamlines that have ended stay in `SINK_CELL`.
    packed_phase = _pack_neighbor_mask(np.full(cell_count, 2, dtype=np.float32), 1 << 4)
    cell_noise = np.zeros((cell_count, channels), dtype=np.float32)
    cell_noise[cell_of_pixel] = noise
    max_noise = max(float(np.abs(noise).max()), 1e-30)
    max_slope = 2 * max_noise / (SHORT_STEP if look.is_on_surface else 1.0)
    maxima = (1.0, max_noise, max_slope)
    quantize = [np.float32(INT16_MAX / largest) for largest in maxima]
    state_table = np.zeros((2 * line_count, cell_count, 2 + 2 * channels), dtype=np.int16)
    for block in reported_blocks(count, "finding directions"):
        block_cells = cell_of_pixel[block]
        right, up = _noise_gradient(cell_noise, block_cells, width, field.neighbor_mask[block])
        right, up = right * quantize[2], up * quantize[2]
        cell_phase, x, y = _nearest_member(field.representation[block], degree, look.guiding_angle)
        cell_phase *= np.float32(per_turn / (2 * np.pi))
        cell_phase += np.float32(2)
        packed_phase[block_cells] = _pack_neighbor_mask(cell_phase, field.neighbor_mask[block])
        rows = np.empty((len(block_cells), 2 + 2 * channels), dtype=np.int16)
        rows[:, 2::2] = np.rint(noise[block] * quantize[1])
        for sheet in range(line_count):
            angle = look.guiding_angle + 2 * np.pi * sheet / per_turn
            direction = _apply_harmonics(field, block, *_rotate(x, y, angle))
            step_x, step_y = _to_screen(field, block, *direction, look.is_on_surface)
            slope_x, slope_y = step_x, step_y
            if look.is_on_surface:
                (step_x, step_y), (slope_x, slope_y) = _surface_steps(step_x, step_y)
            rows[:, 3::2] = np.rint(up * slope_x[:, None] - right * slope_y[:, None])
            step_x, step_y = step_x * quantize[0], step_y * quantize[0]
            rows[:, 0], rows[:, 1] = np.rint(step_x, out=step_x), np.rint(step_y, out=step_y)
            scatter_rows(state_table[sheet], block_cells, rows)
            # For the opposite direction, all columns except the noise are negated.
            for column in (0, 1, *range(3, rows.shape[1], 2)):
                np.negative(rows[:, column], out=rows[:, column])
            scatter_rows(state_table[sheet + line_count], block_cells, rows)
    seams = None
    if field.seam_steps is not None and len(field.seam_steps.source):
        seams = SeamTable(field.seam_steps, cell_of_pixel, per_turn)
    return Covering(
        line_count=line_count,
        sheets_per_turn=per_turn,
        width=width,
        cell_of_pixel=cell_of_pixel,
        packed_phase=packed_phase,
        state_table=state_table.reshape(-1, state_table.shape[2]),
        state_scales=tuple(largest / INT16_MAX for largest in maxima),
        seams=seams,
        has_directions=not field.symmetry.has_opposites,
    )


def _surface_steps(x: np.ndarray, y: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return steps shortened to at most one pixel along x and y, and these steps over their squared length.

    `x` and `y` are the components of (n,) steps in the picture, in pixels. The result is two (x, y) pairs:
    the shortened steps s, and s / |s|^2, where |s| counts as at least `SHORT_STEP`. The second pair is for the
    derivative of the noise to the left: it replaces the unit vector s / |s|, because `streamline_batch`
    multiplies the derivative by `streamline_tracing.lateral_offset`, which has a factor |s|.
    """
    scale = 1 / np.maximum(np.maximum(np.abs(x), np.abs(y)), np.float32(1))
    x, y = x * scale, y * scale
    square = np.maximum(x * x + y * y, np.float32(SHORT_STEP**2))
    return [(x, y), (x / square, y / square)]


def unpack_neighbor_mask(packed_phase: np.ndarray) -> np.ndarray:
    """Return the (n,) uint32 neighbor masks of cells, from elements of `Covering.packed_phase`."""
    return packed_phase.view(np.uint32) & np.uint32(ALL_NEIGHBORS)


def _pack_neighbor_mask(phase: np.ndarray, bits: np.ndarray | int) -> np.ndarray:
    """Return (n,) float32 phases with neighbor masks (`bits`) in the last nine bits of the mantissa."""
    return (phase.view(np.uint32) & ~np.uint32(ALL_NEIGHBORS) | bits).view(np.float32)


def scatter_rows(table: np.ndarray, index: np.ndarray, rows: np.ndarray) -> None:
    """Assign ``table[index] = rows``. Rows are copied as scalars, which is faster."""
    rows_as_scalars(table)[index] = rows_as_scalars(rows)


def rows_as_scalars(table: np.ndarray) -> np.ndarray:
    """Return an (n,) view of an (n, k) array, with each row of 8 or 16 bytes as one complex scalar."""
    scalar_type = np.complex64 if table.shape[1] * table.itemsize == 8 else np.complex128
    return table.view(scalar_type)[:, 0]


def _noise_gradient(
    noise: np.ndarray, cells: np.ndarray, width: int, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return two (n, K) central differences of the (C, K) noise at n cells: in x and in y.

    The differences are per pixel. One is 0 where one of its two neighbors is not linked to the cell. `mask`,
    (n,), has a bit for each neighbor that is linked: one that streamlines may step to.
    """
    slopes = []
    for cell_offset, offset in ((1, (1, 0)), (width, (0, 1))):
        slope = noise.take(cells + cell_offset, axis=0) - noise.take(cells - cell_offset, axis=0)
        slope *= np.float32(0.5)
        bit = NEIGHBOR_OFFSETS.index(offset)
        both_bits = np.uint16(1 << bit | 1 << (8 - bit))
        slope[mask & both_bits != both_bits] = 0
        slopes.append(slope)
    return slopes[0], slopes[1]


def _nearest_member(
    z: np.ndarray, degree: int, guiding_angle: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the angle from the guiding angle to the nearest member, and the cosine and sine of that angle.

    All are (n,), like the representations `z` of the degree `degree`. Angles are in radians. All three
    results are 0 where the representation `z` is 0.
    """
    x, y = _rotate(z.real, z.imag, -degree * guiding_angle)
    angle = vector_angle(x, y)
    angle /= np.float32(degree)
    if degree == 1:
        norm = _length(x, y)
        norm[norm == 0] = 1
        return angle, x / norm, y / norm
    cosine, sine = cos_sin(angle)
    defined = z != 0
    return angle, cosine * defined, sine * defined


def _length(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the lengths of vectors, given by components, also where squared lengths over- or underflow."""
    with np.errstate(over="ignore"):
        square = x * x + y * y
    length = np.sqrt(square)
    extreme = ~((square > MIN_SQUARE) & (square < MAX_SQUARE))
    length[extreme] = np.hypot(x[extreme], y[extreme])
    return length


def _rotate(x: np.ndarray, y: np.ndarray, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Rotate vectors, given by components, counter-clockwise by an angle in radians."""
    if angle == 0:
        return x, y
    cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    return cosine * x - sine * y, sine * x + cosine * y


def _apply_harmonics(
    field: PixelField, block: slice, x: np.ndarray, y: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions of the field from members of the RoSy that they deviate from, for some pixels.

    `x` and `y` are the (n,) components of a unit member at each pixel of `block`, in the view plane. The
    result has the components of the unit direction. It is `x` and `y` if the field is a RoSy.
    """
    if not field.harmonics:
        return x, y
    member, harmonics = x + 1j * y, [(j, c[block]) for j, c in field.harmonics]
    direction = normalized(member * evaluate_harmonics(harmonics, member))
    return direction.real, direction.imag


def _to_screen(
    field: PixelField, block: slice, x: np.ndarray, y: np.ndarray, foreshorten: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Project unit directions from the view plane to the screen, for a block of pixels, in single precision.

    Directions are given and returned as components, x and y. The results are unit vectors or, if
    `foreshorten`, displacements in pixels of a unit step on the surface (`PixelField.screen_jacobian`).
    """
    x_axis, y_axis = field.screen_jacobian[block, 0], field.screen_jacobian[block, 1]
    screen_x = x_axis.real * x + y_axis.real * y
    screen_y = x_axis.imag * x + y_axis.imag * y
    if not foreshorten:
        norm = np.sqrt(screen_x * screen_x + screen_y * screen_y)
        norm[norm == 0] = 1
        scale = 1 / norm
        screen_x *= scale
        screen_y *= scale
    return screen_x, screen_y
