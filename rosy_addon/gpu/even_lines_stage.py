"""Evenly spaced lines: their phases on the surfaces, evaluated at the pixels."""

from __future__ import annotations

from ..compositor.even_lines import COARSE_RATIO, SPACING_GRAINS, has_even_lines
from ..compositor.look_units import instance_line_spacing
from ..progress import Task, subtask
from . import passes
from .frame import Frame
from .uniforms import even_line_uniforms


def even_lines_task(frame: Frame) -> Task[None]:
    """Render the lines of all instances into ``frame.textures["line_image"]``.

    The method is that of `even_lines.even_lines_task`. The lines that replace crowded ones are in the
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
        spacing = instance_line_spacing(look, SPACING_GRAINS, camera, item.instance)
        uniforms = even_line_uniforms(look, item, camera)
        for ratio, first_layer in ((1.0, 0), (COARSE_RATIO, item.kind.line_count)):
            task = resources.line_records_task(item, look.display, ratio * spacing)
            frame.textures["line_records"], node_count = yield from subtask(task, 0.13, 0.15)
            uniforms |= {"node_count": node_count, "first_layer": first_layer}
            images = {"line_image": image}
            frame.run_on_instance(passes.EVEN_LINES, instance_id, box, images, uniforms)
    frame.textures["line_image"] = image
