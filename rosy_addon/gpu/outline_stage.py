"""The outline of a picture: lines at silhouettes, borders and creases."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

import numpy as np

from ..compositor.hatching import has_outline
from . import passes
from .defines import CREASE_SLICES, CREASES_PER_ROW
from .frame import Frame
from .resources import DrawItem, OutlineTextures
from .screen_box import Box
from .uniforms import clip_uniforms


def outline_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return what looks up the creases of the instances, by the keys of `Frame.prepared`."""
    if not has_outline(frame.look):
        return {}
    drawn = frame if frame.samples is None else frame.samples
    angle = _crease_angle(drawn)
    return {
        ("outline", instance_id): partial(frame.resources.outline_textures, item, angle)
        for instance_id, item, _ in drawn.fields_in_view()
    }


def render_outline(frame: Frame) -> None:
    """Render the outline of a look that has one: the share of pixels that it covers.

    It is ``frame.textures["outline_coverage"]``. The method is that of `compositor.outline`. If pixels
    have several samples, it is drawn at these.
    """
    if not has_outline(frame.look):
        return
    if frame.samples is None:
        frame.textures["outline_coverage"] = _coverage(frame, frame.prepared)
        return
    coverage = _coverage(frame.samples, frame.prepared)
    mean = frame.resources.image("outline_coverage", *frame.size, "R32F")
    frame.run(
        passes.OUTLINE_MEAN,
        (0, 0, *frame.size),
        {**frame.textures, "sample_coverage": coverage},
        {"outline_coverage": mean},
        {"samples_per_side": frame.samples_per_side},
    )
    frame.textures["outline_coverage"] = mean


def _crease_angle(frame: Frame) -> float | None:
    return None if frame.look.cross_creases else frame.look.crease_angle


def _coverage(frame: Frame, prepared: dict[Hashable, Any]) -> Any:
    """Return the share of each pixel, or sample, that outlines cover."""
    look = frame.look
    image, size = frame.resources.image, frame.size
    crease_marks, edges = (
        image("crease_marks", *size, "R32F"),
        image("outline_edges", *size, "RG32F"),
    )
    frame.clear(crease_marks, "R32F")
    frame.clear(edges, "RG32F")
    for instance_id, item, box in frame.fields_in_view():
        found = prepared["outline", instance_id]
        if found.crease_count:
            _mark_creases(frame, instance_id, item, found, crease_marks)
        _render_edges(frame, instance_id, box, found, crease_marks, edges)
    block_side = look.supersampling
    width, height = (side // block_side for side in size)
    blocks, widths = (
        image("outline_blocks", width, height, "R32F"),
        image("outline_widths", *size, "R32F"),
    )
    box = 0, 0, width, height
    textures = {"outline_edges": edges, "outline_blocks": blocks}
    uniforms = {"outline": look.outline, "supersampling": block_side}
    frame.run(passes.OUTLINE_BLOCKS, box, textures, {"outline_blocks": blocks}, uniforms, pause=0.5)
    frame.run(passes.OUTLINE_WIDTHS, box, textures, {"outline_widths": widths}, uniforms)
    coverage = image("outline_coverage", *size, "R32F")
    textures = {**frame.textures, "outline_widths": widths}
    images = {"outline_coverage": coverage}
    frame.run(passes.OUTLINE_COVERAGE, (0, 0, *size), textures, images, uniforms)
    return coverage


def _mark_creases(
    frame: Frame, instance_id: int, item: DrawItem, found: OutlineTextures, crease_marks: Any
) -> None:
    """Mark the pixels next to the visible creases of an instance."""
    columns = min(found.crease_count, CREASES_PER_ROW)
    frame.compute(
        passes.OUTLINE_CREASES,
        (columns, -(-found.crease_count // columns), CREASE_SLICES),
        {**frame.textures, "crease_points": found.crease_points},
        {"crease_marks": crease_marks},
        {
            **clip_uniforms(item, frame.camera, frame.clip_planes),
            **frame.instance_uniforms(instance_id),
            "crease_count": found.crease_count,
        },
    )


def _render_edges(
    frame: Frame,
    instance_id: int,
    box: Box,
    found: OutlineTextures,
    crease_marks: Any,
    edges: Any,
) -> None:
    """Render the edges of an instance: the width of the line, and what begins there."""
    look, has_parts = frame.look, found.triangle_parts is not None
    parts = found.triangle_parts if has_parts else frame.textures["visibility"]
    frame.run(
        passes.OUTLINE_EDGES,
        box,
        {**frame.textures, "crease_marks": crease_marks, "triangle_parts": parts},
        {"outline_edges": edges},
        {
            **frame.instance_uniforms(instance_id),
            "outline": look.outline,
            "min_normal_cosine": -2.0 if look.cross_creases else float(np.cos(look.crease_angle)),
            "has_creases": int(found.crease_count > 0),
            "has_parts": int(has_parts),
        },
    )
