"""The job of combing: read a mesh's field and guides, change them along a stroke, and store them."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.cache import BAKE_CACHE
from ..field.combing import BrushStroke, Combing, GuideBrush, start_combing
from ..field.guided_system import guided_system
from ..field.rosy_field import RosyField
from ..scene.brush_surface import closest_faces
from ..scene.combed_guides import check_guides_storable, read_combed_guides, store_combed_guides
from ..scene.field_attributes import is_face_vector_field
from ..scene.meshes import mesh_surface
from ..scene.read_field import read_mesh_field
from ..scene.write_field import assign_fields, check_writable, overwrite_vectors
from ..worker.job import Call, Steps


class CombStroke:
    """A stroke that is being drawn.

    Parameters
    ----------
    mesh : bpy.types.Mesh
    brush : GuideBrush
    reach : float
        Distance from the strokes at which the field stays what it is, relative to `Surface.extent`.

    Raises
    ------
    RosyError
        If the mesh cannot be changed, its field cannot be read or is not a RoSy, or an attribute with the name
        of the guides has another type.
    """

    def __init__(self, mesh: bpy.types.Mesh, brush: GuideBrush, reach: float) -> None:
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
        """Go on to (n, 3) places on the surface at rest, with (n,) pressures. Return whether the field has changed."""
        return self._follow(self._stroke.extend(points, pressure))

    def lift(self) -> bool:
        """End the line, so that the next point begins another one. Return whether the field has changed."""
        return self._follow(self._stroke.finish())

    def _follow(self, face: np.ndarray) -> bool:
        self._combing.follow(face)
        return len(face) > 0

    def show(self) -> None:
        """Write the present field to the mesh, without its guides.

        Fields that are not stored as one vector on each face are shown when they are stored.
        """
        if not is_face_vector_field(self.mesh):
            return
        before = overwrite_vectors(self.mesh, self._combing.vectors)
        if self._vectors_before is None:
            self._vectors_before = before

    def settle(self) -> Steps[None]:
        """Solve for the whole field."""
        self._combing.representations = yield Call(Combing.settle, (self._combing,))

    def store(self) -> RosyField:
        """Store the field and its guides. Return the field."""
        field = RosyField(self._degree, self._combing.vectors)
        assign_fields({self.mesh: field})
        store_combed_guides(self.mesh, self._combing.guide_vectors)
        return field

    def restore(self) -> None:
        """Take back what `show` has changed."""
        if self._vectors_before is not None:
            overwrite_vectors(self.mesh, self._vectors_before)
