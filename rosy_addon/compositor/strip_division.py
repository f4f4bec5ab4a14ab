"""Division of a picture into strips of rows, and of the strips among processes; see `strips`."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..field.symmetry import FieldSymmetry
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance, with_field
from .hatching import has_breaks, has_outline, has_overshoot, has_paper_grain, overshoot_steps
from .image_noise import MAX_MARGIN, high_pass_margin
from .look import Look, is_even, magnitude_range, uses_magnitude
from .look_units import PixelLook, pixel_look
from .outline import FULL_MARK_LENGTH
from .paper_grain import surface_paper_grain_settings
from .streak_statistics import break_steps
from .strips import OVERLAP_ROWS, Strip, streamline_margin
from .undirected import disc_offsets

#: Minimum number of states (pixels times directions of the field) in a strip. Strips of about this size bound
#: the memory.
STRIP_STATES = 1 << 20

#: Minimum number of rows of a strip, in multiples of the `streamline_margin`, so that margins are a small
#: part of the work.
MIN_STRIP_MARGINS = 4

#: Maximum number of rows between a pixel and the neighbors of its neighbors.
NEIGHBOR_ROWS = 4

#: Maximum number of pixels in the strips that one process draws together, unless a single strip has more.
#: This bounds the memory.
MAX_GROUP_PIXELS = 1 << 21


def divide_into_strips(
    look: Look, camera: Camera, instances: Sequence[MeshInstance]
) -> list[Strip]:
    """Divide the rows of a picture into strips, from the bottom.

    Parameters
    ----------
    look : Look
        Its lengths are in pixels of the picture or in Blender units.
    camera : Camera
        The camera of the picture.
    instances : sequence of MeshInstance
        All meshes of the picture.

    Returns
    -------
    list of Strip
        The number of strips is a power of two. It is 1 if the LIC method of the look is not "sheets".
    """
    height, count = camera.height, 1
    if look.method == "sheets":
        degrees = {instance.field.degree for instance in with_field(instances)}
        lines = max((FieldSymmetry(degree, ()).line_count for degree in degrees), default=1)
        margin = _longest_margin(pixel_look(look, camera, instances))
        rows = STRIP_STATES / (2 * lines * camera.width)
        rows = max(rows, MIN_STRIP_MARGINS * margin, 2 * OVERLAP_ROWS)
        count = 1 << max(int(np.log2(height / rows)), 0)
    borders = [height * number // count for number in range(count + 1)]
    return [Strip(start, stop, height) for start, stop in pairwise(borders)]


def group_strips(
    strips: Sequence[Strip],
    look: Look,
    camera: Camera,
    instances: Sequence[MeshInstance],
    workers: int,
) -> list[Sequence[Strip]]:
    """Group the strips of a picture, so that each group can be drawn by a process of its own.

    Parameters
    ----------
    strips : sequence of Strip
        From `divide_into_strips`, for these arguments.
    look : Look
        Its lengths are in pixels of the picture or in Blender units.
    camera : Camera
        The camera of the picture.
    instances : sequence of MeshInstance
        All meshes of the picture.
    workers : int
        Number of processes. A group has at most `MAX_GROUP_PIXELS` pixels, unless a single strip has more.

    Returns
    -------
    list of sequence of Strip
        Groups from the bottom. There is a single group if some result depends on all visible pixels, or if a
        result that all strips need should be computed by one process alone.
    """
    fields = [instance.field for instance in with_field(instances)]
    if (
        is_even(look)
        or (uses_magnitude(look) and magnitude_range(look) is None)
        or high_pass_margin(look.high_pass) > MAX_MARGIN
        or any(field.direction_ratios is not None or field.family_count > 1 for field in fields)
    ):
        return [strips]
    per_worker = -(-camera.width * camera.height // (MAX_GROUP_PIXELS * workers))
    count = min(workers * per_worker, len(strips))
    borders = [len(strips) * group // count for group in range(count + 1)]
    return [strips[start:stop] for start, stop in pairwise(borders)]


def context_rows(look: Look, camera: Camera, instances: Sequence[MeshInstance]) -> int:
    """Return how many rows below and above a strip the pixels of the strip may depend on.

    `camera` and `instances` are the camera and all meshes of the picture.
    """
    look = pixel_look(look, camera, instances)
    noise = 0
    if look.anchor == "surface":
        # Noise that is anchored to the picture is known everywhere. Noise on surfaces is known at visible
        # pixels only, so its filters depend on these.
        noise = high_pass_margin(look.high_pass) + int(np.ceil(look.line_width))
    disc = int(np.abs(disc_offsets(look.line_width)).max())
    rows = max(_longest_margin(look), disc) + noise
    if has_paper_grain(look) and look.anchor == "surface":
        rows = max(rows, high_pass_margin(surface_paper_grain_settings(look).high_pass))
    if has_outline(look):
        rows = max(rows, int(np.ceil(look.outline)) + 1 + FULL_MARK_LENGTH)
    return OVERLAP_ROWS + rows + NEIGHBOR_ROWS


def _longest_margin(look: PixelLook) -> int:
    """Return by how many rows the streamlines of any LIC image of a look may leave a strip."""
    lengths = [look.length]
    if has_breaks(look):
        lengths.append(break_steps(look))
    if has_overshoot(look):
        lengths.append(overshoot_steps(look))
    return streamline_margin(look.with_length(max(lengths)))
