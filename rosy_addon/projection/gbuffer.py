"""The G-buffer, a flat list of the visible pixels of surfaces; mesh instances, and points on them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..field.formats.polygons import offsets_from_sizes
from ..field.frames import transformed
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from .camera import Camera
from .field_channel import FieldChannel
from .pixel_blocks import part_of, pixel_blocks
from .surface_tone import SurfaceTone


@dataclass(frozen=True, eq=False)
class MeshInstance:
    """An instance of a mesh in the scene: surface, transform, field, tone, and values for the color map.

    Attributes
    ----------
    surface : Surface
        In object space. Several instances may share one surface.
    matrix : (4, 4) float64 ndarray
        Object to world space.
    field : RosyField or None
        On the faces of `surface`. An instance without a field is not drawn, but occludes others.
    tone : SurfaceTone or None
        The tone of the surface, if it is given: painted, computed or from an image.
    color_values : (C,) float32 ndarray or None
        Values at the C corners of the surface, which the color map turns into colors. NaN at corners
        without a value. None if the mesh has no such values.
    """

    surface: Surface
    matrix: np.ndarray
    field: RosyField | None = None
    tone: SurfaceTone | None = None
    color_values: np.ndarray | None = None

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """Transform (..., 3) points from object space to world space."""
        return transformed(points, np.asarray(self.matrix, dtype=np.float64)[:3])

    def world_points(self) -> np.ndarray:
        """Return the (V, 3) float64 vertices in world space."""
        return self.to_world(self.surface.vertices)

    def world_bounds(self) -> np.ndarray:
        """Return the (8, 3) corners of the bounding box in world space.

        The box is aligned to the axes of object space.
        """
        return self.to_world(self.surface.box_corners)

    def points_in_triangles(self, triangle: np.ndarray, barycentric: np.ndarray) -> np.ndarray:
        """Return (n, 3) points in world space, given (n,) triangles and (n, 3) barycentric coordinates."""
        corners = self.to_world(self.surface.vertices[self.surface.triangle_vertex[triangle]])
        return np.einsum("nk,nki->ni", barycentric, corners)

    def face_points(self) -> np.ndarray:
        """Return the (n, 3) float64 positions of the vertices that belong to a face, in world space."""
        return self.world_points()[self.surface.used_vertices]


#: The mesh instances of a scene.
MeshInstances = Sequence[MeshInstance]


def with_field(instances: Iterable[MeshInstance]) -> list[MeshInstance]:
    """Return the mesh instances that have a field."""
    return [instance for instance in instances if instance.field is not None]


class SurfacePoints(NamedTuple):
    """P points on mesh instances.

    Attributes
    ----------
    instance_id : (P,) int32 ndarray
        Index of the mesh instance.
    triangle : (P,) int32 ndarray
        Index of the triangle of the instance's surface.
    barycentric : (P, 3) float64 ndarray
        Barycentric coordinates of the point in that triangle.
    """

    instance_id: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray

    @staticmethod
    def of(instance_id: int, triangle: np.ndarray, barycentric: np.ndarray) -> SurfacePoints:
        """Return points on one instance, given their (P,) triangles and (P, 3) barycentric coordinates."""
        instance_ids = np.full(len(triangle), instance_id, dtype=np.int32)
        return SurfacePoints(instance_ids, triangle, barycentric)


class PixelCoverage(NamedTuple):
    """The fractions of pixels that surfaces cover, for the P pixels of a G-buffer.

    A pixel has several samples. Most covered samples show the surface that the G-buffer stores for their own
    pixel. The E others show the surface that it stores for a neighboring pixel; they are listed.

    Attributes
    ----------
    own : (P,) float32 ndarray
        Fraction of the pixel that its own surface covers. It may be 0, if a triangle is visible only at the
        center.
    pixel : (E,) int32 ndarray
        Pixel that contains the sample, as a flat index into the frame, in ascending order.
    entry : (E,) int32 ndarray
        Neighboring pixel whose surface the sample shows, as an index into the G-buffer.
    share : float
        Fraction of a pixel that one sample covers.
    """

    own: np.ndarray
    pixel: np.ndarray
    entry: np.ndarray
    share: float


class PixelSamples(NamedTuple):
    """The visible triangles at S x S samples of each of the P pixels of a G-buffer.

    Most samples show the triangle that the G-buffer stores for their pixel. The E others are listed.

    Attributes
    ----------
    side : int
        S.
    own : (P,) uint16 ndarray
        Bit field of the samples that show the pixel's stored triangle: bit ``row * S + column``.
    other : (E,) int32 ndarray
        The samples that show another triangle, as flat indices into the frame of all samples.
    other_triangle : (E,) int32 ndarray
        The triangle that each of these samples shows, counted over all mesh instances.
    other_entry : (E,) int32 ndarray
        The pixel whose surface each of these samples shows, as an index into the G-buffer: the pixel that
        contains the sample, or a neighbor of it.
    """

    side: int
    own: np.ndarray
    other: np.ndarray
    other_triangle: np.ndarray
    other_entry: np.ndarray


@dataclass(frozen=True, eq=False)
class GBuffer:
    """The P visible pixels of all surfaces with a field, in ascending order of pixel index.

    Each pixel has one element in every (P, ...) array. Other modules call its index an entry of the
    G-buffer. All vectors are in camera space.

    Attributes
    ----------
    camera : Camera
    instances : tuple of MeshInstance
        The mesh instances that were projected, in the order of `instance_id`.
    pixel : (P,) int32 ndarray
        Flat index into the frame, row by row from the lower left.
    instance_id : (P,) int32 ndarray
        Index of the visible mesh instance.
    triangle : (P,) int32 ndarray
        Index of the visible triangle of the instance's surface.
    barycentric : (P, 3) float32 ndarray
        Perspective-correct barycentric coordinates in that triangle.
    position : (P, 3) float32 ndarray
        Visible point, in Blender units.
    normal : (P, 3) float32 ndarray
        Unit shading normal. It points to the side that the camera sees.
    view_direction : (P, 3) float32 ndarray
        Unit direction to the eye. (0, 0, 1) at all pixels of an orthographic camera.
    representation : (P,) complex64 ndarray
        z = rho exp(i N t), where t is the angle of a member that is transported into the view plane
        (perpendicular to `view_direction`), in the frame `field.frames.view_frame` of that plane.
        Zero where the field is undefined.
    geometric_normal : (P, 3) float32 ndarray
        Unit normal of the visible triangle, without smooth shading. It points to the side that the
        camera sees.
    front_facing : (P,) bool ndarray
        Whether the corners of the visible triangle run counter-clockwise in the picture.
    channels : dict of FieldChannel to (P,) complex64 ndarray
        Additional values of some fields (see `field_channel.FieldChannel`), in the same frame as
        `representation`. Where the field does not have the channel, the value is 1 for the harmonic of
        order 0, and otherwise 0. These are the values for evenly spaced directions without labels.
    coverage : PixelCoverage or None
        How much of the pixels the surfaces cover, if pixels have several samples. None if each surface
        covers its whole pixel.
    samples : PixelSamples or None
        The visible triangles at these samples; None if pixels have one sample.
    """

    camera: Camera
    instances: tuple[MeshInstance, ...]
    pixel: np.ndarray
    instance_id: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    view_direction: np.ndarray
    representation: np.ndarray
    geometric_normal: np.ndarray
    front_facing: np.ndarray
    channels: dict[FieldChannel, np.ndarray]
    coverage: PixelCoverage | None = None
    samples: PixelSamples | None = None

    @property
    def instance_degrees(self) -> list[int]:
        """The degree of the field of each mesh instance, 0 without a field."""
        fields = [instance.field for instance in self.instances]
        return [0 if field is None else field.degree for field in fields]

    def part(self, extent: slice) -> GBuffer:
        """Return the G-buffer of the pixels `extent`: views of the arrays, without `coverage` and `samples`."""
        return replace(part_of(self, extent), coverage=None, samples=None)

    def instance_blocks(
        self,
    ) -> list[tuple[int, MeshInstance, list[slice | np.ndarray], tuple[float, float]]]:
        """Return the pixels of each visible mesh instance, in blocks: a list with a tuple for each instance.

        The instances are in ascending order of their index. The tuples have these elements:

        Returns
        -------
        instance_id : int
        instance : MeshInstance
        blocks : list of slice or of (n,) intp ndarray
            Its pixels, as indices into this G-buffer, in blocks of limited size.
        progress : (float, float)
            Fraction of all pixels that belong to instances before this one, and the same fraction with
            this instance included.
        """
        counts = np.bincount(self.instance_id)
        ends = offsets_from_sizes(counts) / len(self.pixel)
        instances = []
        for instance_id in np.flatnonzero(counts).tolist():
            blocks: list[slice | np.ndarray] = [*pixel_blocks(counts[instance_id])]
            if counts[instance_id] < len(self.pixel):
                pixels = np.flatnonzero(self.instance_id == instance_id)
                blocks = [pixels[block] for block in blocks]
            extent = ends[instance_id], ends[instance_id + 1]
            instances.append((instance_id, self.instances[instance_id], blocks, extent))
        return instances
