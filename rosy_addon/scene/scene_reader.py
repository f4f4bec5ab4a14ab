"""Read a scene as mesh instances: evaluated meshes with their fields, and occluders.

Bakes and live views use the same `SceneReader`. Nothing is changed in the file. The field and the rest positions of an
object are read from the mesh that holds its field, if this mesh has the same faces as the evaluated mesh. Otherwise the
field is read from the attributes that modifiers have copied to the evaluated mesh, and a note says so.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from bpy.types import Depsgraph, Mesh, Object

from ..core.cache import Cache, cached
from ..core.errors import REPORTED_ERRORS, RosyError
from ..field.rosy_field import RosyField
from ..field.surface import Surface, have_same_polygons
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from . import look_inputs
from .datablocks import field_mesh, remedy_for_absence, user_modifiers
from .field_attributes import ANGLE_TYPE, attribute_name, direction_names, field_degree
from .mesh_fields import read_mesh_field
from .mesh_states import MeshStates, mesh_state_key, read_mesh_state
from .meshes import evaluated_mesh, mesh_surface, no_faces_error
from .transparency import opaque_triangles, transparent_slots
from .visible_objects import Instances, drawn_objects, rendered_instances

#: Cache key of the mesh instances of the last call of `SceneReader.read`.
_INSTANCES_KEY = "instances of the last reading"


@dataclass(frozen=True, eq=False)
class SceneData:
    """The mesh instances of a scene, and the objects that they come from.

    Attributes
    ----------
    instances : list of MeshInstance
        In world space. Instances with a field come first, then occluders (meshes that only hide others).
    objects : list of bpy.types.Object
        The original object of each instance with a field, in the same order.
    warnings : tuple of str
        One message for each object that was left out because its field cannot be drawn, and one for each object whose
        field was made for other faces than its evaluated mesh has.
    mesh_states : dict
        Digests of the meshes that were read; see the module `mesh_states`.
    """

    instances: list[MeshInstance]
    objects: list[Object]
    warnings: tuple[str, ...]
    mesh_states: MeshStates


def read_scene(
    depsgraph: Depsgraph,
    objects: Sequence[Object] | None = None,
    request: look_inputs.ReadRequest = look_inputs.FIELDS_ONLY,
    cache: Cache | None = None,
) -> SceneData:
    """Read every mesh that is visible in renders, as arrays.

    Meshes are evaluated: modifiers (with their viewport settings), shape keys and armatures are applied. Each
    instance of an object is returned as a separate mesh instance. If an object with a field is deformed, its
    rest positions are read too.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        The evaluated depsgraph of a view layer.
    objects : sequence of bpy.types.Object, optional
        Original objects whose fields are drawn. All other objects only hide what is behind them. By default
        all of `field_objects`; those whose fields cannot be drawn are then left out with a warning.
    request : ReadRequest
        What is read of the meshes besides shapes and fields.
    cache : Cache, optional
        Keeps mesh instances that have not changed since an earlier call.

    Returns
    -------
    SceneData

    Raises
    ------
    RosyError
        If no object has a field that can be drawn, or none has the requested tone or values for the color
        map. If one of `objects` is hidden, its field cannot be read, or its modifiers remove the field.
    """
    targets = drawn_objects(depsgraph) if objects is None else list(objects)
    if not targets:
        remedy = remedy_for_absence("make or import one first")
        raise RosyError(f"no visible object has a RoSy field: {remedy}")
    depsgraph.update()
    reader = SceneReader(cache, mesh_states={})
    entries = reader.read(rendered_instances(depsgraph, targets), request)
    errors = _field_errors(reader.errors, entries, targets)
    if errors and (objects is not None or len(errors) == len(targets)):
        raise errors[0]
    with_field = [entry for entry in entries if entry.instance.field is not None]
    look_inputs.check_sources([(entry.instance, entry.owner) for entry in with_field], request)
    occluders = [entry.instance for entry in entries if entry.instance.field is None]
    return SceneData(
        [entry.instance for entry in with_field] + occluders,
        [entry.owner for entry in with_field],
        (*(f"{error}. It was left out" for error in errors), *reader.notes.values()),
        reader.mesh_states,
    )


def _field_errors(
    errors: Mapping[str, Exception], entries: Sequence[SceneInstance], targets: Sequence[Object]
) -> list[RosyError]:
    """Return one error for each object of `targets` whose field cannot be drawn.

    `errors` are the errors of `SceneReader`, by the full names of objects, and `entries` are the instances
    that it has read. If `errors` has an error of another object, or one that is not a `RosyError`, raise it.
    """
    names = [obj.name_full for obj in targets]
    for name, error in errors.items():
        if name not in names or not isinstance(error, RosyError):
            raise error
    seen = {entry.owner.name_full for entry in entries} | errors.keys()
    return [
        errors.get(name)
        or RosyError(
            f"object '{obj.name}' has a field, but is hidden in the viewport: show it, or "
            "switch off its drawing"
        )
        for name, obj in zip(names, targets, strict=True)
        if name in errors or name not in seen
    ]


@dataclass(frozen=True, eq=False)
class SceneInstance:
    """A mesh instance of a scene, and the objects that it comes from.

    Attributes
    ----------
    instance : MeshInstance
        The same Python object as in the last call of `SceneReader.read`, if nothing has changed.
    owner : bpy.types.Object
        The original object of the mesh.
    visibility_object : bpy.types.Object
        The original object that decides in which 3D views the instance is visible.
    """

    instance: MeshInstance
    owner: Object
    visibility_object: Object


#: A surface, its field, its tone and its values for the color map. Occluders have only the surface.
_MeshData = tuple[Surface, RosyField | None, SurfaceTone | None, np.ndarray | None]


class SceneReader:
    """A reader of the meshes of one view layer. Repeated calls of `read` read only what has changed.

    Parameters
    ----------
    cache : Cache, optional
        Keeps surfaces, fields and mesh instances. Equal contents give the same object.
    mesh_states : dict, optional
        The states of meshes that are read are added to it; see the module `mesh_states`.

    Attributes
    ----------
    cache : Cache
    mesh_states : dict or None
    errors : dict of str to Exception
        By the full name of an object: why its field cannot be drawn, or why it cannot be read at all.
    notes : dict of str to str
        By the full name of an object: a message if its field is drawn, but was made for other faces.
    is_complete : bool
        Whether the last call of `read` read all objects before its deadline.
    """

    def __init__(self, cache: Cache | None = None, mesh_states: MeshStates | None = None) -> None:
        self.cache = Cache() if cache is None else cache
        self.mesh_states = mesh_states
        self.errors: dict[str, Exception] = {}
        self.notes: dict[str, str] = {}
        self.is_complete = True
        self._request = look_inputs.FIELDS_ONLY
        self._deadline = math.inf
        self._has_read_any = False
        # Keys: the full name of the object, the pointer of its mesh, whether its field is drawn, and
        # `tone_image_key` or, without a field, `transparent_slots`. None: the mesh has no faces.
        self._meshes: dict[tuple, _MeshData | None] = {}

    def invalidate(self, names: set[str]) -> None:
        """Mark objects with these full names as changed, so that the next call of `read` reads them again."""
        self._meshes = {key: data for key, data in self._meshes.items() if key[0] not in names}
        for name in names:
            self.errors.pop(name, None)
            self.notes.pop(name, None)

    def read(
        self,
        instances: Instances,
        request: look_inputs.ReadRequest = look_inputs.FIELDS_ONLY,
        deadline: float = math.inf,
    ) -> list[SceneInstance]:
        """Return the mesh instances of a scene in their current state.

        Objects that cannot be read are left out; see `errors`.

        Parameters
        ----------
        instances : iterator of (bpy.types.DepsgraphObjectInstance, bool)
            Instances of meshes, and whether their fields are drawn. If not, they only occlude others.
        request : ReadRequest
            What is read of the meshes besides shapes and fields.
        deadline : float
            Time in seconds of `time.monotonic` after which no further mesh is read, except the first changed
            one. The remaining meshes are left for the next call; see `is_complete`.
        """
        if self.is_complete:
            self.errors.clear()
        if request != self._request:
            self._meshes.clear()
            self._request = request
        self._deadline, self._has_read_any, self.is_complete = deadline, False, True
        entries: list[SceneInstance] = []
        last_instances = self.cache.get(_INSTANCES_KEY) or {}
        mesh_instances: dict[tuple, MeshInstance] = {}
        faceless: set[Object] = set()
        for instance, draws_field in instances:
            obj, owner = instance.object, instance.object.original
            mesh_data = self._mesh_data(obj, owner, draws_field)
            if mesh_data is None and draws_field and owner.name_full in self.errors:
                mesh_data = self._mesh_data(obj, owner, False)  # without its field
            if mesh_data is None:
                if draws_field:
                    faceless.add(owner)
                continue
            matrix = np.array(instance.matrix_world, dtype=np.float64)
            key = *(id(part) for part in mesh_data), matrix.tobytes()
            if key not in mesh_instances:
                new_instance = MeshInstance(mesh_data[0], matrix, *mesh_data[1:])
                mesh_instances[key] = last_instances.get(key, new_instance)
            is_shown_by_parent = instance.is_instance and instance.parent
            visibility_object = instance.parent.original if is_shown_by_parent else owner
            entries.append(SceneInstance(mesh_instances[key], owner, visibility_object))
        if self.is_complete:
            owners = {entry.owner for entry in entries}
            for owner in faceless - owners:
                self.errors.setdefault(owner.name_full, _lost_field_error(owner, None))
            names = {owner.name_full for owner in owners}
            self.notes = {name: note for name, note in self.notes.items() if name in names}
        # The instances of the last call are released only now: the keys have ids of surfaces, and while a
        # surface is alive, no new object can have its id.
        self.cache.put(_INSTANCES_KEY, mesh_instances)
        self.cache.evict_over_limit()
        return entries

    def _mesh_data(self, obj: Object, owner: Object, draws_field: bool) -> _MeshData | None:
        """Return the data of the mesh of the evaluated object `obj`, whose original object is `owner`.

        Return None if it has no faces, has an error, or is left for a later call.
        """
        pointer, request = obj.data.as_pointer(), self._request
        kind = look_inputs.tone_image_key(owner, request)
        if not draws_field:
            kind = transparent_slots(obj.data, owner)
        key = owner.name_full, pointer, draws_field, kind
        if key in self._meshes:
            return self._meshes[key]
        if draws_field and owner.name_full in self.errors:
            return None
        if self._has_read_any and time.monotonic() > self._deadline:
            self.is_complete = False
            return None
        self._has_read_any = True
        try:
            with evaluated_mesh(obj) as mesh:
                if mesh is None:
                    mesh_data = None
                elif draws_field:
                    mesh_data = self._read_field_mesh(mesh, owner)
                else:
                    mesh_data = self._read_occluder(mesh, owner)
                if self.mesh_states is not None:
                    state_request = request if draws_field else None
                    state_key = mesh_state_key(obj, owner, state_request)
                    self.mesh_states[state_key] = read_mesh_state(mesh, owner, state_request)
        except REPORTED_ERRORS as error:
            self.errors[owner.name_full] = error
            return None
        self._meshes[key] = mesh_data
        return mesh_data

    def _read_occluder(self, mesh: Mesh, owner: Object) -> _MeshData | None:
        """Read a mesh that only hides others. Return None if it hides nothing."""
        surface = mesh_surface(mesh, f"object '{owner.name}'", occluder_only=True, cache=self.cache)
        shown = opaque_triangles(surface, mesh, owner)
        if len(shown) < len(surface.triangles):
            names = "triangles", "triangle_face"
            parts = {name: getattr(surface, name)[shown] for name in names}
            with_parts = partial(surface.with_parts, **parts)
            surface = cached(self.cache, with_parts, surface, "opaque", shown)
        return (surface, None, None, None) if len(shown) else None

    def _read_field_mesh(self, mesh: Mesh, owner: Object) -> _MeshData:
        """Read an evaluated mesh with its field."""
        request, cache, label = self._request, self.cache, f"object '{owner.name}'"
        original, holder = owner.data, field_mesh(owner)
        surface = undeformed = mesh_surface(mesh, label, cache=cache)
        tone = look_inputs.read_tone(mesh, owner, request, cache)
        values = look_inputs.read_color_values(mesh, request.color_attribute, label, cache)
        modifiers, is_edited = user_modifiers(owner), holder == original and original.is_editmode
        if not is_edited and (holder != original or modifiers or original.shape_keys):
            undeformed = mesh_surface(holder, label, cache=cache)
        has_same_faces = is_edited or have_same_polygons(surface, undeformed)
        if has_same_faces:
            surface = self._with_rest(surface, undeformed.vertices)
        elif holder != original:
            problem = "its modifiers make other faces now than when its field was made"
            raise RosyError(f"{label}: {problem}: make the field again")
        may_change_field = is_edited or any(each.type == "NODES" for each in modifiers)
        if not has_same_faces or (holder == original and may_change_field):
            field = self._copied_field(mesh, owner, surface, undeformed if has_same_faces else None)
            return surface, field, tone, values
        if values is None and holder != original:  # values that RoSy has computed
            values = look_inputs.read_color_values(holder, request.color_attribute, label, cache)
        field = read_mesh_field(
            holder, surface=undeformed, nonfinite=request.nonfinite, cache=cache
        )
        return surface, field, tone, values

    def _copied_field(
        self, mesh: Mesh, owner: Object, surface: Surface, undeformed: Surface | None
    ) -> RosyField:
        """Return the field in the attributes that modifiers or edit mode have copied to an evaluated mesh.

        `surface` is the surface of the mesh. `undeformed` has the same faces in the shape for which the field was
        made. If modifiers have changed the faces, it is None: each part of a face then has a copy of the vector of
        the face, projected to the part, and a note says that the field was made for other faces.
        """
        original = owner.data
        name, degree = attribute_name(original), field_degree(original)
        names = [name] if name in original.attributes else direction_names(original)
        if not all(each in mesh.attributes for each in names):
            raise _lost_field_error(owner, name)
        is_angle = name in names and mesh.attributes[name].data_type == ANGLE_TYPE
        has_other_faces = undeformed is None or (original.is_editmode and user_modifiers(owner))
        if is_angle and has_other_faces:
            problem = "modifiers do not keep a field that is stored as angles"
            raise RosyError(f"{surface.name}: {problem}: make the field again")
        policy = {"nonfinite": self._request.nonfinite, "off_surface": "project"}
        shape = undeformed or surface
        field = read_mesh_field(mesh, name, degree, shape, **policy, cache=self.cache)
        if undeformed is None:
            problem = "its field was made for the faces without modifiers"
            note = f"{surface.name}: {problem}: make it again for those that are seen"
            self.notes[owner.name_full] = note
        return field

    def _with_rest(self, surface: Surface, rest: np.ndarray) -> Surface:
        """Return a surface with rest positions: the surface itself if they are equal to its positions."""
        if np.array_equal(rest, surface.vertices):
            return surface
        rest = np.asarray(rest, dtype=np.float64)
        with_rest = partial(surface.with_parts, rest_vertices=rest)
        return cached(self.cache, with_rest, surface, "rest", rest)


def _lost_field_error(obj: Object, attribute: str | None) -> RosyError:
    """Return the error for an object whose modifiers remove an attribute.

    `attribute` is the name of the attribute. If it is None, the modifiers remove all faces.
    """
    if attribute is None and not len(obj.data.polygons):
        return no_faces_error(obj.data, f"object '{obj.name}'")
    names = ", ".join(modifier.name for modifier in user_modifiers(obj)) or "none"
    problem = "has no faces"
    if attribute is not None:
        problem = f"has no attribute '{attribute}': make the field again"
    return RosyError(f"object '{obj.name}': after its modifiers ({names}) the mesh {problem}")
