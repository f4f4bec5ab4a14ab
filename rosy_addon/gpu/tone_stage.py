"""The tone of a picture: light, shadows, and the target tone of each pixel."""

from typing import Any

import numpy as np

from ..compositor.color_values import value_scale
from ..compositor.look import colors_values
from ..projection.shadow_maps import light_cameras
from .defines import SUN_LIGHT, TONE_SOURCES
from .frame import Box, Frame, is_empty, union_box
from .passes import ComputePass, RasterPass
from .uniforms import light_uniforms, light_view_uniforms, shadow_uniforms, tone_uniforms


def render_target_tones(frame: Frame) -> None:
    """Render the target tone of each pixel into ``frame.textures["tones"]``.

    The first three components are the tones of red, green and blue. If the look shows values of the surface
    by a color map, the last component is the position of the value in the color map, from 0 to 1, or -1 where
    there is no value. The light alone is rendered into the texture ``lighting``. `target_tone.target_tone`
    does the same with numpy.
    """
    look, reference = frame.look, frame.view.reference
    tones = frame.image("tones")
    low, scale = value_scale(look, [item.mesh.buffers.value_range for item in frame.items])
    shared_uniforms = {
        **tone_uniforms(look, frame.camera, reference),
        "colors_values": int(colors_values(look)),
        "values_bottom": low,
        "values_scale": scale,
    }
    reference_atlas = None if reference is None else frame.resources.reference_atlas(reference)
    lighting = frame.textures["lighting"] = _lighting(frame)
    for instance_id, item in frame.fields_in_view():
        atlas = item.mesh.tone_atlas if look.tone == "image" else reference_atlas
        level = 0 if atlas is None else atlas.max_level
        if atlas is not None and look.tone == "picture":
            requested_level = round(reference.mip_level(frame.camera)) - atlas.skipped_levels
            level = min(max(requested_level, 0), atlas.max_level)
        # An item without a tone of its own has the light as its tone.
        has_own_tone = look.tone == "picture" or item.mesh.buffers.has_tone
        uniforms = {
            **shared_uniforms,
            "tone_source": TONE_SOURCES[look.tone if has_own_tone else "light"],
            "image_size": (1, 1) if atlas is None else atlas.size,
            "image_level": level,
            "values_texel": item.mesh.buffers.values_texel,
        }
        textures = {"tone_image": lighting if atlas is None else atlas.texture, "tones": tones}
        frame.run_on_instance(ComputePass("tone"), instance_id, textures, uniforms)
    frame.textures["tones"] = tones


def _lighting(frame: Frame) -> Any:
    """Return an image of the light of all light sources together, as `shading.diffuse` at full strength."""
    box = union_box(frame.boxes[instance_id] for instance_id, _ in frame.fields_in_view())
    images = [frame.image(f"lighting {index}") for index in range(2)]
    lights = [] if is_empty(box) else light_uniforms(frame.look, frame.view.lights)
    for index, light in enumerate(lights):
        textures = {
            "shadow_visibility": _shadow_visibility(frame, light, box)
            if light["is_shadowed"]
            else frame.textures["normals"],
            "previous_lighting": images[1],
            "lighting": images[0],
        }
        uniforms = {**light, "is_first": int(index == 0)}
        frame.run(ComputePass("lighting"), box, textures, uniforms)
        images.reverse()
    return images[1]


def _shadow_visibility(frame: Frame, light: dict[str, Any], box: Box) -> Any:
    """Return an image of the fraction of a light that reaches each pixel of a box.

    `light` has the uniforms of the light, an item of `light_uniforms`.
    `shadow_maps.shadow_visibility` does the same with numpy.
    """
    kind = "sun" if light["light_kind"] == SUN_LIGHT else "point"
    vector = np.array(light["light_vector"][:3])
    images = [frame.image(f"shadow visibility {index}", "RGBA16F") for index in range(2)]
    instances = [item.instance for item in frame.items]
    for index, light_view in enumerate(light_cameras(instances, frame.camera, kind, vector)):
        shadow_map = frame.resources.image("shadow_map", light_view.size)
        batches = [(item.mesh.batch, shadow_uniforms(item, light_view)) for item in frame.items]
        frame.draw(RasterPass("shadow_map"), batches, shadow_map)
        textures = {
            "shadow_map": shadow_map,
            "previous_visibility": images[1],
            "shadow_visibility": images[0],
        }
        uniforms = {**light_view_uniforms(light_view, frame.camera), "is_first": int(index == 0)}
        frame.run(ComputePass("shadow_visibility"), box, textures, uniforms)
        images.reverse()
    return images[1]
