"""The renderer that uses numpy alone: project, then compose."""

from __future__ import annotations

from contextlib import suppress

from ..cache import Cache
from ..compositor.color_values import check_color_values
from ..compositor.compose import compose
from ..compositor.picture import Picture
from ..compositor.picture_key import fixed_color_range
from ..compositor.target_tone import check_tone
from ..errors import RosyError
from ..progress import Task, as_task, progress, subtask
from ..projection.gbuffer import GBuffer
from ..projection.project import cached_project, check_instances, project
from .arrowheads import with_arrowheads
from .band_workers import BandWorkers
from .picture_memory import check_picture_memory
from .singularities import with_singularities
from .view_input import ViewInput

#: Share of the progress bar that projecting takes.
PROJECTION_SHARE = 0.4


class CpuRenderer:
    """Draws pictures with numpy. Implements `Renderer`.

    Parameters
    ----------
    cache : Cache, optional
        Keeps results for later pictures. A result is reused while the mesh instances are the same
        objects, and the camera and the settings that it depends on are unchanged. The owner of the
        cache evicts its entries. Without a cache nothing is kept.
    keep_gbuffers : bool
        Whether G-buffers and the results computed from them are kept. If not, as for animations,
        only results that do not depend on the camera are kept.
    workers : BandWorkers, optional
        Processes that draw large pictures together, but for thresholds. Their G-buffers are not kept.
    """

    device_name = "cpu"

    def __init__(
        self,
        cache: Cache | None = None,
        *,
        keep_gbuffers: bool = True,
        workers: BandWorkers | None = None,
    ) -> None:
        self._cache = cache
        self._gbuffer_cache = cache if keep_gbuffers else None
        self._workers = workers

    def render_task(self, view: ViewInput) -> Task[Picture]:
        """As `Renderer.render_task`."""
        picture = yield from subtask(as_task(self._picture, view), 0.0, 0.97)
        picture = yield from subtask(
            as_task(with_arrowheads, picture, view, self._cache), 0.97, 0.99
        )
        return (
            yield from subtask(as_task(with_singularities, picture, view, self._cache), 0.99, 1.0)
        )

    def _picture(self, view: ViewInput) -> Picture:
        """Draw the picture without arrowheads and singularities."""
        check_tone(view.look, [instance.tone for instance in view.instances], view.reference)
        if not view.draws_thresholds:
            check_color_values(view.look, view.instances)
        rows = self._checked_bands(view)
        if len(rows) > 1:
            rgba = self._workers.draw(view, rows, self._cache)
            if rgba is not None:
                return Picture(rgba, (), color_range=fixed_color_range(view.look, view.instances))
        with progress(0.0, PROJECTION_SHARE):
            gbuffer = self._gbuffer(view)
        with progress(PROJECTION_SHARE, 1.0):
            return compose(
                gbuffer,
                view.look,
                view.lights,
                view.reference,
                self._gbuffer_cache,
                self._cache,
                draws_thresholds=view.draws_thresholds,
            )

    def _checked_bands(self, view: ViewInput) -> list[tuple[int, int]]:
        """Return the rows of the bands that the workers draw, for which there is enough memory.

        If need be, the cache gives back its own, or a single process draws the picture.
        """
        check_instances(view.instances, view.sample_camera, view.look.display)
        if self._workers is not None and not view.draws_thresholds:
            rows = self._workers.divide(view)
            with suppress(RosyError):
                check_picture_memory(view, rows, self._workers.count)
                return rows
        try:
            check_picture_memory(view)
        except RosyError:
            if not self._cache:
                raise
            self._cache.clear()
            check_picture_memory(view)
        return []

    def _gbuffer(self, view: ViewInput) -> GBuffer:
        """Return the G-buffer from the cache, or project the meshes."""
        instances, camera, display = view.instances, view.shaded_camera, view.look.display
        samples = view.samples_per_side
        if self._gbuffer_cache is None:
            return project(instances, camera, display, self._cache, samples)
        return cached_project(instances, camera, display, self._gbuffer_cache, samples)
