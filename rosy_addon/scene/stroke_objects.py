"""Stroke objects of a scene: create, replace and remove them.

There is at most one object of each kind for each camera. Records in ``scene.rosy.strokes`` identify
these objects. A copy has no record, so it belongs to the user. When strokes are drawn again, the
object gets new data, and keeps its modifiers, name and collections.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy
from mathutils import Matrix

from ..color import to_hex
from ..compositor.family_hues import PALETTE
from ..errors import RosyError
from ..line_drawing.drawing_outputs import StrokeGeometry
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from .compat import is_editable
from .curves import new_curves
from .grease_pencil import new_grease_pencil
from .look_properties import read_settings
from .owned_data import OWNED_TAG, rollback_on_error
from .stroke_digest import stroke_digest
from .surface_strokes import follow_surface, stop_following
from .visible_objects import field_objects

#: The function that creates the data of each kind of object.
DATA_BUILDERS: dict[str, Callable[..., bpy.types.ID]] = {
    "PENCIL": new_grease_pencil,
    "CURVES": new_curves,
}


def read_stroke_style(settings: bpy.types.PropertyGroup) -> StrokeStyle:
    """Return the stroke style that the properties ``scene.rosy.strokes`` hold."""
    return StrokeStyle(**read_settings(settings, StrokeStyle))


def read_pen(settings: bpy.types.PropertyGroup) -> Pen:
    """Return the pen that the properties ``scene.rosy.strokes`` hold."""
    ink = to_hex(settings.ink_colour)
    return Pen(
        width=float(f"{settings.width:.7g}"),
        colours=[to_hex(color) for color in PALETTE] if settings.inks == "FAMILIES" else [ink],
        paper=None if settings.plotter or not settings.paper else "#ffffff",
        millimetres=settings.page or None,
        plotter=settings.plotter,
        outline=to_hex(settings.outline_colour) if settings.inks == "FAMILIES" else ink,
    )


def target_objects(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> list[bpy.types.Object] | None:
    """Return the objects to draw strokes on: the selected ones with a field, or None for all.

    Raises
    ------
    RosyError
        If only selected objects are to be drawn, and none of them has a field.
    """
    if not scene.rosy.strokes.selected:
        return None
    selected = [obj for obj in field_objects(view_layer) if obj.select_get(view_layer=view_layer)]
    if not selected:
        raise RosyError(
            "no selected object has a field: select one with a field, or switch off Selected Only"
        )
    return selected


def store_strokes(
    scene: bpy.types.Scene,
    kind: str,
    geometry: StrokeGeometry,
    camera: str,
    owner: bpy.types.Object | None = None,
    collection: bpy.types.Collection | None = None,
    vertex_count: int = 0,
) -> bpy.types.Object:
    """Store strokes in an object. Those of the same kind from the same camera are replaced.

    If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    kind : {"PENCIL", "CURVES"}
        Grease Pencil or Curves.
    geometry : StrokeGeometry
    camera : str
        Name of the camera.
    owner : bpy.types.Object, optional
        Parent of the object. The strokes move with it.
    collection : bpy.types.Collection, optional
        The collection of a new object, by default that of the scene. Also if it cannot be changed.
    vertex_count : int
        Of the evaluated mesh of `owner`, if the geometry has the places of its points on it.

    Returns
    -------
    bpy.types.Object
    """
    name = f"RoSy Strokes {camera}"
    final_names: dict[bpy.types.ID, str] = {}
    with rollback_on_error() as created:

        def register(datablock: bpy.types.ID, final_name: str) -> None:
            created.append(datablock)
            final_names[datablock] = final_name

        data = DATA_BUILDERS[kind](
            name, geometry, min(scene.frame_start, scene.frame_current), register
        )
        record = _find_record(scene, kind, camera)
        obj = None if record is None else record.thing
        if obj is None:
            obj = bpy.data.objects.new(name, data)
            created.append(obj)
            is_usable = collection is not None and is_editable(collection)
            (collection if is_usable else scene.collection).objects.link(obj)
            obj.visible_shadow = False
            obj.use_grease_pencil_lights = False
    if obj.data != data:
        old_data, obj.data = obj.data, data
        _remove_data(old_data)
        for datablock, final_name in final_names.items():
            datablock.name = final_name  # now free: the old data had this name
    obj.parent = owner
    obj.matrix_parent_inverse = Matrix() if owner is None else owner.matrix_world.inverted_safe()
    obj.matrix_basis = Matrix()
    if kind == "CURVES" and geometry.places is not None:
        follow_surface(obj, owner, vertex_count)
    else:
        stop_following(obj)
    _store_record(scene, kind, camera, obj)
    return obj


def stroke_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the stroke objects that RoSy created and that are still in the scene."""
    objects = (record.thing for record in scene.rosy.strokes.made)
    return [obj for obj in objects if obj is not None and obj.name in scene.objects]


def remove_strokes(scene: bpy.types.Scene) -> int:
    """Delete all stroke objects that RoSy created in a scene. Return their number.

    Other scenes that show the same objects lose them, too.
    """
    objects = stroke_objects(scene)
    for record in scene.rosy.strokes.made:
        if record.thing is not None:
            _delete_object(record.thing)
    scene.rosy.strokes.made.clear()
    return len(objects)


def edited_strokes(scene: bpy.types.Scene, kind: str, camera: str) -> bpy.types.Object | None:
    """Return the object that `store_strokes` would replace the strokes of, if they were edited.

    None if there is no such object, or nobody has edited its strokes since they were drawn.
    """
    record = _find_record(scene, kind, camera)
    if record is None or not record.digest or record.digest == stroke_digest(record.thing.data):
        return None
    return record.thing


def _find_record(scene: bpy.types.Scene, kind: str, camera: str) -> bpy.types.PropertyGroup | None:
    """Return the record of an object; None if the user has deleted it or given it other data."""
    for record in scene.rosy.strokes.made:
        if (record.kind, record.name) == (kind, camera) and record.thing in stroke_objects(scene):
            return record if record.thing.data.get(OWNED_TAG) else None
    return None


def _store_record(scene: bpy.types.Scene, kind: str, camera: str, obj: bpy.types.Object) -> None:
    """Record an object, and clean up the records of objects that the user has deleted."""
    records = scene.rosy.strokes.made
    for index in reversed(range(len(records))):
        record = records[index]
        if record.thing is None or record.thing.name not in scene.objects:
            if record.thing is not None:
                _delete_object(record.thing)
            records.remove(index)
        elif (record.kind, record.name) == (kind, camera):
            records.remove(index)
    record = records.add()
    record.name, record.kind, record.thing = camera, kind, obj
    record.digest = stroke_digest(obj.data)


def _delete_object(obj: bpy.types.Object) -> None:
    """Delete an object, and its data if RoSy created them and nothing else uses them."""
    data = obj.data
    stop_following(obj)
    bpy.data.objects.remove(obj)
    _remove_data(data)


def _remove_data(data: bpy.types.ID) -> None:
    """Delete data that RoSy created, and their materials, if nothing else uses them."""
    if data.users or not data.get(OWNED_TAG):
        return
    materials = [material for material in data.materials if material and material.get(OWNED_TAG)]
    bpy.data.batch_remove([data])
    bpy.data.batch_remove([material for material in materials if not material.users])
