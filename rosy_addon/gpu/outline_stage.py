"""The outline of a picture: lines at silhouettes, borders and creases."""

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from ..compositor.hatching import has_outline
from ..compositor.look import crease_angle_of
from .defines import CREASE_SLICES, CREASES_PER_ROW
from .frame import Frame
from .passes import ComputePass
from .resources import OutlineTextures
from .uniforms import clip_uniforms, min_normal_cosine


def outline_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return a dict from keys of `Frame.prepared` to functions that look up the creases of instances.

    Each function returns the result of `GpuResources.outline_textures`: `OutlineTextures`, or a `Preparation`
    if they are not on the device. The dict is empty if the look has no outline.
    """
    if not has_outline(frame.look):
        return {}
    drawn = frame if frame.samples is None else frame.samples
    angle = crease_angle_of(frame.look)
    return {
        ("outline", instance_id): partial(frame.resources.outline_textures, item, angle)
        for instance_id, item in drawn.fields_in_view()
    }


def render_outline(frame: Frame) -> None:
    """Render the fraction of each pixel that outlines cover into ``frame.textures["outline_coverage"]``.

    Nothing is rendered if the look has no outline. If pixels have several samples, the outline is drawn at
    the samples, and the result is their mean. `compositor.outline` does the same with numpy.
    """
    if not has_outline(frame.look):
        return
    if frame.samples is None:
        frame.textures["outline_coverage"] = _coverage(frame, frame.prepared)
        return
    textures = {
        "sample_coverage": _coverage(frame.samples, frame.prepared),
        "outline_coverage": frame.image("outline_coverage", "R32F"),
    }
    uniforms = {"samples_per_side": frame.samples_per_side}
    frame.run(ComputePass("outline_mean"), frame.box, textures, uniforms)
    frame.textures["outline_coverage"] = textures["outline_coverage"]


def _coverage(frame: Frame, prepared: dict[Hashable, Any]) -> Any:
    """Return an image of the fraction that outlines cover, for each pixel of the frame.

    `prepared` has the `OutlineTextures` of instances, by the keys of `outline_lookups`.
    """
    crease_marks = frame.image("crease_marks", "R32F")
    edges = frame.image("outline_edges", "RG32F")
    frame.clear(crease_marks, "R32F")
    frame.clear(edges, "RG32F")
    for instance_id, _ in frame.fields_in_view():
        found = prepared["outline", instance_id]
        if found.crease_count:
            _mark_creases(frame, instance_id, found, crease_marks)
        textures = {
            "outline_edges": edges,
            "crease_marks": crease_marks,
            "triangle_parts": found.triangle_parts or frame.textures["visibility"],
        }
        uniforms = {
            "min_normal_cosine": min_normal_cosine(frame.look),
            "has_creases": int(found.crease_count > 0),
            "has_parts": int(found.triangle_parts is not None),
        }
        frame.run_on_instance(ComputePass("outline_edges"), instance_id, textures, uniforms)
    width, height = (side // frame.look.supersampling for side in frame.size)
    textures = {
        "outline_edges": edges,
        "outline_blocks": frame.resources.image("outline_blocks", (width, height), "R32F"),
        "outline_widths": frame.image("outline_widths", "R32F"),
        "outline_coverage": frame.image("outline_coverage", "R32F"),
    }
    blocks = 0, 0, width, height
    frame.run(ComputePass("outline_blocks"), blocks, textures, {}, pause=0.5)
    frame.run(ComputePass("outline_widths"), blocks, textures, {})
    frame.run(ComputePass("outline_coverage"), frame.box, textures, {})
    return textures["outline_coverage"]


def _mark_creases(frame: Frame, instance_id: int, found: OutlineTextures, marks: Any) -> None:
    """Mark the pixels next to the visible creases of an instance in the image `crease_marks`.

    `found` has the creases of the instance.
    """
    columns = min(found.crease_count, CREASES_PER_ROW)
    box = 0, 0, columns, -(-found.crease_count // columns)
    textures = {"crease_points": found.crease_points, "crease_marks": marks}
    uniforms = {
        **clip_uniforms(frame.items[instance_id], frame.camera, frame.view.clip_planes),
        **frame.instance_uniforms(instance_id),
        "crease_count": found.crease_count,
    }
    frame.run(ComputePass("outline_creases"), box, textures, uniforms, layers=CREASE_SLICES)
