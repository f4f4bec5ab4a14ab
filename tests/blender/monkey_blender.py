"""What the monkey does with Blender alone: to objects, meshes, scenes, cameras and files.

This includes what RoSy made, and what a user or a script does behind RoSy's back.
"""

import math
from glob import escape

import bmesh
import bpy
import numpy as np
from extension import switch_extension
from monkey_actions import (
    MAX_OBJECTS,
    NAMES,
    Monkey,
    action,
    is_small,
    meshes,
    objects,
    select,
    select_mesh,
    to_object_mode,
)
from monkey_checks import changes, expect_none, fingerprint

ANY = (True, False)

#: Operators that add an object, and those for the selection, with the values of their settings.
ADD_OPERATORS = (
    ("mesh.primitive_monkey_add", {}), ("mesh.primitive_cube_add", {}), ("mesh.primitive_plane_add", {}),
    ("mesh.primitive_uv_sphere_add", {"segments": (12,), "ring_count": (8,)}),
    ("mesh.primitive_torus_add", {"major_segments": (16,), "minor_segments": (8,)}),
    ("mesh.primitive_circle_add", {}), ("object.light_add", {"type": ("SUN", "POINT", "SPOT", "AREA")}),
    ("object.empty_add", {}), ("object.armature_add", {}), ("object.text_add", {}),
    ("object.metaball_add", {}), ("curve.primitive_bezier_curve_add", {}),
    ("object.curves_empty_hair_add", {}), ("object.grease_pencil_add", {}),
)  # fmt: skip
OBJECT_OPERATORS = (
    ("object.duplicate", {"linked": ANY}), ("object.delete", {"use_global": ANY}),
    ("object.transform_apply", {}), ("object.shape_key_add", {"from_mix": (False,)}),
    ("object.shape_key_remove", {"all": ANY}), ("object.parent_set", {"keep_transform": ANY}),
    ("object.parent_clear", {"type": ("CLEAR_KEEP_TRANSFORM",)}), ("object.join", {}),
    ("object.make_local", {"type": ("SELECT_OBJECT", "SELECT_OBDATA", "ALL")}),
)  # fmt: skip
EDIT_OPERATORS = (
    ("mesh.delete", {"type": ("VERT", "EDGE", "FACE", "ONLY_FACE")}), ("mesh.subdivide", {}),
    ("mesh.dissolve_limited", {}), ("mesh.quads_convert_to_tris", {}), ("mesh.flip_normals", {}),
    ("mesh.merge", {"type": ("CENTER",)}), ("mesh.extrude_region_move", {}), ("mesh.mark_seam", {}),
    ("mesh.vertices_smooth", {}), ("mesh.separate", {"type": ("SELECTED",)}),
    ("transform.resize", {"value": ((1.1, 0.8, 0.0),)}),
)  # fmt: skip
GROWING_MODIFIERS = ("SUBSURF", "MIRROR", "ARRAY", "SOLIDIFY", "BEVEL", "WIREFRAME")
MODIFIERS = (*GROWING_MODIFIERS, "TRIANGULATE", "DECIMATE", "WELD", "NODES", "DISPLACE", "MASK")


def call_one(monkey: Monkey, operators: tuple) -> None:
    """Call one of the operators with one of the values of each setting."""
    operator, settings = monkey.pick(operators)
    chosen = {name: monkey.pick(values) for name, values in settings.items()}
    monkey.note(f"{operator} {chosen}")
    monkey.blender(operator, **chosen)


@action(5)
def add_object(monkey: Monkey) -> None:
    """Add an object, and select a mesh with it: curves and empties guide fields."""
    if len(bpy.data.objects) < MAX_OBJECTS and to_object_mode(monkey):
        call_one(monkey, ADD_OPERATORS)
        mesh, added = monkey.pick(meshes()), bpy.context.view_layer.objects.active
        if mesh is not None and added is not None and monkey.chance(0.5):
            select(monkey, mesh, added)


@action(6)
def change_selection(monkey: Monkey) -> None:
    """Call an operator for objects: some crash Blender without a mesh, or with many faces."""
    chosen = [obj for obj in objects() if monkey.chance(0.3)] or objects()[:1]
    is_safe = len(bpy.data.objects) < MAX_OBJECTS - len(chosen)
    is_safe &= all(is_small(obj.data, 2) for obj in chosen if obj.type == "MESH")
    if chosen and select(monkey, *chosen) and is_safe:
        call_one(monkey, OBJECT_OPERATORS)


@action(3)
def transform(monkey: Monkey) -> None:
    obj = monkey.pick(objects())
    if obj is None or obj.library is not None:
        return
    match monkey.random.randrange(3):
        case 0:
            obj.scale = [monkey.pick([1.0, 1.0, 1.0, 0.0, -1.0, 2.0, 1e6, 1e-6]) for _ in range(3)]
        case 1:
            size = monkey.pick([1.0, 1.0, 1.0, 1e6])
            obj.location = [size * monkey.random.uniform(-1, 1) for _ in range(3)]
        case 2:
            obj.rotation_euler = [monkey.random.uniform(-7, 7) for _ in range(3)]


@action(2)
def rename_or_hide(monkey: Monkey) -> None:
    names = ("objects", "meshes", "cameras", "scenes", "materials")
    kinds = (getattr(bpy.data, name) for name in names)
    block, obj = monkey.pick(block for kind in kinds for block in kind), monkey.pick(objects())
    if monkey.chance(0.5) and block is not None and block.library is None:
        block.name = monkey.pick(NAMES)
    elif obj is not None and obj.library is None:
        name = monkey.pick(["hide_render", "hide_viewport", "visible_camera"])
        setattr(obj, name, (name == "visible_camera") == monkey.chance(0.7))


@action(0.5)
def delete_data(monkey: Monkey) -> None:
    """Delete a datablock of any kind behind everyone's back."""
    name = monkey.pick(["meshes", "cameras", "images", "materials", "objects"])
    kind = getattr(bpy.data, name)
    # Blender 5.2 hangs if a node group of its own assets, which are linked, is deleted.
    block = monkey.pick(block for block in kind if block.library is None)
    if block is not None and to_object_mode(monkey):
        monkey.note(f"delete {block!r}")
        kind.remove(block)


@action(2)
def change_mode(monkey: Monkey) -> None:
    mode = monkey.pick(["EDIT", "EDIT", "SCULPT", "VERTEX_PAINT", "OBJECT"])
    if bpy.context.mode != "OBJECT" or select_mesh(monkey):
        monkey.blender("object.mode_set", mode=mode)


@action(5)
def edit_mesh(monkey: Monkey) -> None:
    """Change the faces of a mesh in edit mode, and leave it, mostly."""
    if bpy.context.mode != "EDIT_MESH" and not (
        select_mesh(monkey) and monkey.blender("object.mode_set", mode="EDIT")
    ):
        return
    mesh = bpy.context.edit_object.data
    monkey.blender("mesh.select_all", action="DESELECT")
    monkey.blender("mesh.select_mode", type=monkey.pick(["VERT", "EDGE", "FACE"]))
    ratio = monkey.pick([0.1, 0.3, 0.5, 1.0])
    monkey.blender("mesh.select_random", ratio=ratio, seed=monkey.random.randrange(1000))
    # Blender may crash when it subdivides edges of more than two faces.
    edges = bmesh.from_edit_mesh(mesh).edges
    is_manifold = all(len(edge.link_faces) in (1, 2) for edge in edges)
    if is_small(mesh, 4) and is_manifold and len(bpy.data.objects) < MAX_OBJECTS:
        call_one(monkey, EDIT_OPERATORS)
    if monkey.chance(0.8):
        monkey.blender("object.mode_set", mode="OBJECT")


@action(4)
def change_modifiers(monkey: Monkey) -> None:
    obj = select_mesh(monkey)
    if obj is None or obj.library is not None:
        return
    modifier = monkey.pick(obj.modifiers)
    match monkey.random.randrange(5):
        case 0 | 1:
            kind = monkey.pick(MODIFIERS)
            if len(obj.modifiers) < 4 and is_small(obj.data, 8 if kind in GROWING_MODIFIERS else 3):
                obj.modifiers.new(monkey.pick([kind.title(), monkey.pick(NAMES)]), kind)
        case 2 if modifier and is_small(obj.data, 6 if modifier.type in GROWING_MODIFIERS else 2):
            monkey.blender("object.modifier_apply", modifier=modifier.name)
        case 3 if modifier:
            obj.modifiers.remove(modifier)
        case 4 if modifier:
            modifier.show_viewport = not modifier.show_viewport


@action(4)
def change_attributes(monkey: Monkey) -> None:
    """Change the attributes of a mesh behind RoSy's back."""
    obj = select_mesh(monkey)
    if obj is None or obj.data.shape_keys is not None or obj.data.is_editmode:
        return
    mesh = obj.data
    custom = [a.name for a in mesh.attributes if not a.is_required and not a.is_internal]
    chosen = mesh.attributes[monkey.pick(custom)] if custom else None
    kind = monkey.pick(["FLOAT_VECTOR", "FLOAT", "INT", "BOOLEAN", "FLOAT_COLOR"])
    domain = monkey.pick(["FACE", "POINT", "CORNER", "EDGE"])
    match monkey.random.randrange(6):
        case 0 if chosen:
            mesh.attributes.remove(chosen)
        case 1 if chosen:
            mesh.attributes.active = chosen
            monkey.blender("geometry.attribute_convert", domain=domain, data_type=kind)
        case 2 if len(custom) < 12 and (name := monkey.pick(NAMES) or "a") not in mesh.attributes:
            mesh.attributes.new(name, kind, domain)
        case 3 if chosen and chosen.data_type == "FLOAT_VECTOR":
            value = monkey.pick([0.0, 1.0, 1e30, math.nan, math.inf, 1e-30])
            values = np.full(3 * len(chosen.data), value, dtype=np.float32)
            chosen.data.foreach_set("vector", values)
            mesh.update()
        case 4 if chosen:
            chosen.name = monkey.pick(NAMES) or "b"
        case 5:
            group = obj.vertex_groups.new(name="Weights")
            group.add(list(range(0, len(mesh.vertices), 2)), monkey.random.random(), "REPLACE")


@action(3)
def change_camera(monkey: Monkey) -> None:
    scene = bpy.context.scene
    obj = monkey.pick([obj for obj in scene.objects if obj.type == "CAMERA" and not obj.library])
    if obj is None:
        return
    match monkey.random.randrange(5):
        case 0 | 1:
            monkey.set_properties(obj.data, 0.1)
        case 2:
            obj.scale = monkey.pick([(1, 1, 1), (0, 0, 0), (-1, 1, 1), (1, 1, 0)])
        case 3:
            scene.camera = monkey.pick([None, *scene.objects])
        case 4:
            bpy.data.objects.remove(obj)


@action(3)
def change_scene(monkey: Monkey) -> None:
    """Change the frame, the resolution and the view transform."""
    scene, render = bpy.context.scene, bpy.context.scene.render
    render.resolution_x = monkey.pick([4, 32, 64, 80, 96])
    render.resolution_y = monkey.pick([4, 48, 64, 80, 96])
    render.resolution_percentage = monkey.pick([1, 50, 100, 100, 100, 120])
    render.pixel_aspect_x = monkey.pick([1.0, 1.0, 1.0, 2.0, 200.0])
    scene.view_settings.view_transform = monkey.pick(["Standard", "AgX", "Raw"])
    scene.frame_set(monkey.pick([-5, 0, 1, 2, 24]), subframe=monkey.pick([0.0, 0.0, 0.5]))
    obj = monkey.pick(objects())
    if obj is not None and obj.library is None and monkey.chance(0.3):
        obj.keyframe_insert("location")


@action(1.5)
def change_scenes(monkey: Monkey) -> None:
    """Add, remove and switch scenes and view layers."""
    window = bpy.context.window_manager.windows[0]
    others = [scene for scene in bpy.data.scenes if scene != window.scene]
    if bpy.context.mode != "OBJECT":
        return
    match monkey.random.randrange(4):
        case 0 if len(others) < 2:
            with bpy.context.temp_override(window=window):
                kind = monkey.pick(["NEW", "EMPTY", "LINK_COPY", "FULL_COPY"])
                monkey.blender("scene.new", type=kind)
        case 1 if others:
            window.scene = monkey.pick(others)
        case 2 if others:
            bpy.data.scenes.remove(monkey.pick(others))
        case 3:
            layers = window.scene.view_layers
            window.view_layer = layers.new("Layer") if len(layers) < 3 else monkey.pick(layers)


@action(5)
def undo(monkey: Monkey) -> None:
    for operator, counts in (("ed.undo", [1, 1, 2, 5]), ("ed.redo", [0, 1, 2])):
        for _ in range(monkey.pick(counts)):
            monkey.blender(operator)


@action(0.5)
def new_file(monkey: Monkey) -> None:
    if monkey.chance(0.2):
        bpy.ops.wm.read_factory_settings(use_empty=monkey.chance(0.5))
        switch_extension(True)
    else:
        bpy.ops.wm.read_homefile(use_empty=monkey.chance(0.7))


@action(0.5)
def switch_off_and_on(monkey: Monkey) -> None:
    """Disable RoSy, and enable it after an undo or another action."""
    switch_extension(False)
    try:
        monkey.pick([transform, delete_data, change_scene, undo])(monkey)
    finally:
        switch_extension(True)


@action(1.5)
def save_and_reopen(monkey: Monkey) -> None:
    """Save and open the file, and check that it is the same."""
    if bpy.context.mode != "OBJECT" or any(mesh.is_editmode for mesh in bpy.data.meshes):
        return
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    path, before = str(monkey.folder / "monkey.blend"), fingerprint()
    try:
        bpy.ops.wm.save_as_mainfile(filepath=path)
    except RuntimeError as error:
        monkey.note(f"    not saved: {error}")
        return
    bpy.ops.wm.open_mainfile(filepath=path)
    # Blender does not save settings of tools, reads what is linked again, overridden meshes too, and makes paths relative.
    overrides = [
        f"meshes/{escape(mesh.name)}/*" for mesh in bpy.data.meshes if mesh.override_library
    ]
    allowed = ("*/tool_settings/*", "*@*.blend*", "cameras/*/custom_filepath", *overrides)
    expect_none(changes(before, fingerprint(), allowed), "the saved file differs")


@action(1)
def link_or_append(monkey: Monkey) -> None:
    """Link or append the objects of a copy of this file; override one that is linked."""
    linked = [obj for obj in objects() if obj.library is not None]
    is_full = len(bpy.data.objects) >= MAX_OBJECTS or len(bpy.data.libraries) > 2
    if linked and monkey.chance(0.5):
        obj = monkey.pick(linked).override_create(remap_local_usages=True)
        if obj is not None and obj.data is not None and monkey.chance(0.3):
            obj.data.override_create(remap_local_usages=True)
    if is_full or not to_object_mode(monkey):
        return
    path = monkey.folder / f"library{monkey.random.randrange(3)}.blend"
    if not path.is_file():
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
        except RuntimeError:
            return
    with bpy.data.libraries.load(str(path), link=monkey.chance(0.5)) as (there, here):
        here.objects = [name for name in there.objects if monkey.chance(0.4)][:3]
    for obj in bpy.data.objects:  # parents and targets as well, as Blender's own Append does
        is_new = obj in here.objects or (obj.library is None and not obj.users_collection)
        if is_new and obj.name not in bpy.context.scene.objects:
            bpy.context.scene.collection.objects.link(obj)
