"""The G-buffer of a picture: the triangle that each pixel sees, and the surface and field there."""

from __future__ import annotations

import numpy as np

from . import passes
from .frame import Frame
from .uniforms import NO_CLIP_PLANES, clip_uniforms, uniform_scale


def render_gbuffer(frame: Frame) -> None:
    """Render the G-buffer: the triangle that each pixel sees, and the surface and field there.

    The images are put into ``frame.textures``: ``visibility``, ``normals``, ``field_values``,
    ``depth_slopes`` and ``field_channels``.
    """
    image, camera, size = frame.resources.image, frame.camera, frame.size
    batches = [
        (
            item.mesh.batch,
            {
                "first_triangle_id": first_triangle_id,
                **clip_uniforms(item, camera, frame.clip_planes),
            },
        )
        for first_triangle_id, item in zip(frame.first_triangle_ids, frame.items, strict=True)
    ]
    is_clipped = not np.array_equal(frame.clip_planes, NO_CLIP_PLANES)
    shader = passes.VISIBILITY_CLIPPED if is_clipped else passes.VISIBILITY
    visibility = image("visibility", *size, "R32F")
    frame.resources.device.draw(
        shader, batches, (visibility, frame.resources.depth_image(*size)), {}
    )
    channel_count = max((item.mesh.buffers.channel_count for item in frame.items), default=0)
    channel_size = size if channel_count else (1, 1)
    gbuffer = {
        "normals": image("normals", *size),
        "field_values": image("field_values", *size),
        "depth_slopes": image("depth_slopes", *size),
        "field_channels": image("field_channels", *channel_size, layers=max(channel_count, 1)),
    }
    frame.clear(gbuffer["field_values"])
    frame.textures["visibility"] = visibility
    for instance_id, item, box in frame.fields_in_view():
        uniforms = {
            "pixels_per_unit": camera.pixels_per_unit,
            "channel_count": item.mesh.buffers.channel_count,
            "model_scale": uniform_scale(item.model_matrix),
        }
        frame.run_on_instance(passes.RESOLVE, instance_id, box, gbuffer, uniforms)
    frame.textures.update(gbuffer)
