"""The outline of a picture: lines at silhouettes, borders and creases."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from ..compositor.hatching import has_outline
from ..compositor.look import crease_angle_of
from .defines import CREASE_SLICES, CREASES_PER_ROW
from .frame import Frame
from .passes import ComputePass
from .resources import DrawItem, OutlineTextures
from .uniforms import clip_uniforms, min_normal_cosine


def outline_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return functions that look up the creases of instances, by the keys of `Frame.prepared`.

    There are none if the look has no outline.
    """
    if not has_outline(frame.look):
        return {}
    drawn = frame if frame.samples is None else frame.samples
    angle = crease_angle_of(frame.look)
    return {
        ("outline", instance_id): partial(frame.resources.outline_textures, item, angle)
        for instance_id, item, _ in drawn.fields_in_view()
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
    coverage = _coverage(frame.samples, frame.prepared)
    mean = frame.image("outline_coverage", "R32F")
    frame.run(
        ComputePass("outline_mean"),
        frame.box,
        {"sample_coverage": coverage},
        {"outline_coverage": mean},
        {"samples_per_side": frame.samples_per_side},
    )
    frame.textures["outline_coverage"] = mean


def _coverage(frame: Frame, prepared: dict[Hashable, Any]) -> Any:
    """Return an image of the fraction that outlines cover, for each pixel of the frame."""
    crease_marks = frame.image("crease_marks", "R32F")
    edges = frame.image("outline_edges", "RG32F")
    frame.clear(crease_marks, "R32F")
    frame.clear(edges, "RG32F")
    for instance_id, item, box in frame.fields_in_view():
        found = prepared["outline", instance_id]
        if found.crease_count:
            _mark_creases(frame, instance_id, item, found, crease_marks)
        textures = {
            "crease_marks": crease_marks,
            "triangle_parts": found.triangle_parts or frame.textures["visibility"],
        }
        uniforms = {
            "min_normal_cosine": min_normal_cosine(frame.look),
            "has_creases": int(found.crease_count > 0),
            "has_parts": int(found.triangle_parts is not None),
        }
        images, shader = {"outline_edges": edges}, ComputePass("outline_edges")
        frame.run_on_instance(shader, instance_id, box, textures, images, uniforms)
    width, height = (side // frame.look.supersampling for side in frame.size)
    images = {
        "outline_blocks": frame.resources.image("outline_blocks", width, height, "R32F"),
        "outline_widths": frame.image("outline_widths", "R32F"),
        "outline_coverage": frame.image("outline_coverage", "R32F"),
    }
    textures = {**images, "outline_edges": edges}
    blocks = 0, 0, width, height
    frame.run(ComputePass("outline_blocks"), blocks, textures, images, {}, pause=0.5)
    frame.run(ComputePass("outline_widths"), blocks, textures, images, {})
    frame.run(ComputePass("outline_coverage"), frame.box, textures, images, {})
    return images["outline_coverage"]


def _mark_creases(
    frame: Frame, instance_id: int, item: DrawItem, found: OutlineTextures, crease_marks: Any
) -> None:
    """Mark the pixels next to the visible creases of an instance."""
    columns = min(found.crease_count, CREASES_PER_ROW)
    frame.run(
        ComputePass("outline_creases"),
        (0, 0, columns, -(-found.crease_count // columns)),
        {"crease_points": found.crease_points},
        {"crease_marks": crease_marks},
        {
            **clip_uniforms(item, frame.camera, frame.view.clip_planes),
            **frame.instance_uniforms(instance_id),
            "crease_count": found.crease_count,
        },
        layers=CREASE_SLICES,
    )
