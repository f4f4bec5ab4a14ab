"""Dividing a picture into bands; see `band`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..field.symmetry import FieldSymmetry
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from .even_lines import has_even_lines
from .fast_lic import OVERLAP_ROWS, streamline_margin, strip_count
from .hatching import (
    has_breaks,
    has_outline,
    has_overshoot,
    has_paper_grain,
    is_shaded_by_pixel,
    overshoot_steps,
)
from .image_noise import MAX_MARGIN, high_pass_margin
from .look import Look, colors_magnitude
from .look_units import look_in_pixels
from .outline import FULL_MARK_LENGTH
from .paper_grain import surface_paper_grain_args
from .streak_statistics import break_steps
from .undirected import disc_offsets

#: Rows by which the neighbors of a pixel, and theirs, can be away.
NEIGHBOR_ROWS = 4


def divide_rows(
    look: Look, camera: Camera, instances: Sequence[MeshInstance], count: int
) -> list[tuple[int, int]]:
    """Divide the rows of a picture into at most `count` bands of whole strips.

    Parameters
    ----------
    look : Look
        Its lengths are in pixels of the picture or in Blender units.
    camera : Camera
        Of the picture.
    instances : sequence of MeshInstance
        Of the picture.
    count : int

    Returns
    -------
    list of (int, int)
        The first row of each band, and the row after its last one, from the bottom. A single band if
        the picture cannot be divided: streamlines are traced by another method than "sheets", lines
        are evenly spaced, or something depends on all visible pixels.
    """
    height = camera.height
    fields = [instance.field for instance in instances if instance.field is not None]
    depends_on_all = colors_magnitude(look) or look.magnitude in ("length", "both")
    if (
        look.method != "sheets"
        or not (is_shaded_by_pixel(look) or look.supersampling == 1)
        or has_even_lines(look)
        or (depends_on_all and not look.magnitude_range)
        or high_pass_margin(look.high_pass) > MAX_MARGIN
        or any(field.direction_ratios is not None or field.family_count > 1 for field in fields)
    ):
        return [(0, height)]
    look = look_in_pixels(replace(look, supersampling=1), camera, instances)
    # Fields with more lines have more strips, at the borders of these and between them.
    lines = min(FieldSymmetry(field.degree, ()).line_count for field in fields)
    strips = strip_count(camera.width, height, lines, _longest_margin(look))
    borders = [height * (strips * band // count) // strips for band in range(count + 1)]
    return [(start, stop) for start, stop in pairwise(borders) if start < stop]


def context_rows(look: Look, camera: Camera, instances: Sequence[MeshInstance]) -> int:
    """Return how many rows around a band the pixels in it may depend on."""
    look = look_in_pixels(replace(look, supersampling=1), camera, instances)
    noise = 0
    if look.anchor == "surface":
        # The noise of the picture is known everywhere, and that of surfaces at visible pixels.
        noise = high_pass_margin(look.high_pass) + int(np.ceil(look.grain))
    disc = int(np.abs(disc_offsets(look.grain)).max())
    rows = max(_longest_margin(look) + OVERLAP_ROWS, disc) + noise
    if has_paper_grain(look) and look.anchor == "surface":
        rows = max(rows, high_pass_margin(surface_paper_grain_args(look)["high_pass"]))
    if has_outline(look):
        rows = max(rows, int(np.ceil(look.outline)) + 1 + FULL_MARK_LENGTH)
    return rows + NEIGHBOR_ROWS


def _longest_margin(look: Look) -> int:
    """Return the largest `streamline_margin` of all images that a look takes."""
    lengths = [look.length]
    if has_breaks(look):
        lengths.append(break_steps(look))
    if has_overshoot(look):
        lengths.append(overshoot_steps(look))
    return streamline_margin(replace(look, length=max(lengths)))
