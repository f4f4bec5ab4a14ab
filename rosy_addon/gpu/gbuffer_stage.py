"""The G-buffer of a picture: the triangle that is visible at each pixel, and the surface and field there."""

from typing import Any

import numpy as np

from ..compositor.hatching import has_outline
from .frame import Frame
from .passes import ComputePass, RasterPass
from .uniforms import clip_uniforms


def render_gbuffer(frame: Frame) -> None:
    """Render the G-buffer: the triangle that is visible at each pixel, and the surface and field there.

    The images are put into ``frame.textures``: ``visibility``, ``normals``, ``field_values``,
    ``depth_slopes`` and ``field_channels``. If pixels have several samples, ``sample_entries`` is added:
    for each sample, the pixel whose surface it shows; see `projection.pixel_coverage`. A G-buffer of the
    samples themselves is rendered only if outlines need it.
    """
    samples = frame.samples
    if samples is None:
        _render_surfaces(frame, _visibility(frame))
        return
    samples.textures["visibility"] = _visibility(samples)
    _render_surfaces(frame, _pixel_visibility(frame, samples))
    if has_outline(samples.look):
        _render_surfaces(samples, samples.textures["visibility"])
    frame.textures["sample_entries"] = _sample_entries(frame, samples)


def _visibility(frame: Frame) -> Any:
    """Return an image with the id of the triangle that is visible at the center of each pixel."""
    batches = []
    for first_triangle_id, item in zip(frame.first_triangle_ids, frame.items, strict=True):
        uniforms = clip_uniforms(item, frame.camera, frame.view.clip_planes)
        batches.append((item.mesh.batch, {"first_triangle_id": first_triangle_id, **uniforms}))
    # Testing the clip planes takes a third of the time.
    is_clipped = frame.view.clip_planes is not None
    shader = RasterPass("visibility_clipped" if is_clipped else "visibility")
    visibility = frame.image("visibility", "R32F")
    frame.draw(shader, batches, visibility)
    return visibility


def _pixel_visibility(frame: Frame, samples: Frame) -> Any:
    """Return an image with the id of the triangle that each pixel shows.

    It is the triangle at the center of the pixel or, if there is none, at the sample nearest to the center.
    """
    textures = {
        "center_visibility": _visibility(frame),
        "sample_visibility": samples.textures["visibility"],
        "visibility": frame.image("pixel_visibility", "R32F"),
    }
    uniforms = {"samples_per_side": frame.samples_per_side, "occluder_id": frame.occluder_id}
    frame.run(ComputePass("pixel_visibility"), frame.box, textures, uniforms)
    return textures["visibility"]


def _render_surfaces(frame: Frame, visibility: Any) -> None:
    """Render the surface and field at each pixel, given the ids of visible triangles."""
    channel_count = max((item.mesh.buffers.channel_count for item in frame.items), default=0)
    channel_size = frame.size if channel_count else (1, 1)
    gbuffer = {name: frame.image(name) for name in ("normals", "field_values", "depth_slopes")}
    gbuffer["field_channels"] = frame.resources.image(
        "field_channels", channel_size, layers=max(channel_count, 1)
    )
    frame.clear(gbuffer["field_values"])
    frame.textures["visibility"] = visibility
    for instance_id, item in frame.fields_in_view():
        uniforms = {
            "pixels_per_unit": frame.camera.pixels_per_unit,
            "channel_count": item.mesh.buffers.channel_count,
            "model_scale": float(np.linalg.norm(item.model_matrix[:3, 0])),  # a similarity
        }
        frame.run_on_instance(ComputePass("resolve"), instance_id, gbuffer, uniforms)
    frame.textures |= gbuffer


def _sample_entries(frame: Frame, samples: Frame) -> Any:
    """Return an image that holds, for each sample, the pixel of `frame` from which it takes its shading.

    It is a pixel nearby that shows the same surface. `samples` is the frame with several samples per pixel.
    """
    entries = samples.image("sample_entries", "R32F")
    samples.clear(entries, "R32F")
    visibility = samples.textures["visibility"]
    textures = {**frame.textures, "sample_visibility": visibility, "sample_entries": entries}
    uniforms = {"samples_per_side": frame.samples_per_side}
    for instance_id, _ in samples.fields_in_view():
        samples.run_on_instance(ComputePass("sample_entries"), instance_id, textures, uniforms)
    return entries
