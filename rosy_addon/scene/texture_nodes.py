"""Materials that show a texture: its color, or its hatching by the light of the scene."""

from __future__ import annotations

import bpy

from ..compositor.look import Look
from .hatching_nodes import set_hatching_look
from .node_builder import NodeBuilder, new_empty_material


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


def new_hatching_material(
    name: str,
    image: bpy.types.Image,
    uv_map: str,
    group: bpy.types.NodeTree,
    look: Look,
    line_count: int,
) -> bpy.types.Material:
    """Create a material that draws the hatching of a texture of thresholds, as dense as the light asks.

    In EEVEE, the tone is the diffuse light on the surface. Cycles has no shader that returns the light;
    there it is the ambient occlusion.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
        Thresholds; see `compositor.ink_thresholds`.
    uv_map : str
        Name of the UV map.
    group : bpy.types.NodeTree
        From `hatching_group`.
    look : Look
        The settings of the ink.
    line_count : int
        Number of lines through a point.
    """
    material, build = new_empty_material(name)
    tree = build.tree
    image_node = _image_on_map(build, image, uv_map)
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
    hatching = build("ShaderNodeGroup", node_tree=group)
    set_hatching_look(hatching, look, line_count)
    tree.links.new(image_node.outputs["Color"], hatching.inputs["Thresholds"])
    tree.links.new(image_node.outputs["Alpha"], hatching.inputs["Spread"])
    tree.links.new(tone, hatching.inputs["Tone"])
    emission, output = build("ShaderNodeEmission"), build("ShaderNodeOutputMaterial")
    color = hatching.outputs["Ink" if look.clear_paper else "Color"]
    tree.links.new(color, emission.inputs["Color"])
    surface = emission.outputs["Emission"]
    if look.clear_paper:
        transparent, mix = build("ShaderNodeBsdfTransparent"), build("ShaderNodeMixShader")
        tree.links.new(hatching.outputs["Coverage"], mix.inputs[0])
        tree.links.new(transparent.outputs["BSDF"], mix.inputs[1])
        tree.links.new(surface, mix.inputs[2])
        surface = mix.outputs["Shader"]
    tree.links.new(surface, output.inputs["Surface"])
    return material


def _image_on_map(build: NodeBuilder, image: bpy.types.Image, uv_map: str) -> bpy.types.Node:
    """Add the node of an image on a UV map."""
    coordinates = build("ShaderNodeUVMap", uv_map=uv_map)
    image_node = build("ShaderNodeTexImage", image=image)
    build.tree.links.new(coordinates.outputs["UV"], image_node.inputs["Vector"])
    return image_node
