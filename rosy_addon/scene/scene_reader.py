"""Reading a scene as mesh instances: evaluated meshes with their fields, and occluders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from dataclasses import field as dataclass_field

import bpy
import numpy as np

from ..cache import Cache
from ..errors import RosyError
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from .color_inputs import check_colored, read_color_values
from .compat import has_rosy_properties, is_editable
from .evaluated_field import (
    FACE_NORMAL_ATTRIBUTE,
    FieldLayout,
    add_temp_field,
    add_temp_vectors,
    read_evaluated_field,
)
from .field_attributes import attribute_name, field_degree, has_field, is_face_vector_field
from .libraries import check_object_type, remedy_for_absence
from .meshes import evaluated_mesh, mesh_surface, read_uvs
from .owned_data import OWNED_TAG, user_modifiers
from .read_field import read_mesh_field
from .tone_inputs import ToneRequest, check_tones, read_tone

#: Temporary attribute while a scene is read: vectors on faces, for a field that is stored in
#: another form.
TEMP_FIELD_ATTRIBUTE = "rosy_stand_in"


@dataclass(frozen=True, eq=False)
class SceneData:
    """The mesh instances of a scene, and the objects that they come from.

    Attributes
    ----------
    instances : list of MeshInstance
        World space. Instances with a field come first, then occluders.
    objects : list of bpy.types.Object
        The original object of each instance with a field, in the same order.
    warnings : tuple of str
        For each object that was left out because its field cannot be drawn: which one, and why.
    uvs : dict of bpy.types.Object to (C, 2) float32 ndarray
        u and v at the corners of the objects whose UV maps were asked for.
    """

    instances: list[MeshInstance]
    objects: list[bpy.types.Object]
    warnings: tuple[str, ...] = ()
    uvs: Mapping[bpy.types.Object, np.ndarray] = dataclass_field(default_factory=dict)


def field_objects(
    view_layer: bpy.types.ViewLayer, names: Iterable[str] | None = None
) -> list[bpy.types.Object]:
    """Return the mesh objects with a field that are visible in renders, sorted by name.

    Objects in instanced collections are included. Objects whose field is switched off are not.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer
    names : iterable of str, optional
        Return only these objects, in this order.

    Raises
    ------
    RosyError
        If there is no object with one of the names, or it has no field, is hidden or switched off.
    """
    candidates = {
        obj.name: obj
        for obj in _visible_objects(view_layer)
        if has_field(obj) and is_field_enabled(obj)
    }
    if names is None:
        return [candidates[name] for name in sorted(candidates)]
    return [_find_field_object(name, candidates) for name in dict.fromkeys(names)]


def read_instances(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object] | None = None,
    nonfinite: str = "error",
) -> list[MeshInstance]:
    """Return the mesh instances of `read_scene`."""
    return read_scene(depsgraph, objects, nonfinite).instances


def read_scene(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object] | None = None,
    nonfinite: str = "error",
    cache: Cache | None = None,
    tone_request: ToneRequest | None = None,
    uv_maps: Mapping[bpy.types.Object, str] | None = None,
    color_attribute: str | None = None,
) -> SceneData:
    """Read every mesh that is visible in renders, as arrays.

    Meshes are evaluated: modifiers (with their viewport settings), shape keys and armatures are
    applied. Each instance is returned as a separate mesh instance. The rest positions of deforming
    objects with a field are read too. For this, Blender's option to keep them
    (``add_rest_position_attribute``) is switched on while the scene is read.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        The evaluated depsgraph of a view layer.
    objects : sequence of bpy.types.Object, optional
        Original objects whose fields are drawn. All other objects only occlude. By default all of
        `field_objects` whose fields can be drawn.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    cache : Cache, optional
        Keeps mesh instances that have not changed since an earlier call.
    tone_request : ToneRequest, optional
        The source of the surface tones.
    uv_maps : mapping of bpy.types.Object to str, optional
        Names of UV maps that are read, too. Empty: the active one.
    color_attribute : str, optional
        Name of the attribute whose numbers are read for the color map.

    Returns
    -------
    SceneData

    Raises
    ------
    RosyError
        If no object has a field that can be drawn, or no object has the requested tone or numbers. If one of
        the given objects is hidden, or its field cannot be read or is lost in its modifiers.
    """
    view_layer = depsgraph.view_layer
    errors: Errors | None = {} if objects is None else None
    objects = field_objects(view_layer) if objects is None else list(objects)
    if not objects:
        remedy = remedy_for_absence("make or import one first")
        raise RosyError(f"no visible object has a RoSy field: {remedy}")
    cache = Cache() if cache is None else cache
    with temp_attributes(depsgraph, objects, nonfinite, cache, errors) as layouts:
        reader = _SceneReader(
            layouts, nonfinite, cache, tone_request, errors, uv_maps or {}, color_attribute
        )
        depsgraph.update()
        for instance in rendered_instances(depsgraph):
            reader.add(instance)
    reader.check_complete(objects)
    if errors and not reader.field_instances:
        raise next(iter(errors.values()))
    check_tones(
        tone_request, [(instance.tone, owner) for instance, owner in reader.field_instances]
    )
    check_colored(
        color_attribute,
        [(instance.color_values, owner) for instance, owner in reader.field_instances],
    )
    return SceneData(
        [instance for instance, _ in reader.field_instances] + reader.occluders,
        [owner for _, owner in reader.field_instances],
        tuple(f"{error}. It was left out" for error in (errors or {}).values()),
        reader.uvs,
    )


#: Why the fields of objects cannot be drawn.
Errors = dict[bpy.types.Object, RosyError]

#: A surface, its field, its tone and its numbers for the color map. Occluders have only the surface.
_MeshData = tuple[Surface, RosyField | None, SurfaceTone | None, np.ndarray | None]


class _SceneReader:
    """Collects mesh instances. All instances of an evaluated mesh share its surface and field.

    Attributes
    ----------
    field_instances : list of (MeshInstance, bpy.types.Object)
        Instances with a field, and their original objects.
    occluders : list of MeshInstance
        All other instances.
    uvs : dict of bpy.types.Object to (C, 2) float32 ndarray
        As in `SceneData`.
    mesh_data : dict
        The data of each evaluated mesh; None if it has no faces. The key is the pointer of the mesh,
        and the original object or, for an occluder, None.
    """

    def __init__(
        self,
        layouts: dict[bpy.types.Object, FieldLayout],
        nonfinite: str,
        cache: Cache,
        tone_request: ToneRequest | None,
        errors: Errors | None,
        uv_maps: Mapping[bpy.types.Object, str],
        color_attribute: str | None,
    ) -> None:
        self.layouts = layouts
        self.uv_maps = uv_maps
        self.uvs: dict[bpy.types.Object, np.ndarray] = {}
        self.errors = errors
        self.nonfinite = nonfinite
        self.cache = cache
        self.tone_request = tone_request
        self.color_attribute = color_attribute
        self.field_instances: list[tuple[MeshInstance, bpy.types.Object]] = []
        self.occluders: list[MeshInstance] = []
        self.mesh_data: dict[tuple, _MeshData | None] = {}

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Add an instance to `field_instances` or `occluders`."""
        obj = instance.object
        original = obj.original
        layout = self.layouts.get(original)
        mesh_key = (obj.data.as_pointer(), original if layout else None)
        if mesh_key not in self.mesh_data:
            try:
                self.mesh_data[mesh_key] = self._read_mesh(obj, layout)
            except RosyError as error:
                record_error(self.errors, original, error)
                self.mesh_data[mesh_key] = self._read_mesh(obj, None)
        if self.mesh_data[mesh_key] is None:
            return
        surface, field, tone, values = self.mesh_data[mesh_key]
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        ids = id(surface), id(field), id(tone), id(values)
        mesh_instance = self.cache.get_or_create(
            ("instance", *ids, matrix.tobytes()),
            lambda: MeshInstance(surface, matrix, field, tone, values),
        )
        if field is None:
            self.occluders.append(mesh_instance)
        else:
            self.field_instances.append((mesh_instance, original))

    def _read_mesh(self, obj: bpy.types.Object, layout: FieldLayout | None) -> _MeshData | None:
        """Read an evaluated mesh; None if it has no faces."""
        with evaluated_mesh(obj) as mesh:
            if mesh is None:
                return None
            if layout is None or not layout.is_on(mesh):
                return (
                    mesh_surface(mesh, obj.name, occluder_only=True, cache=self.cache),
                    None,
                    None,
                    None,
                )
            label = f"object '{obj.name}'"
            surface = mesh_surface(mesh, label, read_rest=True, cache=self.cache)
            field = read_evaluated_field(mesh, layout, surface, self.nonfinite, label, self.cache)
            tone = read_tone(mesh, obj.original, surface, self.tone_request, self.cache)
            values = read_color_values(mesh, surface, self.color_attribute, label, self.cache)
            uv_map = self.uv_maps.get(obj.original)
            if uv_map is not None:
                self.uvs[obj.original] = read_uvs(mesh, uv_map, label, "the texture")
            return surface, field, tone, values

    def check_complete(self, objects: Sequence[bpy.types.Object]) -> None:
        """Record or raise an error for each object whose field was not read."""
        drawn_objects = {owner for _, owner in self.field_instances}
        for obj in objects:
            if obj not in drawn_objects and obj not in (self.errors or ()):
                record_error(self.errors, obj, self._lost_error(obj))

    def _lost_error(self, obj: bpy.types.Object) -> RosyError:
        """Return why an object's field was not read."""
        if obj not in {key[1] for key in self.mesh_data}:
            return RosyError(
                f"object '{obj.name}' has a field, but is hidden in the viewport: show it, or "
                "switch off its drawing"
            )
        faceless = all(value is None for key, value in self.mesh_data.items() if key[1] == obj)
        return lost_field_error(obj, None if faceless else self.layouts[obj].name)


def lost_field_error(obj: bpy.types.Object, attribute: str | None) -> RosyError:
    """Return the error for an object whose modifiers lose an attribute, or, if None, all faces."""
    names = ", ".join(modifier.name for modifier in user_modifiers(obj)) or "none"
    problem = "has no faces" if attribute is None else f"has no attribute '{attribute}'"
    return RosyError(f"object '{obj.name}': after its modifiers ({names}) the mesh {problem}")


@contextmanager
def temp_attributes(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object],
    nonfinite: str,
    cache: Cache,
    errors: Errors | None = None,
) -> Iterator[dict[bpy.types.Object, FieldLayout]]:
    """Add temporary attributes that modifiers copy to evaluated meshes, and remove them at exit.

    The attributes are the rest positions, the normals of the original faces, and vectors on faces
    for fields that are stored in another form. All fields are checked on the original meshes.

    If a context that is already open covers the same objects, nothing is added again. For many
    calls of `read_scene`, keep one context open around them.

    Parameters
    ----------
    errors : dict of bpy.types.Object to RosyError, optional
        Gets the errors of the fields that cannot be read; these objects are left out.

    Yields
    ------
    dict of bpy.types.Object to FieldLayout
        The attributes that hold each object's field on its evaluated mesh.

    Raises
    ------
    RosyError
        If a field cannot be read, and there is no `errors`.
    """
    layouts: dict[bpy.types.Object, FieldLayout] = {}
    rest_enabled: list[bpy.types.Object] = []
    temp_meshes: list[bpy.types.Mesh] = []
    try:
        for obj in objects:
            mesh = obj.data
            try:
                layouts[obj] = _prepare_field(obj, nonfinite, temp_meshes, cache)
            except RosyError as error:
                record_error(errors, obj, error)
                continue
            deforms = bool(user_modifiers(obj) or mesh.shape_keys)
            if deforms and is_editable(obj) and not obj.add_rest_position_attribute:
                obj.add_rest_position_attribute = True
                rest_enabled.append(obj)
            if deforms and FACE_NORMAL_ATTRIBUTE not in mesh.attributes and _can_modify(mesh):
                temp_meshes.append(mesh)
                surface = mesh_surface(mesh, f"object '{obj.name}'", cache=cache)
                add_temp_vectors(mesh, FACE_NORMAL_ATTRIBUTE, surface.face_normal)
        if rest_enabled or temp_meshes:
            depsgraph.update()
        yield layouts
    finally:
        for obj in rest_enabled:
            obj.add_rest_position_attribute = False
        for mesh in set(temp_meshes):
            temp_names = [
                a.name
                for a in mesh.attributes
                if a.name.startswith((FACE_NORMAL_ATTRIBUTE, TEMP_FIELD_ATTRIBUTE))
            ]
            for name in temp_names:
                mesh.attributes.remove(mesh.attributes[name])
            mesh.update_tag()
        if rest_enabled or temp_meshes:
            depsgraph.update()


def record_error(errors: Errors | None, obj: bpy.types.Object, error: RosyError) -> None:
    """Note why an object's field cannot be drawn, or raise the error if there is no dict for it."""
    if errors is None:
        raise error
    errors[obj] = error


def _prepare_field(
    obj: bpy.types.Object, nonfinite: str, temp_meshes: list[bpy.types.Mesh], cache: Cache
) -> FieldLayout:
    """Return the layout of a field as vectors on faces. Add them temporarily if missing."""
    mesh, label = obj.data, f"object '{obj.name}'"
    name = attribute_name(mesh)
    if mesh.is_editmode and is_face_vector_field(mesh):
        return FieldLayout(name, field_degree(mesh))  # only the evaluated mesh can be read
    field = read_mesh_field(mesh, nonfinite=nonfinite, label=label, cache=cache)
    if is_face_vector_field(mesh):
        return FieldLayout(name, field.degree)
    if not _can_modify(mesh):
        raise RosyError(
            f"{label}: its mesh is {'in edit mode' if mesh.is_editmode else 'linked'}, and only fields "
            "stored as vectors on faces can be read there: use Store Field first"
        )
    if TEMP_FIELD_ATTRIBUTE not in mesh.attributes:
        temp_meshes.append(mesh)
        return add_temp_field(mesh, field, TEMP_FIELD_ATTRIBUTE)
    return FieldLayout(
        TEMP_FIELD_ATTRIBUTE, field.degree, field.direction_ratios is not None, field.family_count
    )


def _can_modify(mesh: bpy.types.Mesh) -> bool:
    """Whether attributes can be added to a mesh."""
    return is_editable(mesh) and not mesh.is_editmode


def rendered_instances(
    depsgraph: bpy.types.Depsgraph,
) -> Iterator[bpy.types.DepsgraphObjectInstance]:
    """Yield the instances of meshes that are visible in renders, each valid until the next one."""
    visible_objects = set(_visible_objects(depsgraph.view_layer))
    for instance in depsgraph.object_instances:
        if _is_rendered(instance, visible_objects):
            yield instance


def _is_rendered(
    instance: bpy.types.DepsgraphObjectInstance, visible_objects: set[bpy.types.Object]
) -> bool:
    """Whether an instance is a mesh that is visible in renders."""
    obj = instance.object
    # The depsgraph lists the meshes of curves, texts, surfaces and metaballs as separate instances.
    if obj.type != "MESH" or not instance.show_self or not obj.visible_camera:
        return False
    if obj.original.get(OWNED_TAG):  # a stroke object, made a mesh by Geometry Nodes
        return False
    if instance.is_instance:
        instancer = instance.parent
        return not obj.original.hide_render and (
            instancer is None or instancer.original in visible_objects
        )
    return obj.original in visible_objects


def is_field_enabled(obj: bpy.types.Object) -> bool:
    """Whether drawing an object's field is switched on."""
    return obj.rosy.include if has_rosy_properties() else True


def _visible_objects(view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Return the original objects visible in renders, including those in instanced collections."""
    visible: dict[bpy.types.Object, None] = {}

    def add_object(obj: bpy.types.Object) -> None:
        """Add an object and the objects of the collection that it instances."""
        if obj.hide_render or obj in visible:
            return
        visible[obj] = None
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            for child in obj.instance_collection.all_objects:
                add_object(child)

    def visit_layer(layer: bpy.types.LayerCollection) -> None:
        """Add the objects of a layer collection and its children."""
        if layer.exclude or layer.collection.hide_render:
            return
        for obj in layer.collection.objects:
            add_object(obj)
        for child in layer.children:
            visit_layer(child)

    visit_layer(view_layer.layer_collection)
    return list(visible)


def _find_field_object(name: str, candidates: dict[str, bpy.types.Object]) -> bpy.types.Object:
    """Return a candidate by name, or raise an error that says why there is none."""
    if name in candidates:
        return candidates[name]
    obj = bpy.data.objects.get(name)
    if obj is None:
        raise RosyError(f"there is no object '{name}': {remedy_for_absence('check its name')}")
    check_object_type(obj, "MESH")
    if not has_field(obj):
        field_name = attribute_name(obj.data)
        raise RosyError(
            f"object '{name}' has no attribute '{field_name}' with a field: make or import a field first"
        )
    raise RosyError(
        f"object '{name}' is hidden in renders of this view layer, or its drawing is switched off: "
        "show it, and switch it on"
    )
