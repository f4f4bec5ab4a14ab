"""The memory that a picture takes, estimated before it is taken.

The estimate is the resident memory that `CpuRenderer.render_task` takes at its peak, beyond what
the process holds before. It is the largest of the needs of the stages, each of which is a number
of bytes for each sample of the frame, visible sample, pixel of the picture, triangle and so on.
The numbers are sizes of arrays, fitted to measurements; `bench/memory.py` compares the estimate
with what pictures take.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..compositor.band_division import context_rows
from ..compositor.even_lines import has_even_lines
from ..compositor.fast_lic import (
    BATCH_SIZE,
    HALF_WINDOW_STEPS,
    MAX_BATCH_STEPS,
    OVERLAP_ROWS,
    streamline_margin,
    strip_count,
)
from ..compositor.flow import noise_channel_count, streamline_reach
from ..compositor.hatching import (
    has_breaks,
    has_outline,
    has_overshoot,
    has_paper_grain,
)
from ..compositor.look import Look, colors_values, has_flow, is_hatched, uses_color_map
from ..compositor.look_units import look_in_pixels, supersampled_look
from ..field.directional_field import ratio_harmonics
from ..field.symmetry import FieldSymmetry
from ..memory import MMAP_THRESHOLD_BYTES, available_memory, check_memory
from ..projection.gbuffer import MeshInstance
from ..projection.project import rasterize_instances
from ..projection.rasterizer import MAX_BAND_PIXELS
from .view_input import ViewInput

#: Longest side in pixels of the small frame in which the visible pixels are counted.
COUNTING_SIDE = 256

#: Number of faces whose directions are looked at.
SAMPLED_FACES = 1000

#: Bytes of a visible sample: in the G-buffer, of each further channel of its field, while it is
#: projected, and of its tone and its links to neighbors.
GBUFFER_BYTES, CHANNEL_BYTES, PROJECTION_BYTES, FIELD_BYTES = 85, 8, 9, 30

#: Bytes of a sample of a band of the depth buffer, and of a visible sample, while rasterizing.
DEPTH_BUFFER_BYTES, FRAGMENT_BYTES = 18, 30

#: Bytes of a triangle: while its corners are computed, and of its connectivity, which is kept.
TRIANGLE_BYTES, KEPT_TRIANGLE_BYTES = 145, 35

#: Bytes of a visible sample while noise is made that is anchored to the surface, and of a sample of
#: the rectangle around the visible samples while noise is made that is anchored to the picture.
SURFACE_NOISE_BYTES, IMAGE_NOISE_BYTES = 155, 34

#: Bytes of a visible sample with the methods "members" and "brute", and of each of its lines or
#: directions there.
MEMBERS_BYTES, MEMBERS_LINE_BYTES, BRUTE_BYTES, BRUTE_DIRECTION_BYTES = 59, 39, 79, 34

#: Bytes of a sample of the rectangle around the visible samples with the method "ibfv", of each of its
#: states, and of each sum over the noise there.
IBFV_CELL_BYTES, IBFV_STATE_BYTES, IBFV_SUM_BYTES = 13, 26, 16

#: Bytes of a visible sample with even lines instead of streaks, and of each of its lines.
EVEN_LINES_BYTES, EVEN_LINE_BYTES = 26, 14

#: Bytes of a step of the streamlines of a batch.
STEP_BYTES = 24

#: Bytes of the statistics of streaks, which are simulated once for a look.
STATISTICS_BYTES = 100_000_000

#: Bytes of a visible sample while its color is computed: gray; colored; by a color map; hatched.
GRAY_BYTES, COLOR_BYTES, MAGNITUDE_BYTES, HATCHING_BYTES = 33, 120, 105, 50

#: Bytes of a visible sample for its place in the color map of numbers.
VALUE_BYTES = 4

#: Bytes of a sample that shows another triangle than the center of its pixel: while such samples are
#: found, and kept.
OTHER_SAMPLE_BYTES, KEPT_OTHER_SAMPLE_BYTES = 40, 16

#: Bytes of a shadow map of a light, while it is made.
SHADOW_MAP_BYTES = 110_000_000

#: Bytes of a pixel of a finished picture, and while it is written to a file.
PICTURE_BYTES, WRITING_BYTES = 16, 6

#: Bytes of a process that draws a band, before it begins.
PROCESS_BYTES = 60_000_000

#: Fraction of the memory of arrays below `MMAP_THRESHOLD_BYTES` that the C library keeps for later
#: arrays after they are freed.
KEPT_FRACTION = 0.85


class Coverage(NamedTuple):
    """How much of a frame shows surfaces with a field, as fractions from 0 to 1.

    Attributes
    ----------
    visible : float
        Pixels that show them.
    columns, rows : float
        Sides of the rectangle around these pixels.
    """

    visible: float = 1.0
    columns: float = 1.0
    rows: float = 1.0


def check_picture_memory(
    view: ViewInput, rows: Sequence[tuple[int, int]] = (), together: int = 1
) -> None:
    """Check that a picture can take the memory that it needs.

    The visible pixels are counted only if a picture full of them would need more than there is.

    Parameters
    ----------
    view : ViewInput
    rows : sequence of (int, int)
        Of the bands in which it is drawn, if there are several.
    together : int
        Bands that are drawn at a time, each in a process.

    Raises
    ------
    RosyError
        If it needs more than `available_memory`.
    """
    free = available_memory()
    if free is None or bands_memory(view, Coverage(), rows, together) <= free:
        return
    camera, samples = view.camera, view.look.supersampling
    each = f" with {samples} x {samples} samples each" if samples > 1 else ""
    check_memory(
        bands_memory(view, view_coverage(view), rows, together),
        f"a picture of {camera.width} x {camera.height} pixels{each}",
        "choose a smaller size" + (", or less supersampling" if samples > 1 else ""),
    )


def view_coverage(view: ViewInput) -> Coverage:
    """Return the coverage of a view, counted in a small frame."""
    camera = view.camera
    scale = min(COUNTING_SIDE / max(camera.width, camera.height), 1)
    width, height = (max(round(side * scale), 1) for side in (camera.width, camera.height))
    fragments, first_triangle = rasterize_instances(view.instances, camera.resized(width, height))
    instance_id = np.searchsorted(first_triangle, fragments.triangle, side="right") - 1
    has_field = np.array([instance.field is not None for instance in view.instances])
    pixel = fragments.pixel[has_field[instance_id]]
    if not len(pixel):
        return Coverage(0.0, 0.0, 0.0)
    row, column = np.divmod(pixel, width)
    return Coverage(
        len(pixel) / (width * height),
        (int(column.max() - column.min()) + 1) / width,
        (int(row[-1] - row[0]) + 1) / height,
    )


def bands_memory(
    view: ViewInput, coverage: Coverage, rows: Sequence[tuple[int, int]], together: int
) -> int:
    """Estimate the memory that all processes together take for a picture.

    Parameters
    ----------
    view, coverage
        As for `picture_memory`.
    rows, together
        As for `check_picture_memory`.
    """
    if len(rows) < 2:
        return picture_memory(view, coverage)
    camera = view.camera
    context = context_rows(view.look, camera, view.instances)
    height = min(max(stop - start for start, stop in rows) + 2 * context, camera.height)
    visible = min(coverage.visible * camera.height / height, coverage.columns)
    band = picture_memory(
        replace(view, camera=replace(camera, height=height)),
        Coverage(visible, coverage.columns, 1.0),
    )
    together = min(together, len(rows))
    picture = PICTURE_BYTES * camera.width * camera.height
    return together * band + (together - 1) * PROCESS_BYTES + picture


def picture_memory(view: ViewInput, coverage: Coverage) -> int:
    """Estimate the memory that `CpuRenderer` takes for a picture.

    Parameters
    ----------
    view : ViewInput
    coverage : Coverage
        From `view_coverage`, or a bound.

    Returns
    -------
    int
        Bytes at the peak, beyond those that are taken before, up to the writing of the picture to a
        file.
    """
    camera = view.shaded_camera
    frame = camera.width * camera.height
    pixels = view.camera.width * view.camera.height
    visible = frame * coverage.visible
    triangles = sum(len(instance.surface.triangles) for instance in view.instances)
    look = view.look
    if view.samples_per_side > 1:
        look = replace(look, supersampling=1)
    look = supersampled_look(look_in_pixels(look, camera, view.instances))
    lines, channels = _lines_and_channels(view.instances)
    noise_channels = noise_channel_count(look)
    image_bytes = 4 * (lines + 1) * noise_channels + 8

    other_samples = _other_samples(view, visible, triangles)
    gbuffer = (GBUFFER_BYTES + CHANNEL_BYTES * channels) * visible + KEPT_TRIANGLE_BYTES * triangles
    gbuffer += KEPT_OTHER_SAMPLE_BYTES * other_samples
    shadow_maps = SHADOW_MAP_BYTES if look.shadows and look.light != "headlight" else 0
    base = gbuffer + (FIELD_BYTES + VALUE_BYTES * colors_values(look)) * visible
    images = base + image_bytes * visible
    colored = images + (4 * noise_channels + 16) * visible
    lic = base
    if has_even_lines(look):
        even_lines = (EVEN_LINES_BYTES + EVEN_LINE_BYTES * lines) * visible
        lic, images = base + even_lines, images + even_lines
    if not has_even_lines(look) or has_breaks(look):
        lic += _lic_bytes(view, look, coverage, lines, noise_channels)
    if has_overshoot(look):
        tones = 4 * (lines + 1) * visible
        lic = max(lic, images + tones + _sheets_bytes(view, look, coverage, lines, 3))
    has_surface_grain = has_paper_grain(look) and look.anchor == "surface"
    paper_grain = 0
    if has_surface_grain:
        paper_grain = images + (SURFACE_NOISE_BYTES + _modulation_bytes(look, lines)) * visible
    # What LIC has freed is used again, if its arrays are small.
    kept = KEPT_FRACTION * lic if 8 * visible < MMAP_THRESHOLD_BYTES else 0
    # The rows without visible samples are never written to, so they take no memory.
    sample_rows = PICTURE_BYTES * frame * coverage.rows
    downsampled = PICTURE_BYTES * pixels if look.supersampling > 1 else 0
    others = OTHER_SAMPLE_BYTES * other_samples
    samples = frame * view.samples_per_side**2
    return int(
        max(
            DEPTH_BUFFER_BYTES * min(samples, MAX_BAND_PIXELS) + FRAGMENT_BYTES * visible + others,
            gbuffer + PROJECTION_BYTES * visible + TRIANGLE_BYTES * triangles,
            gbuffer + shadow_maps,
            lic,
            paper_grain,
            images + STATISTICS_BYTES,
            images + _color_bytes(look, lines, noise_channels) * visible,
            max(colored, kept) + sample_rows + downsampled,
            (downsampled or sample_rows) + WRITING_BYTES * pixels,
        )
    )


def _other_samples(view: ViewInput, visible: float, triangles: int) -> float:
    """Return the number of samples that show another triangle than the center of their pixel.

    Half of the triangles face the camera. The smaller they are in pixels, the more samples are
    in others.
    """
    samples = view.samples_per_side
    if samples == 1:
        return 0.0
    edges_per_pixel = float(np.sqrt(triangles / 2 / max(visible, 1.0)))
    return min(edges_per_pixel, 1.0) * visible * samples**2


def _lines_and_channels(instances: Sequence[MeshInstance]) -> tuple[int, int]:
    """Return the largest number of lines of a field, and the largest number of its channels.

    The directions of some faces show which harmonics a field has.
    """
    lines, channels = 1, 0
    for field in (instance.field for instance in instances if instance.field is not None):
        harmonics: dict[int, np.ndarray] = {}
        if field.direction_ratios is not None:
            step = max(len(field.direction_ratios) // SAMPLED_FACES, 1)
            harmonics = ratio_harmonics(field.direction_ratios[::step])
        lines = max(lines, FieldSymmetry(field.degree, tuple(harmonics)).line_count)
        channels = max(channels, len(harmonics) + (field.family_count > 1))
    return lines, channels


def _lic_bytes(
    view: ViewInput, look: Look, coverage: Coverage, lines: int, noise_channels: int
) -> float:
    """Return the bytes that noise and LIC images take, beyond the fields of pixels."""
    camera = view.shaded_camera
    frame = camera.width * camera.height
    visible = frame * coverage.visible
    if look.anchor == "surface":
        noise = SURFACE_NOISE_BYTES * visible
    else:
        window = frame * coverage.columns * coverage.rows
        noise = IMAGE_NOISE_BYTES * window + (12 + 4 * noise_channels) * visible
    degree = max(instance.field.degree for instance in view.instances if instance.field is not None)
    if look.method == "sheets":
        lic = _sheets_bytes(view, look, coverage, lines, noise_channels)
    elif look.method == "members":
        lic = (MEMBERS_BYTES + MEMBERS_LINE_BYTES * lines + 12 * noise_channels) * visible
    elif look.method == "ibfv":
        lic = _ibfv_bytes(view, look, coverage, lines, degree)
    else:
        image_bytes = 4 * lines * (noise_channels - 1)
        lic = (BRUTE_BYTES + BRUTE_DIRECTION_BYTES * degree + image_bytes) * visible
    return max(noise, lic)


def _sheets_bytes(
    view: ViewInput, look: Look, coverage: Coverage, lines: int, noise_channels: int
) -> float:
    """Return the bytes that the method "sheets" takes; see `fast_lic`."""
    camera = view.shaded_camera
    visible = camera.width * camera.height * coverage.visible
    columns, rows = camera.width * coverage.columns, camera.height * coverage.rows
    line_bytes, cell_bytes = 25 + 16 * noise_channels, 11 + 8 * noise_channels
    if look.magnitude in ("length", "both"):
        cell_bytes += 16
    margin = streamline_margin(look)
    strips = strip_count(camera.width, camera.height, lines, margin)
    if strips > 1:
        rows = min(rows, camera.height / strips + 2 * margin + OVERLAP_ROWS)
        # The values of the strip, and copies of the fields of pixels.
        line_bytes, cell_bytes = line_bytes + 4 + 4 * noise_channels, cell_bytes + 38
    strip = (line_bytes * lines + cell_bytes) * columns * rows
    half_length = max(HALF_WINDOW_STEPS, look.length // 2) + streamline_reach(look)
    steps = min(BATCH_SIZE * half_length, MAX_BATCH_STEPS)
    # Sums along whole streamlines, of each channel.
    step_bytes = STEP_BYTES + (16 * noise_channels if has_flow(look) else 0)
    images = (8 * noise_channels + 4 * lines * noise_channels + 4) * visible
    return images + strip + step_bytes * steps


def _ibfv_bytes(view: ViewInput, look: Look, coverage: Coverage, lines: int, degree: int) -> float:
    """Return the bytes that the method "ibfv" takes; see `ibfv`."""
    camera = view.shaded_camera
    frame = camera.width * camera.height
    has_three_channels = look.noise == "colour" or has_flow(look)
    sums = (2 if has_three_channels else 1) * (2 if has_breaks(look) else 1)
    state_bytes = IBFV_STATE_BYTES + IBFV_SUM_BYTES * sums
    # Without opposites, the states are those of the directions alone; the covering has all.
    cell_bytes = IBFV_CELL_BYTES + 8 * sums + 16 * lines
    noise = (56 if has_three_channels else 12) * coverage.visible
    return (noise + (state_bytes * degree + cell_bytes) * coverage.columns * coverage.rows) * frame


def _color_bytes(look: Look, lines: int, noise_channels: int) -> float:
    """Return the bytes of a visible sample while its color is computed, beyond its LIC images."""
    if not is_hatched(look):
        if uses_color_map(look):
            return MAGNITUDE_BYTES
        colored = noise_channels > 1 or look.hue == "families"
        return COLOR_BYTES if colored else GRAY_BYTES
    extra = _modulation_bytes(look, lines)
    extra += 4 * lines + 8 if has_paper_grain(look) else 0
    extra += 4 * lines if has_overshoot(look) else 0
    return HATCHING_BYTES + extra + (4 if has_outline(look) else 0)


def _modulation_bytes(look: Look, lines: int) -> float:
    """Return the bytes of a visible sample that breaks and wobble take beside its LIC images."""
    return (4 * lines + 8 if has_breaks(look) else 0) + (35 if look.wobble > 0 else 0)
