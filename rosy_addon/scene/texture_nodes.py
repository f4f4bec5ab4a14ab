"""Materials that show a texture: its color, its hatching by the light of the scene, or its highlights."""

from __future__ import annotations

from typing import NamedTuple

import bpy
import numpy as np

from ..compositor.look import Look
from .hatching_nodes import set_hatching_look
from .node_builder import NodeBuilder, new_empty_material

#: Strength and roughness of brushed metal.
ANISOTROPY, BRUSHED_ROUGHNESS = 0.8, 0.3


def new_texture_material(name: str, image: bpy.types.Image, uv_map: str) -> bpy.types.Material:
    """Create a material that shows a texture of colors on a UV map, lit like any other surface.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
    uv_map : str
        Name of the UV map.
    """
    material, build = new_empty_material(name)
    tree = build.tree
    image_node = _image_on_map(build, image, uv_map)
    shader = build("ShaderNodeBsdfPrincipled")
    output = build("ShaderNodeOutputMaterial")
    shader.inputs["Roughness"].default_value = 1.0
    tree.links.new(image_node.outputs["Color"], shader.inputs["Base Color"])
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material


class Hatching(NamedTuple):
    """How hatching is drawn from thresholds.

    Attributes
    ----------
    look : Look
        The settings of the ink.
    line_count : int
        Number of lines through a point.
    """

    look: Look
    line_count: int


def new_hatching_material(
    name: str,
    image: bpy.types.Image,
    uv_map: str,
    group: bpy.types.NodeTree,
    hatching: Hatching,
) -> bpy.types.Material:
    """Create a material that draws the hatching of a texture of thresholds; see `hatching_shader`.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
        Thresholds; see `compositor.ink_thresholds`.
    uv_map : str
        Name of the UV map.
    group : bpy.types.NodeTree
        From `hatching_group`.
    hatching : Hatching
    """
    material, build = new_empty_material(name)
    shader = hatching_shader(build, _image_on_map(build, image, uv_map), group, hatching)
    build.tree.links.new(shader, build("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def hatching_shader(
    build: NodeBuilder,
    image_node: bpy.types.Node,
    group: bpy.types.NodeTree,
    hatching: Hatching,
) -> bpy.types.NodeSocket:
    """Add nodes that draw hatching from an image of thresholds, as dense as the light asks.

    In EEVEE, the tone is the diffuse light on the surface. Cycles has no shader that returns the light;
    there it is the ambient occlusion.

    Returns
    -------
    bpy.types.NodeSocket
        The shader.
    """
    tree, look = build.tree, hatching.look
    # Has no effect, but Blender's exporter of glTF takes the color of the first emission, and follows all
    # links before it, which takes long in the group.
    exported = build("ShaderNodeEmission", label="For Exporters")
    tree.links.new(image_node.outputs["Color"], exported.inputs["Color"])
    light = build("ShaderNodeShaderToRGB")
    white = build("ShaderNodeBsdfDiffuse")
    white.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(white.outputs["BSDF"], light.inputs["Shader"])
    luminance = build("ShaderNodeRGBToBW")
    tree.links.new(light.outputs["Color"], luminance.inputs["Color"])
    # Alpha is 1. Cycles ignores the node of the light and its links, and takes the value of the socket.
    occlusion = build("ShaderNodeAmbientOcclusion")
    tone = build.mix("FLOAT", 0.0, occlusion.outputs["AO"], luminance.outputs["Val"])
    tree.links.new(light.outputs["Alpha"], tone.node.inputs["Factor"])
    ink = build("ShaderNodeGroup", node_tree=group)
    set_hatching_look(ink, look, hatching.line_count)
    tree.links.new(image_node.outputs["Color"], ink.inputs["Thresholds"])
    tree.links.new(image_node.outputs["Alpha"], ink.inputs["Spread"])
    tree.links.new(tone, ink.inputs["Tone"])
    emission = build("ShaderNodeEmission")
    color = ink.outputs["Ink" if look.clear_paper else "Color"]
    tree.links.new(color, emission.inputs["Color"])
    surface = emission.outputs["Emission"]
    if look.clear_paper:
        transparent, mix = build("ShaderNodeBsdfTransparent"), build("ShaderNodeMixShader")
        tree.links.new(ink.outputs["Coverage"], mix.inputs[0])
        tree.links.new(transparent.outputs["BSDF"], mix.inputs[1])
        tree.links.new(surface, mix.inputs[2])
        surface = mix.outputs["Shader"]
    unmixed = build("ShaderNodeMixShader")
    unmixed.inputs[0].default_value = 0.0
    tree.links.new(surface, unmixed.inputs[1])
    tree.links.new(exported.outputs["Emission"], unmixed.inputs[2])
    return unmixed.outputs["Shader"]


def new_anisotropy_material(name: str, image: bpy.types.Image, uv_map: str) -> bpy.types.Material:
    """Create a metal that is brushed along the directions of an anisotropy map.

    Nodes and links are those that Blender's importer of glTF makes, in front of which the direction is mirrored
    where the UV map is. So its exporter recognizes the map.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
        From `surface_texture.direction_maps`.
    uv_map : str
        Name of the UV map.
    """
    material, build = new_empty_material(name)
    tree = build.tree
    image_node = _image_on_map(build, image, uv_map)
    decoded = build("ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    decoded.inputs[1].default_value, decoded.inputs[2].default_value = (2, 2, 1), (-1, -1, 0)
    tree.links.new(image_node.outputs["Color"], decoded.inputs[0])
    component = build("ShaderNodeSeparateXYZ")
    tree.links.new(decoded.outputs["Vector"], component.inputs[0])
    angle = build("ShaderNodeMath", operation="ARCTAN2")
    tree.links.new(component.outputs["X"], angle.inputs[1])
    tangent = build("ShaderNodeTangent", direction_type="UV_MAP", uv_map=uv_map)
    tree.links.new(_along_bitangent(build, decoded, tangent, uv_map), angle.inputs[0])
    # Highlights are drawn out along the tangent, and across the strokes of a brush.
    rotation = build.math("ADD", angle.outputs[0], np.pi / 2)
    rotation.node.label = "Rotation"
    strength = build.math("MULTIPLY", component.outputs["Z"], ANISOTROPY)
    strength.node.label = "Strength"
    shader, output = build("ShaderNodeBsdfPrincipled"), build("ShaderNodeOutputMaterial")
    shader.inputs["Metallic"].default_value = 1.0
    shader.inputs["Roughness"].default_value = BRUSHED_ROUGHNESS
    turns = build.math("DIVIDE", rotation, 2 * np.pi)
    for socket, name in (
        (strength, "Anisotropic"),
        (turns, "Anisotropic Rotation"),
        (tangent.outputs["Tangent"], "Tangent"),
    ):
        tree.links.new(socket, shader.inputs[name])
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return material


def _along_bitangent(
    build: NodeBuilder, decoded: bpy.types.Node, tangent: bpy.types.Node, uv_map: str
) -> bpy.types.NodeSocket:
    """Add nodes for the component along the bitangent. Blender turns to the left where the map is mirrored, too."""
    links = build.tree.links
    # In the tangent space of the map, this color is the bitangent.
    bitangent = build("ShaderNodeNormalMap", uv_map=uv_map)
    bitangent.inputs["Color"].default_value = (0.5, 1.0, 0.5, 1.0)
    left, normal = (
        build("ShaderNodeVectorMath", operation="CROSS_PRODUCT"),
        build("ShaderNodeNewGeometry"),
    )
    links.new(normal.outputs["Normal"], left.inputs[0])
    links.new(tangent.outputs["Tangent"], left.inputs[1])
    handedness = build("ShaderNodeVectorMath", operation="DOT_PRODUCT")
    links.new(left.outputs["Vector"], handedness.inputs[0])
    links.new(bitangent.outputs["Normal"], handedness.inputs[1])
    mirrored = build("ShaderNodeVectorMath", operation="SCALE")
    links.new(decoded.outputs["Vector"], mirrored.inputs[0])
    links.new(build.math("SIGN", handedness.outputs["Value"]), mirrored.inputs["Scale"])
    component = build("ShaderNodeSeparateXYZ")
    links.new(mirrored.outputs["Vector"], component.inputs[0])
    return component.outputs["Y"]


def _image_on_map(build: NodeBuilder, image: bpy.types.Image, uv_map: str) -> bpy.types.Node:
    """Add the node of an image on a UV map."""
    coordinates = build("ShaderNodeUVMap", uv_map=uv_map)
    image_node = build("ShaderNodeTexImage", image=image)
    build.tree.links.new(coordinates.outputs["UV"], image_node.inputs["Vector"])
    return image_node
