"""Meshes, images and textures that stay on the device from picture to picture."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..compositor.target_tone import ReferenceRender
from ..core.errors import RosyError
from ..field.surface import Surface
from ..projection.gbuffer import MeshInstance
from ..projection.rest_coordinates import matrix_scale
from ..projection.surface_lines import rest_matrix
from ..projection.surface_tone import MipMap
from ..worker.job import Call, run
from .device import Device
from .mesh_buffers import (
    FieldKind,
    MeshBuffers,
    field_kinds,
    mesh_buffers,
    mip_atlas,
    split_matrix,
    translation_matrix,
)
from .preparation import Preparation, prepare_steps
from .surface_records import feature_records, line_records, outline_records

#: Numbers of uploads, of all views together, for which something that is not used stays on the device: images,
#: meshes (each frame of an animation has new ones), and tables that are computed from meshes.
IMAGE_LIFETIME, MESH_LIFETIME, TABLE_LIFETIME = 32, 2, 4

#: Seconds for each triangle of a mesh: of its buffers and outlines, of even lines, and of features.
BUFFER_SECONDS, LINE_SECONDS, FEATURE_SECONDS = 1e-6, 6e-6, 1e-5

#: Maximum side, in texels, of an image that tones are sampled from.
MAX_TONE_IMAGE_SIDE = 2048


@dataclass(frozen=True, eq=False)
class DrawItem:
    """A mesh instance on the device.

    Attributes
    ----------
    instance : MeshInstance
    mesh : GpuMesh
    model_matrix : (4, 4) float64 ndarray
        From the mesh buffers to world space: a rotation, a uniform scale and a translation.
    kind : FieldKind or None
        None for a mesh that only occludes.
    """

    instance: MeshInstance
    mesh: GpuMesh
    model_matrix: np.ndarray
    kind: FieldKind | None

    @property
    def object_scale(self) -> float:
        """Scale of the matrix of the instance."""
        return matrix_scale(self.instance.matrix)


@dataclass(frozen=True, eq=False)
class GpuMesh:
    """A mesh with its field on the device.

    Attributes
    ----------
    buffers : MeshBuffers
    batch : handle
        A batch of `Device.batch`.
    records_texture : texture or None
        The triangle records; None without a field.
    tone_atlas : MipAtlas or None
    instance : MeshInstance
        The instance whose mesh was sent. It keeps the arrays alive whose ids are in the key of the mesh.
    """

    buffers: MeshBuffers
    batch: Any
    records_texture: Any
    tone_atlas: MipAtlas | None
    instance: MeshInstance


class OutlineTextures(NamedTuple):
    """The creases and parts of a mesh (`outline_mesh.OutlineMesh`) as textures.

    Attributes
    ----------
    crease_points : texture or None
        The two ends of each edge, relative to the center of the mesh, in rows of `ROW_TEXELS`.
    crease_count : int
    triangle_parts : texture or None
        The parts of four triangles in each texel. None if there is only one part.
    """

    crease_points: Any
    crease_count: int
    triangle_parts: Any


@dataclass(frozen=True, eq=False)
class MipAtlas:
    """All levels of a mip map in one texture (`mesh_buffers.mip_atlas`).

    Attributes
    ----------
    texture : texture
    size : (int, int)
        Width and height of level 0.
    max_level : int
    skipped_levels : int
        Levels of the mip map that are larger than level 0 of the atlas.
    """

    texture: Any
    size: tuple[int, int]
    max_level: int
    skipped_levels: int


class GpuResources:
    """The meshes, images and textures on a device. What is not used for some uploads is freed.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    device : Device
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        #: What is on the device, and the last upload after which it stays there unused, by key.
        self._kept: dict[Hashable, tuple[Any, int]] = {}
        self._lookup_textures: dict[str, tuple[Any, Any]] = {}
        self._upload_count = 0

    def release(self) -> None:
        """Free all resources."""
        self._kept.clear()
        self._lookup_textures.clear()

    def mesh_lookups(
        self, instances: Sequence[MeshInstance], display: str
    ) -> list[Callable[[], GpuMesh | Preparation]]:
        """Return a function for each mesh instance that looks its mesh up; see `prepare_steps`."""
        kinds = field_kinds(instance.field for instance in instances if instance.field is not None)
        return [partial(self._mesh, instance, display, kinds) for instance in instances]

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[DrawItem]:
        """Return draw items of mesh instances. Meshes on the device are not sent again.

        Raises
        ------
        RosyError
            If a mesh has too many triangles for the device.
        """
        self._upload_count += 1
        kinds = field_kinds(instance.field for instance in instances if instance.field is not None)
        meshes = run(prepare_steps(self.mesh_lookups(instances, display)))
        items = []
        for instance, mesh in zip(instances, meshes, strict=True):
            kind = None if instance.field is None else kinds[instance.field.degree]
            _, model_matrix = split_matrix(instance.matrix)
            model_matrix = model_matrix @ translation_matrix(mesh.buffers.center)
            items.append(DrawItem(instance, mesh, model_matrix, kind))
        self._kept = {
            key: kept for key, kept in self._kept.items() if kept[1] >= self._upload_count
        }
        return items

    def feature_curvature(self, surface: Surface) -> Any:
        """Look up the curvature of features at the corners of each triangle of a surface.

        See `field.feature_curvature`. It is a texture, or a `Preparation` of it.
        """
        call = Call(feature_records, (surface,), label="measuring features")
        key = "feature curvature", surface.rest_shape_key
        seconds = FEATURE_SECONDS * len(surface.triangles)
        return self._look_up(key, call, seconds, self._texture)

    def outline_textures(
        self, item: DrawItem, crease_angle: float | None
    ) -> OutlineTextures | Preparation:
        """Look up the creases and parts of the mesh of an item.

        Raises
        ------
        RosyError
            When they are sent: if there are too many for the device.
        """
        surface = item.instance.surface
        linear, _ = split_matrix(item.instance.matrix)

        def send(records: tuple[np.ndarray | None, int, np.ndarray | None]) -> OutlineTextures:
            points, crease_count, parts = records
            points, parts = (
                None if rows is None else self._rows_texture(rows, surface, "its creases")
                for rows in (points, parts)
            )
            return OutlineTextures(points, crease_count, parts)

        arguments = surface, linear, item.mesh.buffers.center, crease_angle
        call = Call(outline_records, arguments, label="finding outlines")
        key = "outline", surface, linear.tobytes(), crease_angle
        return self._look_up(key, call, BUFFER_SECONDS * len(surface.triangles), send)

    def line_records(
        self, item: DrawItem, display: str, spacing: float
    ) -> tuple[Any, int] | Preparation:
        """Look up the texture of `surface_records.line_rows` for an instance, and its node count.

        Parameters
        ----------
        item : DrawItem
            With a field.
        display : {"smooth", "flat"}
        spacing : float
            Distance between lines, in Blender units.

        Raises
        ------
        RosyError
            When it is sent: if the lines do not fit into a texture.
        """
        surface, matrix, field = item.instance.surface, item.instance.matrix, item.instance.field

        def send(records: tuple[np.ndarray, int, int]) -> tuple[Any, int]:
            rows, node_count, triangle_count = records
            what = f"even lines on {triangle_count} triangles"
            remedy = "choose wider lines, or the processor"
            return self._rows_texture(rows, surface, what, remedy), node_count

        call = Call(line_records, (surface, matrix, field, display, spacing), label="spacing lines")
        key = "lines", surface, field, rest_matrix(matrix).tobytes(), display, spacing
        return self._look_up(key, call, LINE_SECONDS * len(surface.triangles), send)

    def image(
        self,
        name: Hashable,
        width: int,
        height: int,
        texel_format: str = "RGBA32F",
        layers: int = 0,
    ) -> Any:
        """Return the image of a name, size and format. Its contents are those of its last use."""
        size_and_format = width, height, texel_format, layers
        key = "image", name, *size_and_format
        texture = self._kept[key][0] if key in self._kept else self.device.texture(*size_and_format)
        return self._keep(key, texture, IMAGE_LIFETIME)

    def lookup_texture(
        self,
        name: str,
        key: Any,
        create: Callable[[], np.ndarray],
        min_size: tuple[int, int] = (0, 0),
    ) -> Any:
        """Return a texture of values. Of each name, the last key is kept.

        Parameters
        ----------
        name : str
        key : any
        create : function
            Returns (H, W, C) values; the other channels are 0.
        min_size : (int, int)
            Width and height in texels. A smaller texture is created again.
        """
        last_key, texture = self._lookup_textures.get(name, (None, None))
        is_kept = (
            texture is not None
            and last_key == key
            and texture.width >= min_size[0]
            and texture.height >= min_size[1]
        )
        if not is_kept:
            texture = self._texture(create())
            self._lookup_textures[name] = key, texture
        return texture

    def reference_atlas(self, reference: ReferenceRender) -> MipAtlas:
        """Return the image that the tone "picture" is sampled from."""
        cached = self._lookup_textures.get("rendered")
        if cached is None or cached[0] is not reference:
            cached = reference, self._upload_atlas(reference.mip_map)
            self._lookup_textures["rendered"] = cached
        return cached[1]

    def _look_up(
        self,
        key: Hashable,
        call: Call,
        seconds: float,
        send: Callable[[Any], Any],
        lifetime: int = TABLE_LIFETIME,
    ) -> Any:
        """Return what is kept under a key, or a `Preparation` of it with the other arguments."""
        if key in self._kept:
            return self._keep(key, self._kept[key][0], lifetime)
        return Preparation(call, seconds, lambda answer: self._keep(key, send(answer), lifetime))

    def _keep(self, key: Hashable, handle: Any, lifetime: int) -> Any:
        """Keep a handle until it has not been used for a number of uploads, and return it."""
        self._kept[key] = handle, self._upload_count + lifetime
        return handle

    def _mesh(
        self, instance: MeshInstance, display: str, kinds: dict[int, FieldKind]
    ) -> GpuMesh | Preparation:
        """Look up the mesh of an instance."""
        surface, field, tone = instance.surface, instance.field, instance.tone
        linear, _ = split_matrix(instance.matrix)
        channels = () if field is None else kinds[field.degree].channels

        def send(buffers: MeshBuffers) -> GpuMesh:
            records, atlas = buffers.triangle_records, None
            if records is not None:
                what = f"{len(surface.triangles)} triangles"
                records = self._rows_texture(records, surface, what)
            if buffers.has_tone and tone.image is not None:
                atlas = self._upload_atlas(tone.mip_map)
            return GpuMesh(buffers, self.device.batch(buffers.corners), records, atlas, instance)

        label = f"preparing the mesh of {surface.name}"
        arguments = surface, linear, field, display, channels, tone, instance.color_values
        call = Call(mesh_buffers, arguments, label=label)
        sources = surface, field, tone, instance.color_values
        key = "mesh", *map(id, sources), linear.tobytes(), display, channels
        seconds = BUFFER_SECONDS * len(surface.triangles)
        return self._look_up(key, call, seconds, send, MESH_LIFETIME)

    def _rows_texture(
        self, rows: np.ndarray, surface: Surface, what: str, remedy: str = "choose the processor"
    ) -> Any:
        """Return rows of `ROW_TEXELS` as a texture, or raise a `RosyError` if there are too many."""
        if len(rows) > self.device.max_texture_size:
            raise RosyError(f"{surface.name}: {what} are too many for this graphics card: {remedy}")
        return self._texture(rows)

    def _texture(self, values: np.ndarray) -> Any:
        """Return (H, W, C) values as a texture; its other channels are 0."""
        height, width, channels = values.shape
        data = np.pad(values, ((0, 0), (0, 0), (0, 4 - channels))) if channels < 4 else values
        return self.device.texture(width, height, "RGBA32F", data=data)

    def _upload_atlas(self, mip_map: MipMap) -> MipAtlas:
        max_side = min(MAX_TONE_IMAGE_SIDE, self.device.max_texture_size // 2)
        texels, size, max_level = mip_atlas(mip_map, max_side)
        height, width = texels.shape[:2]
        texture = self.device.texture(width, height, "RGBA16F", data=texels)
        return MipAtlas(texture, size, max_level, len(mip_map.levels) - 1 - max_level)
