"""What the monkey does with RoSy: every operator with random settings, canceled or to its end."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import bpy
from monkey_actions import (
    ACTIONS,
    CheckError,
    action,
    meshes,
    objects,
    push_undo,
    select,
    select_mesh,
    to_object_mode,
)
from monkey_blender import delete, duplicate, transform, undo
from monkey_state import EXTENSION, allowed_changes, changes, fingerprint, leftovers, rosy

# --- fields ------------------------------------------------------------------------------


def attribute_argument(monkey):
    """Return the name of the attribute. If none is given, Blender takes that of the last call."""
    return {"attribute": monkey.name() if monkey.chance(0.15) else "rosy"}


@action(9, uses_rosy=True)
def make_field(monkey):
    if monkey.chance(0.95):
        select_mesh(monkey)
    kinds = ["form", "smoothest", "curvature", "features", "axis", "uv"]
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
        pair_distance=monkey.pick([0.0, 0.0, 0.1, 10.0]),
        magnitude=monkey.pick(kinds),
        values=monkey.pick(["", "Weights", "rosy", "Occlusion", monkey.name()]),
    )


@action(3, uses_rosy=True)
def store_field(monkey):
    select_mesh(monkey)
    form = monkey.pick(["VECTOR", "DIRECTIONS", "ANGLE", "TANGENT"])
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


@action(1, uses_rosy=True)
def move_singularity(monkey):
    obj = select_mesh(monkey)
    count = len(obj.data.vertices) if obj is not None else 0
    monkey.rosy(
        "field_singularities",
        source=monkey.random.randrange(-1, count + 1),
        target=monkey.random.randrange(-1, count + 1),
        index=monkey.pick([0, 0, 1, -1, 3]),
        reach=monkey.pick([0.0, 0.1, 10.0]),
    )


@action(0.8, uses_rosy=True)
def comb(monkey):
    obj = select_mesh(monkey)
    vertices = obj.data.vertices if obj is not None else ()
    stroke = [
        {
            "name": "",
            "location": tuple(monkey.pick(list(vertices)).co) if len(vertices) else (0.0, 0.0, 0.0),
            "pressure": monkey.pick([0.0, 0.5, 1.0]),
            "is_start": monkey.pick([False, False, True]),
        }
        for _ in range(monkey.random.randrange(6))
    ]
    monkey.rosy(
        "field_comb",
        stroke=stroke,
        effect=monkey.pick(["COMB", "COMB", "ERASE", "SMOOTH"]),
        radius=monkey.pick([1e-6, 0.2, 1.0, 1e6]),
        exact=monkey.pick([False, True]),
        front_faces=monkey.pick([False, True]),
        mirror=[monkey.pick([False, True]) for _ in range(3)],
        reach=monkey.pick([0.0, 0.1, 10.0]),
    )


@action(1.5, uses_rosy=True)
def compare_fields(monkey):
    prepare(monkey)
    obj = bpy.context.view_layer.objects.active
    names = (
        [attribute.name for attribute in obj.data.attributes] if obj and obj.type == "MESH" else []
    )
    other = monkey.pick([*names, *names, monkey.name(), ""])
    monkey.rosy("field_compare", other=other, use_as_color=monkey.chance(0.7))


@action(0.7, uses_rosy=True)
def occlusion(monkey):
    prepare(monkey)
    monkey.rosy("occlusion", directions=monkey.pick([1, 7, 32]))


# --- pictures ----------------------------------------------------------------------------


def randomize(monkey, group, cls, probability):
    """Set random values of settings within their ranges."""
    description = rosy("rosy_addon.core.settings")
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
    settings.relight = monkey.chance(0.3)
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
    settings.look.hue = monkey.pick(["one", "families", "values"])
    settings.color_attribute = monkey.pick(["", "Occlusion", "position", "rosy", monkey.name()])
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
    attributes = obj.data.attributes
    for name in ("rosy", "dir0"):
        if name in attributes:
            attributes.remove(attributes[name])
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
    if camera_object not in scene.objects.values():
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


@action(3, uses_rosy=True)
def bake_texture(monkey):
    prepare(monkey)
    obj, settings = select_mesh(monkey), bpy.context.scene.rosy
    settings.texture_size = monkey.pick([16, 64, 128])
    settings.texture_margin = monkey.pick([0, 2, 16])
    settings.texture_bake_light = monkey.chance(0.3)
    settings.texture_udim = monkey.chance(0.2)
    settings.texture_content = monkey.pick(["LOOK", "LOOK", "ANISOTROPY", "FLOW"])
    if monkey.chance(0.7):
        settings.look.ink = "soft"
    if obj is not None and obj.library is None:
        obj.rosy.texture_uv_map = monkey.pick(["", "", "UVMap", monkey.name()])
    unwrap = monkey.chance(0.5)
    if not monkey.window or not unwrap or monkey.chance(0.3):
        monkey.rosy("bake_texture", unwrap=unwrap)
    else:
        yield from modal(monkey, "bake_texture", unwrap=True)


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
    elif has_folder():
        yield from modal(monkey, "bake_animation", **settings)


def has_folder():
    """Whether the scene has a folder for frames, so that no file browser asks for one."""
    directory = bpy.context.scene.rosy.directory
    return bool(directory.strip()) and not (directory.startswith("//") and not bpy.data.filepath)


@action(3, uses_rosy=True)
def remove(monkey):
    if monkey.rosy("remove") == {"FINISHED"} and bpy.context.scene.rosy.bakes:
        raise CheckError("records are left")


@action(1.5, uses_rosy=True)
def show(monkey):
    names = [record.name for record in bpy.context.scene.rosy.bakes]
    monkey.rosy("show", camera=monkey.pick([*names, *names, monkey.name()]) or "")


@action(0.5, uses_rosy=True)
def show_here(monkey):
    monkey.rosy("show_here")


@action(1, uses_rosy=True)
def turntable(monkey):
    select_mesh(monkey)
    suffix = monkey.pick([".gif", ".gif", ".gif", ".txt", ""])
    settings = {"pictures": monkey.pick([2, 3]), "width": 16, "height": monkey.pick([16, 40])}
    settings["still"] = monkey.pick([False, False, True])
    path = monkey.folder / f"turn{suffix}"
    monkey.rosy("turntable", filepath=str(path), film=".gif", skip_browser=True, **settings)


@action(2, uses_rosy=True)
def live_view(monkey):
    monkey.rosy("viewport", show=monkey.pick(["ON", "ON", "OFF", "TOGGLE"]),
                device=monkey.pick(["AUTO", "CPU"]))  # fmt: skip
    for _ in range(monkey.pick([0, 3]) if monkey.window else 0):
        yield


@action(1, uses_rosy=True)
def flow_play(monkey):
    monkey.rosy("flow_play")
    for _ in range(monkey.pick([0, 3]) if monkey.window else 0):
        yield


# --- strokes, presets --------------------------------------------------------------------


@action(3, uses_rosy=True)
def strokes(monkey):
    prepare(monkey)
    if not to_object_mode(monkey) or any(
        max(obj.dimensions) > 30 or min(map(abs, obj.scale)) < 1e-3 for obj in meshes(monkey)
    ):
        return  # strokes on what is much larger than the frame take minutes
    settings = bpy.context.scene.rosy.strokes
    settings.follow = monkey.chance(0.3)
    style = rosy("rosy_addon.line_drawing.style").StrokeStyle
    randomize(monkey, settings, style, 0.2)
    if settings.unit == "world" or settings.spacing < 3:  # any number of strokes
        settings.unit, settings.spacing = "pixels", monkey.pick([4.0, 9.0, 1e4])
    settings.selected = monkey.chance(0.2)
    settings.plotter, settings.paper = monkey.chance(0.3), monkey.chance(0.5)
    kind = monkey.pick(["PENCIL", "CURVES", "FILE"])
    path = monkey.pick([monkey.folder / "a.svg", monkey.folder / "none" / "a.svg", monkey.folder])
    # `replace`, so that no dialog asks.
    arguments = {"kind": kind, "camera": "SCENE", "filepath": str(path), "replace": True}
    if not monkey.window or monkey.chance(0.3):
        monkey.rosy("strokes", **arguments)
    else:
        yield from modal(monkey, "strokes", **arguments)


@action(1, uses_rosy=True)
def strokes_remove(monkey):
    monkey.rosy("strokes_remove")


@action(1.5, uses_rosy=True)
def preset_apply(monkey):
    keys = list(rosy("rosy_addon.ui.preset_library").entries())
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


# --- cancel, switch off, clean up --------------------------------------------------------


@action(4, uses_rosy=True)
def cancel_midway(monkey):
    """Cancel the task behind an operator midway, as ESC does."""
    prepare(monkey)
    scene = bpy.context.scene
    if monkey.window:
        operators = {"bake": {}, "strokes": {"kind": "CURVES", "replace": True}, "occlusion": {}}
        operators |= {"bake_animation": {}} if has_folder() else {}
        if monkey.chance(0.7):
            operator = monkey.pick(list(operators))
            yield from modal(monkey, operator, **operators[operator])
        return
    addon = "rosy_addon"
    settings = rosy(f"{addon}.scene.pictures")
    frames = range(1, 4)

    def animation():
        output_settings = settings.OutputSettings(folder=monkey.folder / "frames")
        return rosy(f"{addon}.animation").bake_animation.begin(
            scene, frames, settings=output_settings
        )

    what, begin = monkey.pick(
        [
            ("bake", lambda: rosy(f"{addon}.bake").bake.begin(scene)),
            ("bake_animation", animation),
            (
                "strokes",
                lambda: rosy(f"{addon}.draw_strokes").draw_strokes.begin(scene, kind="CURVES"),
            ),
        ]
    )
    if what == "strokes" and bpy.context.mode != "OBJECT":
        return
    if bpy.ops.rosy.bake.poll():
        monkey.cancelled_job(begin, what)


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
            for run in (transform, duplicate, delete, undo):
                monkey.note(f"  {run.__name__}")
                list(run(monkey) or ())
                if run is not undo:
                    push_undo(run.__name__)
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
    was_pressed = False
    for name in [scene.name for scene in bpy.data.scenes]:
        scene = bpy.data.scenes[name]
        if scene.library is not None:
            continue
        window.scene = scene
        yield
        for operator in ("remove", "strokes_remove"):
            if getattr(bpy.ops.rosy, operator).poll():
                monkey.rosy(operator)
                was_pressed = True
        for obj in meshes(monkey, editable=False):
            if select(monkey, obj) and bpy.ops.rosy.singularities.poll():
                monkey.rosy("singularities", show="NONE")
    window.scene = bpy.data.scenes[original]
    yield
    if not was_pressed:
        # The user has deleted all that RoSy could remove; what that used is unused data in the file.
        bpy.ops.outliner.orphans_purge(do_recursive=True)
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
