"""The actions of the monkey, as a table with weights: what a user can do to objects with fields.

An action is a function of a `Monkey`. If it yields, Blender handles its events in between (in a
window). An action that does not fit the current state does nothing. Actions keep no references to
datablocks across a yield, an undo or a file.
"""

from __future__ import annotations

import math
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any
from unicodedata import category

import bpy
import numpy as np
from monkey_state import EXTENSION, allowed_changes, changes, fingerprint, is_owned, leftovers, rosy

#: Names that a user, or a script, can give.
ODD_NAMES = (
    "a/b\\c", "line\nbreak\ttab", "\x01\x1b[31m", "é 日本 🙂", "x" * 200, "", " ", ".", "..", "con",
    "%s {0} {x}", "'quote\" `", "-flag", "a.001", "RoSy Camera", "rosy", "dir0", "position", "Suzanne",
)  # fmt: skip

#: Largest number of faces, vertices and objects that the monkey makes.
MAX_FACES, MAX_OBJECTS = 1500, 14


class CheckError(Exception):
    """A check has failed."""


@dataclass(frozen=True)
class Action:
    """An action, how often it is chosen, and where.

    Attributes
    ----------
    run : callable
    weight : float
    uses_rosy : bool
    bare : bool
        Whether to run it outside of the context of a 3D view, as it replaces the window's contents.
    """

    run: Callable[[Monkey], Iterator[float | None] | None]
    weight: float
    uses_rosy: bool
    bare: bool

    @property
    def name(self) -> str:
        return self.run.__name__

    def slices(self, monkey: Monkey) -> Iterator[Any]:
        """Run the action; yield where Blender may handle events."""
        work = self.run(monkey)
        if work is not None:
            yield from work


ACTIONS: list[Action] = []


def action(weight: float = 1.0, *, uses_rosy: bool = False, bare: bool = False) -> Callable:
    """Add a function to the table of actions."""

    def add(run: Callable) -> Callable:
        ACTIONS.append(Action(run, weight, uses_rosy, bare))
        return run

    return add


class Monkey:
    """The random choices of one step, and how operators are called and checked.

    Attributes
    ----------
    random : Random
        Of the current step, so that steps do not depend on the choices within earlier ones.
    folder : Path
        Where files go.
    window : bool
        Whether there is a window.
    uses_rosy : bool
        False for Blender's own actions alone.
    note : callable
        Prints what an action does.
    outcomes : Counter
        How often each operator of RoSy's did something, and how often it failed.
    """

    def __init__(self, folder: Path, window: bool, uses_rosy: bool, note: Callable) -> None:
        self.folder, self.window, self.uses_rosy, self.note = folder, window, uses_rosy, note
        self.random = Random()
        self.outcomes: Counter[tuple[str, str]] = Counter()

    def chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def pick(self, items: Any) -> Any:
        """Return one of the items; None if there is none."""
        items = list(items)
        return self.random.choice(items) if items else None

    def name(self) -> str:
        return self.pick(ODD_NAMES)

    def blender(self, operator: str, **settings: Any) -> bool:
        """Call an operator of Blender's. Return whether it did something."""
        module, name = operator.split(".")
        function = getattr(getattr(bpy.ops, module), name)
        if not function.poll():
            return False
        try:
            return function("EXEC_DEFAULT", **settings) == {"FINISHED"}
        except RuntimeError:
            return False

    def rosy(
        self,
        operator: str,
        *,
        attribute: str | None = None,
        invoke: bool = False,
        **settings: Any,
    ) -> set[str]:
        """Call an operator of RoSy's, and check its errors and what it changes."""
        function = getattr(bpy.ops.rosy, operator)
        if attribute is not None:
            settings["attribute"] = attribute
        self.note(f"rosy.{operator} {settings}")
        allowed = allowed_changes(operator, attribute)
        before = fingerprint()
        error = None
        try:
            result = function("INVOKE_DEFAULT" if invoke else "EXEC_DEFAULT", True, **settings)
        except RuntimeError as raised:
            error, result = str(raised), {"CANCELLED"}
            check_message(error)
            self.note(f"    {error.strip()}")
        self.outcomes[operator, "failed" if error else "did"] += 1
        if result == {"RUNNING_MODAL"}:
            return result
        if differences := changes(before, fingerprint(), () if error else allowed):
            verb = f"failed ({error.strip()}), but changed" if error else "changed"
            raise CheckError(f"rosy.{operator} {verb} " + "; ".join(differences[:8]))
        return result

    def task(self, make_task: Callable[[], Any], what: str) -> None:
        """Run a task of RoSy's for some steps, cancel it, and check that nothing has changed."""
        steps = self.pick([0, 1, 1, 2, 3, 5, 8, 15, 40])
        self.note(f"cancel {what} after {steps} steps")
        before = fingerprint()
        error_class = rosy("rosy_addon.errors").RosyError
        try:
            task = make_task()
            try:
                for _ in range(steps):
                    next(task)
            finally:
                task.close()
        except StopIteration:
            return
        except error_class as error:
            check_message(f"Error: {error}\n")
        if differences := changes(before, fingerprint()):
            raise CheckError(f"{what}, cancelled, changed " + "; ".join(differences[:8]))


def check_message(message: str) -> None:
    """Check that the text of a RuntimeError is one clear line."""
    lines = message.strip().splitlines()
    if len(lines) != 1 or "Traceback" in message or not message.startswith(("Error: ", "Operator")):
        raise CheckError(f"the error is not one line: {message!r}")
    if any(category(character) == "Cc" for character in lines[0]):
        raise CheckError(f"the error has control characters: {message!r}")


def push_undo(name: str) -> None:
    """Add an undo step, as each of Blender's own actions does.

    Blender crashes if an undo meets datablocks that were deleted without one.
    """
    bpy.ops.ed.undo_push(message=name)


# --- choices -----------------------------------------------------------------------------------


def meshes(monkey: Monkey, *, editable: bool = True) -> list[bpy.types.Object]:
    """Return the mesh objects of the view layer that are not RoSy's."""
    return [
        obj
        for obj in objects(monkey)
        if obj.type == "MESH" and not is_owned(obj) and (obj.data.library is None or not editable)
    ]


def objects(monkey: Monkey) -> list[bpy.types.Object]:
    """Return the objects of the view layer. Blender lists None for some that were deleted."""
    return [obj for obj in bpy.context.view_layer.objects if obj is not None]


def select(monkey: Monkey, obj: bpy.types.Object, *others: bpy.types.Object) -> bool:
    """Make objects the selection. Return whether that was possible."""
    if bpy.context.mode != "OBJECT" and not monkey.blender("object.mode_set", mode="OBJECT"):
        return False
    for other in objects(monkey):
        other.select_set(False)
    for other in (obj, *others):
        other.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj.select_get()


def select_mesh(monkey: Monkey, **options: Any) -> bpy.types.Object | None:
    """Select a mesh object, and sometimes more. Return the active one."""
    candidates = meshes(monkey, **options)
    obj = monkey.pick(candidates)
    if obj is None:
        return None
    others = [other for other in candidates if monkey.chance(0.15)]
    return obj if select(monkey, obj, *others) else None


def to_object_mode(monkey: Monkey) -> bool:
    return bpy.context.mode == "OBJECT" or monkey.blender("object.mode_set", mode="OBJECT")


def is_small(mesh: bpy.types.Mesh, factor: int = 1) -> bool:
    return len(mesh.polygons) * factor <= MAX_FACES and len(mesh.vertices) * factor <= MAX_FACES


# --- Blender: objects --------------------------------------------------------------------------


@action(4)
def add_mesh(monkey):
    if len(bpy.data.objects) >= MAX_OBJECTS or not to_object_mode(monkey):
        return
    location = [monkey.random.uniform(-1.5, 1.5) for _ in range(3)]
    kind, settings = monkey.pick(
        [
            ("monkey", {}),
            ("cube", {}),
            ("plane", {}),
            ("uv_sphere", {"segments": 12, "ring_count": 8}),
            ("ico_sphere", {"subdivisions": 2}),
            ("torus", {"major_segments": 16, "minor_segments": 8}),
            ("grid", {"x_subdivisions": 8, "y_subdivisions": 6}),
            ("circle", {}),
            ("cone", {"vertices": 9}),
        ]
    )
    monkey.blender(f"mesh.primitive_{kind}_add", location=location, **settings)


@action(1)
def add_other(monkey):
    if len(bpy.data.objects) >= MAX_OBJECTS or not to_object_mode(monkey):
        return
    kind = monkey.pick(["light", "empty", "armature", "text", "metaball"])
    settings = {"light": {"type": monkey.pick(["SUN", "POINT", "SPOT", "AREA"])}}.get(kind, {})
    monkey.blender(f"object.{kind}_add", **settings)


@action(2)
def add_guide(monkey):
    """Add a curve, hair curves, an empty or Grease Pencil, and select it with a mesh."""
    obj = select_mesh(monkey)
    if obj is None or len(bpy.data.objects) >= MAX_OBJECTS:
        return
    kind = monkey.pick(["curve.primitive_bezier_curve_add", "object.empty_add",
                        "object.grease_pencil_add", "curve.primitive_nurbs_path_add",
                        "object.curves_empty_hair_add"])  # fmt: skip
    mesh_name = obj.name
    monkey.blender(kind, location=obj.matrix_world.translation)
    obj = bpy.data.objects.get(mesh_name)
    if obj is not None and obj.name in bpy.context.view_layer.objects:
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj


@action(3)
def select_some(monkey):
    for obj in objects(monkey):
        obj.select_set(monkey.chance(0.4))
    if monkey.chance(0.1):
        bpy.context.view_layer.objects.active = None
    elif monkey.chance(0.7):
        bpy.context.view_layer.objects.active = monkey.pick(objects(monkey))


@action(3)
def transform(monkey):
    obj = monkey.pick(objects(monkey))
    if obj is None or obj.library is not None:
        return
    what = monkey.pick(["location", "rotation_euler", "scale"])
    if what == "scale":
        values = [
            monkey.pick([0.0, -1.0, 1e6, 1e-6, 1.0, 1.0, 1.0, 2.0, monkey.random.random()])
            for _ in range(3)
        ]
        if monkey.chance(0.5):
            values = [1.0, 1.0, 1.0]
        obj.scale = values
    elif what == "location":
        size = monkey.pick([1.0, 1.0, 1.0, 1e6])
        obj.location = [size * monkey.random.uniform(-1, 1) for _ in range(3)]
    else:
        obj.rotation_euler = [monkey.random.uniform(-7, 7) for _ in range(3)]


@action(1)
def apply_transform(monkey):
    if select_mesh(monkey):
        monkey.blender("object.transform_apply")


@action(2)
def duplicate(monkey):
    if len(bpy.data.objects) < MAX_OBJECTS and select_mesh(monkey, editable=False):
        monkey.blender("object.duplicate", linked=monkey.chance(0.5))


@action(1)
def duplicate_anything(monkey):
    obj = monkey.pick(objects(monkey))
    if obj is not None and len(bpy.data.objects) < MAX_OBJECTS and select(monkey, obj):
        monkey.blender("object.duplicate", linked=monkey.chance(0.5))


@action(1)
def join(monkey):
    candidates = meshes(monkey)
    if len(candidates) > 4:
        first, second = monkey.random.sample(candidates, 2)
        if is_small(first.data, 2) and is_small(second.data, 2) and select(monkey, first, second):
            monkey.blender("object.join")


@action(2)
def delete(monkey):
    obj = monkey.pick(objects(monkey))
    if obj is not None and select(monkey, obj):
        monkey.blender("object.delete", use_global=monkey.chance(0.3))


@action(0.5)
def delete_data(monkey):
    """Delete a datablock of any kind behind everyone's back."""
    collections = (bpy.data.meshes, bpy.data.cameras, bpy.data.images, bpy.data.materials,
                   bpy.data.node_groups, bpy.data.objects, bpy.data.curves, bpy.data.worlds)  # fmt: skip
    collection = monkey.pick(collections)
    datablock = monkey.pick(collection)
    if datablock is not None and to_object_mode(monkey):
        monkey.note(f"delete {datablock!r}")
        collection.remove(datablock)


@action(1)
def delete_of_rosys(monkey):
    """Delete something that RoSy made, as the outliner does."""
    owned = [(c, block) for c in (bpy.data.images, bpy.data.materials, bpy.data.node_groups,
             bpy.data.objects, bpy.data.meshes, bpy.data.texts) for block in c if is_owned(block)]  # fmt: skip
    chosen = monkey.pick(owned)
    if chosen is not None and to_object_mode(monkey):
        monkey.note(f"delete {chosen[1]!r}")
        chosen[0].remove(chosen[1])


@action(0.7)
def rename_of_rosys(monkey):
    owned = [block for c in (bpy.data.images, bpy.data.materials, bpy.data.node_groups,
             bpy.data.objects) for block in c if is_owned(block)]  # fmt: skip
    block = monkey.pick(owned)
    if block is not None and block.library is None:
        block.name = monkey.name()


@action(1)
def edit_of_rosys(monkey):
    """Change a node tree, image or modifier that RoSy made."""
    material = monkey.pick([m for m in bpy.data.materials if is_owned(m) and m.node_tree])
    group = monkey.pick([group for group in bpy.data.node_groups if is_owned(group)])
    image = monkey.pick([image for image in bpy.data.images if is_owned(image)])
    what = monkey.pick(["node", "group node", "image", "fake user", "tag"])
    if what == "node" and material and material.node_tree.nodes:
        material.node_tree.nodes.remove(monkey.pick(material.node_tree.nodes))
    elif what == "group node" and group and group.nodes:
        group.nodes.remove(monkey.pick(group.nodes))
    elif what == "image" and image:
        image.reload()
    elif what == "fake user" and image:
        image.use_fake_user = True
    elif what == "tag" and material:
        material.use_fake_user = True


@action(2)
def rename(monkey):
    block = monkey.pick(
        [*bpy.data.objects, *bpy.data.meshes, *bpy.data.cameras, *bpy.data.scenes,
         *bpy.data.collections, *bpy.data.materials]
    )  # fmt: skip
    if block is not None and block.library is None:
        block.name = monkey.name()


@action(2)
def hide(monkey):
    obj = monkey.pick(objects(monkey))
    if obj is None or obj.library is not None:
        return
    what = monkey.pick(["hide_render", "hide_viewport", "hide_set", "visible_camera", "show"])
    if what == "hide_set":
        obj.hide_set(monkey.chance(0.5))
    elif what == "show":
        for other in objects(monkey):
            if other.library is None:
                other.hide_render = other.hide_viewport = False
                other.visible_camera = True
                other.hide_set(False)
    else:
        setattr(obj, what, monkey.chance(0.5))


@action(1)
def parent(monkey):
    candidates = objects(monkey)
    if len(candidates) < 2:
        return
    child, top = monkey.random.sample(candidates, 2)
    if select(monkey, top, child):
        if monkey.chance(0.3):
            monkey.blender("object.parent_clear", type="CLEAR_KEEP_TRANSFORM")
        else:
            monkey.blender("object.parent_set", type="OBJECT", keep_transform=monkey.chance(0.5))


@action(1)
def collections(monkey):
    obj = monkey.pick(objects(monkey))
    scene = bpy.context.scene
    if obj is None or not to_object_mode(monkey):
        return
    what = monkey.pick(["new", "instance", "exclude", "hide", "show"])
    if what == "new" and len(bpy.data.collections) < 6:
        collection = bpy.data.collections.new(monkey.name())
        scene.collection.children.link(collection)
        collection.objects.link(obj)
    elif what == "instance" and len(bpy.data.objects) < MAX_OBJECTS:
        empty = bpy.data.objects.new("Instance", None)
        collection = monkey.pick(bpy.data.collections)
        if collection is not None:
            scene.collection.objects.link(empty)
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
            empty.location.x = 2.0
    else:
        child = monkey.pick(bpy.context.view_layer.layer_collection.children)
        if child is not None:
            child.exclude = what == "exclude"
            child.collection.hide_render = what == "hide"


# --- Blender: meshes ---------------------------------------------------------------------------


@action(3)
def edit_mode(monkey):
    if bpy.context.mode == "OBJECT":
        if select_mesh(monkey):
            mode = monkey.pick(["EDIT"] * 5 + ["SCULPT", "VERTEX_PAINT", "WEIGHT_PAINT"])
            monkey.blender("object.mode_set", mode=mode)
    else:
        monkey.blender("object.mode_set", mode="OBJECT")


@action(5)
def edit_mesh(monkey):
    """Change the faces of a mesh in edit mode, and leave it, mostly."""
    if bpy.context.mode != "EDIT_MESH":
        if select_mesh(monkey) is None:
            return
        if not monkey.blender("object.mode_set", mode="EDIT"):
            return
    mesh = bpy.context.edit_object.data
    monkey.blender("mesh.select_all", action="DESELECT")
    monkey.blender("mesh.select_mode", type=monkey.pick(["VERT", "EDGE", "FACE"]))
    ratio = monkey.pick([0.1, 0.3, 0.5, 1.0])
    monkey.blender("mesh.select_random", ratio=ratio, seed=monkey.random.randrange(1000))
    operator, settings = monkey.pick(
        [
            ("mesh.delete", {"type": monkey.pick(["VERT", "EDGE", "FACE", "ONLY_FACE"])}),
            ("mesh.dissolve_faces", {}),
            ("mesh.dissolve_limited", {}),
            ("mesh.subdivide", {}),
            ("mesh.quads_convert_to_tris", {}),
            ("mesh.tris_convert_to_quads", {}),
            ("mesh.flip_normals", {}),
            ("mesh.merge", {"type": "CENTER"}),
            ("mesh.extrude_region_move", {}),
            ("mesh.mark_sharp", {}),
            ("mesh.mark_seam", {}),
            ("mesh.vertices_smooth", {}),
            ("mesh.remove_doubles", {"threshold": 0.3}),
            ("mesh.separate", {"type": "SELECTED"}),
            ("transform.translate", {"value": (0.1, -0.2, 0.3)}),
            ("transform.resize", {"value": (1.1, 0.8, 0.0)}),
        ]
    )
    grows = operator in ("mesh.subdivide", "mesh.extrude_region_move")
    if (not grows or is_small(mesh, 4)) and len(bpy.data.objects) < MAX_OBJECTS:
        monkey.blender(operator, **settings)
    if monkey.chance(0.8):
        monkey.blender("object.mode_set", mode="OBJECT")


@action(1)
def clear_mesh(monkey):
    obj = select_mesh(monkey)
    if obj is not None and obj.data.shape_keys is None and monkey.chance(0.5):
        obj.data.clear_geometry()


@action(4)
def add_modifier(monkey):
    obj = select_mesh(monkey)
    if obj is None or len(obj.modifiers) >= 4 or obj.library is not None:
        return
    kinds = ["SUBSURF", "MIRROR", "ARRAY", "ARMATURE", "TRIANGULATE", "DECIMATE", "SOLIDIFY",
             "SIMPLE_DEFORM", "WELD", "BEVEL", "REMESH", "NODES", "DISPLACE", "WIREFRAME", "MASK"]  # fmt: skip
    kind = monkey.pick(kinds)
    if not is_small(obj.data, 8 if kind in ("SUBSURF", "ARRAY", "BEVEL", "WIREFRAME") else 3):
        return
    modifier = obj.modifiers.new(monkey.pick([kind.title(), monkey.name()]), kind)
    if kind == "SUBSURF":
        modifier.levels = modifier.render_levels = 1
    elif kind == "ARMATURE":
        modifier.object = monkey.pick([o for o in bpy.data.objects if o.type == "ARMATURE"])
    elif kind == "DECIMATE":
        modifier.ratio = monkey.pick([0.0, 0.3, 0.7])
    elif kind == "REMESH":
        modifier.mode, modifier.octree_depth = "BLOCKS", 2
    modifier.show_viewport = monkey.chance(0.9)


@action(2)
def change_modifiers(monkey):
    obj = select_mesh(monkey)
    if obj is None or obj.library is not None or not obj.modifiers:
        return
    modifier = monkey.pick(obj.modifiers)
    what = monkey.pick(["apply", "remove", "move", "toggle"])
    grows = modifier.type in ("SUBSURF", "ARRAY", "REMESH", "WIREFRAME", "BEVEL")
    if what == "apply" and is_small(obj.data, 6 if grows else 2):
        monkey.blender("object.modifier_apply", modifier=modifier.name)
    elif what == "remove":
        obj.modifiers.remove(modifier)
    elif what == "move":
        monkey.blender("object.modifier_move_to_index", modifier=modifier.name, index=0)
    else:
        modifier.show_viewport = not modifier.show_viewport


@action(1.5)
def shape_keys(monkey):
    obj = select_mesh(monkey)
    if obj is None or obj.library is not None:
        return
    if obj.data.shape_keys is None or monkey.chance(0.4):
        monkey.blender("object.shape_key_add", from_mix=False)
    elif monkey.chance(0.3):
        monkey.blender("object.shape_key_remove", all=monkey.chance(0.5))
    keys = obj.data.shape_keys
    if keys is not None and len(keys.key_blocks) > 1:
        block = keys.key_blocks[-1]
        block.value = monkey.random.random()
        for index in range(0, len(block.data), 5):
            block.data[index].co.z += 0.2


@action(1)
def materials(monkey):
    obj = select_mesh(monkey)
    if obj is None:
        return
    if monkey.chance(0.3) and obj.data.materials:
        obj.data.materials.pop(index=0)
    elif len(bpy.data.materials) < 8:
        obj.data.materials.append(monkey.pick([bpy.data.materials.new(monkey.name()), None]))


@action(4)
def attributes(monkey):
    """Change the attributes of a mesh behind RoSy's back."""
    obj = select_mesh(monkey)
    if obj is None or obj.data.shape_keys is not None:
        return
    mesh = obj.data
    custom = [a.name for a in mesh.attributes if not a.is_required and not a.is_internal]
    what = monkey.pick(["remove", "remove", "convert", "add", "fill", "fill", "rename", "weights"])
    if what == "remove" and custom:
        mesh.attributes.remove(mesh.attributes[monkey.pick(custom)])
    elif what == "convert" and custom:
        mesh.attributes.active = mesh.attributes[monkey.pick(custom)]
        kind, domain = monkey.pick([("FLOAT_VECTOR", "POINT"), ("FLOAT_VECTOR", "CORNER"),
                                    ("FLOAT_VECTOR", "FACE"), ("FLOAT", "FACE"), ("INT", "EDGE"),
                                    ("FLOAT_COLOR", "CORNER"), ("BYTE_COLOR", "POINT")])  # fmt: skip
        monkey.blender("geometry.attribute_convert", domain=domain, data_type=kind)
    elif what == "add" and len(custom) < 12:
        name = monkey.pick(["rosy", "rosy", "dir0", "dir1", "rosy_angle", monkey.name() or "a"])
        kind = monkey.pick(["FLOAT_VECTOR", "FLOAT", "INT", "BOOLEAN", "FLOAT_COLOR"])
        if name not in mesh.attributes:
            mesh.attributes.new(name, kind, monkey.pick(["FACE", "POINT", "CORNER", "EDGE"]))
    elif what == "fill":
        vectors = [n for n in custom if mesh.attributes[n].data_type == "FLOAT_VECTOR"]
        if vectors:
            data = mesh.attributes[monkey.pick(vectors)].data
            values = np.full(
                3 * len(data), monkey.pick([0.0, 1.0, 1e30, math.nan, math.inf, 1e-30])
            )
            if monkey.chance(0.5):
                old = np.empty(3 * len(data), dtype=np.float32)
                data.foreach_get("vector", old)
                values[7:] = old[7:]
            data.foreach_set("vector", values.astype(np.float32))
            mesh.update()
    elif what == "rename" and custom:
        mesh.attributes[monkey.pick(custom)].name = monkey.name() or "b"
    elif what == "weights":
        if mesh.is_editmode:
            return
        group = obj.vertex_groups.new(name="Weights")
        group.add(list(range(0, len(mesh.vertices), 2)), monkey.random.random(), "REPLACE")


# --- Blender: scenes, cameras, files -----------------------------------------------------------


@action(4)
def camera(monkey):
    """Add, delete or change cameras. Mostly there is one that sees something."""
    scene = bpy.context.scene
    obj = monkey.pick([obj for obj in scene.objects if obj.type == "CAMERA"])
    if obj is None or monkey.chance(0.25):
        if obj is None or len(bpy.data.cameras) < 4:
            obj = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
            scene.collection.objects.link(obj)
        angle = monkey.random.uniform(0, 2 * math.pi)
        obj.location = 6 * math.sin(angle), -6 * math.cos(angle), monkey.pick([0.0, 1.0, 3.0])
        obj.rotation_euler = math.atan2(6, obj.location.z), 0.0, angle
        scene.camera = obj
        return
    if obj.library is not None:
        return
    data = obj.data
    what = monkey.pick(
        ["type", "lens", "shift", "clip", "scale", "sensor", "delete", "none", "reset", "reset"]
    )
    if what == "type":
        data.type = monkey.pick(["PERSP", "PERSP", "ORTHO", "ORTHO", "PANO"])
        data.ortho_scale = monkey.pick([1e-3, 1.0, 6.0, 1e5])
    elif what == "lens":
        data.lens = monkey.pick([1.0, 10.0, 50.0, 250.0, 5000.0])
    elif what == "shift":
        data.shift_x, data.shift_y = monkey.random.uniform(-2, 2), monkey.random.uniform(-0.5, 0.5)
    elif what == "clip":
        data.clip_start, data.clip_end = monkey.pick([(0.1, 100), (5, 6), (1e-6, 1e6), (100, 0.1)])
    elif what == "scale":
        obj.scale = monkey.pick([(1, 1, 1), (0, 0, 0), (-1, 1, 1), (1, 1, 0)])
    elif what == "sensor":
        data.sensor_fit = monkey.pick(["AUTO", "HORIZONTAL", "VERTICAL"])
        data.sensor_width = monkey.pick([1.0, 36.0, 1e3])
    elif what == "delete":
        bpy.data.objects.remove(obj)
    elif what == "none":
        scene.camera = monkey.pick([None, *scene.objects])
    else:
        data.type, data.lens, data.shift_x, data.shift_y = "PERSP", 50.0, 0.0, 0.0
        data.clip_start, data.clip_end, data.sensor_width = 0.1, 1000.0, 36.0
        obj.scale = 1, 1, 1
        scene.camera = obj


@action(2)
def resolution(monkey):
    render = bpy.context.scene.render
    render.resolution_x = monkey.pick([4, 32, 64, 80, 96])
    render.resolution_y = monkey.pick([4, 48, 64, 80, 96])
    render.resolution_percentage = monkey.pick([1, 50, 100, 100, 100, 120])
    render.pixel_aspect_x = monkey.pick([1.0, 1.0, 1.0, 2.0, 200.0])
    render.use_border = monkey.chance(0.1)
    bpy.context.scene.view_settings.view_transform = monkey.pick(["Standard", "AgX", "Raw"])


@action(1.5)
def frame(monkey):
    scene = bpy.context.scene
    scene.frame_set(monkey.pick([-5, 0, 1, 2, 24, 100000]), subframe=monkey.pick([0.0, 0.0, 0.5]))
    obj = monkey.pick(objects(monkey))
    if obj is not None and obj.library is None and monkey.chance(0.5):
        obj.keyframe_insert("location")
    if monkey.chance(0.2):
        scene.timeline_markers.new(monkey.name(), frame=2).camera = scene.camera


@action(1.5, bare=True)
def scenes(monkey):
    """Add, remove and switch scenes and view layers."""
    window = bpy.context.window_manager.windows[0]
    what = monkey.pick(
        ["new", "switch", "switch", "remove", "layer", "switch layer", "remove layer"]
    )
    if bpy.context.mode != "OBJECT":
        return
    if what == "new" and len(bpy.data.scenes) < 3:
        kind = monkey.pick(["NEW", "EMPTY", "LINK_COPY", "FULL_COPY"])
        with bpy.context.temp_override(window=window):
            monkey.blender("scene.new", type=kind)
    elif what == "switch":
        window.scene = monkey.pick(bpy.data.scenes)
    elif what == "remove" and len(bpy.data.scenes) > 1:
        scene = monkey.pick([s for s in bpy.data.scenes if s != window.scene])
        bpy.data.scenes.remove(scene)
    elif what == "layer" and len(window.scene.view_layers) < 3:
        window.scene.view_layers.new(monkey.name() or "Layer")
    elif what == "switch layer":
        window.view_layer = monkey.pick(window.scene.view_layers)
    elif what == "remove layer" and len(window.scene.view_layers) > 1:
        layer = monkey.pick([a for a in window.scene.view_layers if a != window.view_layer])
        window.scene.view_layers.remove(layer)


@action(5)
def undo(monkey):
    for _ in range(monkey.pick([1, 1, 2, 5])):
        monkey.blender("ed.undo")
        yield
    for _ in range(monkey.pick([0, 1, 2])):
        monkey.blender("ed.redo")
        yield


@action(0.5)
def purge(monkey):
    monkey.blender("outliner.orphans_purge", do_recursive=monkey.chance(0.5))


@action(0.5, bare=True)
def new_file(monkey):
    if monkey.chance(0.2):
        bpy.ops.wm.read_factory_settings(use_empty=monkey.chance(0.5))
        if monkey.uses_rosy:
            bpy.ops.preferences.addon_enable(module=EXTENSION)
    else:
        bpy.ops.wm.read_homefile(use_empty=monkey.chance(0.7))
    yield 0.1


@action(1.5, bare=True)
def save_and_reopen(monkey):
    """Save and open the file, and check that it is the same."""
    if bpy.context.mode != "OBJECT":
        return
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    path = monkey.folder / "monkey.blend"
    before = fingerprint(pixels=True)
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=monkey.chance(0.3))
    except RuntimeError as error:
        monkey.note(f"    not saved: {error}")
        return
    bpy.ops.wm.open_mainfile(filepath=str(path))
    yield 0.1
    differences = changes(before, fingerprint(pixels=True), UNSAVED)
    if differences:
        raise CheckError("the saved file differs: " + "; ".join(differences[:8]))


#: Paths that Blender itself does not save, or reads again from libraries.
UNSAVED = ("*/tool_settings/*", "*@*.blend*")


@action(1)
def link_or_append(monkey):
    """Link or append the objects of a copy of this file."""
    if (
        len(bpy.data.objects) >= MAX_OBJECTS
        or len(bpy.data.libraries) > 2
        or not to_object_mode(monkey)
    ):
        return
    path = monkey.folder / f"library{monkey.random.randrange(3)}.blend"
    if not path.is_file():
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
        except RuntimeError:
            return
    link = monkey.chance(0.5)
    with bpy.data.libraries.load(str(path), link=link) as (there, here):
        names = [name for name in there.objects if monkey.chance(0.4)][:3]
        here.objects = names
    for obj in here.objects:
        if obj is not None and obj.name not in bpy.context.scene.objects:
            bpy.context.scene.collection.objects.link(obj)
            obj.select_set(monkey.chance(0.5))


@action(1)
def make_local(monkey):
    linked = [obj for obj in objects(monkey) if obj.library is not None]
    obj = monkey.pick(linked)
    if obj is None or not select(monkey, obj):
        return
    if monkey.chance(0.5):
        monkey.blender(
            "object.make_local", type=monkey.pick(["SELECT_OBJECT", "SELECT_OBDATA", "ALL"])
        )
    else:
        obj.override_create(remap_local_usages=True)


# --- RoSy: fields ------------------------------------------------------------------------------


def attribute_argument(monkey):
    """Return the name of the attribute. If none is given, Blender takes that of the last call."""
    return {"attribute": monkey.name() if monkey.chance(0.15) else "rosy"}


@action(9, uses_rosy=True)
def make_field(monkey):
    if monkey.chance(0.95):
        select_mesh(monkey)
    kinds = ["smoothest", "curvature", "features", "axis", "uv"]
    settings = {
        "kind": monkey.pick(kinds),
        "degree": monkey.pick([1, 2, 2, 3, 4, 4, 4, 5, 6, 7, 8, 12]),
    }
    if monkey.chance(0.3):
        settings["reach"] = monkey.pick([0.0, 0.05, 10.0])
        settings["sharp_angle"] = monkey.pick([0.0, 0.5, math.pi])
        settings["edges"] = monkey.pick(
            ["FEATURES", "SHARP", "SEAM", "CREASE", "BEVEL", "FREESTYLE"]
        )
        settings["axis"] = monkey.pick([(0, 0, 1), (0, 0, 0), (1, 1e-30, 0), (1e30, 0, 0)])
        settings["uv_map"] = monkey.pick(["", "UVMap", monkey.name()])
        items = bpy.ops.rosy.field_generate.get_rna_type().properties["edges"].enum_items.keys()
        if settings["edges"] not in items:
            settings["edges"] = monkey.pick(items)
    monkey.rosy("field_generate", **settings, **attribute_argument(monkey))


@action(3, uses_rosy=True)
def make_guided_field(monkey):
    names = [obj.name for obj in objects(monkey) if obj.type != "MESH"]
    if monkey.chance(0.7):
        guides = [bpy.data.objects[name] for name in names if monkey.chance(0.5)]
        mesh = monkey.pick(meshes(monkey))
        if mesh is not None:
            select(monkey, mesh, *guides)
    flags = [flag for flag in ("OBJECTS", "EDGES", "UV", "ATTRIBUTE") if monkey.chance(0.4)]
    monkey.rosy(
        "field_generate",
        kind="guided",
        degree=monkey.pick([1, 2, 4, 6]),
        guides=set(flags) or {"OBJECTS"},
        guide=monkey.pick(["", "", *names, monkey.name()]),
        vectors=monkey.pick(["rosy", "dir0", "position", monkey.name()]),
        reach=monkey.pick([0.0, 0.1]),
        **attribute_argument(monkey),
    )


@action(3, uses_rosy=True)
def convert_field(monkey):
    select_mesh(monkey)
    kinds = bpy.ops.rosy.field_convert.get_rna_type().properties["magnitude"].enum_items.keys()
    monkey.rosy(
        "field_convert",
        degree=monkey.pick([0, 0, 1, 2, 4, 8, 12]),
        angle=monkey.pick([0.0, 0.3, -6.0]),
        smooth=monkey.pick([0.0, 0.05, 10.0]),
        magnitude=monkey.pick(kinds),
        values=monkey.pick(["", "Weights", "rosy", "Occlusion", monkey.name()]),
    )


@action(3, uses_rosy=True)
def store_field(monkey):
    select_mesh(monkey)
    form = monkey.pick(["VECTOR", "DIRECTIONS", "ANGLE"])
    monkey.rosy("field_store", form=form, **attribute_argument(monkey))


@action(2, uses_rosy=True)
def export_and_import(monkey):
    select_mesh(monkey)
    suffix = monkey.pick([".rosy", ".rawfield", ".txt", ".npy", ".obj", ".sings"])
    path = monkey.folder / f"field{suffix}"
    items = bpy.ops.rosy.field_export.get_rna_type().properties
    settings = {}
    for prop in items:
        if prop.type == "ENUM" and suffix in prop.enum_items and not prop.is_enum_flag:
            settings[prop.identifier] = suffix
    monkey.rosy("field_export", filepath=str(path), **settings)
    if monkey.chance(0.3):
        select_mesh(monkey)
    source = monkey.pick([path, path, path, monkey.folder, monkey.folder / "none.rosy", Path("")])
    settings = {"degree": monkey.pick([0, 0, 4, 3]), **attribute_argument(monkey)}
    monkey.rosy("field_import", filepath=str(source), **settings)


@action(1.5, uses_rosy=True)
def field_name(monkey):
    obj = select_mesh(monkey)
    if obj is not None:
        obj.data.rosy.attribute = monkey.pick(
            ["rosy", "rosy", "rosy_angle", "dir0", "position", monkey.name()]
        )
        if monkey.chance(0.3):
            obj.data.rosy.degree = monkey.pick([1, 2, 3, 4, 12])


@action(1, uses_rosy=True)
def include(monkey):
    obj = select_mesh(monkey)
    if obj is not None and obj.library is None:
        obj.rosy.include = monkey.chance(0.7)


@action(2.5, uses_rosy=True)
def singularities(monkey):
    select_mesh(monkey)
    monkey.rosy("singularities", show=monkey.pick(["OVERLAY", "POINTS", "BOTH", "NONE"]))


@action(0.7, uses_rosy=True)
def occlusion(monkey):
    prepare(monkey)
    monkey.rosy("occlusion", directions=monkey.pick([1, 7, 32]))


# --- RoSy: pictures ----------------------------------------------------------------------------


def randomize(monkey, group, cls, probability):
    """Set random values of settings within their ranges."""
    description = rosy("rosy_addon.settings")
    for name, setting in description.settings_of(cls).items():
        if not monkey.chance(probability):
            continue
        if monkey.chance(0.4):
            group.property_unset(name)
        elif isinstance(setting, description.Choice):
            setattr(group, name, monkey.pick(setting.options))
        elif isinstance(setting, description.Switch):
            setattr(group, name, monkey.chance(0.5))
        elif isinstance(setting, description.Color):
            setattr(group, name, [monkey.random.random() for _ in range(3)])
        else:
            setattr(group, name, random_number(monkey, setting))


def random_number(monkey, setting):
    """Return a number within a range: an end of it, or one between, of any magnitude."""
    low, high = setting.low, setting.high
    if setting.name in ("length", "supersampling"):
        high = min(high, {"length": 120, "supersampling": 2}[setting.name])  # time
    value = monkey.random.uniform(low, high)
    if high > 1000 * max(abs(low), 1e-3):
        value = math.exp(monkey.random.uniform(math.log(max(low, 1e-3)), math.log(high)))
    value = monkey.pick([low, high, setting.default, value, value, value])
    return int(value) if setting.is_integer else value


@action(5, uses_rosy=True)
def look(monkey):
    cls = rosy("rosy_addon.compositor.look").Look
    settings = bpy.context.scene.rosy
    randomize(monkey, settings.look, cls, monkey.pick([0.05, 0.2, 0.6]))
    if monkey.chance(0.7):
        settings.look.property_unset("tone")


@action(2, uses_rosy=True)
def output(monkey):
    settings = bpy.context.scene.rosy
    settings.camera = monkey.pick(["SCENE", "SCENE", "ALL", "VIEW"])
    settings.percentage = monkey.pick([1, 50, 100, 100, 150])
    settings.placement = monkey.pick(["PROJECTION", "WINDOW"])
    settings.emission, settings.diffuse = monkey.random.random(), monkey.random.random()
    settings.store = monkey.pick(["PACKED", "PACKED", "SAVED"])
    settings.directory = monkey.pick(
        [str(monkey.folder / "pictures"), str(monkey.folder / "pictures"), "//rosy/",
         str(monkey.folder / "user" / "none" / "none"), "/proc/none", "", monkey.name()]
    )  # fmt: skip
    settings.image_format = monkey.pick(["BYTE", "FLOAT"])
    settings.undefined = monkey.chance(0.5)


@action(1, uses_rosy=True)
def tone(monkey):
    settings = bpy.context.scene.rosy
    settings.look.tone = monkey.pick(["light", "attribute", "image", "picture"])
    settings.tone_attribute = monkey.pick(["", "Occlusion", "position", "rosy", monkey.name()])
    settings.tone_picture = monkey.pick(["", str(monkey.folder / "none.png"), "//x####.png"])
    obj = select_mesh(monkey)
    if obj is not None and obj.library is None:
        obj.rosy.tone_image = monkey.pick([None, *bpy.data.images])
        obj.rosy.tone_uv_map = monkey.pick(["", "UVMap", monkey.name()])


@action(2.5, uses_rosy=True)
def look_at_a_field(monkey):
    prepare(monkey, 1.0)


def prepare(monkey, probability=0.5):
    """Make a field, and a camera that sees it, so that there is something to draw."""
    if not monkey.chance(probability):
        return
    scene = bpy.context.scene
    obj = monkey.pick([obj for obj in meshes(monkey) if len(obj.data.polygons) > 4])
    if obj is None or obj.library is not None or not select(monkey, obj):
        return
    obj.hide_render = obj.hide_viewport = False
    obj.rosy.include = obj.visible_camera = True
    obj.parent = None
    obj.location, obj.scale = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    for attribute in [a for a in obj.data.attributes if a.name in ("rosy", "dir0")]:
        obj.data.attributes.remove(attribute)
    obj.data.rosy.attribute = "rosy"
    render = scene.render
    render.resolution_x, render.resolution_y = monkey.pick([(64, 64), (96, 64), (80, 96)])
    render.resolution_percentage, render.pixel_aspect_x = 100, 1.0
    scene.rosy.percentage, scene.rosy.store, scene.rosy.look.tone = 100, "PACKED", "light"
    if monkey.chance(0.5):
        scene.rosy.directory = str(monkey.folder / "pictures")
    angle = monkey.random.uniform(0, 2 * math.pi)
    camera_object = next((o for o in bpy.data.objects if o.name == "Eye" and not o.library), None)
    if camera_object is None or camera_object.type != "CAMERA" or camera_object.library is not None:
        camera_object = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    if camera_object.name not in scene.objects:
        scene.collection.objects.link(camera_object)
    camera_object.parent = None
    camera_object.scale = 1.0, 1.0, 1.0
    camera_object.location = 6 * math.sin(angle), -6 * math.cos(angle), 1.5
    camera_object.rotation_euler = math.atan2(6, 1.5), 0.0, angle
    camera_object.data.type, camera_object.data.lens = "PERSP", 50.0
    scene.camera = camera_object
    bpy.context.view_layer.update()
    kind = monkey.pick(["smoothest", "axis", "curvature"])
    monkey.rosy(
        "field_generate", kind=kind, degree=monkey.pick([2, 4, 6]), attribute="rosy", reach=0.0
    )


@action(8, uses_rosy=True)
def bake(monkey):
    prepare(monkey)
    settings = {"camera": monkey.pick(["SCENE", "ALL", "VIEW"])} if monkey.chance(0.5) else {}
    if settings.get("camera", bpy.context.scene.rosy.camera) == "VIEW" and monkey.chance(0.8):
        settings["camera"] = "SCENE"  # a view of the window has many pixels
    if not monkey.window or monkey.chance(0.3):
        monkey.rosy("bake", **settings)
    else:
        yield from modal(monkey, "bake", **settings)


@action(2, uses_rosy=True)
def bake_animation(monkey):
    prepare(monkey)
    first = monkey.pick([0, 1, 1, 1, -3])
    settings = {
        "first": first,
        "last": first + monkey.pick([0, 1, 2, -1]),
        "all_cameras": monkey.chance(0.3),
    }
    if not monkey.window or monkey.chance(0.3):
        monkey.rosy("bake_animation", **settings)
    else:
        yield from modal(monkey, "bake_animation", **settings)


@action(3, uses_rosy=True)
def remove(monkey):
    if monkey.rosy("remove") == {"FINISHED"} and bpy.context.scene.rosy.bakes:
        raise CheckError("records are left")


@action(1.5, uses_rosy=True)
def show(monkey):
    names = [record.name for record in bpy.context.scene.rosy.bakes]
    monkey.rosy("show", camera=monkey.pick([*names, *names, monkey.name()]) or "")


@action(1, uses_rosy=True)
def turntable(monkey):
    select_mesh(monkey)
    suffix = monkey.pick([".gif", ".gif", ".gif", ".txt", ""])
    settings = {"pictures": monkey.pick([2, 3]), "width": 16, "height": monkey.pick([16, 40])}
    path = monkey.folder / f"turn{suffix}"
    monkey.rosy("turntable", filepath=str(path), film=".gif", skip_browser=True, **settings)


@action(2, uses_rosy=True)
def live_view(monkey):
    monkey.rosy("viewport", show=monkey.pick(["ON", "ON", "OFF", "TOGGLE"]),
                device=monkey.pick(["AUTO", "CPU"]))  # fmt: skip
    for _ in range(monkey.pick([0, 3]) if monkey.window else 0):
        yield


# --- RoSy: strokes, presets --------------------------------------------------------------------


@action(3, uses_rosy=True)
def strokes(monkey):
    prepare(monkey)
    to_object_mode(monkey)
    settings = bpy.context.scene.rosy.strokes
    style = rosy("rosy_addon.strokes.style").StrokeStyle
    randomize(monkey, settings, style, 0.2)
    if settings.unit == "world" or settings.spacing < 3:  # any number of strokes
        settings.unit, settings.spacing = "pixels", monkey.pick([4.0, 9.0, 1e4])
    if settings.spacing < 9:  # the crossings of many strokes in a large face take minutes
        settings.gaps = 0.0
    settings.selected = monkey.chance(0.2)
    settings.plotter, settings.paper = monkey.chance(0.3), monkey.chance(0.5)
    kind = monkey.pick(["PENCIL", "CURVES", "SVG"])
    path = monkey.pick([monkey.folder / "a.svg", monkey.folder / "none" / "a.svg", monkey.folder])
    arguments = {"kind": kind, "camera": "SCENE", "filepath": str(path)}
    if not monkey.window or monkey.chance(0.3):
        monkey.rosy("strokes", **arguments)
    else:
        yield from modal(monkey, "strokes", **arguments)


@action(1, uses_rosy=True)
def strokes_remove(monkey):
    monkey.rosy("strokes_remove")


@action(1.5, uses_rosy=True)
def preset_apply(monkey):
    keys = rosy("rosy_addon.ui.preset_library").preset_keys()
    if monkey.chance(0.3):
        bpy.context.scene.rosy.preset = monkey.pick(keys)
    else:
        monkey.rosy("preset_apply", preset=monkey.pick([*keys, monkey.name()]))


@action(0.4, uses_rosy=True)
def preset_save(monkey):
    monkey.rosy(
        "preset_save", name=monkey.name(), sentence=monkey.name(), replace=monkey.chance(0.5)
    )


@action(0.7, uses_rosy=True)
def preset_files(monkey):
    keys = rosy("rosy_addon.ui.preset_library").user_preset_keys()
    path = monkey.folder / "preset.json"
    operator, settings = monkey.pick(
        [
            ("preset_rename", {"name": monkey.name(), "sentence": monkey.name()}),
            ("preset_remove", {}),
            ("preset_export", {"filepath": str(path)}),
            ("preset_import", {"filepath": str(path), "replace": monkey.chance(0.5)}),
        ]
    )
    if operator != "preset_import":
        settings["preset"] = monkey.pick([*keys, *keys, monkey.name()])
    monkey.rosy(operator, **settings)


# --- RoSy: cancel, switch off, clean up --------------------------------------------------------


@action(4, uses_rosy=True)
def cancel_midway(monkey):
    """Cancel the task behind an operator midway, as ESC does."""
    prepare(monkey)
    scene = bpy.context.scene
    if monkey.window:
        if monkey.chance(0.7):
            yield from modal(
                monkey, monkey.pick(["bake", "strokes", "bake_animation", "occlusion"])
            )
        return
    addon = "rosy_addon"
    settings = rosy(f"{addon}.scene.pictures")
    frames = range(1, 4)

    def animation():
        output_settings = settings.OutputSettings(folder=monkey.folder / "frames")
        return rosy(f"{addon}.animation").bake_animation_task(
            scene, frames, settings=output_settings
        )

    what, make_task = monkey.pick(
        [
            ("bake", lambda: rosy(f"{addon}.bake").bake_task(scene)),
            ("bake_animation", animation),
            (
                "strokes",
                lambda: rosy(f"{addon}.draw_strokes").draw_strokes_task(scene, kind="CURVES"),
            ),
        ]
    )
    if what == "strokes" and bpy.context.mode != "OBJECT":
        return
    if bpy.ops.rosy.bake.poll():
        monkey.task(make_task, what)


def modal(monkey, operator, **settings):
    """Start an operator as from its button; let it end, press ESC, or do something else meanwhile."""
    before = fingerprint()
    if monkey.rosy(operator, invoke=True, **settings) != {"RUNNING_MODAL"}:
        return
    allowed = allowed_changes(operator)
    status = rosy("rosy_addon.ui.job_status")
    for _ in range(monkey.pick([0, 0, 1, 3, 10])):
        yield
    ending = monkey.pick(["wait", "escape", "escape", "act"])
    monkey.note(f"    {ending}")
    if ending == "act":
        chosen = monkey.pick([a for a in ACTIONS if a.name in WHILE_BUSY])
        monkey.note(f"    {chosen.name}")
        if chosen.bare:
            yield "bare"
        yield from chosen.slices(monkey)
        if chosen.bare:
            yield "in view"
        before = None
    elif ending == "escape":
        press(monkey, "ESC")
    for _ in range(3000):
        if EXTENSION not in bpy.context.preferences.addons or status.current is None:
            break
        yield
    else:
        raise CheckError(f"rosy.{operator} does not end after: {ending}")
    yield
    if before is not None and (differences := changes(before, fingerprint(), allowed)):
        raise CheckError(f"rosy.{operator} ({ending}) changed " + "; ".join(differences[:8]))


#: Actions that a user can do while a task runs.
WHILE_BUSY = {
    "add_mesh", "select_some", "transform", "duplicate", "delete", "delete_data", "rename", "hide",
    "edit_mesh", "edit_mode", "add_modifier", "change_modifiers", "attributes", "camera", "resolution",
    "frame", "scenes", "undo", "purge", "new_file", "switch_off_and_on", "look", "remove", "live_view",
    "make_field", "singularities", "delete_of_rosys", "clear_mesh",
}  # fmt: skip


def press(monkey, key):
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    x, y = area.x + area.width // 2, area.y + area.height // 2
    for value in ("PRESS", "RELEASE"):
        window.event_simulate(type=key, value=value, x=x, y=y)


@action(0.5, uses_rosy=True, bare=True)
def switch_off_and_on(monkey):
    """Disable and enable the extension."""
    bpy.ops.preferences.addon_disable(module=EXTENSION)
    yield 0.1
    try:
        if monkey.chance(0.5):
            for name in ("transform", "duplicate", "delete", "undo"):
                chosen = next(a for a in ACTIONS if a.name == name)
                monkey.note(f"  {name}")
                list(chosen.slices(monkey))
                if name != "undo":
                    push_undo(name)
    finally:
        bpy.ops.preferences.addon_enable(module=EXTENSION)
    yield 0.1


@action(1, uses_rosy=True, bare=True)
def clean_up(monkey):
    """Remove all that RoSy can remove, and check that nothing is left."""
    yield from remove_everything(monkey)


def remove_everything(monkey):
    """Press all buttons that remove something, in all scenes, and check that nothing is left."""
    window = bpy.context.window_manager.windows[0]
    if bpy.context.mode != "OBJECT":
        return
    original = window.scene.name
    for name in [scene.name for scene in bpy.data.scenes]:
        scene = bpy.data.scenes[name]
        if scene.library is not None:
            continue
        window.scene = scene
        yield
        for operator in ("remove", "strokes_remove"):
            if getattr(bpy.ops.rosy, operator).poll():
                monkey.rosy(operator)
        for obj in meshes(monkey, editable=False):
            if select(monkey, obj) and bpy.ops.rosy.singularities.poll():
                monkey.rosy("singularities", show="NONE")
    window.scene = bpy.data.scenes[original]
    yield
    if left := [text for text in leftovers() if not expected_leftover(text)]:
        raise CheckError("left after everything was removed: " + "; ".join(left[:8]))


def expected_leftover(text):
    """Whether something that RoSy made is now the user's: strokes and points, copied by the user."""
    return text.startswith(("objects", "meshes", "grease_pencils", "hair_curves", "pointclouds"))


def forget_files(monkey):
    """Delete the files that actions have written."""
    for path in monkey.folder.iterdir():
        if path.name != "user":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
