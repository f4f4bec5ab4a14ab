"""The noise of a picture: input noise of line integral convolution, paper grain, and wobble."""

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

import numpy as np

from ..compositor.hatching import has_paper_grain
from ..compositor.image_noise import BLUR_FACTOR, NoiseSettings, box_radius
from ..compositor.lic import noise_settings
from ..compositor.paper_grain import surface_paper_grain_settings
from ..compositor.surface_noise import instance_hashes
from ..compositor.wobble import has_wobble
from . import lookup_tables
from .frame import Frame
from .passes import ComputePass
from .uniforms import noise_uniforms, surface_cell_uniforms, wobble_uniforms


def feature_lookups(frame: Frame) -> dict[Hashable, Callable[[], Any]]:
    """Return a dict from keys of `Frame.prepared` to functions that look up the curvatures of surfaces.

    Each function returns the result of `GpuResources.feature_curvature`: a texture, or a `Preparation` if the
    curvature is not on the device. The dict is empty if the noise does not depend on the curvature.
    """
    if frame.look.anchor != "surface" or not frame.look.detail:
        return {}
    return {
        ("features", instance_id): partial(frame.resources.feature_curvature, item.instance.surface)
        for instance_id, item in frame.fields_in_view()
    }


def render_noise(frame: Frame) -> None:
    """Render the noise of a picture, its paper grain and wobble into ``frame.textures``.

    Paper grain that is fixed to the picture, not to the surfaces, is left out: it depends on the number of
    line directions, so `lic_stage.render_fields` looks it up.
    """
    look = frame.look
    if look.anchor == "surface":
        settings = noise_settings(look)
        frame.textures["noise"] = _surface_noise(frame, settings, "noise", look.detail)
    else:
        frame.textures["noise"] = lookup_tables.picture_noise(frame.resources, frame.size, look)
    if has_paper_grain(look) and look.anchor == "surface":
        settings = surface_paper_grain_settings(look)
        frame.textures["paper_grain"] = _surface_noise(frame, settings, "paper_grain")
    _render_wobble(frame)


def _render_wobble(frame: Frame) -> None:
    """Render the angle in radians by which lines wobble at each pixel to ``frame.textures["wobble_angles"]``.

    `wobble.wobble_angle` does the same with numpy.
    """
    if not has_wobble(frame.look):
        frame.textures["wobble_angles"] = lookup_tables.palette(frame.resources)
        return
    angles = frame.image("wobble_angles")
    textures = {"wave_table": lookup_tables.waves(frame.resources), "wobble_angles": angles}
    for instance_id, item in frame.fields_in_view():
        uniforms = wobble_uniforms(frame.look, item, frame.camera)
        frame.run_on_instance(ComputePass("wobble"), instance_id, textures, uniforms)
    frame.textures["wobble_angles"] = angles


def _surface_noise(frame: Frame, settings: NoiseSettings, name: str, detail: float = 0.0) -> Any:
    """Return an image of noise that moves with the surfaces, as `surface_noise.surface_noise` with numpy.

    `name` is the name of the image. On small features of the surface, the cells of the noise are smaller by
    up to the fraction `detail`.
    """
    raw_noise = frame.image("raw_noise")
    frame.clear(raw_noise)
    shared_uniforms = noise_uniforms(settings, frame.look, detail)
    names = [item.instance.surface.name for item in frame.items]
    hashes = instance_hashes(names).view(np.int32)
    for instance_id, item in frame.fields_in_view():
        curvature = lookup_tables.palette(frame.resources)
        if detail:
            curvature = frame.prepared["features", instance_id]
        textures = {"feature_curvature": curvature, "raw_noise": raw_noise}
        uniforms = {
            **shared_uniforms,
            **surface_cell_uniforms(settings.cell, frame.look, item, frame.camera),
            "instance_hash": int(hashes[instance_id]),
        }
        frame.run_on_instance(ComputePass("surface_noise"), instance_id, textures, uniforms)
    return _high_passed(frame, raw_noise, settings.high_pass, name)


def _high_passed(frame: Frame, raw_noise: Any, high_pass: float, name: str) -> Any:
    """Return an image of the noise minus its mean; if `high_pass` is not 0, also without low frequencies.

    Variations wider than about `high_pass` pixels are removed. `name` is the name of the image.
    """
    blurred = raw_noise
    if high_pass:
        radius = box_radius(BLUR_FACTOR * high_pass)
        for index, axis in enumerate(((1, 0), (0, 1)) * 3):
            image = frame.image(f"blurred {index % 2}")
            textures = {"source_image": blurred, "blurred_image": image}
            uniforms = {"blur_axis": axis, "radius": radius}
            frame.run(ComputePass("box_blur"), frame.box, textures, uniforms, pause=0.5)
            blurred = image
    noise = frame.image(name)
    textures = {"raw_noise": raw_noise, "blurred_noise": blurred, "noise": noise}
    uniforms = {"high_passed": int(high_pass > 0)}
    frame.run(ComputePass("center_noise"), frame.box, textures, uniforms)
    return noise
