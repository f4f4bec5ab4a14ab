"""The renderer that uses numpy alone: project, then compose."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from ..cache import Cache
from ..compositor.band_division import context_rows
from ..compositor.color_values import check_color_values
from ..compositor.compose import compose_task
from ..compositor.flow import noise_channel_count
from ..compositor.look import is_hatched
from ..compositor.picture import Picture
from ..compositor.picture_key import fixed_color_range
from ..compositor.target_tone import check_tone
from ..errors import RosyError
from ..field.symmetry import FieldSymmetry
from ..memory import (
    PIXEL_BYTES,
    PROCESS_BYTES,
    TRIANGLE_BYTES,
    check_memory,
    samples_memory,
)
from ..progress import Task, subtask
from ..projection.gbuffer import GBuffer
from ..projection.project import cached_project_task, check_instances, project_task
from .arrowheads import with_arrowheads_task
from .band_workers import BandWorkers
from .singularities import with_singularities_task
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
        picture = yield from subtask(self._picture_task(view), 0.0, 0.97)
        picture = yield from subtask(with_arrowheads_task(picture, view, self._cache), 0.97, 0.99)
        return (yield from subtask(with_singularities_task(picture, view, self._cache), 0.99, 1.0))

    def _picture_task(self, view: ViewInput) -> Task[Picture]:
        """Draw the picture without arrowheads and singularities."""
        check_tone(view.look, [instance.tone for instance in view.instances], view.reference)
        if not view.draws_thresholds:
            check_color_values(view.look, view.instances)
        rows = self._checked_bands(view)
        if len(rows) > 1:
            rgba = yield from self._workers.draw_task(view, rows, self._cache)
            if rgba is not None:
                return Picture(rgba, (), color_range=fixed_color_range(view.look, view.instances))
        gbuffer = yield from subtask(self._gbuffer_task(view), 0.0, PROJECTION_SHARE)
        compose = compose_task(
            gbuffer,
            view.look,
            view.lights,
            view.reference,
            self._gbuffer_cache,
            self._cache,
            draws_thresholds=view.draws_thresholds,
        )
        return (yield from subtask(compose, PROJECTION_SHARE, 1.0))

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

    def _gbuffer_task(self, view: ViewInput) -> Task[GBuffer]:
        """Return the G-buffer from the cache, or project the meshes."""
        instances, camera, display = view.instances, view.shaded_camera, view.look.display
        samples = view.samples_per_side
        if self._gbuffer_cache is None:
            return project_task(instances, camera, display, self._cache, samples)
        return cached_project_task(instances, camera, display, self._gbuffer_cache, samples)


def check_picture_memory(
    view: ViewInput, rows: Sequence[tuple[int, int]] = (), together: int = 1
) -> None:
    """Check that a picture can take the memory that it needs; see `picture_memory`.

    Raises
    ------
    RosyError
        If it needs more than `memory.available_memory`.
    """
    camera, samples = view.camera, view.look.supersampling
    each = f" with {samples} x {samples} samples each" if samples > 1 else ""
    check_memory(
        picture_memory(view, rows, together),
        f"a picture of {camera.width} x {camera.height} pixels{each}",
        "choose a smaller size" + (", or less supersampling" if samples > 1 else ""),
    )


def picture_memory(
    view: ViewInput, rows: Sequence[tuple[int, int]] = (), together: int = 1
) -> float:
    """Return the bytes that a picture may take at its peak, beyond those that are taken before.

    It is the finished picture, and in each process the samples of its piece and all triangles. The
    surfaces are assumed to fill the picture.

    Parameters
    ----------
    view : ViewInput
    rows : sequence of (int, int)
        Of the bands in which it is drawn, if there are several.
    together : int
        Bands that are drawn at a time, each in a process.
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
    height = camera.height
    if len(rows) > 1:
        context = context_rows(look, camera, view.instances)
        height = min(max(stop - start for start, stop in rows) + 2 * context, height)
    process = PROCESS_BYTES
    process += samples_memory(camera.width * height, max(lines, default=1), many_images)
    process += TRIANGLE_BYTES * sum(len(instance.surface.triangles) for instance in view.instances)
    picture = PIXEL_BYTES * view.camera.width * view.camera.height
    return picture + process * min(together, max(len(rows), 1))
