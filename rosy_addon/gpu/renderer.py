"""The GPU renderer: the passes from meshes, fields and a camera to a picture, in their order.

The stages are those of the numpy rooms. They work on images instead of lists of pixels. A streamline
is traced from every pixel and line: unlike `fast_lic`, no averages are shared between pixels.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..compositor.family_hues import PALETTE
from ..compositor.hatching import has_paper_grain
from ..compositor.image_noise import BLUR_FACTOR, box_radius
from ..compositor.lic import noise_args
from ..compositor.look import Look
from ..compositor.look_units import cell_size_args, look_in_pixels, supersampled_look
from ..compositor.paper_grain import surface_paper_grain_args
from ..compositor.picture import Picture
from ..compositor.shading import Light
from ..compositor.surface_noise import instance_hashes
from ..compositor.target_tone import ReferenceRender, check_tone
from ..compositor.wobble import has_wobble
from ..errors import RosyError
from ..progress import Progress, Task, subtask
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.project import check_instances, raise_nothing_in_view
from ..projection.shadow_maps import light_cameras
from ..render.view_input import ViewInput
from . import lookup_tables, passes
from .defines import HEADLIGHT, MAGNITUDE_MODES, REDUCE_BLOCK, SUN_LIGHT, TONE_SOURCES
from .device import Device
from .field_kind import FieldKind
from .passes import WORKGROUP_SIZE, ComputePass
from .resources import DrawItem, GpuResources
from .screen_box import Box, box_size, is_empty, screen_box, union_box
from .uniforms import (
    NO_CLIP_PLANES,
    camera_uniforms,
    clip_uniforms,
    covering_uniforms,
    direction_uniforms,
    instance_uniforms,
    light_uniforms,
    light_view_uniforms,
    look_uniforms,
    shadow_uniforms,
    surface_cell_uniforms,
    surface_noise_uniforms,
    tone_uniforms,
    uniform_scale,
    wobble_uniforms,
)

#: Maximum steps, of all streamlines together, in one run of the LIC pass: drivers stop longer ones.
MAX_DISPATCH_STEPS = 1 << 29

#: How much closer to the eye than the surface its picture is drawn, in normalized depth.
COMPOSITE_DEPTH_BIAS = 2e-5


@dataclass(eq=False)
class _Frame:
    """A picture that is being drawn.

    Attributes
    ----------
    items : sequence of DrawItem
    camera : Camera
        Of the supersampled frame.
    look : Look
        Lengths in pixels of the finished picture.
    lights : sequence of Light
    reference : ReferenceRender or None
    clip_planes : (6, 4) ndarray
    textures : dict of str to texture
        Results of the passes so far, by the names that shaders read them by.
    """

    items: Sequence[DrawItem]
    camera: Camera
    look: Look
    lights: Sequence[Light]
    reference: ReferenceRender | None
    clip_planes: np.ndarray
    textures: dict[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        return self.camera.width, self.camera.height

    @property
    def pixel_look(self) -> Look:
        """The look with lengths in pixels of the supersampled frame."""
        return supersampled_look(self.look)

    @property
    def kinds(self) -> list[FieldKind]:
        """The kinds of the fields, by degree."""
        kinds = {item.kind for item in self.items} - {None}
        return sorted(kinds, key=lambda kind: kind.degree)

    def box_of_kind(self, kind: FieldKind) -> Box:
        """Return the box of all instances whose fields are of a kind."""
        return union_box(
            [screen_box(item, self.camera) for item in self.items if item.kind == kind]
        )

    def fields_in_view(self) -> Iterator[tuple[int, DrawItem, Box]]:
        """Yield the id, item and box of each instance that has a field and can be visible."""
        for instance_id, item in enumerate(self.items):
            if item.field is not None:
                box = screen_box(item, self.camera)
                if not is_empty(box):
                    yield instance_id, item, box


class GpuRenderer:
    """Draws pictures on a graphics card. Implements `Renderer` and `ViewportRenderer`.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    device_name, downscale_factors, needs_occluders
        As those of the protocols.
    """

    device_name = "gpu"
    downscale_factors = 2, 1
    needs_occluders = False

    def __init__(self, device: Device) -> None:
        self.device = device
        self.resources = GpuResources(device)

    # --- protocols ------------------------------------------------------------------------------

    def render_task(self, view: ViewInput) -> Task[Picture]:
        """As `Renderer.render_task`. The picture has no layers.

        Raises
        ------
        RosyError
            As `Renderer.render_task`. Also if the driver rejects the shaders or the size.
        """
        look, camera, instances = view.look, view.camera, view.instances
        check_tone(look, [instance.tone for instance in instances], view.reference)
        check_instances(instances, view.sample_camera, look.display)
        items = self.upload(instances, look.display)
        texture = yield from self.render_texture_task(items, view)
        rgba = self.read(texture, camera.width, camera.height)
        if not rgba[..., 3].any():
            raise_nothing_in_view(instances, view.sample_camera)
        return Picture(rgba, ())

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[DrawItem]:
        """As `ViewportRenderer.upload`."""
        return self.resources.upload(instances, display)

    def covered_pixels(self, items: Sequence[DrawItem], camera: Camera) -> int:
        """As `ViewportRenderer.covered_pixels`."""
        width, height = box_size(union_box([screen_box(item, camera) for item in items]))
        return width * height

    def render_texture_task(
        self, items: Sequence[DrawItem], view: ViewInput, target_key: Hashable = None
    ) -> Task[Any]:
        """As `ViewportRenderer.render_texture_task`.

        The look's method is ignored: the streamlines of the covering are traced. The texture is
        reused by later pictures.

        Raises
        ------
        RosyError
            If the picture is too large for the device.
        """
        camera = view.sample_camera
        if max(camera.width, camera.height) > self.device.max_texture_size:
            raise RosyError(
                f"a frame of {camera.width} x {camera.height} pixels, including supersampling, is too "
                f"large for this graphics card (at most {self.device.max_texture_size}): choose a "
                "smaller size, or the processor"
            )
        yield Progress(0.0, "finding visible pixels")
        look = look_in_pixels(view.look, camera, [item.instance for item in items])
        clip_planes = NO_CLIP_PLANES if view.clip_planes is None else view.clip_planes
        frame = _Frame(items, camera, look, view.lights, view.reference, clip_planes)
        single_sampled = look.supersampling == 1
        fine_picture = self.resources.image(
            ("picture", target_key if single_sampled else None), *frame.size
        )
        self._render_gbuffer(frame)
        self.device.clear(fine_picture)
        self._noise(frame)
        self._paper_grain(frame)
        self._wobble(frame)
        self._target_tones(frame)
        kinds = frame.kinds
        for index, kind in enumerate(kinds):
            box = frame.box_of_kind(kind)
            if is_empty(box):
                continue
            task = self._lic_task(frame, kind, box, fine_picture)
            start, stop = index / len(kinds), (index + 1) / len(kinds)
            yield from subtask(task, 0.2 + 0.8 * start, 0.2 + 0.8 * stop)
        if single_sampled:
            return fine_picture
        return self._downsampled(fine_picture, camera, look.supersampling, target_key)

    def composite(
        self, texture: Any, items: Sequence[DrawItem], view: ViewInput, opacity: float = 1.0
    ) -> None:
        """As `ViewportRenderer.composite`: the surfaces are drawn with the picture on them."""
        left, bottom, width, height = self.device.viewport()
        clip_planes = NO_CLIP_PLANES if view.clip_planes is None else view.clip_planes
        uniforms = {
            "depth_bias": COMPOSITE_DEPTH_BIAS,
            "view_origin": (float(left), float(bottom)),
            "pixel_scale": (texture.width / width, texture.height / height),
            "opacity": opacity,
        }
        batches = [
            (item.mesh.batch, clip_uniforms(item, view.camera, clip_planes))
            for item in items
            if item.field is not None
        ]
        self.device.draw_to_view(passes.COMPOSITE, batches, {"picture": texture}, uniforms)

    def finish(self) -> None:
        """As `ViewportRenderer.finish`."""
        self.device.read(lookup_tables.palette(self.resources), len(PALETTE), 1)

    def release(self) -> None:
        """As `ViewportRenderer.release`."""
        self.resources.release()

    def read(self, texture: Any, width: int, height: int) -> np.ndarray:
        """Return the (H, W, 4) float32 contents of a picture."""
        return self.device.read(texture, width, height)

    def read_gbuffer(self, camera: Camera) -> dict[str, np.ndarray]:
        """Return the G-buffer of the last picture, by the names of its images."""
        size = camera.width, camera.height
        return {
            name: self.device.read(self.resources.image(name, *size), *size)
            for name in ("visibility", "normals", "field_values")
        }

    # --- passes ---------------------------------------------------------------------------------

    def _render_gbuffer(self, frame: _Frame) -> None:
        """Which triangle each pixel sees, and the surface and field there."""
        image, camera, size = self.resources.image, frame.camera, frame.size
        batches = [
            (
                item.mesh.batch,
                {
                    "instance_id": float(instance_id),
                    **clip_uniforms(item, camera, frame.clip_planes),
                },
            )
            for instance_id, item in enumerate(frame.items)
        ]
        is_clipped = not np.array_equal(frame.clip_planes, NO_CLIP_PLANES)
        shader = passes.VISIBILITY_CLIPPED if is_clipped else passes.VISIBILITY
        visibility = image("visibility", *size)
        self.device.draw(shader, batches, (visibility, self.resources.depth_image(*size)), {})
        channel_count = max((item.mesh.buffers.channel_count for item in frame.items), default=0)
        channel_size = size if channel_count else (1, 1)
        gbuffer = {
            "normals": image("normals", *size),
            "field_values": image("field_values", *size),
            "depth_slopes": image("depth_slopes", *size),
            "field_channels": image("field_channels", *channel_size, layers=max(channel_count, 1)),
        }
        self.device.clear(gbuffer["field_values"])
        frame.textures["visibility"] = visibility
        for instance_id, item, box in frame.fields_in_view():
            uniforms = {
                "pixels_per_unit": camera.pixels_per_unit,
                "channel_count": item.mesh.buffers.channel_count,
                "model_scale": uniform_scale(item.model_matrix),
            }
            self._run_on_instance(passes.RESOLVE, frame, instance_id, box, gbuffer, uniforms)
        frame.textures.update(gbuffer)

    def _noise(self, frame: _Frame) -> None:
        look = frame.look
        if look.anchor == "surface":
            settings = noise_args(frame.pixel_look) | cell_size_args(frame.pixel_look)
            frame.textures["noise"] = self._surface_noise(frame, settings, "noise")
        else:
            frame.textures["noise"] = lookup_tables.picture_noise(self.resources, *frame.size, look)

    def _paper_grain(self, frame: _Frame) -> None:
        """Paper grain on the surface. That of the picture depends on the number of lines."""
        if has_paper_grain(frame.look) and frame.look.anchor == "surface":
            settings = surface_paper_grain_args(frame.pixel_look) | cell_size_args(frame.pixel_look)
            frame.textures["paper_grain"] = self._surface_noise(frame, settings, "paper_grain")

    def _surface_noise(self, frame: _Frame, settings: dict[str, Any], name: str) -> Any:
        """Return noise that moves with the surfaces, as `surface_noise.surface_noise`."""
        raw_noise = self.resources.image("raw_noise", *frame.size)
        self.device.clear(raw_noise)
        shared_uniforms = surface_noise_uniforms(settings)
        names = [item.mesh.keep_alive[0].name for item in frame.items]
        hashes = instance_hashes(names).view(np.int32)
        for instance_id, item, box in frame.fields_in_view():
            uniforms = {
                **shared_uniforms,
                **surface_cell_uniforms(settings, item, frame.camera),
                "instance_hash": int(hashes[instance_id]),
            }
            images = {"raw_noise": raw_noise}
            self._run_on_instance(passes.SURFACE_NOISE, frame, instance_id, box, images, uniforms)
        return self._high_passed(raw_noise, frame.size, settings["high_pass"], name)

    def _high_passed(
        self, raw_noise: Any, size: tuple[int, int], high_pass: float, name: str
    ) -> Any:
        """Return noise around its mean, without its low frequencies."""
        blurred = raw_noise
        if high_pass:
            radius = box_radius(BLUR_FACTOR * high_pass)
            for index, axis in enumerate(((1, 0), (0, 1)) * 3):
                next_blurred = self.resources.image(f"blurred {index % 2}", *size)
                self.device.compute(
                    passes.BOX_BLUR,
                    size,
                    {"source_image": blurred},
                    {"blurred_image": next_blurred},
                    {"blur_axis": axis, "radius": radius},
                )
                blurred = next_blurred
        noise = self.resources.image(name, *size)
        self.device.compute(
            passes.CENTER_NOISE,
            size,
            {"raw_noise": raw_noise, "blurred_noise": blurred},
            {"noise": noise},
            {"high_passed": int(high_pass > 0)},
        )
        return noise

    def _wobble(self, frame: _Frame) -> None:
        """The angle by which lines wobble at each pixel, as `wobble.wobble_angle`."""
        if not has_wobble(frame.look):
            frame.textures["wobble_angles"] = lookup_tables.palette(self.resources)
            return
        angles = self.resources.image("wobble_angles", *frame.size)
        frame.textures["wave_table"] = lookup_tables.waves(self.resources)
        for instance_id, item, box in frame.fields_in_view():
            uniforms = wobble_uniforms(frame.look, item, frame.camera)
            images = {"wobble_angles": angles}
            self._run_on_instance(passes.WOBBLE, frame, instance_id, box, images, uniforms)
        frame.textures["wobble_angles"] = angles

    def _target_tones(self, frame: _Frame) -> None:
        """The tone that each pixel is to have, as `target_tone.target_tone`."""
        look, reference = frame.look, frame.reference
        tones = self.resources.image("tones", *frame.size)
        shared_uniforms = tone_uniforms(look, frame.camera, reference)
        reference_atlas = None if reference is None else self.resources.reference_atlas(reference)
        lighting = frame.textures["lighting"] = self._lighting(frame)
        for instance_id, item, box in frame.fields_in_view():
            atlas = item.mesh.tone_atlas if look.tone == "image" else reference_atlas
            has_own_tone = look.tone == "picture" or item.mesh.buffers.has_tone
            level = 0 if atlas is None else atlas.max_level
            if atlas is not None and look.tone == "picture":
                requested_level = round(reference.mip_level(frame.camera)) - atlas.skipped_levels
                level = min(max(requested_level, 0), atlas.max_level)
            uniforms = {
                **shared_uniforms,
                "tone_source": TONE_SOURCES[look.tone] if has_own_tone else 0,
                "image_size": (1, 1) if atlas is None else atlas.size,
                "image_level": level,
            }
            frame.textures["tone_image"] = lighting if atlas is None else atlas.texture
            self._run_on_instance(passes.TONE, frame, instance_id, box, {"tones": tones}, uniforms)
        frame.textures["tones"] = tones

    def _lighting(self, frame: _Frame) -> Any:
        """Return the light of all light sources together, as `shading.diffuse` at full strength."""
        boxes = [screen_box(item, frame.camera) for item in frame.items if item.field is not None]
        box = union_box(boxes)
        images = [self.resources.image(f"lighting {index}", *frame.size) for index in range(2)]
        normals = frame.textures["normals"]
        for index, light in enumerate(light_uniforms(frame.look, frame.lights)):
            if is_empty(box):
                break
            visibility = normals
            if frame.look.shadows and light["light_kind"] != HEADLIGHT:
                visibility = self._shadow_visibility(frame, light, box)
            uniforms = {
                **camera_uniforms(frame.camera),
                **light,
                "is_shadowed": int(visibility is not normals),
                "is_first": int(index == 0),
            }
            textures = {
                "normals": normals,
                "shadow_visibility": visibility,
                "previous_lighting": images[1],
            }
            self._run(passes.LIGHTING, box, textures, {"lighting": images[0]}, uniforms)
            images.reverse()
        return images[1]

    def _shadow_visibility(self, frame: _Frame, light: dict[str, Any], box: Box) -> Any:
        """Return the share of a light that reaches each pixel, as `shadow_maps.shadow_visibility`."""
        kind = "sun" if light["light_kind"] == SUN_LIGHT else "point"
        vector = np.array(light["light_vector"][:3])
        image = self.resources.image
        images = [image(f"shadow visibility {index}", *frame.size, "RGBA16F") for index in range(2)]
        instances = [item.instance for item in frame.items]
        for index, light_view in enumerate(light_cameras(instances, frame.camera, kind, vector)):
            map_size = light_view.width, light_view.height
            shadow_map = image("shadow_map", *map_size)
            target = shadow_map, self.resources.depth_image(*map_size)
            batches = [(item.mesh.batch, shadow_uniforms(item, light_view)) for item in frame.items]
            self.device.draw(passes.SHADOW_MAP, batches, target, {})
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
            self._run(
                passes.SHADOW_VISIBILITY, box, textures, {"shadow_visibility": images[0]}, uniforms
            )
            images.reverse()
        return images[1]

    def _lic_task(self, frame: _Frame, kind: FieldKind, box: Box, picture: Any) -> Task[None]:
        """Draw the fields of one kind into the picture."""
        look, resources = frame.look, self.resources
        covering = covering_uniforms(kind, look)
        textures = {**frame.textures, **self._unfold(frame, kind, box, covering)}
        textures |= {
            "max_magnitude": self._max_magnitude(textures, kind, look),
            "color_map": lookup_tables.color_map(resources, look),
            "palette": lookup_tables.palette(resources),
            "ink_thresholds": lookup_tables.thresholds(resources, frame.pixel_look),
            "ink_table": lookup_tables.ink_table(resources, kind, look),
        }
        if "paper_grain" not in textures:
            textures["paper_grain"] = lookup_tables.picture_grain(
                resources, *frame.size, look, kind.line_count
            )
        uniforms = {**covering, **look_uniforms(kind, look)}
        left, bottom, right, top = box
        row_steps = (right - left) * kind.line_count * 2 * uniforms["half_length"]
        # Whole work groups: a partial one would reach into rows that belong to the next band.
        groups = max(MAX_DISPATCH_STEPS // max(row_steps, 1) // WORKGROUP_SIZE[1], 1)
        band_rows = groups * WORKGROUP_SIZE[1]
        for start in range(bottom, top, band_rows):
            band = left, start, right, min(start + band_rows, top)
            self._run(passes.LIC, band, textures, {"picture": picture}, uniforms)
            yield Progress((start + band_rows - bottom) / (top - bottom), "tracing streamlines")

    def _unfold(
        self, frame: _Frame, kind: FieldKind, box: Box, covering: dict[str, Any]
    ) -> dict[str, Any]:
        """Return the images of the covering: its cells, and directions with their gradients."""
        image, lines = self.resources.image, kind.line_count
        cells = image("cells", *frame.size)
        directions = image("directions", *frame.size, "RGBA16F", lines)
        angle_gradient = image("angle_gradients", *frame.size, "RGBA16F", lines)
        self._run(
            passes.DIRECTIONS,
            box,
            frame.textures,
            {"cells": cells, "directions": directions},
            {
                **camera_uniforms(frame.camera),
                **covering,
                **direction_uniforms(kind, frame.look, frame.camera),
            },
        )
        textures = {"cells": cells, "directions": directions}
        images = {"angle_gradients": angle_gradient}
        self._run(passes.ANGLE_GRADIENT, box, textures, images, covering, layers=lines)
        return {"cells": cells, "angle_gradients": angle_gradient}

    def _max_magnitude(self, textures: dict[str, Any], kind: FieldKind, look: Look) -> Any:
        """Return a texture of one texel: the largest magnitude of the fields of a kind.

        Any texture if the look does not need it.
        """
        if not MAGNITUDE_MODES[look.magnitude] or look.magnitude_range:
            return textures["cells"]
        source = textures["field_values"]
        width, height = source.width, source.height
        level, is_first = 0, 1
        while (width, height) != (1, 1) or is_first:
            width, height = -(-width // REDUCE_BLOCK), -(-height // REDUCE_BLOCK)
            tiles = self.resources.image(f"tiles {level}", width, height)
            self.device.compute(
                passes.MAX_REDUCE,
                (width, height),
                {"source_values": source},
                {"tiles": tiles},
                {"degree": kind.degree, "is_first": is_first},
            )
            source, level, is_first = tiles, level + 1, 0
        return source

    def _downsampled(
        self, fine_picture: Any, camera: Camera, supersampling: int, target_key: Hashable
    ) -> Any:
        """Return a picture with blocks of subpixels averaged."""
        size = camera.width // supersampling, camera.height // supersampling
        picture = self.resources.image(("picture", target_key), *size)
        self.device.compute(
            passes.DOWNSAMPLE,
            size,
            {"fine_picture": fine_picture},
            {"picture": picture},
            {"block_side": supersampling},
        )
        return picture

    # --- running a pass -------------------------------------------------------------------------

    def _run_on_instance(
        self,
        shader: ComputePass,
        frame: _Frame,
        instance_id: int,
        box: Box,
        images: dict[str, Any],
        uniforms: dict[str, Any],
    ) -> None:
        """Run a compute pass over the pixels of one instance."""
        item = frame.items[instance_id]
        self._run(
            shader,
            box,
            {**frame.textures, "triangle_records": item.mesh.records_texture},
            images,
            {
                **camera_uniforms(frame.camera),
                **instance_uniforms(instance_id, item, frame.camera),
                **uniforms,
            },
        )

    def _run(
        self,
        shader: ComputePass,
        box: Box,
        textures: dict[str, Any],
        images: dict[str, Any],
        uniforms: dict[str, Any],
        layers: int = 1,
    ) -> None:
        """Run a compute pass over the pixels of a box."""
        uniforms = {**uniforms, "box_origin": box[:2]}
        self.device.compute(shader, (*box_size(box), layers), textures, images, uniforms)
