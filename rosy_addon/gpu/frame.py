"""A picture that is being drawn, and the passes that draw it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from ..compositor.look import Look
from ..compositor.shading import Light
from ..compositor.target_tone import ReferenceRender
from ..projection.camera import Camera
from .field_kind import FieldKind
from .mesh_buffers import MAX_TRIANGLES
from .passes import ComputePass, RasterPass, clear_pass
from .resources import DrawItem, GpuResources
from .screen_box import Box, box_size, is_empty, screen_box, union_box
from .uniforms import camera_uniforms, instance_uniforms

#: The smallest id in the id buffer. Ids are the bits of floats, which are then neither 0 nor subnormal.
FIRST_TRIANGLE_ID = 0x00800000

#: Above all ids: the bits of infinity.
STOP_ID = 0x7F800000


class FramePass(NamedTuple):
    """A pass of a picture that is still to be run.

    Attributes
    ----------
    shader : ComputePass or RasterPass
        With the constants of its switches.
    run : callable
    pause : float or None
        If other work may be done before the pass, the fraction of the stage that is drawn until then.
    """

    shader: ComputePass | RasterPass
    run: Callable[[], None]
    pause: float | None


@dataclass(eq=False)
class Frame:
    """A picture that is being drawn.

    The stages add passes to it, which the renderer then runs; see `take_passes`.

    Attributes
    ----------
    resources : GpuResources
        The device, and what stays on it.
    items : sequence of DrawItem
    camera : Camera
        Of the pixels of the frame: those of the picture, or its samples.
    look : Look
        Its lengths are in these pixels. Its supersampling is their number in one of the picture, along a side.
    lights : sequence of Light
    reference : ReferenceRender or None
    clip_planes : (6, 4) ndarray
    samples : Frame or None
        The samples of the pixels, if these have several. The pixels are shaded once.
    textures : dict of str to texture
        Results of the passes so far, by their names in shaders.
    prepared : dict
        What was computed from the meshes for this picture, by the keys of the stages.
    passes : list of FramePass
        Those that are still to be run, also on the samples.
    """

    resources: GpuResources
    items: Sequence[DrawItem]
    camera: Camera
    look: Look
    lights: Sequence[Light]
    reference: ReferenceRender | None
    clip_planes: np.ndarray
    samples: Frame | None = None
    textures: dict[str, Any] = field(default_factory=dict)
    prepared: dict[Hashable, Any] = field(default_factory=dict)
    passes: list[FramePass] = field(default_factory=list)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the frame, in pixels."""
        return self.camera.width, self.camera.height

    @property
    def samples_per_side(self) -> int:
        """Samples along each side of a pixel."""
        return 1 if self.samples is None else self.samples.look.supersampling

    @cached_property
    def first_triangle_ids(self) -> list[int]:
        """The id of the first triangle of each item in the id buffer; those that only occlude are last."""
        order = sorted(range(len(self.items)), key=lambda index: self.items[index].field is None)
        counts = [self.items[index].mesh.buffers.triangle_count for index in order]
        # Shaders round the ids of meshes with more triangles than `MAX_TRIANGLES`.
        spans = [count + count // MAX_TRIANGLES for count in counts]
        ids = accumulate(spans, initial=FIRST_TRIANGLE_ID)
        return [first_id for _, first_id in sorted(zip(order, ids, strict=False))]

    @property
    def occluder_id(self) -> int:
        """The first id of triangles without a field, which only occlude. All others are before."""
        ids = zip(self.first_triangle_ids, self.items, strict=True)
        return min((first_id for first_id, item in ids if item.field is None), default=STOP_ID)

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

    def fields_in_view(self) -> list[tuple[int, DrawItem, Box]]:
        """Return the id, item and box of each instance that has a field and may be visible."""
        boxes = [
            (instance_id, item, screen_box(item, self.camera))
            for instance_id, item in enumerate(self.items)
            if item.field is not None
        ]
        return [entry for entry in boxes if not is_empty(entry[2])]

    def take_passes(self) -> list[FramePass]:
        """Remove and return the passes that are to be run."""
        passes = self.passes.copy()
        self.passes.clear()
        return passes

    def run_on_instance(
        self,
        shader: ComputePass,
        instance_id: int,
        box: Box,
        images: dict[str, Any],
        uniforms: dict[str, Any],
    ) -> None:
        """Add a compute pass over the pixels of one instance.

        The pass can read all ``textures`` and the triangle records of the instance.

        Parameters
        ----------
        shader : ComputePass
        instance_id : int
            Index into ``items``.
        box : Box
        images : dict of str to texture
            Images that the pass writes.
        uniforms : dict
            In addition to those of the camera and the instance.
        """
        item = self.items[instance_id]
        self.run(
            shader,
            box,
            {**self.textures, "triangle_records": item.mesh.records_texture},
            images,
            {
                **self.instance_uniforms(instance_id),
                **uniforms,
            },
        )

    def instance_uniforms(self, instance_id: int) -> dict[str, Any]:
        """Return the uniforms of the camera and of one instance."""
        first_triangle_id, item = self.first_triangle_ids[instance_id], self.items[instance_id]
        return {
            **camera_uniforms(self.camera),
            **instance_uniforms(instance_id, first_triangle_id, item, self.camera),
        }

    def clear(self, image: Any, texel_format: str = "RGBA32F") -> None:
        """Set an image of the size of the frame to 0."""
        self.run(clear_pass(texel_format), (0, 0, *self.size), {}, {"cleared": image}, {})

    def run(
        self,
        shader: ComputePass,
        box: Box,
        textures: dict[str, Any],
        images: dict[str, Any],
        uniforms: dict[str, Any],
        layers: int = 1,
        pause: float | None = None,
    ) -> None:
        """Add a compute pass over the pixels of a box.

        Parameters
        ----------
        shader : ComputePass
        box : Box
        textures, images : dict of str to texture
            What the pass reads and writes.
        uniforms : dict
        layers : int
            Layers of array images.
        pause : float, optional
            See `FramePass`.
        """
        uniforms = {**uniforms, "box_origin": box[:2]}
        self.compute(shader, (*box_size(box), layers), textures, images, uniforms, pause)

    def compute(
        self,
        shader: ComputePass,
        size: Sequence[int],
        textures: dict[str, Any],
        images: dict[str, Any],
        uniforms: dict[str, Any],
        pause: float | None = None,
    ) -> None:
        """Add a compute pass; see `Device.compute`."""
        run = partial(self.resources.device.compute, shader, size, dict(textures), images, uniforms)
        self.passes.append(FramePass(shader.variant(uniforms), run, pause))

    def draw(
        self,
        shader: RasterPass,
        batches: Sequence[tuple[Any, dict[str, Any]]],
        target: tuple[Any, Any],
    ) -> None:
        """Add a pass that draws triangles; see `Device.draw`."""
        run = partial(self.resources.device.draw, shader, batches, target, {})
        self.passes.append(FramePass(shader, run, None))
