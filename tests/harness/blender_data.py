"""What a Blender file holds, and the values of images and fields, in any Blender."""

import bpy
import numpy as np


def contents():
    """Return the contents of the file: all datablocks, and what objects and meshes hold."""
    bpy.context.view_layer.update()
    result = {
        prop.identifier: sorted(obj.name for obj in getattr(bpy.data, prop.identifier))
        for prop in bpy.data.bl_rna.properties
        if prop.type == "COLLECTION"
    }
    for obj in bpy.data.objects:
        result["object " + obj.name] = [
            [modifier.name for modifier in obj.modifiers],
            [slot.material and slot.material.name for slot in obj.material_slots],
            sorted(key for key, _ in obj.items() if key != "rosy"),
            obj.type == "MESH" and obj.add_rest_position_attribute,
            np.round(obj.matrix_world, 6).tolist(),
        ]
    for mesh in bpy.data.meshes:
        result["mesh " + mesh.name] = [
            sorted(
                (attribute.name, attribute.domain, attribute.data_type)
                for attribute in mesh.attributes
                if not attribute.name.startswith(".")
            ),
            [material and material.name for material in mesh.materials],
            len(mesh.vertices),
            len(mesh.polygons),
        ]
    for scene in bpy.data.scenes:
        result["scene " + scene.name] = [
            len(scene.rosy.bakes),
            scene.view_settings.view_transform,
            bool(scene.render.use_compositing),
            scene.render.engine,
        ]
    return result


def pixels(image):
    """Return the (H, W, 4) values of an image, rows from the bottom."""
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def member_vectors(mesh, name="rosy"):
    """Return the (n, 3) vectors of an attribute."""
    return attribute_values(mesh.attributes[name], "vector", 3)


def render_image(scene, path, engine):
    """Render the scene to a .png or .exr file: (H, W, 4) values of the file, rows from the bottom."""
    is_exr = str(path).endswith(".exr")
    scene.render.engine, scene.render.film_transparent = engine, True
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode = "OPEN_EXR" if is_exr else "PNG", "RGBA"
    settings.color_depth = "32" if is_exr else "8"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    values = pixels(image)
    bpy.data.images.remove(image)
    return values


def attribute_values(attribute, key="value", columns=1):
    """Return the (n,) or (n, columns) float32 values of an attribute."""
    values = np.empty(columns * len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get(key, values)
    return values.reshape(-1, columns) if columns > 1 else values
