"""Combing: read the field and the guides of a mesh, change them along a brush stroke, and store them."""

import numpy as np
from bpy.types import Mesh

from ..core.cache import BAKE_CACHE
from ..field.combing import BrushStroke, Combing, GuideBrush, start_combing
from ..field.guided_system import guided_system
from ..field.rosy_field import RosyField
from ..scene.brush_surface import closest_faces
from ..scene.field_attributes import is_face_vector_field
from ..scene.guides import check_guides_storable, read_combed_guides, store_combed_guides
from ..scene.mesh_fields import assign_fields, check_writable, overwrite_vectors, read_mesh_field
from ..scene.meshes import mesh_surface
from ..worker.job import Call, Steps


class CombStroke:
    """A brush stroke that combs the field of a mesh while the user draws it.

    The stroke changes guides, which are directions that the field has to follow. After each extension the
    field near the stroke is computed again, and can be shown. `settle` computes it everywhere.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        The mesh whose field and guides are changed.
    brush : GuideBrush
        Settings of the brush.
    reach : float
        Distance from the stroke beyond which the field hardly changes, relative to `Surface.extent`.

    Raises
    ------
    RosyError
        If the mesh cannot be changed, its field cannot be read or its directions are not rotations of one
        another by equal angles, or an attribute with the name of the guides has another type.
    """

    def __init__(self, mesh: Mesh, brush: GuideBrush, reach: float) -> None:
        check_writable(mesh)
        check_guides_storable(mesh)
        surface = mesh_surface(mesh, cache=BAKE_CACHE)
        field = read_mesh_field(mesh, surface=surface, cache=BAKE_CACHE)
        self.mesh, self._degree = mesh, field.degree
        system = BAKE_CACHE.get_or_create(
            ("guided system", surface, field.degree), lambda: guided_system(surface, field.degree)
        )
        guides = read_combed_guides(mesh, surface)
        self._combing = start_combing(system, field, guides, reach * surface.extent)
        locate = closest_faces(mesh, surface, BAKE_CACHE)
        self._stroke = BrushStroke(system, self._combing.guides, brush, locate)
        self._vectors_before: np.ndarray | None = None
        BAKE_CACHE.evict_over_limit()

    def extend(self, points: np.ndarray, pressure: np.ndarray) -> bool:
        """Extend the stroke by points on the surface. Return whether the field has changed.

        Parameters
        ----------
        points : (n, 3) ndarray
            Points on the mesh without modifiers, in object space.
        pressure : (n,) ndarray
            Pressures of the pen, 0 to 1.
        """
        return self._follow(self._stroke.extend(points, pressure))

    def lift(self) -> bool:
        """End the present line: the next point begins a new one. Return whether the field has changed."""
        return self._follow(self._stroke.finish())

    def _follow(self, face: np.ndarray) -> bool:
        self._combing.follow(face)
        return len(face) > 0

    def show(self) -> None:
        """Write the present field to the mesh as a preview, without the guides.

        It does nothing if the field is not stored as vectors on faces. Such a field is shown after `store`.
        """
        if not is_face_vector_field(self.mesh):
            return
        before = overwrite_vectors(self.mesh, self._combing.vectors)
        if self._vectors_before is None:
            self._vectors_before = before

    def settle(self) -> Steps[None]:
        """Solve for the field on the whole mesh, as part of a job."""
        self._combing.representations = yield Call(Combing.settle, (self._combing,))

    def store(self) -> RosyField:
        """Store the field and its guides on the mesh. Return the field."""
        field = RosyField(self._degree, self._combing.vectors)
        assign_fields({self.mesh: field})
        store_combed_guides(self.mesh, self._combing.guide_vectors)
        return field

    def restore(self) -> None:
        """Restore the field that the mesh had before the first call of `show`. Later calls have no effect."""
        if self._vectors_before is not None:
            overwrite_vectors(self.mesh, self._vectors_before)
            self._vectors_before = None
