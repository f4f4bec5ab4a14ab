"""Strokes as objects of the scene: put there, replaced by the next ones, and taken away again.

Of each camera there is at most one object of each kind. It is found again by the record in
``scene.rosy.strokes``, so that copies, which have none, are the user's. The next strokes give the
object other data; its modifiers, its name and its collections stay as the user has made them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

import bpy
from mathutils import Matrix

from ..compositor.colour import to_hex
from ..compositor.hues import PALETTE
from ..errors import RosyError
from ..projection.camera import Camera
from ..strokes.draw import Drawn, Manner, as_lines
from ..strokes.svg import Pen
from .apply import all_or_nothing
from .bodies import MADE, rosy_objects
from .curves import new_curves
from .looks import exact
from .pencil import new_pencil

#: Of each kind of object, what makes its data.
KINDS: dict[str, Callable[..., bpy.types.ID]] = {"PENCIL": new_pencil, "CURVES": new_curves}


def manner_of(settings: bpy.types.PropertyGroup) -> Manner:
    """How the properties ``scene.rosy.strokes`` want strokes to be laid."""
    return Manner(
        **{entry.name: exact(getattr(settings, entry.name), entry) for entry in fields(Manner)}
    )


def pen_of(settings: bpy.types.PropertyGroup) -> Pen:
    """How the properties ``scene.rosy.strokes`` want strokes to be drawn."""
    one = to_hex(settings.ink_colour)
    return Pen(
        width=float(f"{settings.width:.7g}"),
        colours=[to_hex(colour) for colour in PALETTE] if settings.inks == "FAMILIES" else [one],
        paper=None if settings.plotter or not settings.paper else "#ffffff",
        millimetres=settings.page or None,
        plotter=settings.plotter,
        outline=to_hex(settings.outline_colour) if settings.inks == "FAMILIES" else one,
    )


def wanted_objects(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> list[bpy.types.Object]:
    """The objects that strokes are to be drawn on: all with a field, or those that are selected.

    Raises
    ------
    RosyError
        If none of the selected ones has a field.
    """
    found = rosy_objects(view_layer)
    if not scene.rosy.strokes.selected:
        return found
    chosen = [thing for thing in found if thing.select_get(view_layer=view_layer)]
    if not chosen:
        raise RosyError("none of the selected objects has a field: select one that has")
    return chosen


def put_strokes(
    scene: bpy.types.Scene,
    kind: str,
    drawn: Drawn,
    camera: Camera,
    pen: Pen,
    owner: bpy.types.Object | None = None,
) -> bpy.types.Object:
    """Put strokes into a scene, in place of those of the same kind from the same camera.

    An error leaves things as they were.

    Parameters
    ----------
    scene : bpy.types.Scene
    kind : {"PENCIL", "CURVES"}
    drawn : Drawn
    camera : Camera
        Whose pixels the pen's width is counted in.
    pen : Pen
    owner : bpy.types.Object, optional
        With which the strokes are to move.
    """
    name = f"RoSy Strokes {camera.name}"
    lines = as_lines(drawn, camera, pen)
    names: dict[bpy.types.ID, str] = {}
    with all_or_nothing() as made:

        def keep(datablock: bpy.types.ID, wanted: str) -> None:
            made.append(datablock)
            names[datablock] = wanted

        data = KINDS[kind](name, lines, min(scene.frame_start, scene.frame_current), keep)
        thing = _found(scene, kind, camera.name)
        if thing is None:
            thing = bpy.data.objects.new(name, data)
            made.append(thing)
            scene.collection.objects.link(thing)
            thing.visible_shadow = False
            thing.use_grease_pencil_lights = False
    if thing.data != data:
        old, thing.data = thing.data, data
        _discard(old)
        for datablock, wanted in names.items():
            datablock.name = wanted  # which the old one had
    thing.parent = owner
    thing.matrix_parent_inverse = Matrix() if owner is None else owner.matrix_world.inverted_safe()
    thing.matrix_basis = Matrix()
    _remember(scene, kind, camera.name, thing)
    return thing


def stroke_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The objects of strokes that RoSy has put into a scene and that are still there."""
    things = (record.thing for record in scene.rosy.strokes.made)
    return [thing for thing in things if thing is not None and thing.name in scene.objects]


def remove_strokes(scene: bpy.types.Scene) -> int:
    """Take all strokes away that RoSy put into a scene; how many objects these were."""
    found = stroke_objects(scene)
    for record in scene.rosy.strokes.made:
        if record.thing is not None:
            _delete(record.thing)
    scene.rosy.strokes.made.clear()
    return len(found)


def _found(scene: bpy.types.Scene, kind: str, camera: str) -> bpy.types.Object | None:
    """The object that was made before, unless the user has deleted it, or given it other data."""
    for record in scene.rosy.strokes.made:
        if (record.kind, record.name) == (kind, camera) and record.thing in stroke_objects(scene):
            return record.thing if record.thing.data.get(MADE) else None
    return None


def _remember(scene: bpy.types.Scene, kind: str, camera: str, thing: bpy.types.Object) -> None:
    """Record an object; one that was deleted before by the user alone goes for good."""
    made = scene.rosy.strokes.made
    for index in reversed(range(len(made))):
        record = made[index]
        if record.thing is None or record.thing.name not in scene.objects:
            if record.thing is not None:
                _delete(record.thing)
            made.remove(index)
        elif (record.kind, record.name) == (kind, camera):
            made.remove(index)
    record = made.add()
    record.name, record.kind, record.thing = camera, kind, thing


def _delete(thing: bpy.types.Object) -> None:
    data = thing.data
    bpy.data.objects.remove(thing)
    _discard(data)


def _discard(data: bpy.types.ID) -> None:
    """Delete data of RoSy's, and its materials, where nobody else uses them."""
    if data.users or not data.get(MADE):
        return
    materials = [material for material in data.materials if material and material.get(MADE)]
    bpy.data.batch_remove([data])
    bpy.data.batch_remove([material for material in materials if not material.users])
