"""Draw a picture with numpy: project, then compose. A large picture is drawn by several processes."""

from __future__ import annotations

from dataclasses import replace

from ..cache import BAKE_CACHE, Cache
from ..compositor.color_values import check_color_values
from ..compositor.compose import compose
from ..compositor.picture import Picture
from ..compositor.target_tone import check_tone
from ..errors import RosyError
from ..progress import progress
from ..projection.gbuffer import GBuffer
from ..projection.project import cached_project, check_instances, project
from .arrowheads import with_arrowheads
from .picture_memory import check_picture_memory
from .singularities import with_singularities
from .view_input import ViewInput

#: Share of the progress bar that projecting takes.
PROJECTION_SHARE = 0.4


def draw_picture(
    view: ViewInput, cache: Cache | None = None, *, keep_gbuffers: bool = True, workers: int = 1
) -> Picture:
    """Draw a picture of the size of `view.camera`.

    Parameters
    ----------
    view : ViewInput
    cache : Cache, optional
        Keeps results for later pictures. A result is reused while the mesh instances are the same
        objects, and the camera and the settings that it depends on are unchanged. The owner of the
        cache evicts its entries. Without a cache nothing is kept.
    keep_gbuffers : bool
        Whether G-buffers and the results computed from them are kept. If not, as for animations,
        only results that do not depend on the camera are kept.
    workers : int
        Processes that draw large pictures together; 0 is one for each core. The pixels do not depend
        on it.

    Returns
    -------
    Picture

    Raises
    ------
    RosyError
        If an input is invalid, the tone has no source, or there is not enough memory.
    NothingInViewError
        If no mesh with a field is visible.
    """
    with progress(0.0, 0.97):
        picture = _draw_fields(view, cache, cache if keep_gbuffers else None)
    with progress(0.97, 0.99):
        picture = with_arrowheads(picture, view, cache)
    with progress(0.99, 1.0):
        return with_singularities(picture, view, cache)


def bake_picture(view: ViewInput, keep_gbuffers: bool = True, workers: int = 0) -> Picture:
    """Draw a picture as `draw_picture`, with the cache of bakes in the process that calls it.

    The picture has no layers, which are large, and not needed where it goes.
    """
    picture = draw_picture(view, BAKE_CACHE, keep_gbuffers=keep_gbuffers, workers=workers)
    BAKE_CACHE.evict_over_limit()
    return replace(picture, layers=())


def _draw_fields(view: ViewInput, cache: Cache | None, gbuffer_cache: Cache | None) -> Picture:
    """Draw the picture without arrowheads and singularities."""
    check_tone(view.look, [instance.tone for instance in view.instances], view.reference)
    if not view.draws_thresholds:
        check_color_values(view.look, view.instances)
    check_instances(view.instances, view.sample_camera, view.look.display)
    try:
        check_picture_memory(view)
    except RosyError:
        if not cache:
            raise
        cache.clear()
        check_picture_memory(view)
    with progress(0.0, PROJECTION_SHARE):
        gbuffer = _gbuffer(view, cache, gbuffer_cache)
    with progress(PROJECTION_SHARE, 1.0):
        return compose(
            gbuffer,
            view.look,
            view.lights,
            view.reference,
            gbuffer_cache,
            cache,
            draws_thresholds=view.draws_thresholds,
        )


def _gbuffer(view: ViewInput, cache: Cache | None, gbuffer_cache: Cache | None) -> GBuffer:
    """Return the G-buffer from the cache, or project the meshes."""
    instances, camera, display = view.instances, view.shaded_camera, view.look.display
    samples = view.samples_per_side
    if gbuffer_cache is None:
        return project(instances, camera, display, cache, samples)
    return cached_project(instances, camera, display, gbuffer_cache, samples)
