"""Draw a picture with numpy: project the meshes to a G-buffer, then compose the pixels.

A large picture is divided into strips of rows, which several processes draw.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ..compositor.color_values import check_color_values
from ..compositor.compose import compose
from ..compositor.flow import noise_channel_count
from ..compositor.look import is_hatched
from ..compositor.picture import Picture
from ..compositor.picture_key import fixed_color_range
from ..compositor.strip_division import context_rows, divide_into_strips, group_strips
from ..compositor.strips import Strip, join_strips
from ..compositor.target_tone import check_tone
from ..core.cache import BAKE_CACHE, Cache
from ..core.errors import NothingInViewError, RosyError
from ..core.memory import PIXEL_BYTES, PROCESS_BYTES, TRIANGLE_BYTES, check_memory, samples_memory
from ..core.progress import progress
from ..field.symmetry import FieldSymmetry
from ..projection.gbuffer import with_field
from ..projection.project import cached_project, check_instances, project, raise_nothing_in_view
from ..worker.pool import POOL, core_count
from .marks import with_marks
from .view_input import ViewInput

#: Fraction of the progress at which projecting ends and composing begins.
PROJECTION_SHARE = 0.4


def draw_picture(
    view: ViewInput, cache: Cache | None = None, *, keep_gbuffers: bool = True, workers: int = 1
) -> Picture:
    """Draw a picture of the size of `view.camera`.

    Parameters
    ----------
    view : ViewInput
        What to draw.
    cache : Cache, optional
        Keeps intermediate results for later pictures. A result is reused while the mesh instances are the
        same Python objects, and the camera and settings that it depends on are unchanged. The caller evicts
        entries of the cache. Without a cache nothing is kept.
    keep_gbuffers : bool
        Whether G-buffers, and results that are computed from them, are kept in the cache. If not, as for
        animations, only results that do not depend on the camera are kept.
    workers : int
        Number of processes that draw a large picture together. 0 means one per processor core. The pixels do
        not depend on it.

    Returns
    -------
    Picture

    Raises
    ------
    RosyError
        If an input is invalid, the tone or the values for the color map are missing, or there is not enough
        memory.
    NothingInViewError
        If no mesh with a field is visible.
    """
    views, pictures = view.by_look(), []
    for index, one in enumerate(views):
        start, stop = index / len(views), (index + 1) / len(views)
        try:
            with progress(start, start + 0.97 * (stop - start)):
                picture = _draw_fields(one, cache, cache if keep_gbuffers else None, workers)
        except NothingInViewError:
            if index + 1 == len(views) and not pictures:
                raise
            continue
        with progress(start + 0.97 * (stop - start), stop):
            pictures.append(with_marks(picture, one, cache))
    return joined_pictures(pictures)


def joined_pictures(pictures: Sequence[Picture]) -> Picture:
    """Join pictures that show different meshes of the same scene into one picture.

    The color of a pixel is the mean over the pictures, weighted by opacity. Opacities are added, up to 1. The
    color range is taken from the first picture that has one, and so are the marks.
    """
    if len(pictures) == 1:
        return pictures[0]
    rgba = pictures[0].rgba.copy()
    for picture in pictures[1:]:
        alpha = picture.rgba[..., 3:]
        total = rgba[..., 3:] + alpha
        share = np.divide(alpha, total, out=np.zeros_like(total), where=total > 0)
        rgba[..., :3] += share * (picture.rgba[..., :3] - rgba[..., :3])
        rgba[..., 3:] = np.minimum(total, 1)
        is_alone = share[..., 0] == 1
        rgba[is_alone] = picture.rgba[is_alone]
    ranges = (picture.color_range for picture in pictures)
    marks = (picture.marks for picture in pictures)
    return replace(
        pictures[0],
        rgba=rgba,
        color_range=next((found for found in ranges if found is not None), None),
        marks=next((found for found in marks if found is not None), None),
        line_count=max(picture.line_count for picture in pictures),
    )


def bake_picture(view: ViewInput, keep_gbuffers: bool = True, workers: int = 0) -> Picture:
    """Draw a picture with `draw_picture` and the cache of the calling process, `BAKE_CACHE`.

    `keep_gbuffers` says whether G-buffers are kept in it. `workers` is the number of processes that draw a
    large picture; 0 means one per processor core.
    """
    picture = draw_picture(view, BAKE_CACHE, keep_gbuffers=keep_gbuffers, workers=workers)
    BAKE_CACHE.evict_over_limit()
    return picture


def _draw_fields(
    view: ViewInput, cache: Cache | None, gbuffer_cache: Cache | None, workers: int
) -> Picture:
    """Draw the picture without arrowheads and singularities.

    `cache` keeps results that do not depend on the camera. `gbuffer_cache` keeps all other results.
    """
    check_tone(view.look, [instance.tone for instance in view.instances], view.reference)
    if not view.draws_thresholds:
        check_color_values(view.look, view.instances)
    check_instances(view.instances, view.sample_camera, view.look.display)
    workers = workers or core_count()
    groups = picture_groups(view, workers)
    while True:
        try:
            _check_picture_memory(view, groups, workers)
            break
        except RosyError:
            if workers > 1:  # fewer processes need less memory
                workers -= 1
            elif cache:
                cache.clear()
            else:
                raise
    if len(groups) == 1:
        return _draw_strips(view, groups[0], cache, gbuffer_cache)
    draw_here = partial(draw_rows, cache=Cache() if cache is None else cache)
    pictures = POOL.map(draw_rows, [(view, group) for group in groups], workers, draw_here)
    if all(picture is None for picture in pictures):
        raise_nothing_in_view(view.instances, view.shaded_camera)
    parts = [_whole(group) for group in groups]
    for index, (start, stop) in enumerate(part.drawn_rows for part in parts):
        if pictures[index] is None:
            pictures[index] = np.zeros((stop - start, view.camera.width, 4), dtype=np.float32)
    rgba = join_strips(pictures, parts)
    return Picture(rgba, color_range=fixed_color_range(view.look, view.instances))


def picture_groups(view: ViewInput, workers: int) -> list[Sequence[Strip]]:
    """Divide a picture into strips of rows. Return groups of strips to draw together; see `group_strips`.

    `workers` is the number of processes, each of which draws one group at a time.
    """
    scene = view.look, view.shaded_camera, view.instances
    strips = divide_into_strips(*scene)
    return [strips] if view.draws_thresholds else group_strips(strips, *scene, workers)


def draw_rows(
    view: ViewInput, strips: Sequence[Strip], cache: Cache = BAKE_CACHE
) -> np.ndarray | None:
    """Draw some neighboring strips of a picture.

    Parameters
    ----------
    view : ViewInput
    strips : sequence of Strip
        A group of neighboring strips; see `group_strips`.
    cache : Cache
        Keeps results that do not depend on the camera. By default the cache of this process, `BAKE_CACHE`.

    Returns
    -------
    (h, W, 4) float32 ndarray or None
        Linear RGBA, not premultiplied, of the rows (`Strip.drawn_rows`) of all strips, from the bottom. None
        if no mesh with a field is visible in them.
    """
    try:
        picture = _draw_strips(view, strips, cache, None)
    except NothingInViewError:
        return None
    if cache is BAKE_CACHE:  # the owners of other caches evict their entries
        cache.evict_over_limit()
    return picture.rgba


def _draw_strips(
    view: ViewInput, strips: Sequence[Strip], cache: Cache | None, gbuffer_cache: Cache | None
) -> Picture:
    """Draw neighboring strips, and return a picture of their rows.

    The meshes are also projected to some rows above and below the strips, because streamlines that begin in
    the strips may reach them. `cache` keeps results that do not depend on the camera. `gbuffer_cache` keeps
    all other results.
    """
    camera, look = view.shaded_camera, view.look
    scene = view.instances, camera, look.display
    whole, rows = _whole(strips), None
    if (whole.start, whole.stop) != (0, camera.height):
        context = context_rows(look, camera, view.instances)
        rows = max(whole.start - context, 0), min(whole.stop + context, camera.height)
    with progress(0.0, PROJECTION_SHARE):
        if rows is None and gbuffer_cache is not None:
            gbuffer = cached_project(*scene, gbuffer_cache, view.samples_per_side)
        else:
            gbuffer = project(*scene, cache, view.samples_per_side, rows)
    inputs = gbuffer, look, view.lights, view.reference, gbuffer_cache, cache, strips
    with progress(PROJECTION_SHARE, 1.0):
        return compose(*inputs, view.draws_thresholds, view.drift)


def _whole(strips: Sequence[Strip]) -> Strip:
    """Return a single strip with all rows of neighboring strips."""
    return Strip(strips[0].start, strips[-1].stop, strips[0].height)


def _check_picture_memory(view: ViewInput, groups: Sequence[Sequence[Strip]], workers: int) -> None:
    """Check that there is enough memory to draw a picture; see `picture_memory`.

    Raises
    ------
    RosyError
        If the picture may need more than `memory.available_memory`.
    """
    camera, samples = view.camera, view.look.supersampling
    each = f" with {samples} x {samples} samples each" if samples > 1 else ""
    check_memory(
        picture_memory(view, groups, workers),
        f"a picture of {camera.width} x {camera.height} pixels{each}",
        "choose a smaller size" + (", or less supersampling" if samples > 1 else ""),
    )


def picture_memory(view: ViewInput, groups: Sequence[Sequence[Strip]], workers: int) -> float:
    """Return an upper estimate of the memory in bytes that drawing a picture takes, beyond the present use.

    It is the sum of the finished picture and, for each process, the samples of its strips and all triangles.
    The surfaces are assumed to fill the picture.

    Parameters
    ----------
    view : ViewInput
    groups : sequence of sequence of Strip
        The groups of strips that are drawn together.
    workers : int
        Number of processes.
    """
    look, camera = view.look, view.shaded_camera
    lines = 1
    for field in [instance.field for instance in with_field(view.instances)]:
        is_rosy = field.direction_ratios is None
        lines = max(lines, FieldSymmetry(field.degree).line_count if is_rosy else field.degree)
    many_images = is_hatched(look) or noise_channel_count(look) > 1 or look.method != "sheets"
    height = max(group[-1].stop - group[0].start for group in groups)
    if len(groups) > 1:
        height = min(height + 2 * context_rows(look, camera, view.instances), camera.height)
    process = PROCESS_BYTES
    process += samples_memory(camera.width * height, lines, many_images)
    process += TRIANGLE_BYTES * sum(len(instance.surface.triangles) for instance in view.instances)
    picture = PIXEL_BYTES * view.camera.width * view.camera.height
    return picture + process * min(workers, len(groups))
