"""What the monkey does with Blender alone: to objects, meshes, scenes, cameras and files.

This includes what RoSy made, and what a user or a script does behind RoSy's back.
"""

from __future__ import annotations

import math

import bmesh
import bpy
import numpy as np
from monkey_actions import (
    MAX_OBJECTS,
    CheckError,
    action,
    is_small,
    meshes,
    objects,
    select,
    select_mesh,
    to_object_mode,
)
from monkey_state import EXTENSION, changes, fingerprint, is_owned

# --- objects --------------------------------------------------------------------------


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
    if obj in objects(monkey):
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
    # Blender 5.2 hangs if a node group of its own assets, which are linked, is deleted.
    datablock = monkey.pick(block for block in collection if block.library is None)
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


# --- meshes ---------------------------------------------------------------------------


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
    is_safe = operator != "mesh.subdivide" or _is_manifold(mesh)
    if (not grows or is_small(mesh, 4)) and is_safe and len(bpy.data.objects) < MAX_OBJECTS:
        monkey.blender(operator, **settings)
    if monkey.chance(0.8):
        monkey.blender("object.mode_set", mode="OBJECT")


def _is_manifold(mesh: bpy.types.Mesh) -> bool:
    """Whether a mesh in edit mode has edges of one or two faces. Blender may crash when it subdivides others."""
    return all(len(edge.link_faces) in (1, 2) for edge in bmesh.from_edit_mesh(mesh).edges)


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
        if len(obj.data.materials) > 1:
            obj.data.materials.pop(index=0)
        else:  # to pop the last one leaves slots in objects, and Blender's Join crashes
            obj.data.materials.clear()
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


# --- scenes, cameras, files -----------------------------------------------------------


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
    if bpy.context.mode != "OBJECT" or any(mesh.is_editmode for mesh in bpy.data.meshes):
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
    for obj in bpy.data.objects:  # parents and targets, as Blender's own Append does
        if obj.library is None and not obj.users_collection:
            bpy.context.scene.collection.objects.link(obj)


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
