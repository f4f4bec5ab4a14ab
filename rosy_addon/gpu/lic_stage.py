"""The field in a picture: evenly spaced lines, or line integral convolution on the covering of a field.

Evenly spaced lines come from phases on the surfaces, which are evaluated at the pixels. Streamlines are
traced for line integral convolution. The picture is then colored and lit, or drawn in ink.
"""

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from ..compositor.even_lines import COARSE_RATIO
from ..compositor.flow import noise_channel_count
from ..compositor.look import is_even, is_hatched, magnitude_range, uses_magnitude
from ..compositor.look_units import instance_line_spacing
from . import lookup_tables
from .defines import REDUCE_BLOCK
from .device import NamedValues
from .frame import Box, Frame
from .mesh_buffers import FieldKind
from .passes import WORKGROUP_SIZE, ComputePass
from .uniforms import direction_uniforms, even_line_uniforms, look_uniforms

#: Factor by which the contrast of streaks is reduced if their noise is interpolated between pixels:
#: interpolation makes the streaks a little stronger.
INTERPOLATED_CONTRAST = 0.96

#: Maximum steps, of all streamlines together, in one run of the LIC pass: drivers abort runs that
#: take too long.
MAX_DISPATCH_STEPS = 1 << 29


def even_line_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return a dict from keys of `Frame.prepared` to functions that look up the evenly spaced lines of instances.

    Each function returns the result of `GpuResources.line_records`: the lines, or a `Preparation` if they are
    not on the device. The dict is empty if the look does not draw evenly spaced lines.
    """
    look = frame.look
    if not is_even(look):
        return {}
    lookups: dict[Hashable, Callable[[], Any]] = {}
    for instance_id, item in frame.fields_in_view():
        spacing = instance_line_spacing(look, frame.camera, item.instance)
        for ratio in (1.0, COARSE_RATIO):
            lookups["lines", instance_id, ratio] = partial(
                frame.resources.line_records, item, look.display, ratio * spacing
            )
    return lookups


def render_even_lines(frame: Frame) -> None:
    """Render the evenly spaced lines of all instances into ``frame.textures["line_image"]``.

    `even_lines.even_lines` does the same with numpy. The image has a layer for each line direction,
    followed by as many layers for the wider spaced lines that replace crowded ones. If the look does not
    draw evenly spaced lines, the image is an unused placeholder.
    """
    if not is_even(frame.look):
        frame.textures["line_image"] = frame.resources.image("line_image", (1, 1), "RGBA16F", 1)
        return
    line_count = max((kind.line_count for kind in frame.kinds), default=1)
    image = frame.image("line_image", "RGBA16F", 2 * line_count)
    for instance_id, item in frame.fields_in_view():
        uniforms = even_line_uniforms(frame.look, item, frame.camera)
        for ratio, first_layer in ((1.0, 0), (COARSE_RATIO, item.kind.line_count)):
            records, node_count = frame.prepared["lines", instance_id, ratio]
            textures = {"line_records": records, "line_image": image}
            uniforms |= {"node_count": node_count, "first_layer": first_layer}
            frame.run_on_instance(ComputePass("even_lines"), instance_id, textures, uniforms)
    frame.textures["line_image"] = image


def render_fields(frame: Frame, kind: FieldKind, box: Box, picture: Any) -> None:
    """Draw all fields of one kind into a picture, with the textures of the earlier stages.

    Parameters
    ----------
    frame : Frame
    kind : FieldKind
    box : Box
        Pixels to draw.
    picture : texture
        The image to draw into. It has the size of the frame.
    """
    look, resources = frame.look, frame.resources
    is_antialiased = int(frame.samples is not None)
    uniforms = {**look_uniforms(kind, look), "is_antialiased": is_antialiased}
    textures = _unfold(frame, kind, box)
    textures |= {
        "noise_gradients": textures["directions"],
        "max_magnitude": textures["cells"],  # only read if the look shows it
        "color_map": lookup_tables.color_map(resources, look),
        "palette": lookup_tables.palette(resources),
        "picture": picture,
    }
    if uses_magnitude(look) and magnitude_range(look) is None:
        textures["max_magnitude"] = largest_magnitude(frame, kind.degree)
    if frame.samples is not None:
        textures["noise_gradients"] = _noise_gradients(frame, box, textures)
        uniforms["gain"] = look.gain * INTERPOLATED_CONTRAST
    if not is_hatched(look):
        _trace(frame, box, "lic", textures, uniforms)
        return
    textures["line_means"] = _streaks(frame, box, textures, uniforms)
    textures |= _ink_textures(frame, kind)
    frame.run(ComputePass("ink"), box, textures, uniforms, pause=1.0)


def _streaks(frame: Frame, box: Box, textures: dict[str, Any], uniforms: dict[str, Any]) -> Any:
    """Return means along each line through a pixel, for a look with ink: one layer per line direction.

    The channels are the means of the noise, of the noise that breaks lines, and of the tone. If the look
    needs none of them, return an arbitrary texture, which is not read. `textures` include the result of
    `_unfold`, and `uniforms` the result of `look_uniforms`.
    """
    layers = uniforms["line_count"]
    has_streaks = not uniforms["even_lines"] or uniforms["break_steps"] > 0
    if not (has_streaks or uniforms["overshoot_steps"]):
        return textures["directions"]
    means = frame.image("line_means", "RGBA16F", layers)
    textures = {**textures, "line_means": means}
    _trace(frame, box, "streaks", textures, uniforms, layers)
    if frame.samples is None or not has_streaks:
        return means
    smooth = frame.image("smooth_means", "RGBA16F", layers)
    textures["smooth_means"] = smooth
    frame.run(ComputePass("smooth_streaks"), box, textures, uniforms, layers)
    return smooth


def _ink_textures(frame: Frame, kind: FieldKind) -> dict[str, Any]:
    """Return the lookup tables from tone to ink, by name, and images for the samplers that the look leaves unset.

    Every sampler of the shader needs an image, also those of the outline and the paper grain.
    """
    resources, look = frame.resources, frame.look
    result = {
        "ink_thresholds": lookup_tables.thresholds(resources, look.for_symmetry(kind.symmetry)),
        "disc_offsets": lookup_tables.undirected_offsets(resources, look),
        "ink_table": lookup_tables.ink_table(resources, kind, look),
    }
    if "outline_coverage" not in frame.textures:
        result["outline_coverage"] = frame.textures["depth_slopes"]
    if "paper_grain" not in frame.textures:
        result["paper_grain"] = lookup_tables.picture_grain(
            resources, frame.size, look, kind.line_count
        )
    return result


def _trace(
    frame: Frame, box: Box, name: str, textures: NamedValues, uniforms: NamedValues, layers: int = 1
) -> None:
    """Add the passes of a shader that traces streamlines, each over a band of rows of the box.

    `name` is the name of the shader, and `uniforms` include the result of `look_uniforms`.
    With one layer, a thread traces the streamlines along all line directions at a pixel. Otherwise
    `layers` is the number of line directions, and a thread traces the streamline along one of them.
    """
    left, bottom, right, top = box
    half_steps = frame.look.streamline_reach() if uniforms["half_length"] else 0
    row_steps = (right - left) * uniforms["line_count"] * 2 * half_steps
    # Whole work groups: a partial one would reach into rows that belong to the next band.
    groups = max(MAX_DISPATCH_STEPS // max(row_steps, 1) // WORKGROUP_SIZE[1], 1)
    band_rows = groups * WORKGROUP_SIZE[1]
    for start in range(bottom, top, band_rows):
        band = left, start, right, min(start + band_rows, top)
        done = (start - bottom) / (top - bottom)
        frame.run(ComputePass(name), band, textures, uniforms, layers, pause=done)


def _unfold(frame: Frame, kind: FieldKind, box: Box) -> dict[str, Any]:
    """Render the covering of the fields of one kind, and return its images by name.

    ``cells`` holds the phase and the noise of each pixel. The phase is 2 + S a / (2 pi), with S the number of
    sheets, and a the angle from the guiding angle to the nearest member, rotated by the wobble. The lowest bits
    of the phase are a mask of the neighbors to which the field continues. It is 0 at pixels without a field of
    this kind.

    ``directions`` has a layer for each line direction, with its vector on screen. ``angle_gradients`` has the
    same layers: x and y of the vector, and the derivatives of its angle along x and y, in radians per pixel.
    """
    lines = kind.line_count
    cell_format = "RG32F" if noise_channel_count(frame.look) == 1 else "RGBA32F"
    uniforms = direction_uniforms(kind, frame.look, frame.camera)
    covering = {
        "cells": frame.image("cells", cell_format),
        "directions": frame.image("directions", "RGBA16F", lines),
        "angle_gradients": frame.image("angle_gradients", "RGBA16F", lines),
    }
    frame.run(ComputePass("directions", (("cells", cell_format),)), box, covering, uniforms)
    frame.run(ComputePass("angle_gradient"), box, covering, uniforms, lines, pause=0.0)
    return covering


def _noise_gradients(frame: Frame, box: Box, textures: dict[str, Any]) -> Any:
    """Return an image of the derivatives of the noise along x and y, per pixel.

    A layer has the x and y derivatives of one noise channel, then of a second one. `textures` include the
    result of `_unfold`.
    """
    layers = 2 if noise_channel_count(frame.look) > 1 else 1
    gradients = frame.image("noise_gradients", "RGBA16F", layers)
    textures = {**textures, "noise_gradients": gradients}
    frame.run(ComputePass("noise_gradients"), box, textures, {"noise_layers": layers})
    return gradients


def largest_magnitude(frame: Frame, degree: int) -> Any:
    """Return a texture of one texel: the largest magnitude of the visible fields with a degree."""
    source, (width, height) = frame.image("field_values"), frame.size
    level, is_first = 0, 1
    while (width, height) != (1, 1) or is_first:
        width, height = -(-width // REDUCE_BLOCK), -(-height // REDUCE_BLOCK)
        tiles = frame.resources.image(f"tiles {level}", (width, height))
        textures = {"source_values": source, "tiles": tiles}
        uniforms = {"degree": degree, "is_first": is_first}
        frame.run(ComputePass("max_reduce"), (0, 0, width, height), textures, uniforms)
        source, level, is_first = tiles, level + 1, 0
    return source
