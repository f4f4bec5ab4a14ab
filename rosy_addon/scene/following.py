"""The RoSy objects of a view layer, read again and again: what has not changed is not read twice.

For a live view. In contrast to `bodies.read_scene`, the evaluated meshes are read as they are at any
moment, also while Blender draws, when nothing may be changed. Where modifiers only deform, the
original mesh has the undeformed positions and the field; where they make other faces, both are found
once, by `Follower.learn`, and last as long as the faces do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import bpy
import numpy as np

from ..errors import RosyError
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..projection.gbuffer import Body
from ..projection.tone import SurfaceTone
from ..reuse import Kept, digest
from .attributes import (
    Stored,
    attribute_name,
    field_degree,
    has_field,
    is_native,
    read_carried_field,
    read_mesh_field,
)
from .bodies import is_included, own_modifiers, prepared
from .meshes import evaluated_mesh, mesh_surface
from .tones import ToneWish, image_key, read_tone


@dataclass(frozen=True, eq=False)
class Followed:
    """One instance of a RoSy object, or of what hides them.

    Attributes
    ----------
    body : Body
    owner : bpy.types.Object
        The original object.
    shown_by : bpy.types.Object
        The original object whose visibility in a view is that of this instance.
    number : int
        Another one for everything that looks different.
    """

    body: Body
    owner: bpy.types.Object
    shown_by: bpy.types.Object
    number: int


@dataclass(frozen=True, eq=False)
class _Learned:
    """What is known of an evaluated mesh with faces of its own."""

    topology: bytes
    rest: np.ndarray | None
    field: RosyField


@dataclass(frozen=True, eq=False)
class _Read:
    """An evaluated mesh as it was read last."""

    surface: Surface
    field: RosyField | None
    tone: SurfaceTone | None = None


class Follower:
    """What is known of the RoSy objects of one view layer, from one reading to the next.

    Attributes
    ----------
    errors : dict of str to str
        Why an object's field is not drawn, by the object's name.
    """

    def __init__(self) -> None:
        self.errors: dict[str, str] = {}
        self._kept = Kept()
        self._learned: dict[str, _Learned] = {}
        self._read: dict[tuple[str, int, tuple], _Read] = {}
        self._unknown: set[str] = set()
        self._bodies: dict[tuple, tuple[Body, int]] = {}
        self._count = 0
        self._wish: ToneWish | None = None

    def forget(self, names: set[str] | None = None, *, faces: bool = True) -> None:
        """Read again: the objects of some names, or all.

        Parameters
        ----------
        names : set of str, optional
        faces : bool
            Whether their faces or fields may have changed, not only where the vertices are.
        """
        for key in [key for key in self._read if names is None or key[0] in names]:
            del self._read[key]
        if faces:
            for name in [name for name in self._learned if names is None or name in names]:
                del self._learned[name]

    def read(
        self,
        depsgraph: bpy.types.Depsgraph,
        undefined: str = "error",
        *,
        others: bool = False,
        wish: ToneWish | None = None,
    ) -> list[Followed]:
        """All instances of RoSy objects, as they are now.

        Those that have to be learned first, or cannot be read, are left out; see `is_behind` and
        `errors`. Nothing is changed in the file.

        Parameters
        ----------
        depsgraph : bpy.types.Depsgraph
        undefined : {"error", "zero"}
            What to do about vectors that are not finite.
        others : bool
            Whether to read all that hides them as well.
        wish : ToneWish, optional
            The tones that they are to have of their own.
        """
        if wish != self._wish:
            self._read.clear()
            self._wish = wish
        self.errors.clear()
        self._unknown.clear()
        found: list[Followed] = []
        bodies: dict[tuple, tuple[Body, int]] = {}
        for instance in depsgraph.object_instances:
            thing = instance.object
            if thing.type != "MESH" or not instance.show_self:
                continue
            owner = thing.original
            drawn = has_field(owner) and is_included(owner)
            if not drawn and not others:
                continue
            read = self._of(thing, owner, undefined, drawn)
            if read is None:
                continue
            by = instance.parent.original if instance.is_instance and instance.parent else owner
            matrix = np.array(instance.matrix_world, dtype=np.float64)
            place = id(read.surface), id(read.field), id(read.tone), matrix.tobytes()
            if place not in bodies:
                bodies[place] = self._body(place, read, matrix)
            found.append(Followed(bodies[place][0], owner, by, bodies[place][1]))
        # Until now the last ones had to be alive, for their numbers to be their own.
        self._bodies = bodies
        self._kept.trim()
        return found

    def _body(self, place: tuple, read: _Read, matrix: np.ndarray) -> tuple[Body, int]:
        """The body of the last reading that is the same, or a new one."""
        if place in self._bodies:
            return self._bodies[place]
        self._count += 1
        return Body(read.surface, matrix, read.field, read.tone), self._count

    @property
    def is_behind(self) -> bool:
        """Whether `learn` has something to find out."""
        return bool(self._unknown)

    def learn(self, depsgraph: bpy.types.Depsgraph, undefined: str = "error") -> None:
        """Find the undeformed positions and fields of meshes with faces of their own.

        Not while Blender draws: what that takes is lent to the meshes meanwhile.
        """
        names, self._unknown = set(self._unknown), set()
        for name in names:
            thing = depsgraph.view_layer.objects.get(name) or bpy.data.objects.get(name)
            if thing is None:
                continue
            try:
                with prepared(depsgraph, [thing], undefined, self._kept) as stored:
                    self._learned[name] = self._find(depsgraph, thing, stored[thing], undefined)
            except RosyError as error:
                self.errors[name] = str(error)

    def _of(
        self, thing: bpy.types.Object, owner: bpy.types.Object, undefined: str, drawn: bool
    ) -> _Read | None:
        """An evaluated object's surface and field; None if they cannot be had now."""
        name = owner.name
        key = name, thing.data.as_pointer(), image_key(owner, self._wish)
        if key in self._read:
            return self._read[key]
        if name in self.errors or name in self._unknown:
            return None
        try:
            found = self._evaluated(thing, owner, undefined) if drawn else self._plain(thing)
        except RosyError as error:
            self.errors[name] = str(error)
            return None
        if found is not None:
            self._read[key] = found
        return found

    def _plain(self, thing: bpy.types.Object) -> _Read | None:
        """What only hides others."""
        with evaluated_mesh(thing) as mesh:
            if mesh is None:
                return None
            return _Read(mesh_surface(mesh, thing.name, plain=True, kept=self._kept), None)

    def _evaluated(
        self, thing: bpy.types.Object, owner: bpy.types.Object, undefined: str
    ) -> _Read | None:
        label = f"object '{owner.name}'"
        original = owner.data
        with evaluated_mesh(thing) as mesh:
            if mesh is None:
                return None
            surface = mesh_surface(mesh, label, kept=self._kept)
            tone = read_tone(mesh, owner, surface, self._wish, self._kept)
            if original.is_editmode:
                edited = self._edited(mesh, original, surface, undefined, label)
                return _Read(surface, edited, tone)
            given = mesh_surface(original, label, kept=self._kept)
            if _same_faces(surface, given):
                field = self._given(original, given, undefined, label)
                deformed = bool(own_modifiers(owner) or original.shape_keys)
                placed = _at_rest(surface, given.vertices) if deformed else surface
                return _Read(placed, field, tone)
        learned = self._learned.get(owner.name)
        if learned is None or learned.topology != _topology(surface):
            self._unknown.add(owner.name)
            return None
        return _Read(_at_rest(surface, learned.rest), learned.field, tone)

    def _given(
        self, mesh: bpy.types.Mesh, surface: Surface, undefined: str, label: str
    ) -> RosyField:
        """The field of a mesh without modifiers; one that was shaped after the field was made, too."""
        if is_native(mesh):
            stored = Stored(attribute_name(mesh), field_degree(mesh))
            return read_carried_field(mesh, stored, surface, undefined, label, self._kept)
        return read_mesh_field(
            mesh, undefined=undefined, owner=label, surface=surface, kept=self._kept
        )

    def _edited(
        self,
        mesh: bpy.types.Mesh,
        original: bpy.types.Mesh,
        surface: Surface,
        undefined: str,
        label: str,
    ) -> RosyField:
        """The field of a mesh in edit mode, of which only the evaluated one can be read."""
        name = attribute_name(original)
        if name not in mesh.attributes or not is_native(mesh, name):
            raise RosyError(f"{label}: in edit mode its field can be read only as vectors on faces")
        stored = Stored(name, field_degree(original))
        return read_carried_field(mesh, stored, surface, undefined, label)

    def _find(
        self,
        depsgraph: bpy.types.Depsgraph,
        owner: bpy.types.Object,
        stored: Stored,
        undefined: str,
    ) -> _Learned:
        thing = owner.evaluated_get(depsgraph)
        label = f"object '{owner.name}'"
        with evaluated_mesh(thing) as mesh:
            if mesh is None or any(name not in mesh.attributes for name in stored.names):
                raise RosyError(f"{label}: after its modifiers the mesh has lost its field")
            surface = mesh_surface(mesh, label, rest=True, kept=self._kept)
            field = read_carried_field(mesh, stored, surface, undefined, label, self._kept)
        return _Learned(_topology(surface), surface.rest, field)


def _same_faces(surface: Surface, other: Surface) -> bool:
    """Whether two surfaces differ in no more than where their vertices are."""
    if len(surface.vertices) != len(other.vertices):
        return False
    return np.array_equal(surface.face_start, other.face_start) and np.array_equal(
        surface.corner_vertex, other.corner_vertex
    )


def _topology(surface: Surface) -> bytes:
    return digest(surface.corner_vertex, surface.face_start)


def _at_rest(surface: Surface, rest: np.ndarray | None) -> Surface:
    """A surface that knows where its vertices were."""
    if rest is None or np.array_equal(rest, surface.vertices):
        return surface
    return replace(surface, rest=rest)
