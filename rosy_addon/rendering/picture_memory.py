"""A bound for the memory that a picture takes."""

from __future__ import annotations

from collections.abc import Sequence

from ..compositor.flow import noise_channel_count
from ..compositor.look import is_hatched
from ..compositor.strip_division import context_rows
from ..compositor.strips import Strip
from ..field.symmetry import FieldSymmetry
from ..memory import PIXEL_BYTES, PROCESS_BYTES, TRIANGLE_BYTES, check_memory, samples_memory
from .view_input import ViewInput


def check_picture_memory(view: ViewInput, groups: Sequence[Sequence[Strip]], workers: int) -> None:
    """Check that a picture can take the memory that it needs; see `picture_memory`.

    Raises
    ------
    RosyError
        If it needs more than `memory.available_memory`.
    """
    camera, samples = view.camera, view.look.supersampling
    each = f" with {samples} x {samples} samples each" if samples > 1 else ""
    check_memory(
        picture_memory(view, groups, workers),
        f"a picture of {camera.width} x {camera.height} pixels{each}",
        "choose a smaller size" + (", or less supersampling" if samples > 1 else ""),
    )


def picture_memory(view: ViewInput, groups: Sequence[Sequence[Strip]], workers: int) -> float:
    """Return the bytes that a picture may take at its peak, beyond those that are taken before.

    It is the finished picture, and in each process the samples of its strips and all triangles. The
    surfaces are assumed to fill the picture.

    Parameters
    ----------
    view : ViewInput
    groups : sequence of sequence of Strip
        The strips that are drawn together.
    workers : int
        Number of processes.
    """
    look, camera = view.look, view.shaded_camera
    fields = [instance.field for instance in view.instances if instance.field is not None]
    lines = [
        FieldSymmetry(field.degree, ()).line_count
        if field.direction_ratios is None
        else field.degree
        for field in fields
    ]
    many_images = is_hatched(look) or noise_channel_count(look) > 1 or look.method != "sheets"
    height = max(group[-1].stop - group[0].start for group in groups)
    if len(groups) > 1:
        height = min(height + 2 * context_rows(look, camera, view.instances), camera.height)
    process = PROCESS_BYTES
    process += samples_memory(camera.width * height, max(lines, default=1), many_images)
    process += TRIANGLE_BYTES * sum(len(instance.surface.triangles) for instance in view.instances)
    picture = PIXEL_BYTES * view.camera.width * view.camera.height
    return picture + process * min(workers, len(groups))
