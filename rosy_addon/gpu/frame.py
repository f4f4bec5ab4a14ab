"""A picture that is being drawn, and the passes that draw it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from ..compositor.look_units import PixelLook
from ..projection.camera import Camera
from ..rendering.view_input import ViewInput
from .device import Batches, NamedValues
from .mesh_buffers import MAX_TRIANGLES, FieldKind
from .passes import ComputePass, RasterPass
from .resources import DrawItem, GpuResources
from .uniforms import camera_uniforms, matrix_rows

#: A rectangle of pixels: left, bottom, right and top; right and top are exclusive.
Box = tuple[int, int, int, int]

#: The smallest id in the id buffer. Ids are the bits of floats, which are then neither 0 nor subnormal.
FIRST_TRIANGLE_ID = 0x00800000

#: An integer above all ids: the bits of the float infinity.
STOP_ID = 0x7F800000


class FramePass(NamedTuple):
    """A pass of a picture that is still to be run.

    Attributes
    ----------
    shader : ComputePass or RasterPass
        The shader; for a compute pass, with the values of its switches compiled in.
    run : callable
        Runs the pass on the device.
    pause : float or None
        If the renderer may pause before the pass, the fraction of the stage that is done by then. None if
        it may not.
    """

    shader: ComputePass | RasterPass
    run: Callable[[], None]
    pause: float | None


@dataclass(eq=False)
class Frame:
    """A picture that is being drawn.

    The stages add passes to the frame. The renderer takes these passes (`take_passes`) and runs them.

    Attributes
    ----------
    resources : GpuResources
        The device, and the meshes, images and textures that stay on it.
    items : sequence of DrawItem
    view : ViewInput
    camera : Camera
        Camera with the size of the frame. A pixel of the frame is a pixel of the picture, or a sample of
        such a pixel.
    look : PixelLook
        Lengths are in pixels of the frame.
    samples : Frame or None
        The frame whose pixels are the samples, if pixels have several. Each pixel is still shaded once.
    textures : dict of str to texture
        Results of the passes so far, by their names in shaders.
    prepared : dict
        Handles of data on the device that was computed from the meshes for this picture. Its keys are the
        keys of the lookups from `noise_stage.feature_lookups` and similar functions of other stages.
    passes : list of FramePass
        The passes that are still to be run, including the passes over the samples.
    """

    resources: GpuResources
    items: Sequence[DrawItem]
    view: ViewInput
    camera: Camera
    look: PixelLook
    samples: Frame | None = None
    textures: dict[str, Any] = field(default_factory=dict)
    prepared: dict[Hashable, Any] = field(default_factory=dict)
    passes: list[FramePass] = field(default_factory=list)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the frame, in pixels."""
        return self.camera.size

    @property
    def box(self) -> Box:
        """The box of all pixels."""
        return 0, 0, *self.size

    @property
    def samples_per_side(self) -> int:
        """Samples along each side of a pixel."""
        return 1 if self.samples is None else self.samples.look.supersampling

    @cached_property
    def boxes(self) -> list[Box]:
        """The box of the pixels that each item can cover."""
        return [screen_box(item, self.camera) for item in self.items]

    @cached_property
    def first_triangle_ids(self) -> list[int]:
        """The id of the first triangle of each item in the id buffer.

        The ids of items without a field, which only occlude, follow after all others.
        """
        order = sorted(range(len(self.items)), key=lambda index: self.items[index].kind is None)
        counts = [self.items[index].mesh.buffers.triangle_count for index in order]
        # Shaders round the ids of meshes with more triangles than `MAX_TRIANGLES`.
        spans = [count + count // MAX_TRIANGLES for count in counts]
        ids = accumulate(spans, initial=FIRST_TRIANGLE_ID)
        return [first_id for _, first_id in sorted(zip(order, ids, strict=False))]

    @property
    def occluder_id(self) -> int:
        """The smallest id of triangles without a field, which only occlude; `STOP_ID` if there are none.

        All triangles with a field have smaller ids.
        """
        ids = zip(self.first_triangle_ids, self.items, strict=True)
        return min((first_id for first_id, item in ids if item.kind is None), default=STOP_ID)

    @property
    def kinds(self) -> list[FieldKind]:
        """The `FieldKind` of each degree that the fields have, sorted by degree."""
        kinds = {item.kind for item in self.items} - {None}
        return sorted(kinds, key=lambda kind: kind.degree)

    @cached_property
    def _shared_uniforms(self) -> dict[str, Any]:
        return {**self.look.settings(), **camera_uniforms(self.camera)}

    def image(self, name: str, texel_format: str = "RGBA32F", layers: int = 0) -> Any:
        """Return the image with a name and the size of the frame; see `GpuResources.image`."""
        return self.resources.image(name, self.size, texel_format, layers)

    def box_of_kind(self, kind: FieldKind) -> Box:
        """Return the box of the pixels that instances with a field of this degree and symmetry can cover."""
        items = zip(self.items, self.boxes, strict=True)
        return union_box(box for item, box in items if item.kind == kind)

    def fields_in_view(self) -> list[tuple[int, DrawItem]]:
        """Return the index and the draw item of each instance that has a field and may be visible."""
        return [
            (index, item)
            for index, item in enumerate(self.items)
            if item.kind is not None and not is_empty(self.boxes[index])
        ]

    def take_passes(self) -> list[FramePass]:
        """Remove all passes from the frame, and return them in the order in which they must be run."""
        passes = self.passes.copy()
        self.passes.clear()
        return passes

    def run_on_instance(
        self, shader: ComputePass, instance_id: int, textures: NamedValues, uniforms: NamedValues
    ) -> None:
        """Add a compute pass over the pixels that one instance can cover; see `run`.

        The pass can also read the triangle records of the instance.

        Parameters
        ----------
        shader : ComputePass
        instance_id : int
            Index into ``items``.
        textures : dict of str to texture
        uniforms : dict
            Further uniforms, besides the uniforms of the instance.
        """
        records = {"triangle_records": self.items[instance_id].mesh.records_texture}
        uniforms = {**self.instance_uniforms(instance_id), **uniforms}
        self.run(shader, self.boxes[instance_id], {**records, **textures}, uniforms)

    def instance_uniforms(self, instance_id: int) -> dict[str, Any]:
        """Return the uniforms of passes over the pixels of one instance, given its index."""
        item = self.items[instance_id]
        model_to_camera = self.camera.view @ item.model_matrix
        return {
            "instance_id": float(instance_id),
            "first_triangle_id": self.first_triangle_ids[instance_id],
            "triangle_count": item.mesh.buffers.triangle_count,
            "texels_per_record": item.mesh.buffers.texels_per_record,
            **matrix_rows("model_view", "xyz", model_to_camera[:3]),
        }

    def clear(self, image: Any, texel_format: str | None = None) -> None:
        """Add a pass that sets an image of the size of the frame to 0. Its default format is RGBA32F."""
        formats = () if texel_format is None else (("cleared", texel_format),)
        self.run(ComputePass("clear", formats), self.box, {"cleared": image}, {})

    def run(
        self,
        shader: ComputePass,
        box: Box,
        textures: NamedValues,
        uniforms: NamedValues,
        layers: int = 1,
        pause: float | None = None,
    ) -> None:
        """Add a compute pass over the pixels of a box.

        Parameters
        ----------
        shader : ComputePass
        box : Box
        textures : dict of str to texture
            Textures and images that the pass reads and writes, by their names in the shader. It can also
            read the ``textures`` of the frame.
        uniforms : dict
            Further uniforms. The uniforms of the camera and all settings of the look are added by their
            names.
        layers : int
            Number of layers of the texture arrays that the pass writes.
        pause : float, optional
            Fraction of the stage that is done before the pass, if the renderer may pause there.
        """
        uniforms = {**self._shared_uniforms, **uniforms, "box_origin": box[:2]}
        textures = {**self.textures, **textures}
        shader, size = shader.variant(uniforms), (*box_size(box), layers)
        run = partial(self.resources.device.compute, shader, size, textures, uniforms)
        self.passes.append(FramePass(shader, run, pause))

    def draw(self, shader: RasterPass, batches: Batches, target: Any) -> None:
        """Add a pass that clears the texture `target` and draws triangles into it.

        `batches` are vertex buffers with uniforms; see `Device.draw`.
        """
        depth = self.resources.image("depth", (target.width, target.height), "DEPTH_COMPONENT32F")
        run = partial(self.resources.device.draw, shader, batches, target, depth)
        self.passes.append(FramePass(shader, run, None))


def screen_box(item: DrawItem, camera: Camera) -> Box:
    """Return the box of the pixels that a mesh can cover.

    It is the box of the whole frame if the near plane cuts off a part of the mesh's bounding box, and
    empty if the near plane cuts off all of it.
    """
    points = np.concatenate([item.mesh.buffers.bounds, np.ones((8, 1))], axis=1)
    clip = points @ (camera.projection @ camera.view @ item.model_matrix).T
    is_cut_off = clip[:, 2] < -clip[:, 3]
    if is_cut_off.all():
        return 0, 0, 0, 0
    if is_cut_off.any() or (clip[:, 3] <= 0).any():
        return 0, 0, *camera.size
    ends = clip[:, :2] / clip[:, 3:] * 0.5 + 0.5
    size = np.array(camera.size)
    low = np.clip(np.floor(ends.min(axis=0) * size), 0, size).astype(int)
    high = np.clip(np.ceil(ends.max(axis=0) * size), 0, size).astype(int)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def is_empty(box: Box) -> bool:
    """Return whether a box contains no pixel."""
    left, bottom, right, top = box
    return left >= right or bottom >= top


def union_box(boxes: Iterable[Box]) -> Box:
    """Return the smallest box that contains all given boxes. Empty boxes are ignored."""
    boxes = [box for box in boxes if not is_empty(box)]
    if not boxes:
        return 0, 0, 0, 0
    left, bottom, right, top = zip(*boxes, strict=True)
    return min(left), min(bottom), max(right), max(top)


def box_size(box: Box) -> tuple[int, int]:
    """Return the width and the height of a box, in pixels."""
    left, bottom, right, top = box
    return right - left, top - bottom
