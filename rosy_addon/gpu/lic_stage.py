"""Line integral convolution: the covering of a field, streamlines on it, and their ink."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..compositor.filter_kernel import look_for_symmetry
from ..compositor.flow import streamline_reach
from ..compositor.lic import noise_args
from ..compositor.look import Look, is_hatched
from . import lookup_tables, passes
from .defines import MAGNITUDE_MODES, REDUCE_BLOCK
from .field_kind import FieldKind
from .frame import Frame
from .passes import WORKGROUP_SIZE, ComputePass
from .resources import GpuResources
from .screen_box import Box
from .uniforms import (
    camera_uniforms,
    covering_uniforms,
    direction_uniforms,
    look_uniforms,
)

#: Factor of the contrast of streaks whose noise is interpolated between pixels, which makes them a little
#: stronger. Smooth streaks do not need it.
INTERPOLATED_CONTRAST = 0.96

#: Maximum steps, of all streamlines together, in one run of the LIC pass: drivers abort runs that
#: take too long.
MAX_DISPATCH_STEPS = 1 << 29


def render_fields(frame: Frame, kind: FieldKind, box: Box, picture: Any) -> None:
    """Draw the fields of one kind into a picture, with the textures of the earlier stages.

    Parameters
    ----------
    frame : Frame
    kind : FieldKind
    box : Box
        Pixels to draw.
    picture : texture
        Of the size of the frame.
    """
    look, resources = frame.look, frame.resources
    covering = covering_uniforms(kind, look)
    is_antialiased = int(frame.samples is not None)
    uniforms = {**covering, **look_uniforms(kind, look), "is_antialiased": is_antialiased}
    textures = {**frame.textures, **_unfold(frame, kind, box, covering)}
    textures |= {
        "noise_gradients": textures["directions"],
        "max_magnitude": _max_magnitude(frame, textures, kind, look),
        "color_map": lookup_tables.color_map(resources, look),
        "palette": lookup_tables.palette(resources),
    }
    if frame.samples is not None:
        textures["noise_gradients"] = _noise_gradients(frame, box, textures)
        uniforms["gain"] *= INTERPOLATED_CONTRAST
    if not is_hatched(look):
        _trace(frame, kind, box, passes.LIC, textures, {"picture": picture}, uniforms)
        return
    textures["line_means"] = _streaks(frame, kind, box, textures, uniforms)
    textures |= _ink_textures(frame, kind, textures)
    frame.run(passes.INK, box, textures, {"picture": picture}, uniforms, pause=1.0)


def _streaks(
    frame: Frame, kind: FieldKind, box: Box, textures: dict[str, Any], uniforms: dict[str, Any]
) -> Any:
    """Return the means along the lines of a look with ink; another texture if it needs none."""
    image, layers = frame.resources.image, kind.line_count
    has_streaks = not uniforms["even_lines"] or uniforms["break_steps"] > 0
    if not (has_streaks or uniforms["overshoot_steps"]):
        return textures["directions"]
    means = image("line_means", *frame.size, "RGBA16F", layers)
    images = {"line_means": means}
    _trace(frame, kind, box, passes.STREAKS, textures, images, uniforms, layers)
    if frame.samples is None or not has_streaks:
        return means
    smooth = image("smooth_means", *frame.size, "RGBA16F", layers)
    textures, images = {**textures, "line_means": means}, {"smooth_means": smooth}
    frame.run(passes.SMOOTH_STREAKS, box, textures, images, uniforms, layers)
    return smooth


def _ink_textures(frame: Frame, kind: FieldKind, textures: dict[str, Any]) -> dict[str, Any]:
    """Return the lookup tables of the ink, and images that the look does not have."""
    resources, look = frame.resources, frame.look
    result = {
        "ink_thresholds": lookup_tables.thresholds(
            resources, look_for_symmetry(frame.look, kind.symmetry)
        ),
        "disc_offsets": lookup_tables.undirected_offsets(resources, frame.look),
        "ink_table": lookup_tables.ink_table(resources, kind, look),
    }
    if "outline_coverage" not in textures:
        result["outline_coverage"] = textures["depth_slopes"]
    if "paper_grain" not in textures:
        result["paper_grain"] = lookup_tables.picture_grain(
            resources, *frame.size, look, kind.line_count
        )
    return result


def _trace(
    frame: Frame,
    kind: FieldKind,
    box: Box,
    shader: ComputePass,
    textures: dict[str, Any],
    images: dict[str, Any],
    uniforms: dict[str, Any],
    layers: int = 1,
) -> None:
    """Trace streamlines by passes over bands: all lines of a pixel, or a layer for each line."""
    left, bottom, right, top = box
    half_steps = streamline_reach(frame.look) if uniforms["half_length"] else 0
    row_steps = (right - left) * kind.line_count * 2 * half_steps
    # Whole work groups: a partial one would reach into rows that belong to the next band.
    groups = max(MAX_DISPATCH_STEPS // max(row_steps, 1) // WORKGROUP_SIZE[1], 1)
    band_rows = groups * WORKGROUP_SIZE[1]
    for start in range(bottom, top, band_rows):
        band = left, start, right, min(start + band_rows, top)
        done = (start - bottom) / (top - bottom)
        frame.run(shader, band, textures, images, uniforms, layers, pause=done)


def _unfold(frame: Frame, kind: FieldKind, box: Box, covering: dict[str, Any]) -> dict[str, Any]:
    """Return the images of the covering: its cells, and directions without and with their gradients."""
    image, lines = frame.resources.image, kind.line_count
    has_color_noise = noise_args(frame.look)["channels"] > 1
    shader = passes.COLOR_DIRECTIONS if has_color_noise else passes.DIRECTIONS
    uniforms = {**covering, **direction_uniforms(kind, frame.look, frame.camera)}
    cells = image("cells", *frame.size, dict(shader.images)["cells"])
    directions = image("directions", *frame.size, "RGBA16F", lines)
    frame.run(
        shader,
        box,
        frame.textures,
        {"cells": cells, "directions": directions},
        {**camera_uniforms(frame.camera), **uniforms},
    )
    textures = {"cells": cells, "directions": directions}
    images = {"angle_gradients": image("angle_gradients", *frame.size, "RGBA16F", lines)}
    frame.run(passes.ANGLE_GRADIENT, box, textures, images, covering, lines, pause=0.0)
    return {**textures, **images}


def _noise_gradients(frame: Frame, box: Box, textures: dict[str, Any]) -> Any:
    """Return the derivatives of the noise, two channels in a layer."""
    layers = 2 if noise_args(frame.look)["channels"] > 1 else 1
    gradients = frame.resources.image("noise_gradients", *frame.size, "RGBA16F", layers)
    images, uniforms = {"noise_gradients": gradients}, {"noise_layers": layers}
    frame.run(passes.NOISE_GRADIENTS, box, textures, images, uniforms)
    return gradients


def _max_magnitude(frame: Frame, textures: dict[str, Any], kind: FieldKind, look: Look) -> Any:
    """Return `largest_magnitude` of the fields of a kind.

    If the look does not need it, another texture that the shader does not read.
    """
    if not MAGNITUDE_MODES[look.magnitude] or look.magnitude_range:
        return textures["cells"]
    return largest_magnitude(frame.resources, textures["field_values"], kind.degree, frame.compute)


def largest_magnitude(
    resources: GpuResources, field_values: Any, degree: int, compute: Callable[..., None]
) -> Any:
    """Return a texture of one texel: the largest magnitude of the visible fields of a degree.

    Passes are run by a function as `Device.compute` or `Frame.compute`.
    """
    source = field_values
    width, height = source.width, source.height
    level, is_first = 0, 1
    while (width, height) != (1, 1) or is_first:
        width, height = -(-width // REDUCE_BLOCK), -(-height // REDUCE_BLOCK)
        tiles = resources.image(f"tiles {level}", width, height)
        compute(
            passes.MAX_REDUCE,
            (width, height),
            {"source_values": source},
            {"tiles": tiles},
            {"degree": degree, "is_first": is_first},
        )
        source, level, is_first = tiles, level + 1, 0
    return source
