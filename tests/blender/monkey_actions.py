"""The monkey's actions: a table of functions, most of which choose from what Blender describes.

An action is a function of a `Monkey` that `action` adds to the table with a weight. An action that does not
fit the current state does nothing.

The operators and properties of RoSy are chosen from Blender's descriptions of them, so that new ones take
part. `LIMITS` keeps their random values from taking minutes.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import bpy
from monkey_checks import (
    Fingerprint,
    allowed_changes,
    changes,
    check_message,
    expect_none,
    fingerprint,
    is_owned,
)

#: Names that a user, or a script, can give, and names of data that RoSy or the monkey makes.
NAMES = (
    "a/b\\c", "line\nbreak\ttab", "\x01\x1b[31m", "é 日本 🙂", "x" * 200, "", " ", ".", "..", "con",
    "%s {0} {x}", "'quote\" `", "-flag", "a.001", "RoSy Camera", "rosy", "rosy_guides", "dir0", "mine",
    "position", "Suzanne", "Eye", "UVMap", "Weights", "Occlusion", "default", "engraving",
    "rosy_material", "rosy_projection", "rosy_angle",
)  # fmt: skip
if bpy.app.version >= (
    5,
    0,
):  # before, Blender's own Set Material crashes on it, if it is no face index
    NAMES += ("material_index",)

#: Probability that a job is disturbed while it runs.
DISTURBANCE = 0.5

#: Largest number of faces, vertices and objects that the monkey makes.
MAX_FACES, MAX_OBJECTS = 1500, 14

#: Lowest and highest random values of properties and settings of operators.
LIMITS = {
    "length": (1, 120), "supersampling": (1, 2), "percentage": (1, 150), "workers": (0, 2),
    "texture_size": (16, 128), "pictures": (2, 3), "width": (16, 40), "height": (16, 40),
    "directions": (1, 32), "first": (-3, 3), "last": (-3, 4), "spacing": (4, 1e4), "gaps": (0, 0),
    "source": (-1, 40), "target": (-1, 40), "index": (-2, 3),
}  # fmt: skip

#: Suffixes of the files that operators write or read.
SUFFIXES = {
    "field_export": ".rosy", "field_import": ".rosy", "turntable": ".gif", "preset_export": ".json",
    "preset_import": ".json",
}  # fmt: skip

#: Operators that are not called at random: they need a window, or are actions of their own.
OTHER_OPERATORS = {"drag_singularity", "show_here", "viewport", "flow_play", "bake", "strokes"}

#: How often each action is chosen.
ACTIONS: dict[Callable[[Monkey], None], float] = {}


def action(weight: float = 1.0) -> Callable:
    """Add a function to the table of actions."""

    def add(run: Callable) -> Callable:
        ACTIONS[run] = weight
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
    note : callable
        Prints what an action does.
    outcomes : Counter
        How often each operator of RoSy did something, and how often it failed.
    before : dict
        The fingerprint of the file before the operator of RoSy that runs.
    disturbance : float
        Probability that the next job is disturbed.
    """

    def __init__(self, folder: Path, note: Callable) -> None:
        self.folder, self.note = folder, note
        self.random = Random()
        self.outcomes: Counter[tuple[str, str]] = Counter()
        self.before: Fingerprint = {}
        self.disturbance = DISTURBANCE

    def chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def pick(self, items: Any) -> Any:
        """Return one of the items; None if there is none."""
        items = list(items)
        return self.random.choice(items) if items else None

    def blender(self, operator: str, **settings: Any) -> bool:
        """Call an operator of Blender. Return whether it did something."""
        module, name = operator.split(".")
        function = getattr(getattr(bpy.ops, module), name)
        try:
            return function.poll() and function("EXEC_DEFAULT", **settings) == {"FINISHED"}
        except (RuntimeError, TypeError):  # a setting that this version of Blender does not have
            return False

    def rosy(self, operator: str, **settings: Any) -> None:
        """Call an operator of RoSy, and check its errors and what it changes."""
        function = getattr(bpy.ops.rosy, operator)
        self.note(f"rosy.{operator} {settings}")
        allowed, self.before, error = allowed_changes(operator), fingerprint(), None
        try:
            function("EXEC_DEFAULT", True, **settings)
        except RuntimeError as raised:
            error = str(raised)
            check_message(error)
            self.note(f"    {error.strip()}")
        self.outcomes[operator, "failed" if error else "did"] += 1
        verb = f"failed ({error.strip()}), but changed" if error else "changed"
        differences = changes(self.before, fingerprint(), () if error else allowed)
        expect_none(differences, f"rosy.{operator} {verb}")

    def value(self, prop: bpy.types.Property) -> Any:
        """Return a random value of a property or of a setting of an operator."""
        match prop.type:
            case "BOOLEAN":
                values = [self.chance(0.5) for _ in range(max(prop.array_length, 1))]
            case "INT" | "FLOAT":
                values = [self.number(prop) for _ in range(max(prop.array_length, 1))]
            case "ENUM":
                keys = prop.enum_items.keys()
                return {self.pick(keys)} if prop.is_enum_flag else self.pick(keys)
            case _:
                return self.pick(NAMES)
        return values if getattr(prop, "array_length", 0) else values[0]

    def number(self, prop: bpy.types.Property) -> float:
        """Return the default, an end of the range, or a value between, of any magnitude."""
        low, high = LIMITS.get(prop.identifier, (prop.hard_min, prop.hard_max))
        low, high = max(low, -1e30), min(high, 1e30)
        value = self.random.uniform(low, min(high, low + 10))
        if high > 1000 * max(abs(low), 1e-3):
            value = math.exp(self.random.uniform(math.log(max(low, 1e-3)), math.log(high)))
        value = self.pick([low, high, prop.default, value, value, value])
        return int(max(min(value, high), low)) if prop.type == "INT" else float(value)

    def set_properties(self, group: bpy.types.bpy_struct, probability: float) -> None:
        """Set some properties of a group to random values, or to their defaults."""
        for prop in group.bl_rna.properties:
            if (
                prop.identifier in bpy.types.ID.bl_rna.properties
                or prop.is_readonly
                or prop.type in ("POINTER", "COLLECTION")
                or prop.is_hidden
            ):
                continue
            if self.chance(probability):
                if self.chance(0.4):
                    group.property_unset(prop.identifier)
                elif prop.type == "STRING" and prop.subtype in ("DIR_PATH", "FILE_PATH"):
                    setattr(group, prop.identifier, self.path())
                elif not (prop.type == "ENUM" and not prop.enum_items):
                    setattr(group, prop.identifier, self.value(prop))

    def path(self, suffix: str = "") -> str:
        """Return a path that can be written, mostly one of a file with the suffix."""
        if suffix and self.chance(0.8):
            return str(self.folder / f"file{suffix}")
        names = ("pictures", "a.svg", "field.rosy", "field.txt", "turn.gif", "preset.json")
        paths = [str(self.folder / name) for name in names]
        return self.pick([paths[0], *paths, "//rosy/", "/proc/none", ""])


# --- choices --------------------------------------------------------------------------------------


def objects() -> list[bpy.types.Object]:
    """Return the objects of the view layer. Blender lists None for some that were deleted."""
    return [obj for obj in bpy.context.view_layer.objects if obj is not None]


def meshes(*, editable: bool = True) -> list[bpy.types.Object]:
    """Return the mesh objects of the view layer that are not RoSy's."""
    return [
        obj
        for obj in objects()
        if obj.type == "MESH" and not is_owned(obj) and (obj.data.library is None or not editable)
    ]


def active_mesh() -> bpy.types.Mesh | None:
    obj = bpy.context.view_layer.objects.active
    return obj.data if obj is not None and obj.type == "MESH" else None


def to_object_mode(monkey: Monkey) -> bool:
    return bpy.context.mode == "OBJECT" or monkey.blender("object.mode_set", mode="OBJECT")


def select(monkey: Monkey, *chosen: bpy.types.Object) -> bool:
    """Make objects the selection, the first one active. Return whether that was possible."""
    if not to_object_mode(monkey):
        return False
    # Names do not tell: a linked object may have the name of a local one.
    present = set(objects())
    if not present.issuperset(chosen):
        return False
    for obj in present:
        obj.select_set(obj in chosen)
    bpy.context.view_layer.objects.active = chosen[0]
    return chosen[0].select_get()


def select_mesh(monkey: Monkey) -> bpy.types.Object | None:
    """Select a mesh object, and sometimes more. Return the active one."""
    obj = monkey.pick(meshes())
    if obj is None:
        return None
    others = [other for other in objects() if other != obj and monkey.chance(0.15)]
    return obj if select(monkey, obj, *others) else None


def is_small(mesh: bpy.types.Mesh, factor: int = 1) -> bool:
    return max(len(mesh.polygons), len(mesh.vertices)) * factor <= MAX_FACES


# --- RoSy -----------------------------------------------------------------------------------------


@action(3)
def field_in_view(monkey: Monkey) -> None:
    """Make a field on a mesh in front of a camera, so that there is something to draw."""
    scene = bpy.context.scene
    if not any(len(obj.data.polygons) > 4 for obj in meshes()) and to_object_mode(monkey):
        monkey.blender("mesh.primitive_monkey_add")
    obj = monkey.pick([obj for obj in meshes() if len(obj.data.polygons) > 4])
    if obj is None or obj.library is not None or not select(monkey, obj):
        return
    obj.hide_render = obj.hide_viewport = False
    obj.rosy.include = obj.visible_camera = True
    obj.parent, obj.location, obj.scale = None, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    if "rosy" in obj.data.attributes:
        obj.data.attributes.remove(obj.data.attributes["rosy"])
    obj.data.rosy.attribute = "rosy"
    render = scene.render
    render.resolution_x, render.resolution_y = monkey.pick([(64, 64), (96, 64), (80, 96)])
    render.resolution_percentage, render.pixel_aspect_x = 100, 1.0
    for name in ("percentage", "store"):
        scene.rosy.property_unset(name)
    scene.rosy.texture_size = 64
    scene.rosy.look.property_unset("tone")
    eye = next((o for o in bpy.data.objects if o.name == "Eye" and not o.library), None)
    if eye is None or eye.type != "CAMERA":
        eye = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    if eye not in scene.objects.values():
        scene.collection.objects.link(eye)
    angle = monkey.random.uniform(0, 2 * math.pi)
    eye.parent, eye.scale = None, (1.0, 1.0, 1.0)
    eye.location = 6 * math.sin(angle), -6 * math.cos(angle), 1.5
    eye.rotation_euler = math.atan2(6, 1.5), 0.0, angle
    eye.data.type, eye.data.lens = "PERSP", 50.0
    scene.camera = eye
    bpy.context.view_layer.update()
    kind, degree = monkey.pick(["smoothest", "axis", "curvature"]), monkey.pick([2, 4, 6])
    monkey.rosy("field_generate", kind=kind, degree=degree, attribute="rosy", reach=0.0)


@action(30)
def any_operator(monkey: Monkey) -> None:
    """Call any operator of RoSy with random settings."""
    operator = monkey.pick(name for name in dir(bpy.ops.rosy) if name not in OTHER_OPERATORS)
    if monkey.chance(0.8):
        field_in_view(monkey)
    elif monkey.chance(0.8):
        select_mesh(monkey)
    settings = {}
    for prop in getattr(bpy.ops.rosy, operator).get_rna_type().properties:
        if prop.identifier in ("filepath", "directory"):
            settings[prop.identifier] = monkey.path(SUFFIXES.get(operator, ""))
        elif prop.identifier == "attribute":  # otherwise Blender takes the one of the last call
            settings["attribute"] = monkey.pick(["rosy", "rosy", "rosy", monkey.pick(NAMES)])
        elif prop.identifier == "stroke":
            settings["stroke"] = list(_stroke(monkey))
        elif prop.identifier in ("skip_browser", "replace"):
            settings[prop.identifier] = True  # no dialog
        elif prop.identifier == "film":
            settings["film"] = ".gif"
        elif prop.type not in ("POINTER", "COLLECTION") and (
            prop.identifier in LIMITS or monkey.chance(0.3)  # defaults may take minutes
        ):
            settings[prop.identifier] = monkey.value(prop)
    if operator == "bake_animation":
        settings |= {"step": 1, "first": 1, "last": monkey.pick([1, 2, 3, 0])}
    monkey.rosy(operator, **settings)


def _stroke(monkey: Monkey) -> Iterator[dict]:
    """Yield the points of a stroke of the comb, at vertices of the active mesh."""
    mesh = active_mesh()
    vertices = [] if mesh is None else list(mesh.vertices)
    for _ in range(monkey.random.randrange(6)):
        location = tuple(monkey.pick(vertices).co) if vertices else (0.0, 0.0, 0.0)
        point = {"location": location, "is_start": monkey.pick([False, False, True])}
        yield {"name": "", "pressure": monkey.random.random(), **point}


@action(6)
def any_property(monkey: Monkey) -> None:
    """Set properties of RoSy of the scene, the look, the strokes, and of an object and its mesh."""
    settings = bpy.context.scene.rosy
    groups = [settings, settings.look, settings.look, settings.strokes]
    if (obj := select_mesh(monkey)) is not None and obj.library is None:
        groups += [obj.rosy, obj.data.rosy]
        obj.rosy.tone_image = monkey.pick([None, None, *bpy.data.images])
    monkey.set_properties(monkey.pick(groups), monkey.pick([0.05, 0.2, 0.6]))
    settings.remember_live = False


@action(6)
def bake(monkey: Monkey) -> None:
    if monkey.chance(0.8):
        field_in_view(monkey)
    camera = monkey.pick(["SCENE", "SCENE", "SCENE", "ALL"])
    monkey.rosy("bake", camera=camera)


@action(3)
def texture(monkey: Monkey) -> None:
    if monkey.chance(0.8):
        field_in_view(monkey)
    monkey.rosy("bake_texture", unwrap=monkey.chance(0.8))


@action(3)
def comb(monkey: Monkey) -> None:
    """Comb a field, sometimes one that is stored in another form."""
    field_in_view(monkey)
    if monkey.chance(0.3):
        monkey.rosy("field_store", form="ANGLE", attribute="rosy_angle")
        mesh = active_mesh()
        if mesh is not None and "rosy" in mesh.attributes and mesh.library is None:
            mesh.attributes.remove(mesh.attributes["rosy"])
            mesh.rosy.attribute = "rosy_angle"
    monkey.rosy("field_comb", stroke=list(_stroke(monkey)), radius=monkey.pick([0.1, 0.5, 2.0]))


@action(3)
def strokes(monkey: Monkey) -> None:
    if monkey.chance(0.8):
        field_in_view(monkey)
    # Strokes on what is much larger than the frame, and any number of strokes, take minutes.
    is_large = any(max(o.dimensions) > 30 or min(map(abs, o.scale)) < 1e-3 for o in meshes())
    if is_large or not to_object_mode(monkey):
        return
    bpy.context.scene.rosy.strokes.unit = "pixels"
    if bpy.context.scene.rosy.strokes.spacing < 4:
        bpy.context.scene.rosy.strokes.spacing = 9.0
    path, kind = str(monkey.folder / "a.svg"), monkey.pick(["PENCIL", "CURVES", "FILE"])
    settings = {"kind": kind, "camera": "SCENE", "filepath": path}
    monkey.rosy("strokes", **settings)


@action(2)
def delete_or_rename_of_rosy(monkey: Monkey) -> None:
    """Change something that RoSy made, as the outliner does."""
    kinds = (bpy.data.images, bpy.data.materials, bpy.data.node_groups, bpy.data.objects)
    blocks = ((kind, block) for kind in kinds for block in kind)
    chosen = monkey.pick(pair for pair in blocks if is_owned(pair[1]) and not pair[1].library)
    if chosen is None or not to_object_mode(monkey):
        return
    kind, block = chosen
    monkey.note(f"{block!r}")
    tree = block if kind == bpy.data.node_groups else getattr(block, "node_tree", None)
    match monkey.random.randrange(4):
        case 0:
            kind.remove(block)
        case 1:
            block.name = monkey.pick(NAMES)
        case 2:
            block.use_fake_user = True
        case 3 if tree is not None and tree.nodes:
            tree.nodes.remove(monkey.pick(tree.nodes))
