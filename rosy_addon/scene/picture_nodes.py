"""Nodes that show a picture: a material per camera, a node group and a modifier per object.

If the user has applied the modifier, the mesh of the object itself has the material and the attributes.
"""

from __future__ import annotations

from collections.abc import Container

import bpy
import numpy as np

from ..projection.camera import Camera
from ..rendering.picture_images import NEUTRAL_GRAY
from .datablocks import KEY_TAG, OWNED_TAG, is_editable, is_rosy_modifier
from .meshes import read_attribute
from .node_builder import NodeBuilder, new_empty_material, new_modifier_group
from .texture_nodes import Hatching, hatching_shader

#: Name of the modifier that shows a picture.
MODIFIER_NAME = "RoSy"

#: Point attribute: the clip-space (x, y, w) of each vertex for the camera of the bake.
CLIP_ATTRIBUTE = "rosy_projection"

#: Face attribute: the material index that each face had. Restored if the user applies the modifier and then
#: removes the picture.
MATERIAL_ATTRIBUTE = "rosy_material"

_OUTSIDE_COLOR = (NEUTRAL_GRAY, NEUTRAL_GRAY, NEUTRAL_GRAY, 1.0)


def new_material(
    image: bpy.types.Image,
    camera: Camera,
    created: list[bpy.types.ID],
    *,
    window_coordinates: bool,
    emission: float,
    diffuse: float,
    hatching: Hatching | None = None,
) -> bpy.types.Material:
    """Create a material that shows a picture, the same in Cycles and EEVEE.

    Hatching is drawn by the light on the surface; see `hatching_shader`.

    The attribute `CLIP_ATTRIBUTE` gives the position in the picture. Objects without it, such as
    those with several instances of one mesh, use their current world position. Outside the frame of
    the picture, the material is neutral gray.

    Parameters
    ----------
    image : bpy.types.Image
        The material gets its name.
    camera : Camera
        From which the picture was drawn.
    created : list of bpy.types.ID
        Gets the new datablocks; see `owned_data.rollback_on_error`.
    window_coordinates : bool
        Map the picture to the frame of the current camera instead.
    emission : float
        Strength of the emission.
    diffuse : float
        Factor of the diffuse color.
    hatching : Hatching, optional
        How hatching is drawn, if the image has thresholds of ink and not colors.
    """
    material, build = new_empty_material(image.name)
    created.append(material)
    is_inside = None
    if window_coordinates:
        coordinates = build("ShaderNodeTexCoord").outputs["Window"]
    else:
        x, y, w = _clip_position(build, camera.projection @ camera.view).outputs
        max_abs_xy = build.math("MAXIMUM", build.math("ABSOLUTE", x), build.math("ABSOLUTE", y))
        uv = {
            axis: build.math("MULTIPLY_ADD", build.math("DIVIDE", value, w), 0.5, 0.5)
            for axis, value in (("X", x), ("Y", y))
        }
        coordinates = build("ShaderNodeCombineXYZ", uv).outputs[0]
        is_inside = build.math("LESS_THAN", max_abs_xy, w)
    image_node = build.frame_image(image, coordinates)
    if hatching is not None:
        shader = hatching_shader(build, image_node, hatching, created)
        if is_inside is not None:
            outside = build("ShaderNodeEmission", {"Color": _OUTSIDE_COLOR})
            shader = build.mix_shaders(is_inside, outside.outputs["Emission"], shader)
    else:
        color = image_node.outputs["Color"]
        if is_inside is not None:
            color = build.mix("RGBA", is_inside, _OUTSIDE_COLOR, color)
        emitted = build("ShaderNodeEmission", {"Color": color, "Strength": emission}).outputs[0]
        # A BSDF has no strength, so the diffuse factor scales the color.
        scaled_color = build.scaled(color, diffuse)
        reflected = build("ShaderNodeBsdfDiffuse", {"Color": scaled_color}).outputs[0]
        shader = build("ShaderNodeAddShader", {0: emitted, 1: reflected}).outputs[0]
    build("ShaderNodeOutputMaterial", {"Surface": shader})
    return material


def set_sequence_frames(material: bpy.types.Material, first: int, last: int) -> None:
    """Set the frame range of a material's image sequence. Each file is shown at its own frame."""
    for node in material.node_tree.nodes:
        if node.bl_idname == "ShaderNodeTexImage":
            image_user = node.image_user
            image_user.frame_start, image_user.frame_offset = first, first - 1
            image_user.frame_duration = last - first + 1
            image_user.use_auto_refresh = True


def _clip_position(build: NodeBuilder, view_projection: np.ndarray) -> bpy.types.Node:
    """Add a node with the clip-space x, y and w as its outputs X, Y and Z, and return it."""
    baked_clip = build("ShaderNodeAttribute", attribute_name=CLIP_ATTRIBUTE).outputs["Vector"]
    world_position = build("ShaderNodeNewGeometry").outputs["Position"]
    live_clip = build.transformed(world_position, _clip_rows(view_projection))
    has_baked_clip = build.math("GREATER_THAN", build.vector_math("LENGTH", baked_clip), 0.0)
    clip = build.mix("VECTOR", has_baked_clip, live_clip, baked_clip)
    return build("ShaderNodeSeparateXYZ", {0: clip})


def new_group(
    name: str, material: bpy.types.Material, matrix: np.ndarray | None
) -> bpy.types.NodeTree:
    """Create a geometry node group that sets a material and the attribute `CLIP_ATTRIBUTE`.

    The user's mesh, material slots and other modifiers are not changed.

    Parameters
    ----------
    name : str
    material : bpy.types.Material
    matrix : (4, 4) ndarray or None
        Object to clip space. None for objects with several instances, which get no attribute.
    """
    group, build, geometry = new_modifier_group(name)
    material_index = build("GeometryNodeInputMaterialIndex").outputs[0]
    geometry = build.stored_attribute(geometry, MATERIAL_ATTRIBUTE, "INT", "FACE", material_index)
    inputs = {"Geometry": geometry, "Material": material}
    geometry = build("GeometryNodeSetMaterial", inputs).outputs["Geometry"]
    if matrix is not None:
        position = build("GeometryNodeInputPosition").outputs[0]
        clip_position = build.transformed(position, _clip_rows(matrix))
        geometry = build.stored_attribute(
            geometry, CLIP_ATTRIBUTE, "FLOAT_VECTOR", "POINT", clip_position
        )
    build("NodeGroupOutput", {"Geometry": geometry})
    _add_projection(group, material, matrix)
    return group


def _add_projection(
    group: bpy.types.NodeTree, material: bpy.types.Material, matrix: np.ndarray | None
) -> None:
    """Store how an object shows a picture, for `projections_of_group`."""
    projection = group.rosy.projections.add()
    projection.material = material
    projection.matrix = (np.zeros(16) if matrix is None else matrix.ravel()).tolist()


def projections_of_group(
    group: bpy.types.NodeTree,
) -> dict[bpy.types.Material, np.ndarray | None]:
    """Return the pictures that an object can show, by their materials.

    The values are the object-to-clip matrices, (4, 4); None for objects with several instances.
    """
    projections = {}
    for projection in group.rosy.projections:
        matrix = np.array(projection.matrix).reshape(4, 4)
        projections[projection.material] = matrix if matrix.any() else None
    # The user may have deleted a material, and groups of earlier versions have no projections.
    shown_material = material_of_group(group)
    return {
        material: matrix
        for material, matrix in ({shown_material: None} | projections).items()
        if material is not None
    }


def material_of_group(group: bpy.types.NodeTree) -> bpy.types.Material | None:
    """Return the material that a group of `new_group` sets; None if it sets none."""
    for node in group.nodes:
        if node.bl_idname == "GeometryNodeSetMaterial":
            return node.inputs["Material"].default_value
    return None


def image_node(material: bpy.types.Material) -> bpy.types.Node | None:
    """Return the node of the image of a material of `new_material`; None if there is none."""
    nodes = material.node_tree.nodes if material.node_tree is not None else ()
    return next((node for node in nodes if node.bl_idname == "ShaderNodeTexImage"), None)


def _clip_rows(matrix: np.ndarray) -> np.ndarray:
    """Return the rows of a (4, 4) matrix for the clip-space x, y and w: (3, 4)."""
    return np.asarray(matrix)[[0, 1, 3]]


def set_picture_modifier(
    obj: bpy.types.Object,
    node_group: bpy.types.NodeTree,
    pictures: Container[bpy.types.Material] = (),
) -> None:
    """Set the node group of RoSy's modifier, and move it to the end of the object's stack.

    The new group keeps how the object shows its other pictures, as far as they are in `pictures`.
    """
    existing = [modifier for modifier in obj.modifiers if is_rosy_modifier(modifier)]
    modifier = existing[0] if existing else obj.modifiers.new(MODIFIER_NAME, "NODES")
    modifier.show_expanded = False
    old_group, modifier.node_group = modifier.node_group, node_group
    for extra in existing[1:]:
        obj.modifiers.remove(extra)
    last = len(obj.modifiers) - 1
    obj.modifiers.move(obj.modifiers.find(modifier.name), last)
    if old_group is not None and old_group != node_group:
        shown_material = material_of_group(node_group)
        for material, matrix in projections_of_group(old_group).items():
            if material != shown_material and material in pictures:
                _add_projection(node_group, material, matrix)
        if not old_group.users:
            bpy.data.node_groups.remove(old_group)
    node_group.name = f"RoSy {obj.name}"


def applied_materials(data: bpy.types.ID | None) -> list[bpy.types.Material]:
    """Return the pictures in the material slots of a mesh, or of other data of an object.

    They are there if the modifier was applied. Empty if the data are linked from a library.
    """
    if data is None or not is_editable(data):
        return []
    return [material for material in getattr(data, "materials", ()) if _is_picture(material)]


def shown_materials(obj: bpy.types.Object) -> set[bpy.types.Material]:
    """Return the materials of the pictures that an object shows."""
    modifiers = [modifier for modifier in obj.modifiers if is_rosy_modifier(modifier)]
    materials = {material_of_group(modifier.node_group) for modifier in modifiers}
    return (materials | set(applied_materials(obj.data))) - {None}


def _is_picture(material: bpy.types.Material | None) -> bool:
    """Return whether RoSy created a material for a picture, and not for strokes or a key."""
    return (
        material is not None
        and bool(material.get(OWNED_TAG))
        and not material.get(KEY_TAG)
        and image_node(material) is not None
    )


def has_applied_picture(data: bpy.types.ID | None) -> bool:
    """Return whether a mesh, or other data, have the results of `new_group`: the modifier was applied."""
    return bool(applied_materials(data) or _applied_attributes(data))


def remove_applied_picture(data: bpy.types.ID | None) -> None:
    """Remove what the applied modifier has left in a mesh or other data, not in edit mode."""
    if not has_applied_picture(data):
        return
    if MATERIAL_ATTRIBUTE in _applied_attributes(data):
        _restore_material_indices(data)
    for index in reversed(range(len(getattr(data, "materials", ())))):
        if _is_picture(data.materials[index]):
            data.materials.pop(index=index)
    if not getattr(data, "materials", True):
        # To pop the last material leaves a slot in the objects, and Blender crashes if another
        # object is joined to them (4.3, 5.2).
        data.materials.clear()
    for name in _applied_attributes(data):
        data.attributes.remove(data.attributes[name])


def _applied_attributes(data: bpy.types.ID | None) -> list[str]:
    """Return the names of the attributes of `new_group` that a mesh has."""
    if not isinstance(data, bpy.types.Mesh) or not is_editable(data):
        return []
    return [name for name in (CLIP_ATTRIBUTE, MATERIAL_ATTRIBUTE) if name in data.attributes]


def _restore_material_indices(mesh: bpy.types.Mesh) -> None:
    """Give the faces that show a picture the material that they had before."""
    shows_picture = np.array([_is_picture(material) for material in mesh.materials], dtype=bool)
    index = read_attribute(mesh, "material_index", np.int32, 1)
    earlier_index = read_attribute(mesh, MATERIAL_ATTRIBUTE, np.int32, 1)
    if index is None or earlier_index is None or not shows_picture.any():
        return
    index = np.where(shows_picture[np.clip(index, 0, len(shows_picture) - 1)], earlier_index, index)
    if index.any():
        mesh.attributes["material_index"].data.foreach_set("value", index)
    else:
        mesh.attributes.remove(mesh.attributes["material_index"])
    mesh.update()
