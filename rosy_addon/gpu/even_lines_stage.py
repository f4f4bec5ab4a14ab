"""Evenly spaced lines: their phases on the surfaces, evaluated at the pixels."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from ..compositor.even_lines import COARSE_RATIO, SPACING_GRAINS, has_even_lines
from ..compositor.look_units import instance_line_spacing
from . import passes
from .frame import Frame
from .uniforms import even_line_uniforms


def even_line_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return what looks up the lines of the instances, by the keys of `Frame.prepared`."""
    look = frame.look
    if not has_even_lines(look):
        return {}
    lookups: dict[Hashable, Callable[[], Any]] = {}
    for instance_id, item, _ in frame.fields_in_view():
        spacing = instance_line_spacing(look, SPACING_GRAINS, frame.camera, item.instance)
        for ratio in (1.0, COARSE_RATIO):
            lookups["lines", instance_id, ratio] = partial(
                frame.resources.line_records, item, look.display, ratio * spacing
            )
    return lookups


def render_even_lines(frame: Frame) -> None:
    """Render the lines of all instances into ``frame.textures["line_image"]``.

    The method is that of `even_lines.even_lines`. The lines that replace crowded ones are in the
    layers after the others, whether any are crowded or not. Nothing is rendered for other looks.
    """
    resources = frame.resources
    if not has_even_lines(frame.look):
        frame.textures["line_image"] = resources.image("line_image", 1, 1, "RGBA16F", 1)
        return
    line_count = max((kind.line_count for kind in frame.kinds), default=1)
    image = resources.image("line_image", *frame.size, "RGBA16F", 2 * line_count)
    look, camera = frame.look, frame.camera
    for instance_id, item, box in frame.fields_in_view():
        uniforms = even_line_uniforms(look, item, camera)
        for ratio, first_layer in ((1.0, 0), (COARSE_RATIO, item.kind.line_count)):
            records = frame.prepared["lines", instance_id, ratio]
            frame.textures["line_records"], node_count = records
            uniforms = {**uniforms, "node_count": node_count, "first_layer": first_layer}
            images = {"line_image": image}
            frame.run_on_instance(passes.EVEN_LINES, instance_id, box, images, uniforms)
    frame.textures["line_image"] = image
