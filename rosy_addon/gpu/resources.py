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
from ..projection.gbuffer import MeshInstance, with_field
from ..projection.rest_coordinates import matrix_scale
from ..projection.surface_lines import rest_matrix
from ..projection.surface_tone import MipMap
from ..worker.job import Call, run
from .device import Device
from .mesh_buffers import FieldKind, MeshBuffers, field_kinds, mesh_buffers, mip_atlas, split_matrix
from .preparation import Preparation, prepare_steps
from .surface_records import feature_records, line_records, outline_records

#: Data that is not used is freed after this many uploads, counted over all views: images, meshes (each frame
#: of an animation has new ones), and tables that are computed from meshes.
IMAGE_LIFETIME, MESH_LIFETIME, TABLE_LIFETIME = 32, 2, 4

#: Computing time for each triangle of a mesh, in seconds: of the buffers and the outline, of evenly spaced
#: lines, and of feature curvatures.
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
        Map from the positions in `mesh` to world space: a rotation, a uniform scale and a translation.
    kind : FieldKind or None
        Kind of the field. None for a mesh without a field, which only occludes.
    """

    instance: MeshInstance
    mesh: GpuMesh
    model_matrix: np.ndarray
    kind: FieldKind | None

    @property
    def object_scale(self) -> float:
        """Mean scale of the object-to-world matrix of the instance."""
        return matrix_scale(self.instance.matrix)


@dataclass(frozen=True, eq=False)
class GpuMesh:
    """A mesh on the device, with its field and tone.

    Attributes
    ----------
    buffers : MeshBuffers
        The numpy data that was sent.
    batch : handle
        The vertex buffer, a result of `Device.batch`.
    records_texture : texture or None
        The triangle records of `buffers`. None for a mesh without a field.
    tone_atlas : MipAtlas or None
        The image that the tone is sampled from. None if the tone has no image.
    instance : MeshInstance
        The instance whose mesh was sent. `GpuResources` identifies its arrays by `id`. This reference keeps
        them alive, so that no new array gets the same id.
    """

    buffers: MeshBuffers
    batch: Any
    records_texture: Any
    tone_atlas: MipAtlas | None
    instance: MeshInstance


class OutlineTextures(NamedTuple):
    """The creases and connected components of a mesh (`outline_mesh.OutlineMesh`) as textures.

    Attributes
    ----------
    crease_points : texture or None
        The two ends of each edge of a crease, relative to the center of the mesh, in rows of `ROW_TEXELS`.
        None if there are no creases.
    crease_count : int
        Number of edges of creases.
    triangle_parts : texture or None
        The connected components of the triangles, four triangles in each texel. None if there is only one
        component.
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
        Number of the smallest level in the texture, counted from its level 0.
    skipped_levels : int
        Number of levels of the mip map that are larger than level 0 of the texture, and left out.
    """

    texture: Any
    size: tuple[int, int]
    max_level: int
    skipped_levels: int


class GpuResources:
    """The meshes, images and textures on a device.

    A resource is freed if it was not used during a number of uploads, such as `MESH_LIFETIME`.

    Parameters
    ----------
    device : Device

    Attributes
    ----------
    device : Device
    """

    def __init__(self, device: Device) -> None:
        self.device = device
        #: By key: a handle on the device, and the number of the upload after which it is freed if it is not used.
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
        """Return for each mesh instance a function that looks up its mesh.

        It returns a `Preparation`, which a helper process runs, if the mesh is not on the device yet.
        `display` is the shading of the surface, "smooth" or "flat".
        """
        kinds = field_kinds(instance.field for instance in with_field(instances))
        return [partial(self._mesh, instance, display, kinds) for instance in instances]

    def upload(self, instances: Sequence[MeshInstance], display: str) -> list[DrawItem]:
        """Return a draw item for each mesh instance. Meshes that are on the device are not sent again.

        `display` is the shading of the surface, "smooth" or "flat".

        Raises
        ------
        RosyError
            If a mesh has too many triangles for the device.
        """
        self._upload_count += 1
        kinds = field_kinds(instance.field for instance in with_field(instances))
        meshes = run(prepare_steps(self.mesh_lookups(instances, display)))
        items = []
        for instance, mesh in zip(instances, meshes, strict=True):
            kind = None if instance.field is None else kinds[instance.field.degree]
            model_matrix = mesh.buffers.model_matrix(instance.matrix)
            items.append(DrawItem(instance, mesh, model_matrix, kind))
        kept = self._kept.items()
        self._kept = {key: entry for key, entry in kept if entry[1] >= self._upload_count}
        return items

    def feature_curvature(self, surface: Surface) -> Any:
        """Look up the curvature of a surface at the corners of each triangle.

        It is in units of 1 / length in object space; see `field.feature_curvature`. Return a texture, or a
        `Preparation` of it.
        """
        call = Call(feature_records, (surface,), label="measuring features")
        key = "feature curvature", surface.rest_shape_key
        seconds = FEATURE_SECONDS * len(surface.triangles)
        return self._look_up(key, Preparation(call, seconds, self._texture))

    def outline_textures(
        self, item: DrawItem, crease_angle: float | None
    ) -> OutlineTextures | Preparation:
        """Look up the creases and connected components of the mesh of an item, or return a `Preparation`.

        `crease_angle` is the smallest angle between face normals at a crease, in radians. None: no creases.

        Raises
        ------
        RosyError
            Raised by `Preparation.send` if there are too many creases or triangles for the device.
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
        seconds = BUFFER_SECONDS * len(surface.triangles)
        return self._look_up(key, Preparation(call, seconds, send))

    def line_records(
        self, item: DrawItem, display: str, spacing: float
    ) -> tuple[Any, int] | Preparation:
        """Look up the evenly spaced lines of an instance, or return a `Preparation`.

        The result is a texture with the rows of `surface_records.line_rows`, and the number of nodes of
        bisection trees in it.

        Parameters
        ----------
        item : DrawItem
            An instance with a field.
        display : {"smooth", "flat"}
            Shading of the surface; see `Look.display`.
        spacing : float
            Distance between lines, in Blender units.

        Raises
        ------
        RosyError
            Raised by `Preparation.send` if the lines do not fit into a texture.
        """
        surface, field = item.instance.surface, item.instance.field

        def send(records: tuple[np.ndarray, int, int]) -> tuple[Any, int]:
            rows, node_count, triangle_count = records
            what = f"even lines on {triangle_count} triangles"
            remedy = "choose wider lines, or the processor"
            return self._rows_texture(rows, surface, what, remedy), node_count

        call = Call(line_records, (item.instance, display, spacing), label="spacing lines")
        key = "lines", surface, field, rest_matrix(item.instance.matrix).tobytes(), display, spacing
        seconds = LINE_SECONDS * len(surface.triangles)
        return self._look_up(key, Preparation(call, seconds, send))

    def image(
        self, name: Hashable, size: tuple[int, int], texel_format: str = "RGBA32F", layers: int = 0
    ) -> Any:
        """Return the image with a name, size and format. It has the contents of its last use, if any."""
        key = "image", name, size, texel_format, layers
        if key not in self._kept:
            self._keep(key, self.device.texture(size, texel_format, layers), IMAGE_LIFETIME)
        return self._keep(key, self._kept[key][0], IMAGE_LIFETIME)

    def lookup_texture(
        self, name: str, key: Any, create: Callable[[], Any], min_size: tuple[int, int] = (0, 0)
    ) -> Any:
        """Return a texture of values, created if it does not exist.

        Only one texture is kept for each name: the one with the last key.

        Parameters
        ----------
        name : str
        key : any
            What the values depend on. If it differs from the key of the kept texture, `create` is called.
        create : function
            Returns (H, W, C) values. The texture has four channels; those after the first C are 0.
        min_size : (int, int)
            Smallest width and height in texels. A texture that is smaller is created again.
        """
        last_key, texture = self._lookup_textures.get(name, (None, None))
        is_kept = texture is not None and last_key == key
        if not is_kept or texture.width < min_size[0] or texture.height < min_size[1]:
            texture = self._texture(create())
            self._lookup_textures[name] = key, texture
        return texture

    def reference_atlas(self, reference: ReferenceRender) -> MipAtlas:
        """Return the mip map of a reference render's luminance, which the tone "picture" is sampled from."""
        if self._lookup_textures.get("rendered", (None,))[0] is not reference:
            self._lookup_textures["rendered"] = reference, self._upload_atlas(reference.mip_map)
        return self._lookup_textures["rendered"][1]

    def _look_up(self, key: Hashable, missing: Preparation, lifetime: int = TABLE_LIFETIME) -> Any:
        """Return the handle that is kept under a key or, if there is none, the preparation `missing`.

        After the preparation, the handle is kept until it has not been used during `lifetime` uploads.
        """
        if key in self._kept:
            return self._keep(key, self._kept[key][0], lifetime)
        send = missing.send
        return missing._replace(send=lambda answer: self._keep(key, send(answer), lifetime))

    def _keep(self, key: Hashable, handle: Any, lifetime: int) -> Any:
        """Return a handle, and keep it until it has not been used during `lifetime` uploads."""
        self._kept[key] = handle, self._upload_count + lifetime
        return handle

    def _mesh(
        self, instance: MeshInstance, display: str, kinds: dict[int, FieldKind]
    ) -> GpuMesh | Preparation:
        """Look up the mesh of an instance, or return a `Preparation` of it.

        `display` is the shading of the surface, and `kinds` has the kind of the fields of each degree.
        """
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
        call = Call(mesh_buffers, (instance, display, channels), label=label)
        sources = surface, field, tone, instance.color_values
        key = "mesh", *map(id, sources), linear.tobytes(), display, channels
        seconds = BUFFER_SECONDS * len(surface.triangles)
        return self._look_up(key, Preparation(call, seconds, send), MESH_LIFETIME)

    def _rows_texture(
        self, rows: np.ndarray, surface: Surface, what: str, remedy: str = "choose the processor"
    ) -> Any:
        """Return (rows, `ROW_TEXELS`, 4) values as a texture; raise a `RosyError` if they do not fit.

        The message names the surface, says that there are too many of `what`, and gives the advice `remedy`.
        """
        if len(rows) > self.device.max_texture_size:
            raise RosyError(f"{surface.name}: {what} are too many for this graphics card: {remedy}")
        return self._texture(rows)

    def _texture(self, values: np.ndarray) -> Any:
        """Return (H, W, C) values as a texture of four channels; those after the first C are 0."""
        height, width, channels = values.shape
        data = np.pad(values, ((0, 0), (0, 0), (0, 4 - channels))) if channels < 4 else values
        return self.device.texture((width, height), "RGBA32F", data=data)

    def _upload_atlas(self, mip_map: MipMap) -> MipAtlas:
        max_side = min(MAX_TONE_IMAGE_SIDE, self.device.max_texture_size // 2)
        texels, size, max_level = mip_atlas(mip_map, max_side)
        texture = self.device.texture(texels.shape[1::-1], "RGBA16F", data=texels)
        return MipAtlas(texture, size, max_level, len(mip_map.levels) - 1 - max_level)
