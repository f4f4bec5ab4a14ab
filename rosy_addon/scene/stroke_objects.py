"""Create, replace and remove the objects with strokes in a scene.

For each camera there is at most one Grease Pencil object and one Curves object. Records in
``scene.rosy.strokes`` identify them. An object that the user has copied has no record and is never changed.
When strokes are drawn again, the object gets new data, and keeps its modifiers, name and collections. If the
user has edited its strokes, it belongs to the user from then on, and the new strokes go into a new object.
"""

from typing import Any

import bpy
import numpy as np
from bpy.types import ID, Collection, Curves, Object, PropertyGroup, Scene, ViewLayer
from mathutils import Matrix

from ..compositor.family_hues import PALETTE
from ..core.cache import content_hash
from ..core.color import to_hex
from ..core.errors import RosyError
from ..line_drawing.drawing_outputs import StrokeGeometry
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from . import stroke_data
from .datablocks import OWNED_TAG, is_editable, rollback_on_error
from .look_properties import read_settings
from .meshes import read_collection
from .visible_objects import field_objects

#: Functions that create the data of an object with strokes, by the kind of object.
DATA_BUILDERS = {"PENCIL": stroke_data.new_grease_pencil, "CURVES": stroke_data.new_curves}

#: Attributes that define strokes. Others, such as the selection, may change although strokes are not edited.
STROKE_ATTRIBUTES = ("position", "radius", "opacity", "material_index", stroke_data.INK_ATTRIBUTE)

#: Properties of the points of a stroke before Blender 4.3, with the number of values of each.
LEGACY_POINT_PROPERTIES = {"co": 3, "pressure": 1, "strength": 1}

#: Property with the values of an attribute, and number of values per element, by data type.
_VALUES_BY_TYPE = {"FLOAT_VECTOR": ("vector", 3), "FLOAT_COLOR": ("color", 4)}


def read_stroke_style(settings: PropertyGroup) -> StrokeStyle:
    """Return the stroke style that the properties ``scene.rosy.strokes`` hold."""
    return StrokeStyle(**read_settings(settings, StrokeStyle))


def read_pen(settings: PropertyGroup) -> Pen:
    """Return the pen that the properties ``scene.rosy.strokes`` hold."""
    ink = to_hex(settings.ink_color)
    return Pen(
        width=float(f"{settings.width:.7g}"),
        colors=[to_hex(color) for color in PALETTE] if settings.inks == "FAMILIES" else [ink],
        paper=None if settings.plotter or not settings.paper else "#ffffff",
        millimeters=settings.page or None,
        plotter=settings.plotter,
        outline=to_hex(settings.outline_color) if settings.inks == "FAMILIES" else ink,
    )


def target_objects(scene: Scene, view_layer: ViewLayer) -> list[Object] | None:
    """Return the objects to draw strokes on.

    If the setting *Selected Only* is on, these are the selected objects with a field. If it is off, return
    None, which stands for all objects with a field.

    Raises
    ------
    RosyError
        If the setting is on and no selected object has a field.
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
    scene: Scene,
    kind: str,
    geometry: StrokeGeometry,
    camera: str,
    owner: Object | None = None,
    collection: Collection | None = None,
    vertex_count: int = 0,
) -> tuple[Object, Object | None]:
    """Store strokes in an object. They replace the strokes of the same kind from the same camera.

    Strokes that the user has edited are not replaced; see `edited_strokes`. If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    kind : {"PENCIL", "CURVES"}
        Grease Pencil or Curves.
    geometry : StrokeGeometry
    camera : str
        Name of the camera.
    owner : bpy.types.Object, optional
        Parent of the object with strokes, with which they move.
    collection : bpy.types.Collection, optional
        The collection to which a new object is added. By default, or if it is linked from a library, the
        collection of the scene.
    vertex_count : int
        Number of vertices of the evaluated mesh of `owner`. Only used if the strokes are to follow its
        surface.

    Returns
    -------
    obj : bpy.types.Object
        The object with the strokes.
    edited : bpy.types.Object or None
        The object with edited strokes, which was kept.
    """
    name, first_frame = f"RoSy Strokes {camera}", min(scene.frame_start, scene.frame_current)
    final_names: dict[ID, str] = {}
    with rollback_on_error() as track:

        def register(datablock: ID, final_name: str) -> ID:
            final_names[datablock] = final_name
            return track(datablock)

        data = DATA_BUILDERS[kind](name, geometry, first_frame, register)
        record = _find_record(scene, kind, camera)
        obj = None if record is None else record.thing
        if (edited := edited_strokes(scene, kind, camera)) is not None:
            obj = None
        if obj is None:
            obj = track(bpy.data.objects.new(name, data))
            is_usable = collection is not None and is_editable(collection)
            (collection if is_usable else scene.collection).objects.link(obj)
            obj.visible_shadow = False
            obj.use_grease_pencil_lights = False
    for block in (edited.data, *edited.data.materials) if edited else ():
        if block is not None and OWNED_TAG in block:
            del block[OWNED_TAG]
    if obj.data != data:
        old_data, obj.data = obj.data, data
        _remove_data(old_data)
        for datablock, final_name in final_names.items():
            datablock.name = final_name  # free now, as the old data had this name
    obj.parent = owner
    obj.matrix_parent_inverse = Matrix() if owner is None else owner.matrix_world.inverted_safe()
    obj.matrix_basis = Matrix()
    if kind == "CURVES" and geometry.attachment is not None:
        stroke_data.follow_surface(obj, owner, vertex_count)
    else:
        stroke_data.stop_following(obj)
    _store_record(scene, kind, camera, obj)
    return obj, edited


def stroke_objects(scene: Scene) -> list[Object]:
    """Return the stroke objects that RoSy created and that are still in the scene."""
    objects = (record.thing for record in scene.rosy.strokes.made)
    return [obj for obj in objects if obj is not None and obj.name in scene.objects]


def remove_strokes(scene: Scene) -> int:
    """Delete all stroke objects that RoSy created in a scene. Return their number.

    They also disappear from other scenes that share the objects.
    """
    objects = stroke_objects(scene)
    for record in scene.rosy.strokes.made:
        _delete_object(record.thing)
    scene.rosy.strokes.made.clear()
    return len(objects)


def edited_strokes(scene: Scene, kind: str, camera: str) -> Object | None:
    """Return the object with strokes of a kind from a camera if the user has edited them since they were drawn."""
    record = _find_record(scene, kind, camera)
    if record is None or not record.digest or record.digest == _digest(record.thing.data):
        return None
    return record.thing


def _find_record(scene: Scene, kind: str, camera: str) -> PropertyGroup | None:
    """Return the record of an object with strokes; None if the user has deleted it or given it other data."""
    for record in scene.rosy.strokes.made:
        if (record.kind, record.name) == (kind, camera) and record.thing in stroke_objects(scene):
            return record if record.thing.data.get(OWNED_TAG) else None
    return None


def _store_record(scene: Scene, kind: str, camera: str, obj: Object) -> None:
    """Record an object with strokes, and remove the records of objects that the user has deleted."""
    records = scene.rosy.strokes.made
    for index in reversed(range(len(records))):
        record = records[index]
        is_gone = record.thing is None or record.thing.name not in scene.objects
        if is_gone:
            _delete_object(record.thing)
        if is_gone or (record.kind, record.name) == (kind, camera):
            records.remove(index)
    record = records.add()
    record.name, record.kind, record.thing = camera, kind, obj
    record.digest = _digest(obj.data)


def _delete_object(obj: Object | None) -> None:
    """Delete an object with strokes, and its data if RoSy created them and nothing else uses them."""
    if obj is None:
        return
    data = obj.data
    stroke_data.stop_following(obj)
    bpy.data.objects.remove(obj)
    _remove_data(data)


def _remove_data(data: ID) -> None:
    """Delete data and their materials, as far as RoSy created them and nothing uses them."""
    if data.users or not data.get(OWNED_TAG):
        return
    materials = [material for material in data.materials if material and material.get(OWNED_TAG)]
    bpy.data.batch_remove([data])
    bpy.data.batch_remove([material for material in materials if not material.users])


def _digest(data: ID) -> str:
    """Return a digest of the strokes in Grease Pencil or Curves data.

    It depends on layers, points, widths and colors, but not on values that Blender changes without an edit.
    """
    return content_hash(*_digest_parts(data)).hex()


def _digest_parts(data: ID) -> list[object]:
    """Return the values from which `_digest` is computed."""
    if isinstance(data, Curves):
        return _attribute_parts(data.attributes, data.curve_offset_data)
    styles = [None if material is None else material.grease_pencil for material in data.materials]
    parts: list[object] = [None if style is None else tuple(style.color) for style in styles]
    for layer in data.layers:
        parts.append(layer.name if stroke_data.has_grease_pencil_drawings() else layer.info)
        for frame in layer.frames:
            parts.append(frame.frame_number)
            if stroke_data.has_grease_pencil_drawings():
                parts += _attribute_parts(frame.drawing.attributes, frame.drawing.curve_offsets)
            else:
                parts += _legacy_parts(frame)
    return parts


def _attribute_parts(attributes: Any, offsets: Any) -> list[object]:
    """Return the values of `STROKE_ATTRIBUTES`, and the index of the first point of each stroke.

    `attributes` and `offsets` are collections of Curves or of a Grease Pencil drawing.
    """
    position = attributes.get("position")
    if position is None or not len(position.data):  # the offsets of an empty drawing are unreadable
        return []
    parts: list[object] = [read_collection(offsets, "value", np.float32)]
    for name in STROKE_ATTRIBUTES:
        attribute = attributes.get(name)
        if attribute is not None:
            key, columns = _VALUES_BY_TYPE.get(attribute.data_type, ("value", 1))
            parts += [name, read_collection(attribute.data, key, np.float32, columns)]
    return parts


def _legacy_parts(frame: Any) -> list[object]:
    """Return the values of the strokes of a frame, before Blender 4.3."""
    parts: list[object] = []
    for stroke in frame.strokes:
        parts.append((stroke.line_width, stroke.material_index))
        for name, columns in LEGACY_POINT_PROPERTIES.items():
            parts.append(read_collection(stroke.points, name, np.float32, columns))
    return parts
