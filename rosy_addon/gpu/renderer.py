"""The GPU renderer: the passes from meshes, fields and a camera to a picture, in their order.

The numpy modules have the same stages. Here the stages work on images instead of lists of pixels.
Streamlines are traced from every pixel along every line direction of its field. Unlike in `fast_lic`, no
averages are shared between pixels.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from ..compositor.color_values import ValueRange, check_color_values
from ..compositor.look import Look, colors_magnitude, magnitude_range
from ..compositor.look_units import pixel_look
from ..compositor.picture import Picture, common_color_range
from ..compositor.picture_key import fixed_color_range
from ..compositor.target_tone import check_tone
from ..core.errors import DeviceError, RosyError
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.project import check_instances, raise_nothing_in_view
from ..rendering.marks import has_marks, with_marks
from ..rendering.renderer import ViewportRenderer
from ..rendering.view_input import ViewInput
from ..worker.job import Call, Step, Steps
from . import lookup_tables
from .background import draw_texture
from .device import Device
from .frame import Frame, box_size, is_empty, screen_box, union_box
from .gbuffer_stage import render_gbuffer
from .lic_stage import even_line_lookups, largest_magnitude, render_even_lines, render_fields
from .noise_stage import feature_lookups, render_noise
from .outline_stage import outline_lookups, render_outline
from .passes import ComputePass, all_passes
from .preparation import prepare_steps
from .resources import DrawItem, GpuResources
from .tone_stage import render_target_tones
from .uniforms import clip_uniforms

#: Normalized depth by which the picture is drawn closer to the eye than the surface that it covers.
COMPOSITE_DEPTH_BIAS = 2e-5

#: LIC methods without a shader, and for each the method that is drawn in 3D views instead.
STAND_INS = {"members": "brute", "ibfv": "sheets"}


def check_method(look: Look) -> None:
    """Check that the renderer has shaders for the LIC method of a look; otherwise raise `DeviceError`."""
    if look.method in STAND_INS:
        raise DeviceError(
            f"the graphics card cannot draw the method '{look.method}': choose another method, or the "
            "processor"
        )


class GpuRenderer(ViewportRenderer):
    """A renderer that draws pictures on a graphics card, for 3D views and for bakes.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    resources : GpuResources
        Meshes, images and textures that stay on the device from picture to picture.
    """

    downscale_factors = 2, 1
    stand_ins = STAND_INS

    def __init__(self, device: Device) -> None:
        self.device = device
        self.resources = GpuResources(device)

    def picture_steps(self, view: ViewInput) -> Steps[Picture]:
        """Draw a picture and read it back.

        Raises
        ------
        RosyError
            If an input is invalid, nothing is in view (`draw_picture`), or the driver rejects the
            shaders or the size.
        DeviceError
            If there is no shader for the LIC method of the look.
        """
        look, instances = view.look, view.instances
        check_method(look)
        check_tone(look, [instance.tone for instance in instances], view.reference)
        check_color_values(look, instances)
        check_instances(instances, view.sample_camera, look.display)
        yield from prepare_steps(self.resources.mesh_lookups(instances, look.display))
        items = self.upload(instances, look.display)
        rgba = self.device.read((yield from self.texture_steps(items, view)))
        if not rgba[..., 3].any():
            raise_nothing_in_view(instances, view.sample_camera)
        picture = Picture(rgba, color_range=self._color_range(items, view))
        if has_marks(look):
            return (yield Call(with_marks, (picture, view), 0.98, 1.0, "drawing marks"))
        return picture

    def prepare_steps(self, instances: Sequence[MeshInstance], display: str) -> Steps[Any]:
        """Compile the shaders without switches, and send the meshes to the device."""
        # Shaders with switches are compiled when the values of the switches are known.
        shaders = [shader for shader in all_passes() if not shader.declared.switches]
        return prepare_steps(self.resources.mesh_lookups(instances, display), self.device, shaders)

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[DrawItem]:
        """Return a draw item for each mesh instance. Meshes that are on the device are not sent again."""
        return self.resources.upload(instances, display)

    def covered_pixels(self, items: Sequence[DrawItem], camera: Camera) -> int:
        """Return the number of pixels in the bounding box on screen of all meshes."""
        width, height = box_size(union_box(screen_box(item, camera) for item in items))
        return width * height

    def texture_steps(
        self, items: Sequence[DrawItem], view: ViewInput, target_key: Hashable = None
    ) -> Steps[Any]:
        """Draw a picture into a texture. Later pictures with the same `target_key` overwrite this texture.

        Streamlines are traced on the covering of the field, whatever the LIC method of the look is.

        Raises
        ------
        RosyError
            If the picture is too large for the device.
        """
        sample_camera = view.sample_camera
        if max(sample_camera.size) > self.device.max_texture_size:
            raise RosyError(
                f"a frame of {sample_camera.width} x {sample_camera.height} pixels, including supersampling, is "
                f"too large for this graphics card (at most {self.device.max_texture_size}): choose "
                "a smaller size, or the processor"
            )
        yield Step(0.0, "finding visible pixels")
        frame = self._frame(items, view)
        lookups = outline_lookups(frame) | feature_lookups(frame) | even_line_lookups(frame)
        handles = yield from prepare_steps(lookups.values())
        frame.prepared.update(zip(lookups, handles, strict=True))
        texture, stages = self._stages(frame, target_key)
        stops = [*(start for start, _, _ in stages[1:]), 1.0]
        for (start, label, stage), stop in zip(stages, stops, strict=True):
            yield Step(start, label)
            stage()
            for shader, run, pause in frame.take_passes():
                fraction = start + (stop - start) * (pause or 0.0)
                if not self.device.is_compiled(shader):
                    yield Step(fraction, "compiling shaders")
                    self.device.compile(shader)
                if pause is not None:
                    yield Step(fraction, label)
                run()
        return texture

    def _stages(
        self, frame: Frame, target_key: Hashable
    ) -> tuple[Any, list[tuple[float, str, Callable[[], None]]]]:
        """Return the texture that a picture is drawn into, and the stages of drawing.

        Pictures with equal `target_key` and size share the texture. A stage is a tuple: the fraction of the
        picture that is done before it, a label for the user, and a function that adds its passes to the
        frame.
        """
        name = ("picture", target_key) if frame.samples is None else "shaded_picture"
        texture = self.resources.image(name, frame.size)
        stages: list[tuple[float, str, Callable[[], None]]] = [
            (0.0, "finding visible pixels", partial(render_gbuffer, frame)),
            (0.01, "drawing outlines", partial(render_outline, frame)),
            (0.02, "clearing the picture", partial(frame.clear, texture)),
            (0.02, "making noise", partial(render_noise, frame)),
            (0.13, "drawing lines", partial(render_even_lines, frame)),
            (0.15, "finding tones", partial(render_target_tones, frame)),
        ]
        kinds = [(kind, frame.box_of_kind(kind)) for kind in frame.kinds]
        kinds = [(kind, box) for kind, box in kinds if not is_empty(box)]
        for index, (kind, box) in enumerate(kinds):
            stage = partial(render_fields, frame, kind, box, texture)
            stages.append((0.2 + 0.8 * index / len(kinds), "tracing streamlines", stage))
        if frame.samples is None:
            return texture, stages
        picture = self.resources.image(("picture", target_key), frame.size)
        textures = {"shaded_picture": texture, "picture": picture}
        uniforms = {"samples_per_side": frame.samples_per_side}
        blend = partial(frame.run, ComputePass("blend_samples"), frame.box, textures, uniforms)
        return picture, [*stages, (1.0, "averaging samples", blend)]

    def _frame(self, items: Sequence[DrawItem], view: ViewInput) -> Frame:
        """Return the frame of a picture. It contains a frame of the samples if pixels have several."""
        instances = [item.instance for item in items]
        look = pixel_look(view.look, view.camera, instances, drift=view.drift)
        frame = Frame(self.resources, items, view, view.camera, look)
        side = view.look.supersampling
        if side == 1:
            return frame
        fine_look = look.in_samples(side)
        samples = replace(frame, camera=view.sample_camera, look=fine_look, textures={})
        return replace(frame, samples=samples)

    def composite(
        self, texture: Any, items: list[DrawItem], view: ViewInput, opacity: float
    ) -> None:
        """Draw the surfaces into the current 3D view, with the picture on them."""
        batches = [
            (item.mesh.batch, clip_uniforms(item, view.camera, view.clip_planes))
            for item in items
            if item.kind is not None
        ]
        draw_texture(self.device, texture, batches, opacity, depth_bias=COMPOSITE_DEPTH_BIAS)

    def finish(self) -> None:
        """Wait until the device has done all work, by reading a texture."""
        self.device.read(lookup_tables.palette(self.resources))

    def release(self) -> None:
        """Free all meshes, images and textures."""
        self.resources.release()

    def _color_range(self, items: Sequence[DrawItem], view: ViewInput) -> ValueRange:
        """Return the values of the first and the last color of the color map; see `Picture.color_range`.

        Magnitudes are read from the images of the last picture, so `view` must be its input. Return None if
        there is no color map, or its range differs between degrees.
        """
        if not colors_magnitude(view.look) or magnitude_range(view.look):
            return fixed_color_range(view.look, view.instances)
        frame, tops = self._frame(items, view), set()
        for kind in frame.kinds:
            texture = largest_magnitude(frame, kind.degree)
            for _, run, _ in frame.take_passes():
                run()
            tops.add(float(self.device.read(texture)[0, 0, 0]))
        # 0: no field of this degree is visible
        return common_color_range({(0.0, top) for top in tops if top})
