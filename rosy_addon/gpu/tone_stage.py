"""The tone of a picture: light, shadows, and the target tone of each pixel."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..compositor.color_values import value_scale
from ..compositor.look import colors_values
from ..projection.shadow_maps import light_cameras
from . import passes
from .defines import HEADLIGHT, SUN_LIGHT, TONE_SOURCES
from .frame import Frame
from .passes import ComputePass
from .resources import DrawItem
from .screen_box import Box, is_empty, screen_box, union_box
from .uniforms import (
    camera_uniforms,
    light_uniforms,
    light_view_uniforms,
    shadow_uniforms,
    tone_uniforms,
)


def render_target_tones(frame: Frame) -> None:
    """Render the target tone of each pixel, as ``frame.textures["tones"]``.

    The method is that of `target_tone.target_tone`. The light alone is in the texture ``lighting``. If
    numbers are colored, their places in the color map are in the last component, or -1.
    """
    look, reference = frame.look, frame.reference
    tones = frame.resources.image("tones", *frame.size)
    low, scale = value_scale(look, [item.mesh.buffers.value_range for item in frame.items])
    shared_uniforms = {
        **tone_uniforms(look, frame.camera, reference),
        "values_bottom": low,
        "values_scale": scale,
    }
    shader = _tone_pass(frame)
    reference_atlas = None if reference is None else frame.resources.reference_atlas(reference)
    lighting = frame.textures["lighting"] = _lighting(frame)
    for instance_id, item, box in frame.fields_in_view():
        atlas = item.mesh.tone_atlas if look.tone == "image" else reference_atlas
        level = 0 if atlas is None else atlas.max_level
        if atlas is not None and look.tone == "picture":
            requested_level = round(reference.mip_level(frame.camera)) - atlas.skipped_levels
            level = min(max(requested_level, 0), atlas.max_level)
        uniforms = {
            **shared_uniforms,
            "tone_source": _tone_source(frame, item),
            "image_size": (1, 1) if atlas is None else atlas.size,
            "image_level": level,
            "values_texel": item.mesh.buffers.values_texel,
        }
        frame.textures["tone_image"] = lighting if atlas is None else atlas.texture
        frame.run_on_instance(shader, instance_id, box, {"tones": tones}, uniforms)
    frame.textures["tones"] = tones


def _tone_pass(frame: Frame) -> ComputePass:
    return passes.TONE_AND_VALUES if colors_values(frame.look) else passes.TONE


def _tone_source(frame: Frame, item: DrawItem) -> int:
    """Return where the tone of an item comes from: the light, if it has none of its own."""
    has_own_tone = frame.look.tone == "picture" or item.mesh.buffers.has_tone
    return TONE_SOURCES[frame.look.tone if has_own_tone else "light"]


def _lights(frame: Frame) -> list[dict[str, Any]]:
    """Return the uniforms of the passes that add one light after the other."""
    return [
        {
            **light,
            "is_shadowed": int(frame.look.shadows and light["light_kind"] != HEADLIGHT),
            "is_first": int(index == 0),
        }
        for index, light in enumerate(light_uniforms(frame.look, frame.lights))
    ]


def _lighting(frame: Frame) -> Any:
    """Return the light of all light sources together, as `shading.diffuse` at full strength."""
    boxes = [screen_box(item, frame.camera) for item in frame.items if item.field is not None]
    box = union_box(boxes)
    images = [frame.resources.image(f"lighting {index}", *frame.size) for index in range(2)]
    normals = frame.textures["normals"]
    for light in _lights(frame):
        if is_empty(box):
            break
        visibility = _shadow_visibility(frame, light, box) if light["is_shadowed"] else normals
        uniforms = {**camera_uniforms(frame.camera), **light}
        textures = {
            "normals": normals,
            "shadow_visibility": visibility,
            "previous_lighting": images[1],
        }
        frame.run(passes.LIGHTING, box, textures, {"lighting": images[0]}, uniforms)
        images.reverse()
    return images[1]


def _shadow_visibility(frame: Frame, light: dict[str, Any], box: Box) -> Any:
    """Return the share of a light that reaches each pixel, as `shadow_maps.shadow_visibility`."""
    kind = "sun" if light["light_kind"] == SUN_LIGHT else "point"
    vector = np.array(light["light_vector"][:3])
    image = frame.resources.image
    images = [image(f"shadow visibility {index}", *frame.size, "RGBA16F") for index in range(2)]
    instances = [item.instance for item in frame.items]
    for index, light_view in enumerate(light_cameras(instances, frame.camera, kind, vector)):
        map_size = light_view.width, light_view.height
        shadow_map = image("shadow_map", *map_size)
        target = shadow_map, frame.resources.depth_image(*map_size)
        batches = [(item.mesh.batch, shadow_uniforms(item, light_view)) for item in frame.items]
        frame.draw(passes.SHADOW_MAP, batches, target)
        uniforms = {
            **camera_uniforms(frame.camera),
            **light_view_uniforms(light_view, frame.camera),
            "is_first": int(index == 0),
        }
        textures = {
            "normals": frame.textures["normals"],
            "shadow_map": shadow_map,
            "previous_visibility": images[1],
        }
        frame.run(
            passes.SHADOW_VISIBILITY, box, textures, {"shadow_visibility": images[0]}, uniforms
        )
        images.reverse()
    return images[1]
