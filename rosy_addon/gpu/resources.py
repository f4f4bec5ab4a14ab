"""Meshes, images and textures that stay on the device from picture to picture."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Any

import numpy as np

from ..cache import Cache
from ..compositor.target_tone import ReferenceRender
from ..errors import RosyError
from ..field.feature_curvature import feature_curvature
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..progress import Task, as_task, subtask
from ..projection.field_channel import FieldChannel
from ..projection.gbuffer import MeshInstance
from ..projection.mip_map import MipMap
from ..projection.outline_mesh import cached_outline_mesh
from ..projection.rest_coordinates import matrix_scale
from ..projection.surface_lines import cached_surface_lines, rest_matrix
from .device import Device
from .field_kind import FieldKind, field_kinds
from .line_records import line_records
from .mesh_buffers import (
    MeshBuffers,
    mesh_buffers_task,
    mip_atlas,
    split_matrix,
    to_texture_rows,
    translation_matrix,
)

#: Uploads, of all views together, after which images and meshes that were not used are freed. Each
#: frame of an animation has new meshes.
IMAGE_LIFETIME_UPLOADS, MESH_LIFETIME_UPLOADS = 32, 2

#: Textures of even lines that are kept for each mesh: two for each distance.
MAX_LINE_TEXTURES = 6

#: Size limit of what was computed from meshes in memory: even lines, creases and parts.
MAX_MESH_CACHE_BYTES = 1 << 28

#: Maximum side, in texels, of an image that tones are sampled from.
MAX_TONE_IMAGE_SIDE = 2048


@dataclass(frozen=True, eq=False)
class DrawItem:
    """A mesh instance on the device.

    Attributes
    ----------
    mesh : GpuMesh
    field : RosyField or None
        None for a mesh that only occludes.
    model_matrix : (4, 4) float64 ndarray
        From the mesh buffers to world space: a rotation, a uniform scale and a translation.
    object_scale : float
        Scale of the matrix of the instance.
    kind : FieldKind or None
    instance : MeshInstance or None
    """

    mesh: GpuMesh
    field: RosyField | None
    model_matrix: np.ndarray
    object_scale: float
    kind: FieldKind | None
    instance: MeshInstance | None = None


@dataclass(eq=False)
class GpuMesh:
    """A mesh with its field on the device.

    Attributes
    ----------
    buffers : MeshBuffers
    batch : handle
        Of `Device.batch`.
    records_texture : texture or None
        The triangle records; None without a field.
    keep_alive : tuple
        Surface, field, tone and numbers: the key of the mesh contains their ids.
    tone_atlas : MipAtlas or None
    outline_textures : OutlineTextures or None
        Those of the last crease angle.
    last_used : int
        Number of the upload that used it last.
    line_textures : dict
        The latest textures of `GpuResources.line_records_task`, by their settings.
    """

    buffers: MeshBuffers
    batch: Any
    records_texture: Any
    keep_alive: tuple[Any, ...]
    tone_atlas: MipAtlas | None = None
    outline_textures: OutlineTextures | None = None
    last_used: int = 0
    line_textures: dict[tuple, tuple[Any, int]] = dataclass_field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class OutlineTextures:
    """The creases and parts of a mesh (`outline_mesh.OutlineMesh`) as textures.

    Attributes
    ----------
    crease_angle : float or None
    crease_points : texture or None
        The two ends of each edge, relative to the center of the mesh, in rows of `ROW_TEXELS`.
    crease_count : int
    triangle_parts : texture or None
        The parts of four triangles in each texel. None if there is only one part.
    """

    crease_angle: float | None
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
    """The meshes, images and textures on a device. Those not used for some uploads are freed.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    device : Device
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        self._meshes: dict[tuple, GpuMesh] = {}
        self._images: dict[tuple, Any] = {}
        self._last_used: dict[tuple, int] = {}
        self._lookup_textures: dict[str, tuple[Any, Any]] = {}
        self._upload_count = 0
        self._mesh_cache = Cache(MAX_MESH_CACHE_BYTES)

    @property
    def meshes(self) -> list[GpuMesh]:
        """The meshes on the device."""
        return list(self._meshes.values())

    @property
    def texture_count(self) -> int:
        """The number of textures on the device."""
        records = sum(mesh.records_texture is not None for mesh in self.meshes)
        atlases = sum(mesh.tone_atlas is not None for mesh in self.meshes)
        records += sum(len(mesh.line_textures) for mesh in self.meshes)
        outlines = [mesh.outline_textures for mesh in self.meshes if mesh.outline_textures]
        records += sum(outline.crease_points is not None for outline in outlines)
        records += sum(outline.triangle_parts is not None for outline in outlines)
        return records + atlases + len(self._images) + len(self._lookup_textures)

    def release(self) -> None:
        """Free all resources."""
        for cache in (self._meshes, self._images, self._last_used, self._lookup_textures):
            cache.clear()
        self._mesh_cache.clear()

    def upload_task(self, instances: Sequence[MeshInstance], display: str) -> Task[list[DrawItem]]:
        """Return draw items of mesh instances. Meshes on the device are not sent again.

        Raises
        ------
        RosyError
            If a mesh has too many triangles for the device.
        """
        self._upload_count += 1
        self._evict_images()
        kinds = field_kinds(instance.field for instance in instances if instance.field is not None)
        items = []
        for instance in instances:
            items.append((yield from self._draw_item_task(instance, display, kinds)))
        oldest_kept = self._upload_count - MESH_LIFETIME_UPLOADS
        for key in [key for key, mesh in self._meshes.items() if mesh.last_used < oldest_kept]:
            del self._meshes[key]
        return items

    def feature_curvature_task(self, surface: Surface) -> Task[Any]:
        """Return the curvature of features at the corners of each triangle of a surface, as a texture.

        See `field.feature_curvature`.
        """
        key = "feature curvature", surface.rest_shape_key
        if key not in self._images:
            curvature = yield from as_task(feature_curvature, surface)
            self._images[key] = self._texture_of(to_texture_rows(curvature))
        self._last_used[key] = self._upload_count
        return self._images[key]

    def outline_textures_task(
        self, item: DrawItem, crease_angle: float | None
    ) -> Task[OutlineTextures]:
        """Return the creases and parts of the mesh of an item. They stay on the device with it.

        Raises
        ------
        RosyError
            If there are too many for the device.
        """
        mesh, surface = item.mesh, item.instance.surface
        current = mesh.outline_textures
        if current is not None and current.crease_angle == crease_angle:
            return current
        linear, _ = split_matrix(item.instance.matrix)
        found = yield from as_task(
            cached_outline_mesh, surface, linear, crease_angle, self._mesh_cache
        )
        self._mesh_cache.evict_over_limit()
        points = found.crease_points(surface, linear).reshape(-1, 3) - mesh.buffers.center
        parts = np.empty((0, 4)) if found.triangle_part is None else found.triangle_part
        parts = np.pad(parts.ravel(), (0, -parts.size % 4)).reshape(-1, 4)
        textures = []
        for values in (points, parts):
            rows = to_texture_rows(values)
            if len(rows) > self.device.max_texture_size:
                raise RosyError(
                    f"{surface.name}: has too many creases for this graphics card: choose the processor"
                )
            textures.append(self._texture_of(rows) if len(values) else None)
        mesh.outline_textures = OutlineTextures(
            crease_angle, textures[0], len(points) // 2, textures[1]
        )
        return mesh.outline_textures

    def image(
        self,
        name: Hashable,
        width: int,
        height: int,
        texel_format: str = "RGBA32F",
        layers: int = 0,
    ) -> Any:
        """Return the image of a name, size and format. Its contents are those of its last use."""
        key = name, width, height, texel_format, layers
        return self._cached(key, lambda: self.device.texture(width, height, texel_format, layers))

    def depth_image(self, width: int, height: int) -> Any:
        """Return the depth buffer of a size."""
        key = "depth", width, height
        return self._cached(key, lambda: self.device.depth_texture(width, height))

    def lookup_texture(self, name: str, key: Any, create: Callable[[], np.ndarray]) -> Any:
        """Return (H, W, 4) values as a texture. Of each name, the last key is kept."""
        cached = self._lookup_textures.get(name)
        if cached is None or cached[0] != key:
            cached = self._lookup_textures[name] = key, self._texture_of(create())
        return cached[1]

    def growing_texture(
        self, name: str, key: Any, size: tuple[int, int], create: Callable[[int, int], np.ndarray]
    ) -> Any:
        """Return a texture of a size or larger.

        Parameters
        ----------
        name : str
        key : any
            The texture is created again if the key has changed.
        size : (int, int)
            Width and height in texels.
        create : function
            From width and height to (H, W, 4) values.
        """
        cached = self._lookup_textures.get(name)
        if cached is not None:
            cached_key, (texture, cached_size) = cached
            if cached_key == key and size[0] <= cached_size[0] and size[1] <= cached_size[1]:
                return texture
        texture = self._texture_of(create(*size))
        self._lookup_textures[name] = key, (texture, size)
        return texture

    def line_records_task(
        self, item: DrawItem, display: str, spacing: float
    ) -> Task[tuple[Any, int]]:
        """Return the texture of `line_records.line_records` for an instance, and its node count.

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
            If the lines do not fit into a texture.
        """
        instance, textures = item.instance, item.mesh.line_textures
        key = rest_matrix(instance.matrix).tobytes(), display, spacing
        if key not in textures:
            surface = instance.surface
            lines = yield from as_task(
                cached_surface_lines,
                surface,
                instance.matrix,
                instance.field,
                display,
                spacing,
                self._mesh_cache,
            )
            self._mesh_cache.evict_over_limit()
            rows, node_count = line_records(lines)
            if len(rows) > self.device.max_texture_size:
                raise RosyError(
                    f"{surface.name}: even lines on {len(lines.tree.leaf_root)} triangles are too many "
                    "for this graphics card: choose wider lines, or the processor"
                )
            while len(textures) >= MAX_LINE_TEXTURES:
                del textures[next(iter(textures))]
            textures[key] = self._texture_of(rows), node_count
        return textures[key]

    def reference_atlas(self, reference: ReferenceRender) -> MipAtlas:
        """Return the image that the tone "picture" is sampled from."""
        cached = self._lookup_textures.get("rendered")
        if cached is None or cached[0] is not reference:
            cached = reference, self._upload_atlas(reference.mip_map)
            self._lookup_textures["rendered"] = cached
        return cached[1]

    def _texture_of(self, values: np.ndarray) -> Any:
        return self.device.texture(values.shape[1], values.shape[0], "RGBA32F", data=values)

    def _cached(self, key: tuple, create: Callable[[], Any]) -> Any:
        if key not in self._images:
            self._images[key] = create()
        self._last_used[key] = self._upload_count
        return self._images[key]

    def _evict_images(self) -> None:
        """Free images of names and sizes that were not used for some uploads."""
        oldest_kept = self._upload_count - IMAGE_LIFETIME_UPLOADS
        for key in [key for key, last_used in self._last_used.items() if last_used < oldest_kept]:
            del self._images[key], self._last_used[key]

    def _draw_item_task(
        self, instance: MeshInstance, display: str, kinds: dict[int, FieldKind]
    ) -> Task[DrawItem]:
        linear, model_matrix = split_matrix(instance.matrix)
        kind = None if instance.field is None else kinds[instance.field.degree]
        channels = () if kind is None else kind.channels
        key = (
            id(instance.surface),
            id(instance.field),
            id(instance.tone),
            id(instance.color_values),
            linear.tobytes(),
            display,
            channels,
        )
        if key not in self._meshes:
            self._meshes[key] = yield from self._upload_mesh_task(
                instance, linear, display, channels
            )
        mesh = self._meshes[key]
        mesh.last_used = self._upload_count
        model_matrix = model_matrix @ translation_matrix(mesh.buffers.center)
        return DrawItem(
            mesh, instance.field, model_matrix, matrix_scale(instance.matrix), kind, instance
        )

    def _upload_mesh_task(
        self,
        instance: MeshInstance,
        linear: np.ndarray,
        display: str,
        channels: Sequence[FieldChannel],
    ) -> Task[GpuMesh]:
        surface, field, tone = instance.surface, instance.field, instance.tone
        values = instance.color_values
        task = mesh_buffers_task(surface, linear, field, display, channels, tone, values)
        buffers = yield from subtask(task, 0.0, 1.0, f"preparing the mesh of {surface.name}")
        records_texture = None
        if buffers.triangle_records is not None:
            if len(buffers.triangle_records) > self.device.max_texture_size:
                raise RosyError(
                    f"{surface.name}: {len(surface.triangles)} triangles are too many for this "
                    "graphics card: choose the processor"
                )
            records_texture = self._texture_of(buffers.triangle_records)
        tone_atlas = None
        if buffers.has_tone and tone.image is not None:
            tone_atlas = self._upload_atlas(tone.mip_map)
        batch = self.device.batch(buffers.corners)
        sources = surface, field, tone, values
        return GpuMesh(buffers, batch, records_texture, sources, tone_atlas)

    def _upload_atlas(self, mip_map: MipMap) -> MipAtlas:
        max_side = min(MAX_TONE_IMAGE_SIDE, self.device.max_texture_size // 2)
        texels, size, max_level = mip_atlas(mip_map, max_side)
        height, width = texels.shape[:2]
        texture = self.device.texture(width, height, "RGBA16F", data=texels)
        return MipAtlas(texture, size, max_level, len(mip_map.levels) - 1 - max_level)
