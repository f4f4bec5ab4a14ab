"""The surface under a brush: maps points of the evaluated mesh to points of the original mesh."""

from collections.abc import Callable
from functools import cached_property

import bmesh
import numpy as np
from bpy.types import Depsgraph, Mesh, Object
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ..core.cache import Cache
from ..field.frames import dot, normalize
from ..field.polygon_arrays import mean_per_face
from ..field.surface import Surface
from .meshes import evaluated_mesh, vertex_positions
from .singularity_points import mesh_of_own_vertices

#: Largest number of faces on which dashes are drawn. Length of a dash, relative to the square root of twice
#: the area of the first triangle of its face.
MAX_DASH_FACES, DASH_LENGTH = 1500, 0.7

#: Finds the (n,) faces closest to (n, 3) points.
FaceLocator = Callable[[np.ndarray], np.ndarray]


class BrushSurface:
    """Maps between an object's original mesh (at rest) and its evaluated mesh (as it is seen).

    Parameters
    ----------
    obj : bpy.types.Object
    depsgraph : bpy.types.Depsgraph
    surface : Surface
        Surface of the object's original mesh.
    """

    def __init__(self, obj: Object, depsgraph: Depsgraph, surface: Surface) -> None:
        self._obj = obj
        self._surface = surface
        self._evaluated = obj.evaluated_get(depsgraph)
        with evaluated_mesh(self._evaluated) as mesh:
            source = mesh_of_own_vertices(obj, mesh)
            self._shown = vertex_positions(source)[: len(surface.vertices)].astype(np.float64)
            counts = len(source.polygons), len(source.vertices)
            self._keeps_faces = counts == (surface.face_count, len(surface.vertices))

    def cast_ray(self, origin: Vector, direction: Vector) -> np.ndarray | None:
        """Return the point of the original mesh under a ray, (3,) float32 in object space; None for a miss.

        The ray is in world space, and is intersected with the evaluated mesh. The hit is mapped to the
        original mesh by its barycentric coordinates in a triangle of the face that was hit. If modifiers
        change the faces, the triangle closest to the hit in `_shown_tree` is taken instead.
        """
        to_object = self._obj.matrix_world.inverted_safe()
        is_hit, location, _, face = self._evaluated.ray_cast(
            to_object @ origin, (to_object.to_3x3() @ direction).normalized()
        )
        if not is_hit:
            return None
        vertex = self._surface.triangle_vertex
        if self._keeps_faces:
            triangle = np.flatnonzero(self._surface.triangle_face == face)
        else:
            location, _, index, _ = self._shown_tree.find_nearest(location)
            triangle = np.array([index])
        # Of the triangles of the face, choose the one whose smallest barycentric coordinate is largest: the
        # point lies in it.
        point = np.array(location)
        weights = [_barycentric(corners, point) for corners in self._shown[vertex[triangle]]]
        best = int(np.argmax([weight.min() for weight in weights]))
        return (weights[best] @ self._surface.vertices[vertex[triangle[best]]]).astype(np.float32)

    def dashes(
        self, vectors: np.ndarray, degree: int, place: np.ndarray, radius: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return dashes (short line segments) along a field around a point, on the evaluated mesh.

        For an even degree there is one dash for each pair of opposite members, centered on the face. For an
        odd degree there is one for each member, from the center of the face. The length of a dash follows
        from the size of its face; see `DASH_LENGTH`.

        Parameters
        ----------
        vectors : (F, 3) ndarray
            One member vector of the field per face of the original mesh, object space.
        degree : int
            Degree N of the field.
        place : (3,) ndarray
            Center of the brush: a point of the original mesh, object space.
        radius : float
            Faces of the original mesh get dashes if their centers are nearer to `place` than this, object
            space.

        Returns
        -------
        ends : (K, 2, 3) float64 ndarray
            Both end points of each dash on the evaluated mesh, object space.
        face : (K,) intp ndarray
            The face of the original mesh that each dash belongs to.
        """
        surface = self._surface
        offset = surface.face_center - place
        square = dot(offset, offset)
        near = np.flatnonzero(square < radius**2)
        normal = surface.face_normal[near]
        near = near[normal @ surface.face_normal[square.argmin()] > 0]
        near = near[:: -(-len(near) // MAX_DASH_FACES) or 1]
        member = normalize(vectors[near])
        side = np.cross(surface.face_normal[near], member)
        angles = 2 * np.pi / degree * np.arange(degree if degree % 2 else degree // 2)
        # The deformation of a face is taken from its first triangle.
        rest = surface.vertices
        vertex = surface.triangle_vertex[np.searchsorted(surface.triangle_face, near)]
        a, b, c = (rest[column] for column in vertex.T)
        double_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        half_length = DASH_LENGTH / 2 * np.sqrt(double_area)
        center = self._shown_center[near]
        dashes = []
        for angle in angles:
            direction = np.cos(angle) * member + np.sin(angle) * side
            along = half_length[:, None] * _deformed(direction, vertex, rest, self._shown)
            start = center if degree % 2 else center - along
            dashes.append(np.stack([start, center + along], axis=1))
        return np.concatenate(dashes), np.tile(near, len(dashes))

    @cached_property
    def _shown_tree(self) -> BVHTree:
        """Search tree of the original mesh's triangles, with the vertices where modifiers have moved them.

        The moved vertices are the first V vertices of the evaluated mesh; see `mesh_of_own_vertices`.
        """
        triangles = self._surface.triangle_vertex.tolist()
        return BVHTree.FromPolygons(self._shown.tolist(), triangles, all_triangles=True)

    @cached_property
    def _shown_center(self) -> np.ndarray:
        """Centers of the faces on the evaluated mesh, (F, 3) float64."""
        return mean_per_face(self._shown[self._surface.corner_vertex], self._surface.face_start)


def _deformed(
    direction: np.ndarray, vertex: np.ndarray, rest: np.ndarray, shown: np.ndarray
) -> np.ndarray:
    """Map (n, 3) directions in the planes of triangles by the linear maps from `rest` to `shown` positions.

    `vertex` has the (n, 3) vertex indices of the triangles. `rest` and `shown` are (V, 3) vertex positions.
    The result is (n, 3).
    """
    (a, b), (shown_a, shown_b) = (
        (points[vertex[:, 1]] - points[vertex[:, 0]], points[vertex[:, 2]] - points[vertex[:, 0]])
        for points in (rest, shown)
    )
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    da, db = dot(direction, a), dot(direction, b)
    determinant = np.maximum(aa * bb - ab * ab, 1e-300)
    u, v = (bb * da - ab * db) / determinant, (aa * db - ab * da) / determinant
    return u[:, None] * shown_a + v[:, None] * shown_b


def closest_faces(mesh: Mesh, surface: Surface, cache: Cache) -> FaceLocator:
    """Return a function that finds the faces of a mesh closest to points in object space.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    surface : Surface
        The surface of the mesh. It is the key of the search tree in the cache.
    cache : Cache

    Returns
    -------
    callable
        For (n, 3) points it returns the (n,) indices of the closest faces; -1 if there is none.
    """

    def create() -> BVHTree:
        copy = bmesh.new()
        try:
            copy.from_mesh(mesh, face_normals=False, vertex_normals=False)
            return BVHTree.FromBMesh(copy)
        finally:
            copy.free()

    tree = cache.get_or_create(("tree", surface), create)

    def locate(points: np.ndarray) -> np.ndarray:
        found = [tree.find_nearest(point)[2] for point in points.tolist()]
        return np.array([-1 if face is None else face for face in found], dtype=np.intp)

    return locate


def _barycentric(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the (3,) barycentric coordinates of a point in a triangle with (3, 3) corners."""
    u, v = np.linalg.lstsq((corners[1:] - corners[0]).T, point - corners[0], rcond=None)[0]
    return np.array([1 - u - v, u, v])
