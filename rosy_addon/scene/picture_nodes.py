"""Nodes that show a picture: a material per picture, and per object a modifier with a node group.

The modifier gives the object the material and an attribute with the projection. If the user has applied the
modifier, the material and the attributes are on the mesh of the object.
"""

from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from bpy.types import ID, Image, Material, Mesh, Node, NodeTree, Object

from ..compositor.look import Look, has_clear_paper
from ..projection.camera import Camera
from ..rendering.picture_images import NEUTRAL_GRAY
from .datablocks import INK_TAG, KEY_TAG, OWNED_TAG, Track, is_editable, rosy_modifiers
from .ink_objects import geometry_of_parent, lifted
from .meshes import read_attribute
from .node_builder import NodeBuilder, first_node, new_empty_material, new_modifier_group
from .texture_nodes import Hatching, hatching_shader

#: Name of the modifier that shows a picture.
MODIFIER_NAME = "RoSy"

#: Name of a point attribute: the clip-space (x, y, w) of each vertex in the camera from which the picture was
#: baked.
CLIP_ATTRIBUTE = "rosy_projection"

#: Name of a face attribute: the material index of each face before the modifier. It is restored if the user
#: applies the modifier and then removes the picture.
MATERIAL_ATTRIBUTE = "rosy_material"

#: Types and domains of these attributes. The user's attributes may have the same names, but other types.
_ATTRIBUTE_TYPES = {CLIP_ATTRIBUTE: ("FLOAT_VECTOR", "POINT"), MATERIAL_ATTRIBUTE: ("INT", "FACE")}

_OUTSIDE_COLOR = (NEUTRAL_GRAY, NEUTRAL_GRAY, NEUTRAL_GRAY, 1.0)


@dataclass(frozen=True)
class OutputSettings:
    """Settings for storing and showing pictures in a scene.

    Attributes
    ----------
    window_coordinates : bool
        Whether the picture fills the frame of the camera that renders (window coordinates), instead of being
        projected from the camera from which it was baked.
    emission, diffuse : float
        Strength with which surfaces emit the picture, and factor of the picture as a diffuse color.
    as_float : bool
        Whether linear float values are stored instead of 8-bit sRGB.
    folder : Path or None
        Folder to save images in. None packs them into the .blend file.
    device : {"cpu", "gpu", "auto"}
        Device that draws the pictures.
    relight : bool
        Whether pictures of hatching store its thresholds, from which the material draws hatching in the light
        of the scene. Such pictures are drawn on the CPU.
    over_material : bool
        Whether pictures with transparent paper are shown over the materials of objects, by ink objects.
    """

    window_coordinates: bool = False
    emission: float = 1.0
    diffuse: float = 0.0
    as_float: bool = False
    folder: Path | None = None
    device: str = "cpu"
    relight: bool = False
    over_material: bool = False


def new_material(
    image: Image,
    camera: Camera,
    track: Track,
    settings: OutputSettings,
    look: Look,
    hatching: Hatching | None = None,
) -> Material:
    """Create a material that shows a picture. It looks the same in Cycles and EEVEE.

    The attribute `CLIP_ATTRIBUTE` maps the surface to the picture. An object without it, such as one with
    several instances, is mapped by its current world position. Outside the frame of the picture, the material
    is neutral gray.

    If `hatching` is given, the material draws hatching in the present light on the surface
    (`hatching_shader`), and the settings of emission and diffuse reflection are not used.

    If the paper of ink is transparent, so is the material between the lines. Only front faces have ink, so that a
    line is not drawn twice.

    Parameters
    ----------
    image : bpy.types.Image
        The picture. The material gets the name of this image.
    camera : Camera
        The camera from which the picture was drawn.
    track : function
        Called with each new datablock, which it returns; see `datablocks.rollback_on_error`.
    settings : OutputSettings
    look : Look
        The look of the picture.
    hatching : Hatching, optional
        How hatching is drawn. Given if the image has thresholds of ink instead of colors.
    """
    material, build = new_empty_material(image.name)
    track(material)
    is_inside = None
    if settings.window_coordinates:
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
        shader = hatching_shader(build, image_node, hatching, track)
        if is_inside is not None:
            outside = build("ShaderNodeEmission", {"Color": _OUTSIDE_COLOR})
            shader = build.mix_shaders(is_inside, outside.outputs["Emission"], shader)
    else:
        color = image_node.outputs["Color"]
        if is_inside is not None:
            color = build.mix("RGBA", is_inside, _OUTSIDE_COLOR, color)
        inputs = {"Color": color, "Strength": settings.emission}
        emitted = build("ShaderNodeEmission", inputs).outputs[0]
        # A BSDF has no strength, so the diffuse factor scales the color.
        scaled_color = build.scaled(color, settings.diffuse)
        reflected = build("ShaderNodeBsdfDiffuse", {"Color": scaled_color}).outputs[0]
        shader = build("ShaderNodeAddShader", {0: emitted, 1: reflected}).outputs[0]
        if has_clear_paper(look):
            is_back = build("ShaderNodeNewGeometry").outputs["Backfacing"]
            is_front = build.math("SUBTRACT", 1.0, is_back)
            coverage = build.math("MULTIPLY", image_node.outputs["Alpha"], is_front)
            if is_inside is not None:
                coverage = build.math("MULTIPLY", coverage, is_inside)
            transparent = build("ShaderNodeBsdfTransparent").outputs["BSDF"]
            shader = build.mix_shaders(coverage, transparent, shader)
    build("ShaderNodeOutputMaterial", {"Surface": shader})
    if has_clear_paper(look) and hasattr(material, "cycles"):
        # Ink is not a light source. If Cycles samples it as one, renders are noisier.
        material.cycles.emission_sampling = "NONE"
    return material


def set_sequence_frames(material: Material, first: int, last: int) -> None:
    """Let a material show its image sequence: at each frame, the file with the number of the frame.

    `first` and `last` are the numbers of the first and the last file.
    """
    image_user = image_node(material).image_user
    image_user.frame_start, image_user.frame_offset = first, first - 1
    image_user.frame_duration = last - first + 1
    image_user.use_auto_refresh = True


def _clip_position(build: NodeBuilder, view_projection: np.ndarray) -> Node:
    """Add nodes that compute the position in the clip space of the picture's camera.

    Outputs X, Y and Z of the returned node are x, y and w. `view_projection` is the (4, 4) matrix from world
    space to clip space.
    """
    baked_clip = build("ShaderNodeAttribute", attribute_name=CLIP_ATTRIBUTE).outputs["Vector"]
    world_position = build("ShaderNodeNewGeometry").outputs["Position"]
    live_clip = build.projected(world_position, view_projection)
    has_baked_clip = build.math("GREATER_THAN", build.vector_math("LENGTH", baked_clip), 0.0)
    clip = build.mix("VECTOR", has_baked_clip, live_clip, baked_clip)
    return build("ShaderNodeSeparateXYZ", {0: clip})


def new_group(obj: Object, material: Material, matrix: np.ndarray | None) -> NodeTree:
    """Create a geometry node group that sets a material and the attribute `CLIP_ATTRIBUTE`.

    `set_picture_modifier` names the group, and sets it as the group of RoSy's modifier. The mesh, its material slots
    and other modifiers are not changed.

    Parameters
    ----------
    obj : bpy.types.Object
        The object that gets the modifier. If it is an ink object, the group starts from the geometry of its parent.
    material : bpy.types.Material
    matrix : (4, 4) ndarray or None
        Transforms object space to clip space. None for objects with several instances; they get no attribute.
    """
    group, build, geometry = new_modifier_group(MODIFIER_NAME)
    if obj.get(INK_TAG):
        geometry = geometry_of_parent(build, obj)
    else:
        index = build("GeometryNodeInputMaterialIndex").outputs[0]
        geometry = build.stored_attribute(geometry, MATERIAL_ATTRIBUTE, "INT", "FACE", index)
    inputs = {"Geometry": geometry, "Material": material}
    geometry = build("GeometryNodeSetMaterial", inputs).outputs["Geometry"]
    if matrix is not None:
        position = build("GeometryNodeInputPosition").outputs[0]
        clip = build.projected(position, matrix)
        geometry = build.stored_attribute(geometry, CLIP_ATTRIBUTE, "FLOAT_VECTOR", "POINT", clip)
    if obj.get(INK_TAG):
        geometry = lifted(build, geometry, obj)
    build("NodeGroupOutput", {"Geometry": geometry})
    _add_projection(group, material, matrix)
    return group


def _add_projection(group: NodeTree, material: Material, matrix: np.ndarray | None) -> None:
    """Store a picture, given by its material, and its projection matrix in a node group.

    The matrix is (4, 4), from object space to clip space, or None; see `projections_of_group`.
    """
    projection = group.rosy.projections.add()
    projection.material = material
    projection.matrix = (np.zeros(16) if matrix is None else matrix.ravel()).tolist()


def projections_of_group(group: NodeTree) -> dict[Material, np.ndarray | None]:
    """Return the projections of the pictures that an object can show, by the materials of the pictures.

    The values are (4, 4) object-to-clip matrices, or None if the object has several instances.
    """
    # Groups of earlier versions have no projections.
    projections = {material_of_group(group): None}
    for projection in group.rosy.projections:
        matrix = np.array(projection.matrix).reshape(4, 4)
        projections[projection.material] = matrix if matrix.any() else None
    projections.pop(None, None)  # a material that the user has deleted
    return projections


def material_of_group(group: NodeTree) -> Material | None:
    """Return the material that a node group of `new_group` assigns; None if it assigns none."""
    node = first_node(group, "GeometryNodeSetMaterial")
    return None if node is None else node.inputs["Material"].default_value


def image_node(material: Material) -> Node | None:
    """Return the image texture node of a material that shows a picture; None if there is none."""
    return first_node(material.node_tree, "ShaderNodeTexImage")


def set_picture_modifier(obj: Object, group: NodeTree, pictures: Container[Material] = ()) -> None:
    """Set the node group of RoSy's modifier, and move the modifier to the end of the object's stack.

    The previous group may have projections of other pictures. A projection is copied to the new group if its
    material is in `pictures`, so that the object can show this picture again.
    """
    existing = rosy_modifiers(obj)
    modifier = existing[0] if existing else obj.modifiers.new(MODIFIER_NAME, "NODES")
    modifier.show_expanded = False
    old_group, modifier.node_group = modifier.node_group, group
    for extra in existing[1:]:
        obj.modifiers.remove(extra)
    obj.modifiers.move(obj.modifiers.find(modifier.name), len(obj.modifiers) - 1)
    if old_group is not None and old_group != group:
        shown_material = material_of_group(group)
        for material, matrix in projections_of_group(old_group).items():
            if material != shown_material and material in pictures:
                _add_projection(group, material, matrix)
        if not old_group.users:
            bpy.data.node_groups.remove(old_group)
    group.name = f"RoSy {obj.name}"


def applied_materials(data: ID | None) -> list[Material]:
    """Return the materials of pictures in the slots of a mesh, or of other object data.

    There are some if the user has applied RoSy's modifier. Data that are linked from a library are not
    searched.
    """
    if data is None or not is_editable(data):
        return []
    return [material for material in getattr(data, "materials", ()) if _is_picture(material)]


def shown_materials(obj: Object) -> set[Material]:
    """Return the materials of the pictures that an object shows, by a modifier or in its slots."""
    materials = {material_of_group(modifier.node_group) for modifier in rosy_modifiers(obj)}
    return (materials | set(applied_materials(obj.data))) - {None}


def _is_picture(material: Material | None) -> bool:
    """Return whether RoSy created a material for a picture, and not for strokes or a key."""
    return (
        material is not None
        and bool(material.get(OWNED_TAG))
        and not material.get(KEY_TAG)
        and image_node(material) is not None
    )


def has_applied_picture(data: ID | None) -> bool:
    """Return whether a mesh, or other object data, has materials or attributes of an applied picture."""
    return bool(applied_materials(data) or _applied_attributes(data))


def remove_applied_picture(data: ID | None) -> None:
    """Remove the materials and attributes of an applied modifier of RoSy.

    The mesh must not be in edit mode.
    """
    if not has_applied_picture(data):
        return
    if MATERIAL_ATTRIBUTE in _applied_attributes(data):
        _restore_material_indices(data)
    for index in reversed(range(len(getattr(data, "materials", ())))):
        if _is_picture(data.materials[index]):
            data.materials.pop(index=index)
    if not getattr(data, "materials", True):
        # After `pop` of the last material, objects still have an empty slot, and Blender (4.3, 5.2) crashes
        # when another object is joined to them.
        data.materials.clear()
    for name in _applied_attributes(data):
        data.attributes.remove(data.attributes[name])


def _applied_attributes(data: ID | None) -> list[str]:
    """Return the names of the attributes that are left on a mesh if the user has applied RoSy's modifier.

    The list is empty if `data` is not a mesh that can be edited. A name that two attributes have is left out:
    Blender 4.3 allows this, and then may remove the other one.
    """
    if not isinstance(data, Mesh) or not is_editable(data):
        return []
    found = [(each.name, each.data_type, each.domain) for each in data.attributes]
    names = [name for name, *_ in found]
    return [
        name
        for name, kind in _ATTRIBUTE_TYPES.items()
        if (name, *kind) in found and names.count(name) == 1
    ]


def _restore_material_indices(mesh: Mesh) -> None:
    """Give the faces that show a picture the material index that they had without RoSy's modifier."""
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
