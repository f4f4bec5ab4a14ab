"""Fast LIC on the covering surface (Stalling and Hege, SIGGRAPH 1995).

Pixels on the same streamline average almost the same noise, so tracing one streamline per pixel
repeats work. This method traces fewer, longer streamlines and keeps a prefix sum of the noise along
each. A state of the covering surface is a pixel with one direction of the field (see `covering`). Every
state that a streamline passes takes its average from the difference of two prefix sums. States that no
streamline has passed become the seeds of the next round. Many streamlines are traced together, in
arrays (see `streamline_batch`). A state costs a few steps, whatever the length of the streamlines.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..core.progress import progress, report
from ..projection.pixel_blocks import pixel_blocks
from .contrast import normalize_variance
from .covering import (
    ALL_NEIGHBORS,
    SINK_CELL,
    Covering,
    build_covering,
    member_lines,
    rows_as_scalars,
    scatter_rows,
)
from .filter_kernel import full_sample_count
from .flow import blend_channels
from .image_noise import NOISE_MEAN
from .lic_images import LicImages, lic_images, magnitude_step_limits
from .look import has_flow, is_hatched
from .look_units import PixelLook
from .pixel_field import PixelField, entries_of_rows
from .streamline_batch import StreamlineBatch
from .strips import Strip, streamline_margin

#: Label of most steps.
STEP_LABEL = "tracing streamlines"

#: Streamlines that are traced together, in both directions at once.
BATCH_SIZE = 5120

#: Maximum number of steps in each direction, summed over the streamlines of a batch. Batches of long
#: streamlines are smaller.
MAX_BATCH_STEPS = 1 << 21

#: The half window: states within so many steps of the seed, in each direction, take their average from the
#: streamline. Long streamlines use half their length instead.
HALF_WINDOW_STEPS = 96

#: Spacing of the rows and columns of pixels where the first streamlines are seeded, in half
#: windows.
SEED_SPACING_FACTOR = 1.1

#: Number of seeds of a later round, relative to the number of streamlines that would just cover the
#: remaining lines.
RESEED_FACTOR = 1.75

#: Maximum fraction of the lines (pairs of opposite states) that no streamline has passed after the last
#: round: in general, and for antialiased pictures. These lines take the average of a neighbor.
MAX_UNCOVERED_FRACTION, FINE_UNCOVERED_FRACTION = 0.15, 0.05

#: Maximum number of rounds of seeding.
MAX_ROUNDS = 8

#: Neighbors whose averages are taken by lines that no streamline has passed, in the order in which they are
#: tried. Each is an offset: pixels forward and pixels to the left.
FILL_OFFSETS = ((1, 0), (-1, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 0), (-1, 0), (0, 1), (0, -1))

#: Factor of the contrast, in general and for antialiased pictures. Directions are not interpolated here, so
#: streaks are a little sharper than with the method "brute". The factor gives them the same standard
#: deviation.
CONTRAST_MATCH, FINE_CONTRAST_MATCH = 0.99, 0.98


def fast_lic(
    field: PixelField, looks: Sequence[PixelLook], noise: np.ndarray, strip: Strip | None = None
) -> list[LicImages]:
    """Compute LIC images for several lengths of streamlines, with the same streamlines.

    Each result has one member image for each of the M lines (pairs of opposite directions of the field).

    Parameters
    ----------
    field : PixelField
    looks : sequence of PixelLook
        They differ in the `length` of streamlines. The first has the greatest length.
    noise : (P, K) float32 ndarray
        K channels of image noise, with the mean `NOISE_MEAN`.
    strip : Strip, optional
        The rows to draw; by default all rows.

    Returns
    -------
    list of LicImages
        One for each look, at the pixels in the `Strip.averaged_rows`, or at all pixels without a strip.
    """
    drawn = extent = slice(0, len(field.pixel))
    if strip is not None:
        start, stop = strip.averaged_rows
        margin = streamline_margin(looks[0])
        drawn = entries_of_rows(field.pixel, field.width, (start, stop))
        rows = start - margin, min(stop + margin, strip.height)
        extent = entries_of_rows(field.pixel, field.width, rows)
    images = []
    averages = _line_averages(field, extent, drawn, looks, noise)
    for look, (sums, slopes) in zip(looks, averages, strict=True):
        members = np.empty((*sums.shape[:2], sums.shape[2] - 1), dtype=np.float32)
        for line_sums, member in zip(sums, members, strict=True):
            _write_averages(line_sums, look, member)
        images.append(lic_images(members, sums[:, :, -1].mean(axis=0), slopes))
    return images


def _line_averages(
    field: PixelField, extent: slice, drawn: slice, looks: Sequence[PixelLook], noise: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Average noise along the streamlines through the pixels `drawn`, for each look.

    `drawn` and `extent` are slices of the P pixels of the field. Streamlines end at the border of the pixels
    `extent`. The result is a list of (sums, slopes) pairs, for the n pixels `drawn`.

    Returns
    -------
    sums : (M, n, K + 1) float32 ndarray
        For each of the M lines: the average of each noise channel (relative to `NOISE_MEAN`) times the
        effective samples, then the effective samples.
    slopes : (M, n) float32 ndarray or None
        Derivatives of the averages toward the left of the lines, per pixel; None if the look needs none.
    """
    channels = 1 if has_flow(looks[0]) else noise.shape[1]
    if drawn.start == drawn.stop:
        empty = np.empty((field.line_count, 0, channels + 1), dtype=np.float32)
        return [(empty, empty[..., 0] if has_slopes(look) else None) for look in looks]
    step_limits = [magnitude_step_limits(field, look) for look in looks]
    line = member_lines(field)
    field = _crop_rows(field, extent)
    noise = noise[extent] - np.float32(NOISE_MEAN)
    with progress(0.0, 0.1):
        covering = build_covering(field, looks[0], noise)
    report(0.1, STEP_LABEL)
    cells = covering.cell_of_pixel[drawn.start - extent.start : drawn.stop - extent.start]
    undefined = field.representation == 0
    own_noise = noise[undefined]
    if has_flow(looks[0]):
        own_noise = blend_channels(own_noise, looks[0].flow_phase)
    undefined_cells = covering.cell_of_pixel[undefined]
    tables = [_LineAverages(covering, cells, undefined_cells, own_noise) for _ in looks]
    line_limits = [_line_limits(limit, extent, covering) for limit in step_limits]
    with progress(0.1, 0.9):
        _cover_all_lines(covering, tables, looks, line_limits)
    averages = []
    for look, table in zip(looks, tables, strict=True):
        if is_fine(look):
            table.smooth(covering, cells)
        slopes = table.slopes(covering, cells, line) if has_slopes(look) else None
        averages.append((table.gather(cells, line), slopes))
    return averages


def _line_limits(
    step_limit: np.ndarray | None, extent: slice, covering: Covering
) -> np.ndarray | None:
    """Return the (M C,) intp step limits of the lines of a covering, given the (P,) limits of pixels.

    A limit is the length of streamlines in each direction, in steps. The covering has the pixels `extent`.
    None if `step_limit` is None.
    """
    if step_limit is None:
        return None
    cell_limit = np.zeros(covering.cell_count, dtype=np.intp)
    cell_limit[covering.cell_of_pixel] = step_limit[extent]
    return np.tile(cell_limit, covering.line_count)


def _write_averages(line_sums: np.ndarray, look: PixelLook, member: np.ndarray) -> None:
    """Write the (n, K) averages of a line to `member`, scaled to the variance of full streamlines.

    `line_sums`, (n, K + 1), holds the averages relative to `NOISE_MEAN`, times the effective samples; then
    the effective samples.
    """
    full_samples = np.float32(full_sample_count(look.length, look.kernel) - 0.5)
    for block in pixel_blocks(len(line_sums)):
        sums, effective_samples = line_sums[block, :-1], line_sums[block, -1].copy()
        mean = member[block]
        np.divide(sums, effective_samples[:, None], out=mean)
        mean *= np.float32(FINE_CONTRAST_MATCH if is_fine(look) else CONTRAST_MATCH)
        mean += np.float32(NOISE_MEAN)
        if effective_samples.min() < full_samples:
            mean[...] = normalize_variance(mean, effective_samples, look)


def _crop_rows(field: PixelField, extent: slice) -> PixelField:
    """Return the field at the pixels `extent`, which are whole rows.

    Streamlines end at the first and the last of these rows.
    """
    if extent.stop - extent.start == len(field.pixel):
        return field
    rows = field.part(extent)
    row = rows.pixel // np.int32(field.width)
    mask = rows.neighbor_mask.copy()
    mask[row == row[0]] &= ALL_NEIGHBORS << 3 & ALL_NEIGHBORS
    mask[row == row[-1]] &= ALL_NEIGHBORS >> 3
    return replace(rows, neighbor_mask=mask)


class _LineAverages:
    """Averages of noise along each line (pair of opposite directions) of each cell of the covering surface.

    For each line, the product of average and effective samples is stored, and the effective samples. These
    are 0 for a line that has no average yet, and -1 for a line that needs none.

    Parameters
    ----------
    covering : Covering
    cells : (n,) int32 ndarray
        Cells whose lines need averages.
    undefined : (m,) int32 ndarray
        Cells where the field is undefined. Their averages are their own noise.
    noise : (m, K) float32 ndarray
        The K channels of noise at the undefined cells.
    """

    def __init__(
        self, covering: Covering, cells: np.ndarray, undefined: np.ndarray, noise: np.ndarray
    ) -> None:
        shape = (covering.line_count, covering.cell_count, noise.shape[1] + 1)
        state = np.full(covering.cell_count, -1, dtype=np.float32)
        state[cells] = 0
        state[undefined] = 1
        self._values = np.empty(shape, dtype=np.float32)
        self._values[:, :, -1] = state
        self._values[:, undefined, :-1] = noise
        self._flat = self._values.reshape(-1, shape[-1])

    def write(self, line: np.ndarray, values: np.ndarray) -> None:
        """Store (n, K + 1) averages at the lines with the (n,) indices `line`.

        `values` are the averages times the effective samples, then the effective samples.
        """
        scatter_rows(self._flat, line, values)

    def clear_sink(self) -> None:
        """Clear the cell `SINK_CELL`, where streamlines that have ended write their averages."""
        self._values[:, SINK_CELL, -1] = -1

    def copy_from(self, line: np.ndarray, source: np.ndarray) -> np.ndarray:
        """Copy the average of each line ``source[i]`` to the line ``line[i]``.

        Both are (n,) indices of lines.

        Return the elements of `line` whose source has no average. They are not changed.
        """
        values = self._flat.take(source, axis=0)
        is_known = values[:, -1] > 0
        scatter_rows(self._flat, line[is_known], values[is_known])
        return line[~is_known]

    def missing_lines(self) -> np.ndarray:
        """Return the indices (see `Covering`) of the lines that need an average and have none yet."""
        return np.flatnonzero(self._values[:, :, -1] == 0)

    def filter_missing(self, line: np.ndarray) -> np.ndarray:
        """Return the elements of `line` (indices of lines) that need an average and have none yet."""
        return line[self._flat[:, -1].take(line) == 0]

    def smooth(self, covering: Covering, cells: np.ndarray) -> None:
        """Smooth the averages of all lines of some cells: average each with its two neighbors along the line.

        Neighboring cells can have their averages from different streamlines, which differ a little.
        """
        smooth = np.empty((len(self._values), len(cells), self._values.shape[2]), dtype=np.float32)
        for line, out in enumerate(smooth):
            for block in pixel_blocks(len(cells)):
                entry = line * covering.cell_count + cells[block].astype(np.intp)
                own = self._flat.take(entry, axis=0)
                total = np.float32(2) * own
                for neighbor in covering.neighbor_lines(entry, ((1, 0), (-1, 0))):
                    total += self._known_values(neighbor, own)
                np.multiply(total, np.float32(0.25), out=out[block])
        for line, rows in enumerate(smooth):
            scatter_rows(self._values[line], cells, rows)

    def slopes(self, covering: Covering, cells: np.ndarray, line: np.ndarray) -> np.ndarray:
        """Return (M, n) float32: how the averages of the noise change from a line to its left, per pixel.

        There is a derivative for each of the M lines of each of the n cells, the mean of all channels. `line`,
        (M,), holds the numbers of the lines of a cell in the order of the result.
        """
        slopes = np.empty((len(line), len(cells)), dtype=np.float32)
        for first_entry, out in zip(line * covering.cell_count, slopes, strict=True):
            for block in pixel_blocks(len(cells)):
                entry = first_entry + cells[block].astype(np.intp)
                own = self._flat.take(entry, axis=0)
                neighbors = covering.neighbor_lines(entry, ((0, 1), (0, -1)))
                left, right = (self._known_values(neighbor, own) for neighbor in neighbors)
                difference = left[:, :-1] / left[:, -1:] - right[:, :-1] / right[:, -1:]
                np.multiply(difference.mean(axis=1), np.float32(0.5), out=out[block])
        return slopes

    def _known_values(self, line: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return the (n, K + 1) stored values of lines, or values of `own` where a line has no average.

        `line` holds the (n,) indices of the lines. Row i of `own`, (n, K + 1), replaces the values of
        ``line[i]``. A line has no average if its effective samples, in the last column, are not above 0.
        """
        values = self._flat.take(line, axis=0)
        unknown = np.flatnonzero(values[:, -1] <= 0)
        values[unknown] = own[unknown]
        return values

    def gather(self, cell: np.ndarray, line: np.ndarray) -> np.ndarray:
        """Return the stored (M, n, K + 1) float32 values of the lines of n cells.

        `line` holds the numbers of the M lines of a cell in the order of the result.
        """
        result = np.empty((len(line), len(cell), self._values.shape[2]), dtype=np.float32)
        for line_index, out in zip(line, result, strict=True):
            rows_as_scalars(out)[:] = rows_as_scalars(self._values[line_index]).take(cell)
        return result


def _cover_all_lines(
    covering: Covering,
    averages: Sequence[_LineAverages],
    looks: Sequence[PixelLook],
    step_limits: Sequence[np.ndarray | None],
) -> None:
    """Trace streamlines until every line that needs an average has one, for each look.

    `averages` are filled, one for each look. The looks differ in `length` alone. `step_limits` has for each
    look the (M C,) steps in each direction that the average of each line covers, or None for the `length` of
    the look.
    """
    look = looks[0]
    half_window = max(HALF_WINDOW_STEPS, look.length // 2)
    # A line that has the average for one look has the averages for all looks.
    missing = averages[0].missing_lines()
    total = len(missing)
    fine = is_fine(look)
    max_uncovered = FINE_UNCOVERED_FRACTION if fine else MAX_UNCOVERED_FRACTION
    spacing = max(int(SEED_SPACING_FACTOR * half_window), 1)
    seeds = _grid_seeds(covering, averages[0], spacing)
    batch_size = _batch_size(half_window + look.streamline_reach())
    batch = StreamlineBatch(covering, looks, step_limits, half_window, batch_size, fine)
    threshold = 0.0
    for _ in range(MAX_ROUNDS):
        covered_steps = 0
        for batch_seeds in _batches(seeds, batch_size):
            _write_streamlines(averages, batch.trace(batch_seeds))
            covered_steps += batch.covered_steps
            report(1 - len(missing) / total, STEP_LABEL)
        missing = averages[0].missing_lines()
        if len(missing) <= max_uncovered * total:
            break
        # Streamlines that end early cover fewer lines, so the next round needs more seeds.
        lines_per_seed = covered_steps / max(len(seeds), 1) + 1
        # Lines below the threshold were seeds already.
        last, threshold = threshold, threshold + (1 - threshold) * RESEED_FACTOR / lines_per_seed
        priority = _seed_priority(covering, missing)
        seeds = missing[(priority >= last) & (priority < threshold)]
    for forward, left in FILL_OFFSETS:
        (source,) = covering.neighbor_lines(missing, [(forward, left)])
        missing, *_ = [table.copy_from(missing, source) for table in averages]
    # The neighbors of these lines have no average, either. Each line gets a streamline of its own, which sets
    # no other average (half window 0).
    batch_size = min(_batch_size(look.streamline_reach()), len(missing))
    batch = StreamlineBatch(covering, looks, step_limits, 0, batch_size, fine)
    for batch_seeds in _batches(missing, batch_size):
        _write_streamlines(averages, batch.trace(batch_seeds))
        report(0.95, STEP_LABEL)


def _write_streamlines(
    averages: Sequence[_LineAverages],
    steps: Iterable[tuple[np.ndarray, list[np.ndarray], np.ndarray]],
) -> None:
    """Store the averages of a batch of streamlines.

    If several streamlines pass a line, one that passes near the center of the cell wins.

    Parameters
    ----------
    averages : sequence of _LineAverages
        The averages for each look, which are changed.
    steps : iterable
        For each step of the streamlines, from `StreamlineBatch.trace`: the indices of the lines that are
        passed, a list with their averages for each look, and the indices (into the first array) of the
        streamlines that pass near the center of the cell.
    """
    centered_lines: list[np.ndarray] = []
    centered_values: list[list[np.ndarray]] = [[] for _ in averages]
    for line, values, centered in steps:
        centered_lines.append(line.take(centered))
        for table, rows, collected in zip(averages, values, centered_values, strict=True):
            table.write(line, rows)
            collected.append(rows.take(centered, axis=0))
    line = np.concatenate(centered_lines)
    for table, collected in zip(averages, centered_values, strict=True):
        table.write(line, np.concatenate(collected))
        table.clear_sink()


def has_slopes(look: PixelLook) -> bool:
    """Return whether LIC images of a look have slopes: derivatives across the lines (`LicImages.slopes`)."""
    return is_fine(look) and is_hatched(look)


def is_fine(look: PixelLook) -> bool:
    """Return whether streaks are drawn more accurately: in antialiased pictures, and if they drift.

    Small differences between neighboring streamlines do not drift with the streaks. In an animation they
    would look like a fixed pattern in front of the surface.
    """
    return has_flow(look) or look.is_antialiased


def _batch_size(half_length: int) -> int:
    """Return the number of streamlines in a batch, given the number of steps of each in one direction."""
    return max(min(BATCH_SIZE, MAX_BATCH_STEPS // half_length), 1)


def _batches(seeds: np.ndarray, batch_size: int) -> list[np.ndarray]:
    """Divide seeds into batches of about equal size, at most `batch_size`."""
    return np.array_split(seeds, -(-len(seeds) // batch_size)) if len(seeds) else []


def _grid_seeds(covering: Covering, averages: _LineAverages, spacing: int) -> np.ndarray:
    """Return seeds on evenly spaced rows and columns of pixels: the lines that cross the row or column.

    Streamlines from there run side by side. They miss few lines, pass few lines twice, and their
    memory accesses are close to each other.

    Parameters
    ----------
    covering : Covering
    averages : _LineAverages
        Lines that need no average are not seeds.
    spacing : int
        Approximate distance of rows and of columns, pixels.

    Returns
    -------
    (n,) intp ndarray
        Indices of lines; see `Covering`.
    """
    width, height = covering.width, covering.cell_count // covering.width
    rows, columns = (_even_positions(size, spacing)[:, None] for size in (height, width))
    grid = rows * width + np.arange(width), columns + np.arange(height) * width
    seeds = []
    for line in range(covering.line_count):
        for axis, cells in enumerate(grid):
            entry = averages.filter_missing(line * covering.cell_count + cells.ravel())
            step = np.abs(covering.state_table.take(entry, axis=0)[:, :2])
            along, lateral = step[:, axis], step[:, 1 - axis]
            seeds.append(entry[along < lateral if axis else along <= lateral])
    return np.concatenate(seeds)


def _even_positions(size: int, spacing: int) -> np.ndarray:
    """Return (n,) intp positions from 0 to `size`, evenly spaced, half a spacing from the ends."""
    count = max(round(size / spacing), 1)
    return ((np.arange(count) + 0.5) * (size / count)).astype(np.intp)


def _seed_priority(covering: Covering, line: np.ndarray) -> np.ndarray:
    """Return (n,) float64 priorities from 0 to 1, evenly distributed over rows and columns.

    `line` holds (n,) indices of lines. The seeds of a round are the lines whose priorities are in a range. A
    priority depends on the cell and the number of the line alone. If every n-th line that has no average were
    a seed, a small change of the field would move the seeds everywhere, and animations would flicker.
    """
    line_index, cell = np.divmod(line, covering.cell_count)
    row, column = np.divmod(cell, covering.width)
    return (math.sqrt(2) * column + math.sqrt(3) * row + math.sqrt(5) * line_index) % 1
