"""The noise of a picture: input noise of line integral convolution, paper grain, and wobble."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

import numpy as np

from ..compositor.hatching import has_paper_grain
from ..compositor.image_noise import BLUR_FACTOR, box_radius
from ..compositor.lic import noise_args
from ..compositor.look_units import cell_size_args
from ..compositor.paper_grain import surface_paper_grain_args
from ..compositor.surface_noise import instance_hashes
from ..compositor.wobble import has_wobble
from . import lookup_tables, passes
from .frame import Frame
from .uniforms import surface_cell_uniforms, surface_noise_uniforms, wobble_uniforms


def feature_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return what looks up the features of the surfaces, by the keys of `Frame.prepared`."""
    if frame.look.anchor != "surface" or not frame.look.detail:
        return {}
    return {
        ("features", instance_id): partial(frame.resources.feature_curvature, item.instance.surface)
        for instance_id, item, _ in frame.fields_in_view()
    }


def render_noise(frame: Frame) -> None:
    """Render the noise of a picture, its paper grain and wobble into ``frame.textures``."""
    _render_noise(frame)
    _render_paper_grain(frame)
    _render_wobble(frame)


def _render_noise(frame: Frame) -> None:
    """Render the noise of the picture or of the surfaces, as ``frame.textures["noise"]``."""
    look = frame.look
    if look.anchor == "surface":
        settings = noise_args(frame.look) | cell_size_args(frame.look)
        settings["detail"] = look.detail
        frame.textures["noise"] = _surface_noise(frame, settings, "noise")
    else:
        frame.textures["noise"] = lookup_tables.picture_noise(frame.resources, *frame.size, look)


def _render_paper_grain(frame: Frame) -> None:
    """Render the paper grain of the surfaces, as ``frame.textures["paper_grain"]``.

    Nothing is rendered if the grain is fixed to the picture: it then depends on the number of lines,
    and `lic_stage.render_fields` looks it up.
    """
    if has_paper_grain(frame.look) and frame.look.anchor == "surface":
        settings = surface_paper_grain_args(frame.look) | cell_size_args(frame.look)
        frame.textures["paper_grain"] = _surface_noise(frame, settings, "paper_grain")


def _render_wobble(frame: Frame) -> None:
    """Render the angle by which lines wobble, as ``frame.textures["wobble_angles"]``.

    The method is that of `wobble.wobble_angle`.
    """
    if not has_wobble(frame.look):
        frame.textures["wobble_angles"] = lookup_tables.palette(frame.resources)
        return
    angles = frame.resources.image("wobble_angles", *frame.size)
    frame.textures["wave_table"] = lookup_tables.waves(frame.resources)
    for instance_id, item, box in frame.fields_in_view():
        uniforms = wobble_uniforms(frame.look, item, frame.camera)
        images = {"wobble_angles": angles}
        frame.run_on_instance(passes.WOBBLE, instance_id, box, images, uniforms)
    frame.textures["wobble_angles"] = angles


def _surface_noise(frame: Frame, settings: dict[str, Any], name: str) -> Any:
    """Return noise that moves with the surfaces, as `surface_noise.surface_noise`."""
    raw_noise = frame.resources.image("raw_noise", *frame.size)
    frame.clear(raw_noise)
    shared_uniforms = surface_noise_uniforms(settings)
    names = [item.mesh.keep_alive[0].name for item in frame.items]
    hashes = instance_hashes(names).view(np.int32)
    for instance_id, item, box in frame.fields_in_view():
        if settings.get("detail"):
            frame.textures["feature_curvature"] = frame.prepared["features", instance_id]
        else:
            frame.textures["feature_curvature"] = lookup_tables.palette(frame.resources)
        uniforms = {
            **shared_uniforms,
            **surface_cell_uniforms(settings, item, frame.camera),
            "instance_hash": int(hashes[instance_id]),
        }
        images = {"raw_noise": raw_noise}
        frame.run_on_instance(passes.SURFACE_NOISE, instance_id, box, images, uniforms)
    return _high_passed(frame, raw_noise, settings["high_pass"], name)


def _high_passed(frame: Frame, raw_noise: Any, high_pass: float, name: str) -> Any:
    """Return centered noise, without its low frequencies if `high_pass` is not 0."""
    size, blurred = frame.size, raw_noise
    if high_pass:
        radius = box_radius(BLUR_FACTOR * high_pass)
        for index, axis in enumerate(((1, 0), (0, 1)) * 3):
            next_blurred = frame.resources.image(f"blurred {index % 2}", *size)
            frame.compute(
                passes.BOX_BLUR,
                size,
                {"source_image": blurred},
                {"blurred_image": next_blurred},
                {"blur_axis": axis, "radius": radius},
                pause=0.5,
            )
            blurred = next_blurred
    noise = frame.resources.image(name, *size)
    frame.compute(
        passes.CENTER_NOISE,
        size,
        {"raw_noise": raw_noise, "blurred_noise": blurred},
        {"noise": noise},
        {"high_passed": int(high_pass > 0)},
    )
    return noise
