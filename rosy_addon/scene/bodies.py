"""What is in front of the camera: evaluated meshes, their fields, and all that hides them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ..errors import RosyError
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..projection.gbuffer import Body
from ..projection.tone import SurfaceTone
from ..reuse import Kept
from .attributes import (
    FACE_NORMAL,
    Stored,
    attribute_name,
    field_degree,
    has_field,
    is_native,
    lend_field,
    lend_vectors,
    read_carried_field,
    read_mesh_field,
)
from .capabilities import has_properties, is_editable
from .meshes import evaluated_mesh, mesh_surface
from .tones import ToneWish, check_tones, read_tone

#: Custom property on every datablock that RoSy made.
MADE = "rosy_made"

#: Face vectors standing in, while a scene is read, for a field that is stored in another way.
STAND_IN = "rosy_stand_in"


@dataclass(frozen=True, eq=False)
class Reading:
    """A scene as arrays.

    Attributes
    ----------
    bodies : list of Body
        One an instance; first those with a field.
    owners : list of bpy.types.Object
        The original object of each body with a field, in the same order.
    """

    bodies: list[Body]
    owners: list[bpy.types.Object]


def rosy_objects(
    view_layer: bpy.types.ViewLayer, names: Iterable[str] | None = None
) -> list[bpy.types.Object]:
    """The mesh objects with a field that renders of a view layer show, by name.

    Those in collections that are instanced in it, too.

    Parameters
    ----------
    view_layer : bpy.types.ViewLayer
    names : iterable of str, optional
        Only these.

    Raises
    ------
    RosyError
        If one of the names is not there, has no field or is hidden.
    """
    found = {
        thing.name: thing
        for thing in _shown_objects(view_layer)
        if has_field(thing) and is_included(thing)
    }
    if names is None:
        return [found[name] for name in sorted(found)]
    return [_named(name, found) for name in dict.fromkeys(names)]


def read_bodies(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object] | None = None,
    undefined: str = "error",
) -> list[Body]:
    """The bodies of `read_scene`."""
    return read_scene(depsgraph, objects, undefined).bodies


def read_scene(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object] | None = None,
    undefined: str = "error",
    kept: Kept | None = None,
    wish: ToneWish | None = None,
) -> Reading:
    """All that a camera could see, as arrays.

    Modifiers, shape keys and armatures have had their say, and every instance stands for itself.
    Of a modifier that has one, it is the setting for the viewport that counts. Undeformed positions
    are read of all objects with a field that deform; for that Blender's own option for them is
    switched on meanwhile.

    Parameters
    ----------
    depsgraph : bpy.types.Depsgraph
        Of a view layer.
    objects : sequence of bpy.types.Object, optional
        Original objects whose fields are drawn, everything else only hides; all of `rosy_objects`
        if not given.
    undefined : {"error", "zero"}
        What to do about vectors that are not finite.
    kept : Kept, optional
        Where bodies that have not changed since an earlier reading are found.
    wish : ToneWish, optional
        The tones that those with a field are to have of their own.

    Raises
    ------
    RosyError
        If there are no objects with a field, one of them is nowhere to be seen, or its field cannot
        be read or is lost on the way through its modifiers; or if none has such a tone.
    """
    view_layer = depsgraph.view_layer
    objects = rosy_objects(view_layer) if objects is None else list(objects)
    if not objects:
        raise RosyError("no visible object has a RoSy field: make or import one first")
    shown = set(_shown_objects(view_layer))
    kept = Kept() if kept is None else kept
    with prepared(depsgraph, objects, undefined, kept) as names:
        reader = _Reader(names, undefined, kept, wish)
        for instance in depsgraph.object_instances:
            if _is_seen(instance, shown):
                reader.add(instance)
    reader.check_found(objects)
    check_tones(wish, [(body.tone, owner) for body, owner in reader.drawn])
    return Reading(
        [body for body, _ in reader.drawn] + reader.hiding, [owner for _, owner in reader.drawn]
    )


#: A surface, its field and its tone.
_Read = tuple[Surface, RosyField | None, SurfaceTone | None]


class _Reader:
    """Collects bodies; one surface and one field an evaluated mesh, however many instances."""

    def __init__(
        self,
        stored: dict[bpy.types.Object, Stored],
        undefined: str,
        kept: Kept,
        wish: ToneWish | None,
    ) -> None:
        self.stored = stored
        self.undefined = undefined
        self.kept = kept
        self.wish = wish
        self.drawn: list[tuple[Body, bpy.types.Object]] = []
        self.hiding: list[Body] = []
        self.read: dict[tuple, _Read | None] = {}

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        thing = instance.object
        owner = thing.original
        stored = self.stored.get(owner)
        key = (thing.data.as_pointer(), owner if stored else None)
        if key not in self.read:
            self.read[key] = self._read(thing, stored)
        if self.read[key] is None:
            return
        surface, field, tone = self.read[key]
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        place = "body", id(surface), id(field), id(tone), matrix.tobytes()
        body = self.kept.find_or_make(place, lambda: Body(surface, matrix, field, tone))
        if field is None:
            self.hiding.append(body)
        else:
            self.drawn.append((body, owner))

    def _read(self, thing: bpy.types.Object, stored: Stored | None) -> _Read | None:
        with evaluated_mesh(thing) as mesh:
            if mesh is None:
                return None
            if stored is None or any(name not in mesh.attributes for name in stored.names):
                return mesh_surface(mesh, thing.name, plain=True, kept=self.kept), None, None
            owner = f"object '{thing.name}'"
            surface = mesh_surface(mesh, owner, rest=True, kept=self.kept)
            field = read_carried_field(mesh, stored, surface, self.undefined, owner, self.kept)
            tone = read_tone(mesh, thing.original, surface, self.wish, self.kept)
            return surface, field, tone

    def check_found(self, objects: Sequence[bpy.types.Object]) -> None:
        found = {owner for _, owner in self.drawn}
        seen = {key[1] for key in self.read}
        for thing in objects:
            if thing in found:
                continue
            if thing not in seen:
                raise RosyError(f"object '{thing.name}' has a field, but is hidden in the viewport")
            faceless = all(value is None for key, value in self.read.items() if key[1] == thing)
            what = "has no faces" if faceless else f"has lost attribute '{self.stored[thing].name}'"
            raise RosyError(
                f"object '{thing.name}': after its modifiers "
                f"({', '.join(modifier.name for modifier in own_modifiers(thing)) or 'none'}) "
                f"the mesh {what}"
            )


def own_modifiers(thing: bpy.types.Object) -> list[bpy.types.Modifier]:
    """The user's modifiers: all but those that RoSy put there."""
    return [modifier for modifier in thing.modifiers if not is_rosy_modifier(modifier)]


def is_rosy_modifier(modifier: bpy.types.Modifier) -> bool:
    """Whether RoSy put it there."""
    group = getattr(modifier, "node_group", None) if modifier.type == "NODES" else None
    return group is not None and bool(group.get(MADE))


@contextmanager
def prepared(
    depsgraph: bpy.types.Depsgraph,
    objects: Sequence[bpy.types.Object],
    undefined: str,
    kept: Kept,
) -> Iterator[dict[bpy.types.Object, Stored]]:
    """Have Blender carry what a field needs through the modifiers, and take it away afterwards.

    Held open over many readings, it is done but once.

    These are undeformed positions, the normals of the faces on which vectors were given, and
    vectors where the field is stored in another way. Yields how each object's field is found in its
    evaluated mesh. All fields are checked on the meshes without modifiers.
    """
    stored: dict[bpy.types.Object, Stored] = {}
    switched: list[bpy.types.Object] = []
    lent: list[bpy.types.Mesh] = []
    try:
        for thing in objects:
            mesh = thing.data
            stored[thing] = _checked(thing, undefined, lent, kept)
            deforms = bool(own_modifiers(thing) or mesh.shape_keys)
            if deforms and is_editable(thing) and not thing.add_rest_position_attribute:
                thing.add_rest_position_attribute = True
                switched.append(thing)
            if deforms and FACE_NORMAL not in mesh.attributes and _may_lend(mesh):
                lent.append(mesh)
                surface = mesh_surface(mesh, f"object '{thing.name}'", kept=kept)
                lend_vectors(mesh, FACE_NORMAL, surface.face_normal)
        if switched or lent:
            depsgraph.update()
        yield stored
    finally:
        for thing in switched:
            thing.add_rest_position_attribute = False
        for mesh in set(lent):
            borrowed = [
                a.name for a in mesh.attributes if a.name.startswith((FACE_NORMAL, STAND_IN))
            ]
            for name in borrowed:
                mesh.attributes.remove(mesh.attributes[name])
            mesh.update_tag()
        if switched or lent:
            depsgraph.update()


def _checked(
    thing: bpy.types.Object, undefined: str, lent: list[bpy.types.Mesh], kept: Kept
) -> Stored:
    """How an object's field is stored as vectors on faces, lent to its mesh if it is not yet."""
    mesh, owner = thing.data, f"object '{thing.name}'"
    name = attribute_name(mesh)
    if mesh.is_editmode and is_native(mesh):
        return Stored(name, field_degree(mesh))  # only its evaluated mesh can be read
    field = read_mesh_field(mesh, undefined=undefined, owner=owner, kept=kept)
    if is_native(mesh):
        return Stored(name, field.degree)
    if not _may_lend(mesh):
        raise RosyError(
            f"{owner}: its mesh is {'in edit mode' if mesh.is_editmode else 'linked'}; there its "
            "field can be read only as vectors on faces"
        )
    if STAND_IN not in mesh.attributes:
        lent.append(mesh)
        return lend_field(mesh, field, STAND_IN)
    return Stored(STAND_IN, field.degree, field.deviations is not None, field.families)


def _may_lend(mesh: bpy.types.Mesh) -> bool:
    return is_editable(mesh) and not mesh.is_editmode


def _is_seen(instance: bpy.types.DepsgraphObjectInstance, shown: set[bpy.types.Object]) -> bool:
    """Whether a render shows this."""
    thing = instance.object
    # Curves, texts, surfaces and metaballs come with their meshes as instances of their own.
    if thing.type != "MESH" or not instance.show_self or not thing.visible_camera:
        return False
    if thing.original.get(MADE):  # Geometry Nodes may have made a mesh of strokes
        return False
    if instance.is_instance:
        by = instance.parent
        return not thing.original.hide_render and (by is None or by.original in shown)
    return thing.original in shown


def is_included(thing: bpy.types.Object) -> bool:
    """Whether an object's field is to be drawn."""
    return thing.rosy.include if has_properties() else True


def _shown_objects(view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Original objects that renders of a view layer show, directly or in instanced collections."""
    found: dict[bpy.types.Object, None] = {}

    def add(thing: bpy.types.Object) -> None:
        if thing.hide_render or thing in found:
            return
        found[thing] = None
        if thing.instance_type == "COLLECTION" and thing.instance_collection is not None:
            for inner in thing.instance_collection.all_objects:
                add(inner)

    def walk(layer: bpy.types.LayerCollection) -> None:
        if layer.exclude or layer.collection.hide_render:
            return
        for thing in layer.collection.objects:
            add(thing)
        for child in layer.children:
            walk(child)

    walk(view_layer.layer_collection)
    return list(found)


def _named(name: str, found: dict[str, bpy.types.Object]) -> bpy.types.Object:
    if name in found:
        return found[name]
    thing = bpy.data.objects.get(name)
    if thing is None:
        raise RosyError(f"there is no object '{name}'")
    if thing.type != "MESH":
        raise RosyError(f"object '{name}' is a {thing.type.lower()}, not a mesh")
    if not has_field(thing):
        wanted = attribute_name(thing.data)
        raise RosyError(
            f"object '{name}' has no attribute '{wanted}'; degree {field_degree(thing.data)} and "
            "a vector on faces are wanted: make or import a field first"
        )
    raise RosyError(f"object '{name}' is hidden in renders of this view layer, or switched off")
