"""Meshes, images and textures that stay on the device from picture to picture."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import partial
from typing import Any

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

#: Uploads, of all views together, after which images and meshes that were not used are freed. Each
#: frame of an animation has new meshes.
IMAGE_LIFETIME_UPLOADS, MESH_LIFETIME_UPLOADS = 32, 2

#: Textures of even lines that are kept for each mesh: two for each distance.
MAX_LINE_TEXTURES = 6

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
        The latest results of `GpuResources.line_records`, by their settings.
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

    def release(self) -> None:
        """Free all resources."""
        for cache in (self._meshes, self._images, self._last_used, self._lookup_textures):
            cache.clear()

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
        self._evict_images()
        kinds = field_kinds(instance.field for instance in instances if instance.field is not None)
        meshes = run(prepare_steps(self.mesh_lookups(instances, display)))
        items = []
        for instance, mesh in zip(instances, meshes, strict=True):
            mesh.last_used = self._upload_count
            kind = None if instance.field is None else kinds[instance.field.degree]
            _, model_matrix = split_matrix(instance.matrix)
            model_matrix = model_matrix @ translation_matrix(mesh.buffers.center)
            items.append(DrawItem(instance, mesh, model_matrix, kind))
        oldest_kept = self._upload_count - MESH_LIFETIME_UPLOADS
        for key in [key for key, mesh in self._meshes.items() if mesh.last_used < oldest_kept]:
            del self._meshes[key]
        return items

    def feature_curvature(self, surface: Surface) -> Any:
        """Look up the curvature of features at the corners of each triangle of a surface.

        See `field.feature_curvature`. It is a texture, or a `Preparation` of it.
        """
        key = "feature curvature", surface.rest_shape_key
        if key not in self._images:

            def send(rows: np.ndarray) -> Any:
                return self._cached(key, partial(self._texture_of, rows))

            call = Call(feature_records, (surface,), label="measuring features")
            return Preparation(call, FEATURE_SECONDS * len(surface.triangles), send)
        self._last_used[key] = self._upload_count
        return self._images[key]

    def outline_textures(
        self, item: DrawItem, crease_angle: float | None
    ) -> OutlineTextures | Preparation:
        """Look up the creases and parts of the mesh of an item. They stay on the device with it.

        Raises
        ------
        RosyError
            When they are sent: if there are too many for the device.
        """
        mesh, surface = item.mesh, item.instance.surface
        current = mesh.outline_textures
        if current is not None and current.crease_angle == crease_angle:
            return current

        def send(records: tuple[np.ndarray | None, int, np.ndarray | None]) -> OutlineTextures:
            points, crease_count, parts = records
            textures = []
            for rows in (points, parts):
                if rows is not None and len(rows) > self.device.max_texture_size:
                    raise RosyError(
                        f"{surface.name}: has too many creases for this graphics card: choose the "
                        "processor"
                    )
                textures.append(None if rows is None else self._texture_of(rows))
            mesh.outline_textures = OutlineTextures(
                crease_angle, textures[0], crease_count, textures[1]
            )
            return mesh.outline_textures

        linear, _ = split_matrix(item.instance.matrix)
        call = Call(
            outline_records,
            (surface, linear, mesh.buffers.center, crease_angle),
            label="finding outlines",
        )
        return Preparation(call, BUFFER_SECONDS * len(surface.triangles), send)

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
            texture = self._texture_of(create())
            self._lookup_textures[name] = key, texture
        return texture

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
        instance, textures = item.instance, item.mesh.line_textures
        surface = instance.surface
        key = rest_matrix(instance.matrix).tobytes(), display, spacing
        if key in textures:
            return textures[key]

        def send(records: tuple[np.ndarray, int, int]) -> tuple[Any, int]:
            rows, node_count, triangle_count = records
            if len(rows) > self.device.max_texture_size:
                raise RosyError(
                    f"{surface.name}: even lines on {triangle_count} triangles are too many "
                    "for this graphics card: choose wider lines, or the processor"
                )
            while len(textures) >= MAX_LINE_TEXTURES:
                del textures[next(iter(textures))]
            textures[key] = self._texture_of(rows), node_count
            return textures[key]

        call = Call(
            line_records,
            (surface, instance.matrix, instance.field, display, spacing),
            label="spacing lines",
        )
        return Preparation(call, LINE_SECONDS * len(surface.triangles), send)

    def reference_atlas(self, reference: ReferenceRender) -> MipAtlas:
        """Return the image that the tone "picture" is sampled from."""
        cached = self._lookup_textures.get("rendered")
        if cached is None or cached[0] is not reference:
            cached = reference, self._upload_atlas(reference.mip_map)
            self._lookup_textures["rendered"] = cached
        return cached[1]

    def _texture_of(self, values: np.ndarray) -> Any:
        height, width, channels = values.shape
        data = np.pad(values, ((0, 0), (0, 0), (0, 4 - channels))) if channels < 4 else values
        return self.device.texture(width, height, "RGBA32F", data=data)

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

    def _mesh(
        self, instance: MeshInstance, display: str, kinds: dict[int, FieldKind]
    ) -> GpuMesh | Preparation:
        """Look up the mesh of an instance."""
        surface, field = instance.surface, instance.field
        linear, _ = split_matrix(instance.matrix)
        channels = () if field is None else kinds[field.degree].channels
        sources = surface, field, instance.tone, instance.color_values
        key = (*map(id, sources), linear.tobytes(), display, channels)
        if key in self._meshes:
            return self._meshes[key]

        def send(buffers: MeshBuffers) -> GpuMesh:
            mesh = self._meshes[key] = self._send_mesh(instance, buffers)
            return mesh

        call = Call(
            mesh_buffers,
            (surface, linear, field, display, channels, instance.tone, instance.color_values),
            label=f"preparing the mesh of {surface.name}",
        )
        return Preparation(call, BUFFER_SECONDS * len(surface.triangles), send)

    def _send_mesh(self, instance: MeshInstance, buffers: MeshBuffers) -> GpuMesh:
        surface, tone, rows = instance.surface, instance.tone, buffers.triangle_records
        records_texture = tone_atlas = None
        if rows is not None:
            if len(rows) > self.device.max_texture_size:
                raise RosyError(
                    f"{surface.name}: {len(surface.triangles)} triangles are too many for this "
                    "graphics card: choose the processor"
                )
            records_texture = self._texture_of(rows)
        if buffers.has_tone and tone.image is not None:
            tone_atlas = self._upload_atlas(tone.mip_map)
        batch = self.device.batch(buffers.corners)
        sources = surface, instance.field, tone, instance.color_values
        return GpuMesh(
            buffers, batch, records_texture, sources, tone_atlas, last_used=self._upload_count
        )

    def _upload_atlas(self, mip_map: MipMap) -> MipAtlas:
        max_side = min(MAX_TONE_IMAGE_SIDE, self.device.max_texture_size // 2)
        texels, size, max_level = mip_atlas(mip_map, max_side)
        height, width = texels.shape[:2]
        texture = self.device.texture(width, height, "RGBA16F", data=texels)
        return MipAtlas(texture, size, max_level, len(mip_map.levels) - 1 - max_level)
