"""Incremental reading of the RoSy objects of a view layer, for the live view.

Only objects that have changed are read again. In contrast to `scene_reader.read_scene`, nothing is
changed in the file, so a scene can be read while Blender draws. If modifiers only deform an object,
its original mesh has the rest positions and the field. If they change the topology, both have to be
read once by `SceneCache.resolve_topologies`, and are valid until the topology changes again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..cache import Cache, content_hash
from ..errors import RosyError
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from .evaluated_field import FieldLayout, read_evaluated_field
from .field_attributes import attribute_name, field_degree, has_field, is_face_vector_field
from .meshes import evaluated_mesh, mesh_surface
from .owned_data import user_modifiers
from .read_field import read_mesh_field
from .scene_reader import is_field_enabled, temp_attributes
from .tone_inputs import ToneRequest, read_tone, tone_image_key


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

    topology_hash: bytes
    rest: np.ndarray | None
    field: RosyField


@dataclass(frozen=True, eq=False)
class _MeshState:
    """Surface, field and tone of an evaluated mesh when it was last read."""

    surface: Surface
    field: RosyField | None
    tone: SurfaceTone | None = None


class SceneCache:
    """Cached mesh instances of the RoSy objects of one view layer.

    Attributes
    ----------
    errors : dict of str to str
        By the name of an object: why its field is not drawn.
    """

    def __init__(self) -> None:
        self.errors: dict[str, str] = {}
        self._cache = Cache()
        # By the name of the object.
        self._topologies: dict[str, _TopologyEntry] = {}
        # By the name of the object, the pointer of its mesh, and `tone_image_key`.
        self._mesh_states: dict[tuple[str, int, tuple], _MeshState] = {}
        # Names of objects that need `resolve_topologies`.
        self._unresolved: set[str] = set()
        # Mesh instances of the last call of `read`, and their versions.
        self._instances: dict[tuple, tuple[MeshInstance, int]] = {}
        self._last_version = 0
        self._tone_request: ToneRequest | None = None

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
        if topology_changed:
            for name in [name for name in self._topologies if names is None or name in names]:
                del self._topologies[name]

    def read(
        self,
        depsgraph: bpy.types.Depsgraph,
        nonfinite: str = "error",
        *,
        include_occluders: bool = False,
        tone_request: ToneRequest | None = None,
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
        """
        if tone_request != self._tone_request:
            self._mesh_states.clear()
            self._tone_request = tone_request
        self.errors.clear()
        self._unresolved.clear()
        states: list[InstanceState] = []
        instances: dict[tuple, tuple[MeshInstance, int]] = {}
        for instance in depsgraph.object_instances:
            obj = instance.object
            if obj.type != "MESH" or not instance.show_self:
                continue
            owner = obj.original
            draws_field = has_field(owner) and is_field_enabled(owner)
            if not draws_field and not include_occluders:
                continue
            mesh_state = self._read_cached(obj, owner, nonfinite, draws_field)
            if mesh_state is None:
                continue
            visibility_object = (
                instance.parent.original if instance.is_instance and instance.parent else owner
            )
            matrix = np.array(instance.matrix_world, dtype=np.float64)
            instance_key = (
                id(mesh_state.surface),
                id(mesh_state.field),
                id(mesh_state.tone),
                matrix.tobytes(),
            )
            if instance_key not in instances:
                instances[instance_key] = self._versioned_instance(instance_key, mesh_state, matrix)
            states.append(
                InstanceState(
                    instances[instance_key][0], owner, visibility_object, instances[instance_key][1]
                )
            )
        # The instances of the last call are released only now: while their surfaces are alive, no
        # new object can have the same id.
        self._instances = instances
        self._cache.evict_over_limit()
        return states

    def _versioned_instance(
        self, instance_key: tuple, mesh_state: _MeshState, matrix: np.ndarray
    ) -> tuple[MeshInstance, int]:
        """Return the mesh instance of a key and its version, from the last call or new."""
        if instance_key in self._instances:
            return self._instances[instance_key]
        self._last_version += 1
        return MeshInstance(
            mesh_state.surface, matrix, mesh_state.field, mesh_state.tone
        ), self._last_version

    @property
    def has_unresolved(self) -> bool:
        """Whether there are objects that need `resolve_topologies`."""
        return bool(self._unresolved)

    def resolve_topologies(self, depsgraph: bpy.types.Depsgraph, nonfinite: str = "error") -> None:
        """Read the rest positions and fields of meshes whose modifiers change the topology.

        This adds temporary attributes to the meshes, so it must not be called while Blender draws.
        """
        names, self._unresolved = set(self._unresolved), set()
        for name in names:
            obj = depsgraph.view_layer.objects.get(name) or bpy.data.objects.get(name)
            if obj is None:
                continue
            try:
                with temp_attributes(depsgraph, [obj], nonfinite, self._cache) as layouts:
                    self._topologies[name] = self._evaluate_topology(
                        depsgraph, obj, layouts[obj], nonfinite
                    )
            except RosyError as error:
                self.errors[name] = str(error)

    def _read_cached(
        self, obj: bpy.types.Object, owner: bpy.types.Object, nonfinite: str, draws_field: bool
    ) -> _MeshState | None:
        """Return the state of an evaluated object's mesh; None if it cannot be read now."""
        name = owner.name
        key = name, obj.data.as_pointer(), tone_image_key(owner, self._tone_request)
        if key in self._mesh_states:
            return self._mesh_states[key]
        if name in self.errors or name in self._unresolved:
            return None
        try:
            mesh_state = (
                self._read_evaluated(obj, owner, nonfinite)
                if draws_field
                else self._read_occluder(obj)
            )
        except RosyError as error:
            self.errors[name] = str(error)
            return None
        if mesh_state is not None:
            self._mesh_states[key] = mesh_state
        return mesh_state

    def _read_occluder(self, obj: bpy.types.Object) -> _MeshState | None:
        """Read a mesh that only occludes; None if it has no faces."""
        with evaluated_mesh(obj) as mesh:
            if mesh is None:
                return None
            return _MeshState(
                mesh_surface(mesh, obj.name, occluder_only=True, cache=self._cache), None
            )

    def _read_evaluated(
        self, obj: bpy.types.Object, owner: bpy.types.Object, nonfinite: str
    ) -> _MeshState | None:
        """Read an evaluated mesh with field and tone; None if it has no faces or is unresolved."""
        label = f"object '{owner.name}'"
        original = owner.data
        with evaluated_mesh(obj) as mesh:
            if mesh is None:
                return None
            surface = mesh_surface(mesh, label, cache=self._cache)
            tone = read_tone(mesh, owner, surface, self._tone_request, self._cache)
            if original.is_editmode:
                field_in_edit_mode = self._edit_mode_field(
                    mesh, original, surface, nonfinite, label
                )
                return _MeshState(surface, field_in_edit_mode, tone)
            original_surface = mesh_surface(original, label, cache=self._cache)
            if _has_same_topology(surface, original_surface):
                field = read_mesh_field(
                    original,
                    nonfinite=nonfinite,
                    label=label,
                    surface=original_surface,
                    cache=self._cache,
                )
                deformed = bool(user_modifiers(owner) or original.shape_keys)
                rest_surface = (
                    _with_rest(surface, original_surface.vertices) if deformed else surface
                )
                return _MeshState(rest_surface, field, tone)
        entry = self._topologies.get(owner.name)
        if entry is None or entry.topology_hash != _topology_hash(surface):
            self._unresolved.add(owner.name)
            return None
        return _MeshState(_with_rest(surface, entry.rest), entry.field, tone)

    def _edit_mode_field(
        self,
        mesh: bpy.types.Mesh,
        original: bpy.types.Mesh,
        surface: Surface,
        nonfinite: str,
        label: str,
    ) -> RosyField:
        """Return the field of a mesh in edit mode. Only its evaluated mesh can be read."""
        name = attribute_name(original)
        if name not in mesh.attributes or not is_face_vector_field(mesh, name):
            raise RosyError(
                f"{label}: in edit mode, only fields stored as vectors on faces can be read: leave edit mode (Tab)"
            )
        layout = FieldLayout(name, field_degree(original))
        return read_evaluated_field(mesh, layout, surface, nonfinite, label)

    def _evaluate_topology(
        self,
        depsgraph: bpy.types.Depsgraph,
        owner: bpy.types.Object,
        layout: FieldLayout,
        nonfinite: str,
    ) -> _TopologyEntry:
        """Read the rest positions and the field of an object with temporary attributes."""
        evaluated = owner.evaluated_get(depsgraph)
        label = f"object '{owner.name}'"
        with evaluated_mesh(evaluated) as mesh:
            if mesh is None or any(name not in mesh.attributes for name in layout.attribute_names):
                raise RosyError(f"{label}: a modifier removes the attribute of its field")
            surface = mesh_surface(mesh, label, read_rest=True, cache=self._cache)
            field = read_evaluated_field(mesh, layout, surface, nonfinite, label, self._cache)
        return _TopologyEntry(_topology_hash(surface), surface.rest_vertices, field)


def _has_same_topology(surface: Surface, other: Surface) -> bool:
    """Whether two surfaces have the same vertices and faces, apart from vertex positions."""
    if len(surface.vertices) != len(other.vertices):
        return False
    return np.array_equal(surface.face_start, other.face_start) and np.array_equal(
        surface.corner_vertex, other.corner_vertex
    )


def _topology_hash(surface: Surface) -> bytes:
    """Return a hash of the faces of a surface, without vertex positions."""
    return content_hash(surface.corner_vertex, surface.face_start)


def _with_rest(surface: Surface, rest: np.ndarray | None) -> Surface:
    """Return a surface with rest positions, if there are any that differ from the current ones."""
    if rest is None or np.array_equal(rest, surface.vertices):
        return surface
    return replace(surface, rest_vertices=rest)
