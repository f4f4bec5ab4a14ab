"""What the scenes share: an empty scene, meshes with live modifiers, lamps, a camera, and drawing."""

import bpy
from mathutils import Matrix, Vector

SIZE = 1920, 1080


def empty_scene(scale: float = 1.0) -> bpy.types.Scene:
    """Start a file without objects, with a picture of 1920 x 1080 pixels times a scale."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = (round(scale * side) for side in SIZE)
    return scene


def add(kind: str, **options) -> bpy.types.Object:
    """Add a primitive mesh, such as "cube", with the options of its operator."""
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(**options)
    return bpy.context.object


def box(*size: float, at=(0, 0, 0)) -> bpy.types.Object:
    """Add a box of a size around a point; its scale is applied, so that bevels are even."""
    cube = add("cube", size=1, location=at)
    cube.data.transform(Matrix.Diagonal((*size, 1)))
    return cube


def polygons(name: str, points, faces) -> bpy.types.Object:
    """Add a mesh of points and polygons."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    return link(bpy.data.objects.new(name, mesh))


def prism(name: str, first, last) -> bpy.types.Object:
    """Add a solid between two outlines of as many points, which run counter-clockwise as seen from beyond the last one."""
    n = len(first)
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    return polygons(name, [*first, *last], [range(n)[::-1], range(n, 2 * n), *sides])


def lathe(name: str, profile, at=(0, 0, 0), levels: int = 2) -> bpy.types.Object:
    """Add a surface of revolution about z through (radius, height) points, with live Screw and Subdivision."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(
        [(r, 0, z) for r, z in profile], [(i, i + 1) for i in range(len(profile) - 1)], []
    )
    obj = link(bpy.data.objects.new(name, mesh))
    obj.location = at
    modify(
        obj, "SCREW", steps=24, render_steps=24, use_merge_vertices=True, use_normal_calculate=True
    )
    return smooth(obj, levels)


def link(obj: bpy.types.Object) -> bpy.types.Object:
    bpy.context.collection.objects.link(obj)
    return obj


def modify(obj: bpy.types.Object, kind: str, **options) -> bpy.types.Object:
    """Add a live modifier."""
    modifier = obj.modifiers.new(kind.title(), kind)
    for name, value in options.items():
        setattr(modifier, name, value)
    return obj


def smooth(obj: bpy.types.Object, levels: int = 2) -> bpy.types.Object:
    """Add a live Subdivision, and shade smooth."""
    obj.data.shade_smooth()
    return modify(obj, "SUBSURF", levels=levels, render_levels=levels) if levels else obj


def cut(obj: bpy.types.Object, *others: bpy.types.Object, by="DIFFERENCE") -> bpy.types.Object:
    """Subtract objects, or unite with them, by one live Boolean modifier each, and hide them."""
    for other in others:
        modify(obj, "BOOLEAN", object=other, operation=by)
        other.hide_render, other.display_type = True, "WIRE"
        other.hide_set(True)
    return obj


def bevel(obj: bpy.types.Object, width: float, segments: int = 2) -> bpy.types.Object:
    """Add a live Bevel of the edges of at least 30 degrees."""
    return modify(obj, "BEVEL", width=width, segments=segments, limit_method="ANGLE")


def collection(name: str, preset: str, *objects: bpy.types.Object) -> None:
    """Move objects into a collection whose own look is a preset."""
    group = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(group)
    group.rosy.preset = preset
    for obj in objects:
        bpy.context.collection.objects.unlink(obj)
        group.objects.link(obj)


def material(obj: bpy.types.Object, color, roughness=0.6, transmission=0.0) -> None:
    """Give an object a material of one color, in linear RGB."""
    made = bpy.data.materials.new(obj.name)
    made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*color, 1)
    inputs["Roughness"].default_value = roughness
    inputs["Transmission Weight"].default_value = transmission
    made.use_raytrace_refraction = transmission > 0
    obj.data.materials.clear()
    obj.data.materials.append(made)


def aimed(obj: bpy.types.Object, at, to) -> bpy.types.Object:
    obj.location = at
    obj.rotation_euler = (Vector(to) - Vector(at)).to_track_quat("-Z", "Y").to_euler()
    return link(obj)


def camera(at, to=(0, 0, 0), lens: float = 50.0) -> None:
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    bpy.context.scene.camera = aimed(bpy.data.objects.new("Camera", data), at, to)


def lamp(kind: str, at, energy: float, to=(0, 0, 0), **options) -> None:
    """Add a lamp: "SUN", "AREA", "SPOT" or "POINT"."""
    data = bpy.data.lights.new(kind.title(), kind)
    data.energy = energy
    for name, value in options.items():
        setattr(data, name, value)
    aimed(bpy.data.objects.new(kind.title(), data), at, to)


def make_fields(*objects: bpy.types.Object, kind: str = "form", degree: int = 4) -> None:
    """Make a field on objects, as the button *Make Field* does."""
    bpy.ops.object.select_all(action="DESELECT")
    for obj in objects:
        obj.select_set(True)
        bpy.context.view_layer.objects.active = obj
    bpy.ops.rosy.field_generate(kind=kind, degree=degree)


def bake(preset: str, **settings) -> None:
    """Choose a preset, change settings of the scene, and bake, as the buttons do."""
    bpy.ops.rosy.preset_apply(preset=preset)
    for name, value in settings.items():
        owner = bpy.context.scene.rosy
        setattr(owner if hasattr(owner, name) else owner.look, name, value)
    bpy.ops.rosy.bake()


def render(path: str, engine: str, samples: int = 32) -> None:
    """Render a PNG file with "eevee" or "cycles"."""
    scene = bpy.context.scene
    if engine == "cycles":
        scene.render.engine = "CYCLES"
        scene.cycles.samples, scene.cycles.use_denoising = samples, False
    else:
        scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
        scene.eevee.taa_render_samples, scene.eevee.use_raytracing = samples, True
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
