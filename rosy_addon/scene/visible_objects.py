"""Find the objects of a view layer that are visible in renders, and the ones with a field."""

from collections.abc import Collection, Iterable, Iterator

import bpy
from bpy.types import Depsgraph, DepsgraphObjectInstance, LayerCollection, Object, ViewLayer

from ..core.errors import RosyError
from .datablocks import (
    OWNED_TAG,
    check_object_type,
    field_mesh,
    has_rosy_properties,
    remedy_for_absence,
)
from .field_attributes import attribute_name, has_field


def field_objects(view_layer: ViewLayer, names: Iterable[str] | None = None) -> list[Object]:
    """Return the mesh objects with a field that are visible in renders, sorted by name.

    Objects in instanced collections are included. Objects whose field the user has switched off are left out.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer
    names : iterable of str, optional
        Return only these objects, in this order.

    Raises
    ------
    RosyError
        If there is no object with one of the names, or the object has no field, is hidden or is switched off.
    """
    candidates = {obj.name: obj for obj in _visible_objects(view_layer) if _draws_field(obj)}
    if names is None:
        return [candidates[name] for name in sorted(candidates)]
    return [_find_field_object(name, candidates) for name in dict.fromkeys(names)]


def drawn_objects(depsgraph: Depsgraph) -> list[Object]:
    """Return the original objects with a field that are visible in renders of a view layer.

    These are all `field_objects`, and further objects of which only instances by Geometry Nodes are visible.
    """
    objects = field_objects(depsgraph.view_layer)
    visible_objects = set(_visible_objects(depsgraph.view_layer))
    instanced = {
        instance.object.original
        for instance in depsgraph.object_instances
        if instance.is_instance and _is_rendered(instance, visible_objects)
    }
    others = filter(_draws_field, instanced.difference(objects))
    return objects + sorted(others, key=lambda obj: obj.name_full)


#: Iterator over instances of meshes, each with whether its field is drawn. An instance is valid until the
#: next one is taken.
Instances = Iterator[tuple[DepsgraphObjectInstance, bool]]


def rendered_instances(depsgraph: Depsgraph, targets: Collection[Object]) -> Instances:
    """Return the instances of meshes that are visible in renders.

    `targets` are the original objects whose fields are drawn. All other meshes only hide what is behind them.
    """
    visible_objects = set(_visible_objects(depsgraph.view_layer))
    with_field = set(targets)
    return (
        (instance, instance.object.original in with_field)
        for instance in depsgraph.object_instances
        if _is_rendered(instance, visible_objects)
    )


def shown_instances(depsgraph: Depsgraph, *, include_occluders: bool) -> Instances:
    """Yield the instances of meshes that are visible in 3D views: all, or only meshes with a field."""
    for instance in depsgraph.object_instances:
        if instance.object.type == "MESH" and instance.show_self:
            obj = instance.object.original
            draws_field = _draws_field(obj)
            if draws_field or (include_occluders and not obj.get(OWNED_TAG)):
                yield instance, draws_field


def _is_rendered(instance: DepsgraphObjectInstance, visible_objects: set[Object]) -> bool:
    """Return whether an instance is a mesh that is visible in renders."""
    obj = instance.object
    # For curves, texts, surfaces and metaballs, the depsgraph lists separate instances of their meshes.
    if obj.type != "MESH" or not instance.show_self or not obj.visible_camera:
        return False
    if obj.original.get(OWNED_TAG):  # strokes that Geometry Nodes have turned into a mesh
        return False
    if instance.is_instance:
        instancer = instance.parent
        is_shown = instancer is None or instancer.original in visible_objects
        # Geometry Nodes also show instances of objects that are hidden themselves.
        is_from_nodes = instancer is not None and instancer.instance_type == "NONE"
        return is_shown and (is_from_nodes or not obj.original.hide_render)
    return obj.original in visible_objects


def _draws_field(obj: Object) -> bool:
    """Return whether an object has a field that the user has not switched off."""
    return has_field(obj) and (not has_rosy_properties() or obj.rosy.include)


def _visible_objects(view_layer: ViewLayer) -> list[Object]:
    """Return the original objects that are visible in renders, including those in instanced collections."""
    visible: dict[Object, None] = {}

    def add_object(obj: Object) -> None:
        """Add an object and the objects of the collection that it instances."""
        if obj.hide_render or obj in visible:
            return
        visible[obj] = None
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            for child in obj.instance_collection.all_objects:
                add_object(child)

    def visit_layer(layer: LayerCollection) -> None:
        """Add the objects of a layer collection and its children."""
        if layer.exclude or layer.collection.hide_render:
            return
        for obj in layer.collection.objects:
            add_object(obj)
        for child in layer.children:
            visit_layer(child)

    visit_layer(view_layer.layer_collection)
    return list(visible)


def _find_field_object(name: str, candidates: dict[str, Object]) -> Object:
    """Return the candidate with a name, or raise an error that says why there is none."""
    if name in candidates:
        return candidates[name]
    obj = bpy.data.objects.get(name)
    if obj is None:
        raise RosyError(f"there is no object '{name}': {remedy_for_absence('check its name')}")
    check_object_type(obj, "MESH")
    if not has_field(obj):
        field_name = attribute_name(field_mesh(obj))
        raise RosyError(
            f"object '{name}' has no attribute '{field_name}' with a field: make or import a field first"
        )
    raise RosyError(
        f"object '{name}' is hidden in renders of this view layer, or its drawing is switched off: "
        "show it, and switch it on"
    )
