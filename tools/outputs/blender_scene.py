"""The scene in which cases run in Blender, and functions that write the data that a case has made."""

import json
import os
from collections.abc import Sequence
from math import cos, sin
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

#: Points of a brush stroke along the torus, in object space.
COMB_STROKE = [
    {
        "name": "",
        "location": (1.25 * cos(k / 9), 1.25 * sin(k / 9), 0),
        "pressure": 1.0,
        "is_start": False,
    }
    for k in range(12)
]


def names_of_case(case: str) -> dict[str, Any]:
    """Make the scene, and return the variables and functions that the code of a case may use, by name."""
    ring = build_scene(6 if not case.startswith("card-degree") else int(case[-1]))
    rosy = bpy.context.scene.rosy

    def select_ring() -> None:
        bpy.ops.object.select_all(action="DESELECT")
        ring.select_set(True)
        bpy.context.view_layer.objects.active = ring

    def look(settings: str) -> None:
        for name, value in (word.split("=") for word in settings.split()):
            kind = type(getattr(rosy.look, name))
            setattr(rosy.look, name, value == "on" if kind is bool else kind(value))

    functions = (select_ring, look, dump_images, dump_attributes, dump_pencil, dump_names)
    names = {function.__name__: function for function in functions}
    names |= {"bpy": bpy, "ops": bpy.ops.rosy, "rosy": rosy, "strokes": rosy.strokes}
    return names | {"ring": ring, "comb_stroke": COMB_STROKE}


def build_scene(degree: int) -> Any:
    """Open a new file with all kinds of objects, save it as scene.blend, and return the torus."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene, meshes = bpy.context.scene, bpy.ops.mesh
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    scene.view_settings.view_transform = "Standard"
    scene.rosy.tone_attribute = "shade"
    meshes.primitive_torus_add(
        location=(1.5, 0.2, 0.1), rotation=(0.5, 0.2, 0.0), major_segments=24, minor_segments=12
    )
    ring = bpy.context.object
    ring.name, ring.scale = "Ring", (0.9, 0.9, 1.1)
    shade = ring.data.attributes.new("shade", "FLOAT", "POINT")
    shade.data.foreach_set("value", [0.5 + 0.4 * vertex.co.x for vertex in ring.data.vertices])
    bpy.ops.rosy.field_generate(kind="smoothest", degree=degree)
    meshes.primitive_monkey_add(location=(-1.0, 0.0, 0.1))
    monkey = bpy.context.object
    bpy.ops.object.shade_smooth()
    modifier = monkey.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = 1
    bpy.ops.rosy.field_generate(kind="curvature", degree=4)
    for frame, x in ((6, -0.6), (1, -1.0)):
        monkey.location.x = x
        monkey.keyframe_insert("location", frame=frame)
    _add("Mirrored", monkey.data, (0.4, 1.8, 1.0)).scale = (-0.6, 0.6, 0.6)
    group = bpy.data.collections.new("Group")
    group.objects.link(bpy.data.objects.new("Part", ring.data))
    instance = _add("Instance", None, (0.3, -1.2, -0.5))
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.scale = (0.3, 0.3, 0.3)
    ground = bpy.data.meshes.new("Ground")
    ground.from_pydata([(-4, -3, -1), (4, -3, -1), (4, 4, -1), (-4, 4, -1)], [], [(0, 1, 2, 3)])
    _add("Ground", ground, (0.0, 0.0, 0.0))
    for kind, energy, location in (("SUN", 2.0, (-2, -3, 4)), ("AREA", 150.0, (3, -2, 2))):
        light = bpy.data.lights.new(kind.title(), kind)
        light.energy = energy
        _add(kind.title(), light, location)
    scene.camera = _add("Camera", bpy.data.cameras.new("Camera"), (0.5, -6.5, 2.0))
    ortho = _add("Ortho", bpy.data.cameras.new("Ortho"), (4.0, -4.0, 3.0))
    ortho.data.type, ortho.data.ortho_scale = "ORTHO", 5.0
    ring.select_set(True)
    bpy.context.view_layer.update()
    bpy.ops.wm.save_as_mainfile(filepath=f"{os.getcwd()}/scene.blend")
    return ring


def _add(name: str, data: Any, location: Sequence[float]) -> Any:
    """Add an object. Cameras and lights look at the middle of the scene."""
    obj = bpy.data.objects.new(name, data)
    obj.location = location
    if obj.type in ("CAMERA", "LIGHT"):
        direction = Vector((0.2, 0.0, 0.0)) - obj.location
        obj.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(obj)
    return obj


def dump_images() -> None:
    """Write the pixels of all images."""
    for image in bpy.data.images:
        values = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(values)
        width, height = image.size
        np.save(f"image {image.name}.npy", values.reshape(height, width, -1))


def dump_attributes() -> None:
    """Write the attributes of all meshes, point clouds and curves, with one number per line."""
    values_by_name = {}
    for kind in ("meshes", "pointclouds", "hair_curves"):
        for data in getattr(bpy.data, kind, ()):
            for attribute in data.attributes:
                rows = attribute.data
                if attribute.name.startswith(".") or not len(rows):
                    continue
                key = next(k for k in ("value", "vector", "color") if hasattr(rows[0], k))
                values = [getattr(row, key) for row in rows]
                values_by_name[f"{kind} {data.name} {attribute.name}"] = [
                    list(v) if hasattr(v, "__len__") else v for v in values
                ]
    _write_json("attributes.json", values_by_name)


def dump_pencil() -> None:
    """Write the points of all Grease Pencil strokes (version 2 or 3 of Grease Pencil)."""
    points_by_layer = {}
    for data in getattr(bpy.data, "grease_pencils_v3", bpy.data.grease_pencils):
        for layer in data.layers:
            for frame in layer.frames:
                strokes = frame.strokes if hasattr(frame, "strokes") else frame.drawing.strokes
                name = layer.info if hasattr(layer, "info") else layer.name
                points_by_layer[f"{data.name} {name}"] = [
                    [
                        [*p.co, p.pressure, p.strength]
                        if hasattr(p, "co")
                        else [*p.position, p.radius, p.opacity]
                        for p in stroke.points
                    ]
                    for stroke in strokes
                ]
    _write_json("pencil.json", points_by_layer)


def dump_names() -> None:
    """Write the names of all datablocks, and of the modifiers and materials of objects."""
    names_by_key = {
        prop.identifier: [data.name for data in getattr(bpy.data, prop.identifier)]
        for prop in bpy.data.bl_rna.properties
        if prop.type == "COLLECTION"
    }
    for obj in bpy.data.objects:
        names = [modifier.name for modifier in obj.modifiers]
        names += [slot.material.name for slot in obj.material_slots if slot.material]
        names_by_key[f"object {obj.name}"] = names
    _write_json("names.json", {key: sorted(names) for key, names in names_by_key.items()})


def _write_json(name: str, data: Any) -> None:
    """Write a JSON file with sorted keys and one value per line."""
    Path(name).write_text(json.dumps(data, indent=0, sort_keys=True))
