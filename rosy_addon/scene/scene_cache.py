"""Incremental reading of the RoSy objects of a view layer, for the live view.

Only objects that have changed are read again. In contrast to `scene_reader.read_scene`, nothing is
changed in the file, so a scene can be read while Blender draws. If modifiers only deform an object,
its original mesh has the rest positions and the field. If they change the topology, or may change the
attribute of the field, both have to be read once by `SceneCache.resolve_topologies`, and are valid
until one of them changes again. If that fails, the error is valid until the object changes.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..cache import Cache, content_hash
from ..errors import REPORTED_ERRORS, RosyError, error_text
from ..field.rosy_field import RosyField
from ..field.surface import Surface, have_same_polygons
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from .color_inputs import read_color_values
from .evaluated_field import FieldLayout, read_evaluated_field
from .field_attributes import attribute_name, field_degree, has_field, is_face_vector_field
from .meshes import (
    evaluated_mesh,
    mesh_surface,
    polygon_arrays,
    read_attribute,
)
from .owned_data import OWNED_TAG, user_modifiers
from .read_field import read_mesh_field
from .scene_reader import is_field_enabled, lost_field_error, temp_attributes
from .tone_inputs import ToneRequest, read_tone, tone_image_key

#: Consecutive calls of `SceneCache.resolve_topologies` for an object that may not suffice.
MAX_ATTEMPTS = 4


@dataclass(frozen=True, eq=False)
class InstanceState:
    """One mesh instance of the live view: of an object with a field, or of an occluder.

    Attributes
    ----------
    instance : MeshInstance
    owner : bpy.types.Object
        The original object.
    visibility_object : bpy.types.Object
        The original object that decides in which 3D views the instance is visible.
    version : int
        A number that is different for every different mesh instance.
    """

    instance: MeshInstance
    owner: bpy.types.Object
    visibility_object: bpy.types.Object
    version: int


@dataclass(frozen=True, eq=False)
class _TopologyEntry:
    """Rest positions and field of an evaluated mesh whose topology differs from the original's."""

    rest: np.ndarray | None
    field: RosyField


#: The name of an object, and the `_topology_hash` of one of its evaluated meshes.
_TopologyKey = tuple[str, bytes]


@dataclass(frozen=True, eq=False)
class _MeshState:
    """Surface, field, tone and numbers of an evaluated mesh when it was last read."""

    surface: Surface
    field: RosyField | None
    tone: SurfaceTone | None = None
    color_values: np.ndarray | None = None


class SceneCache:
    """Cached mesh instances of the RoSy objects of one view layer.

    Parameters
    ----------
    cache : Cache, optional
        Keeps surfaces and fields by their contents.

    Attributes
    ----------
    cache : Cache
    errors : dict of str to str
        By the name of an object: why its field is not drawn.
    is_complete : bool
        Whether the last call of `read` ended before its deadline.
    """

    def __init__(self, cache: Cache | None = None) -> None:
        self.errors: dict[str, str] = {}
        self.is_complete = True
        self.cache = Cache() if cache is None else cache
        self._deadline = math.inf
        self._has_read_any = False
        # The error message of a mesh that could not be read.
        self._topologies: dict[_TopologyKey, _TopologyEntry | str] = {}
        # By the name of the object, the pointer of its mesh, and `tone_image_key`. None: no faces.
        self._mesh_states: dict[tuple[str, int, tuple], _MeshState | None] = {}
        # Meshes that need `resolve_topologies`.
        self._unresolved: set[_TopologyKey] = set()
        # By the name of an object: consecutive calls of `resolve_topologies` that did not suffice.
        self._attempts: dict[str, int] = {}
        # Mesh instances of the last call of `read`, and their versions.
        self._instances: dict[tuple, tuple[MeshInstance, int]] = {}
        self._last_version = 0
        self._tone_request: ToneRequest | None = None
        self._color_attribute: str | None = None

    def invalidate(self, names: set[str] | None = None, *, topology_changed: bool = True) -> None:
        """Mark objects as changed, so that they are read again.

        Parameters
        ----------
        names : set of str, optional
            Names of the objects. By default all.
        topology_changed : bool
            Whether the faces or fields may have changed, not only the positions of the vertices.
        """
        for key in [key for key in self._mesh_states if names is None or key[0] in names]:
            del self._mesh_states[key]
        for key in [key for key in self._topologies if names is None or key[0] in names]:
            if topology_changed or isinstance(self._topologies[key], str):
                del self._topologies[key]
        for by_name in (self._attempts, self.errors):
            for name in [name for name in by_name if names is None or name in names]:
                del by_name[name]

    def read(
        self,
        depsgraph: bpy.types.Depsgraph,
        nonfinite: str = "error",
        *,
        include_occluders: bool = False,
        tone_request: ToneRequest | None = None,
        color_attribute: str | None = None,
        deadline: float = math.inf,
    ) -> list[InstanceState]:
        """Return all instances of RoSy objects in their current state.

        Objects that need `resolve_topologies` first, or that cannot be read, are left out; see
        `has_unresolved` and `errors`. Nothing is changed in the file.

        Parameters
        ----------
        depsgraph : bpy.types.Depsgraph
        nonfinite : {"error", "zero"}
            Raise an error if a vector is not finite, or treat it as undefined.
        include_occluders : bool
            Read all other meshes too, since they may occlude the RoSy objects.
        tone_request : ToneRequest, optional
            The source of the surface tones.
        color_attribute : str, optional
            Name of the attribute whose numbers are read for the color map.
        deadline : float
            Seconds, monotonic. Meshes that were not read by then, except one, are left for the next
            call; see `is_complete`.
        """
        if self.is_complete:
            self.errors.clear()
        self._deadline, self.is_complete, self._has_read_any = deadline, True, False
        if (tone_request, color_attribute) != (self._tone_request, self._color_attribute):
            self._mesh_states.clear()
            self._tone_request, self._color_attribute = tone_request, color_attribute
        self._unresolved.clear()
        states: list[InstanceState] = []
        instances: dict[tuple, tuple[MeshInstance, int]] = {}
        faceless: set[bpy.types.Object] = set()
        for instance in depsgraph.object_instances:
            obj = instance.object
            if obj.type != "MESH" or not instance.show_self:
                continue
            owner = obj.original
            draws_field = has_field(owner) and is_field_enabled(owner)
            if not draws_field and (not include_occluders or owner.get(OWNED_TAG)):
                continue
            mesh_state = self._read_cached(obj, owner, nonfinite, draws_field)
            if mesh_state is None:
                if draws_field:
                    faceless.add(owner)
                continue
            visibility_object = (
                instance.parent.original if instance.is_instance and instance.parent else owner
            )
            matrix = np.array(instance.matrix_world, dtype=np.float64)
            instance_key = (
                id(mesh_state.surface),
                id(mesh_state.field),
                id(mesh_state.tone),
                id(mesh_state.color_values),
                matrix.tobytes(),
            )
            if instance_key not in instances:
                instances[instance_key] = self._versioned_instance(instance_key, mesh_state, matrix)
            states.append(
                InstanceState(
                    instances[instance_key][0], owner, visibility_object, instances[instance_key][1]
                )
            )
        waiting = self._waiting_names()
        self._attempts = {name: n for name, n in self._attempts.items() if name in waiting}
        if self.is_complete:
            self._report_faceless(faceless - {state.owner for state in states}, waiting)
        # The instances of the last call are released only now: while their surfaces are alive, no
        # new object can have the same id.
        self._instances = instances
        self.cache.evict_over_limit()
        return states

    def _report_faceless(self, owners: set[bpy.types.Object], waiting: set[str]) -> None:
        """Add errors for objects without any mesh that was read, unless they have one or wait."""
        for owner in owners:
            if owner.name not in self.errors and owner.name not in waiting:
                self.errors[owner.name] = str(lost_field_error(owner, None))

    def _versioned_instance(
        self, instance_key: tuple, mesh_state: _MeshState, matrix: np.ndarray
    ) -> tuple[MeshInstance, int]:
        """Return the mesh instance of a key and its version, from the last call or new."""
        if instance_key in self._instances:
            return self._instances[instance_key]
        self._last_version += 1
        return MeshInstance(
            mesh_state.surface, matrix, mesh_state.field, mesh_state.tone, mesh_state.color_values
        ), self._last_version

    @property
    def has_unresolved(self) -> bool:
        """Whether there are objects that need `resolve_topologies`."""
        return bool(self._unresolved)

    def _waiting_names(self) -> set[str]:
        """Return the names of the objects that need `resolve_topologies`."""
        return {name for name, _ in self._unresolved}

    def resolve_topologies(
        self,
        depsgraph: bpy.types.Depsgraph,
        nonfinite: str = "error",
        deadline: float = math.inf,
    ) -> None:
        """Read the rest positions and fields of meshes whose modifiers change the topology.

        This adds temporary attributes to the meshes, so it must not be called while Blender draws.
        Objects that were not read by the deadline, except one, are left for the next call.
        """
        while self._unresolved:
            self._resolve(depsgraph, min(self._waiting_names()), nonfinite)
            if time.monotonic() > deadline:
                return

    def _resolve(self, depsgraph: bpy.types.Depsgraph, name: str, nonfinite: str) -> None:
        """Read the rest positions and fields of the meshes of an object."""
        unresolved = {key for key in self._unresolved if key[0] == name}
        self._unresolved -= unresolved
        self._attempts[name] = self._attempts.get(name, 0) + 1
        obj = depsgraph.view_layer.objects.get(name) or bpy.data.objects.get(name)
        if obj is None:
            return
        for key in [key for key in self._topologies if key[0] == name]:
            del self._topologies[key]
        problem = str(lost_field_error(obj, attribute_name(obj.data)))
        try:
            self._read_with_attributes(depsgraph, obj, nonfinite)
        except REPORTED_ERRORS as error:
            problem = error_text(error)
        # Whatever was not read now is not tried again before the object changes.
        for key in unresolved:
            self._topologies.setdefault(key, problem)

    def _read_cached(
        self, obj: bpy.types.Object, owner: bpy.types.Object, nonfinite: str, draws_field: bool
    ) -> _MeshState | None:
        """Return the state of an evaluated object's mesh; None if it cannot be read now."""
        name = owner.name
        key = name, obj.data.as_pointer(), tone_image_key(owner, self._tone_request)
        if key in self._mesh_states:
            return self._mesh_states[key]
        if name in self.errors:
            return None
        if self._has_read_any and time.monotonic() > self._deadline:
            self.is_complete = False
            return None
        self._has_read_any = True
        try:
            mesh_state = (
                self._read_evaluated(obj, owner, nonfinite)
                if draws_field
                else self._read_occluder(obj)
            )
        except REPORTED_ERRORS as error:
            self.errors[name] = error_text(error)
            return None
        if mesh_state is not None or name not in self._waiting_names():
            self._mesh_states[key] = mesh_state
        return mesh_state

    def _read_occluder(self, obj: bpy.types.Object) -> _MeshState | None:
        """Read a mesh that only occludes; None if it has no faces."""
        with evaluated_mesh(obj) as mesh:
            if mesh is None:
                return None
            label = f"object '{obj.name}'"
            return _MeshState(mesh_surface(mesh, label, occluder_only=True, cache=self.cache), None)

    def _read_evaluated(
        self, obj: bpy.types.Object, owner: bpy.types.Object, nonfinite: str
    ) -> _MeshState | None:
        """Read an evaluated mesh with its field; None if it has no faces or is unresolved."""
        label = f"object '{owner.name}'"
        original = owner.data
        with evaluated_mesh(obj) as mesh:
            if mesh is None:
                return None
            surface = mesh_surface(mesh, label, cache=self.cache)
            tone = read_tone(mesh, owner, surface, self._tone_request, self.cache)
            values = read_color_values(mesh, surface, self._color_attribute, label, self.cache)
            if original.is_editmode:
                field_in_edit_mode = self._edit_mode_field(mesh, owner, surface, nonfinite, label)
                return _MeshState(surface, field_in_edit_mode, tone, values)
            original_surface = mesh_surface(original, label, cache=self.cache)
            keeps_field = all(modifier.type != "NODES" for modifier in user_modifiers(owner))
            if keeps_field and have_same_polygons(surface, original_surface):
                field = read_mesh_field(
                    original,
                    nonfinite=nonfinite,
                    label=label,
                    surface=original_surface,
                    cache=self.cache,
                )
                deformed = bool(user_modifiers(owner) or original.shape_keys)
                rest_surface = (
                    _with_rest(surface, original_surface.vertices) if deformed else surface
                )
                return _MeshState(rest_surface, field, tone, values)
            key = owner.name, _topology_hash(mesh, original)
        entry = self._topologies.get(key)
        if entry is None:
            if self._attempts.get(owner.name, 0) >= MAX_ATTEMPTS:
                raise RosyError(f"{label}: its modifiers make other faces at each evaluation")
            self._unresolved.add(key)
            return None
        if isinstance(entry, str):
            raise RosyError(entry)
        return _MeshState(_with_rest(surface, entry.rest), entry.field, tone, values)

    def _edit_mode_field(
        self,
        mesh: bpy.types.Mesh,
        owner: bpy.types.Object,
        surface: Surface,
        nonfinite: str,
        label: str,
    ) -> RosyField:
        """Return the field of a mesh in edit mode. Only its evaluated mesh can be read."""
        original = owner.data
        name = attribute_name(original)
        if name in original.attributes and name not in mesh.attributes:
            raise lost_field_error(owner, name)
        if name not in mesh.attributes or not is_face_vector_field(mesh, name):
            raise RosyError(
                f"{label}: in edit mode, only fields stored as vectors on faces can be read: leave edit mode (Tab)"
            )
        layout = FieldLayout(name, field_degree(original))
        return read_evaluated_field(mesh, layout, surface, nonfinite, label)

    def _read_with_attributes(
        self, depsgraph: bpy.types.Depsgraph, owner: bpy.types.Object, nonfinite: str
    ) -> None:
        """Add the meshes of an object that have its field to `_topologies`."""
        with temp_attributes(depsgraph, [owner], nonfinite, self.cache) as layouts:
            layout, label = layouts[owner], f"object '{owner.name}'"
            for instance in depsgraph.object_instances:
                obj = instance.object
                if obj.type != "MESH" or obj.original != owner:
                    continue
                with evaluated_mesh(obj) as mesh:
                    if mesh is None or not layout.is_on(mesh):
                        continue
                    key = owner.name, _topology_hash(mesh, owner.data)
                    if key in self._topologies:
                        continue
                    surface = mesh_surface(mesh, label, read_rest=True, cache=self.cache)
                    field = read_evaluated_field(
                        mesh, layout, surface, nonfinite, label, self.cache
                    )
                    self._topologies[key] = _TopologyEntry(surface.rest_vertices, field)


def _topology_hash(mesh: bpy.types.Mesh, original: bpy.types.Mesh) -> bytes:
    """Return a hash of the faces and the field attribute of an evaluated mesh, without positions."""
    values = None
    if is_face_vector_field(mesh, attribute_name(original)):
        values = read_attribute(mesh, attribute_name(original), np.float32, 3)
    return content_hash(*polygon_arrays(mesh), values)


def _with_rest(surface: Surface, rest: np.ndarray | None) -> Surface:
    """Return a surface with rest positions, if there are any that differ from the current ones."""
    if rest is None or np.array_equal(rest, surface.vertices):
        return surface
    return replace(surface, rest_vertices=rest)
