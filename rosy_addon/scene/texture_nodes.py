"""Materials that show a texture: its color, its hatching by the light of the scene, or its highlights."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import bpy
import numpy as np

from ..compositor.look import Look
from ..core.color import alpha_from_hex
from .hatching_nodes import hatching_group, set_hatching_look
from .node_builder import NodeBuilder, new_empty_material

#: Strength and roughness of brushed metal.
ANISOTROPY, BRUSHED_ROUGHNESS = 0.8, 0.3


class Hatching(NamedTuple):
    """The look and the number of lines with which a material draws hatching from thresholds.

    Attributes
    ----------
    look : Look
        The settings of the ink.
    line_count : int
        Number of lines through a point.
    """

    look: Look
    line_count: int


def new_texture_material(
    name: str,
    image: bpy.types.Image,
    uv_map: str,
    add_shader: Callable[[NodeBuilder, bpy.types.Node], bpy.types.NodeSocket],
) -> bpy.types.Material:
    """Create a material that shows a texture on a UV map.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
    uv_map : str
        Name of the UV map.
    add_shader : callable
        Adds nodes for the node of the image, and returns the shader, such as `color_shader`.
    """
    material, build = new_empty_material(name)
    coordinates = build("ShaderNodeUVMap", uv_map=uv_map).outputs["UV"]
    image_node = build("ShaderNodeTexImage", {"Vector": coordinates}, image=image)
    build("ShaderNodeOutputMaterial", {"Surface": add_shader(build, image_node)})
    return material


def color_shader(build: NodeBuilder, image_node: bpy.types.Node) -> bpy.types.NodeSocket:
    """Add a shader with the colors of an image, lit like any other surface."""
    inputs = {"Base Color": image_node.outputs["Color"], "Roughness": 1.0}
    return build("ShaderNodeBsdfPrincipled", inputs).outputs["BSDF"]


def hatching_shader(
    build: NodeBuilder,
    image_node: bpy.types.Node,
    hatching: Hatching,
    created: list[bpy.types.ID],
) -> bpy.types.NodeSocket:
    """Add nodes that draw hatching from an image of thresholds, as dense as the light asks.

    In EEVEE, the tone is the diffuse light on the surface. Cycles has no shader that returns the light;
    there it is the ambient occlusion.

    Parameters
    ----------
    build : NodeBuilder
    image_node : bpy.types.Node
        Node of an image of thresholds; see `compositor.ink_thresholds`.
    hatching : Hatching
    created : list of bpy.types.ID
        Gets the node group of hatching if it is new; see `owned_data.rollback_on_error`.

    Returns
    -------
    bpy.types.NodeSocket
        The shader.
    """
    look, image_color = hatching.look, image_node.outputs["Color"]
    # Has no visible effect. Blender's glTF exporter takes the color of the first emission and follows all links
    # before it; in the node group that would take long.
    exported = build("ShaderNodeEmission", {"Color": image_color}, label="For Exporters")
    white = build("ShaderNodeBsdfDiffuse", {"Color": (1.0, 1.0, 1.0, 1.0)})
    light = build("ShaderNodeShaderToRGB", {"Shader": white.outputs["BSDF"]})
    luminance = build("ShaderNodeRGBToBW", {"Color": light.outputs["Color"]})
    # Alpha is 1. Cycles ignores the node of the light and its links, and takes the value of the socket.
    occlusion = build("ShaderNodeAmbientOcclusion")
    tone = build.mix("FLOAT", 0.0, occlusion.outputs["AO"], luminance.outputs["Val"])
    build.connect(light.outputs["Alpha"], tone.node.inputs["Factor"])
    inputs = {"Thresholds": image_color, "Spread": image_node.outputs["Alpha"], "Tone": tone}
    ink = build("ShaderNodeGroup", inputs, node_tree=hatching_group(created))
    set_hatching_look(ink, look, hatching.line_count)
    paper_alpha = alpha_from_hex(look.paper_color)
    color = ink.outputs["Color" if paper_alpha == 1 else "Ink"]
    surface = build("ShaderNodeEmission", {"Color": color}).outputs["Emission"]
    if paper_alpha < 1:
        paper = build("ShaderNodeEmission", {"Color": ink.inputs["Paper"].default_value[:]})
        transparent = build("ShaderNodeBsdfTransparent").outputs["BSDF"]
        behind = build.mix_shaders(paper_alpha, transparent, paper.outputs["Emission"])
        surface = build.mix_shaders(ink.outputs["Coverage"], behind, surface)
    return build.mix_shaders(0.0, surface, exported.outputs["Emission"])


def brushed_metal_shader(
    build: NodeBuilder, image_node: bpy.types.Node, uv_map: str
) -> bpy.types.NodeSocket:
    """Add a metal that is brushed along the directions of an anisotropy map.

    The nodes are linked like the ones of Blender's glTF importer, so its exporter recognizes the map. Nodes
    before them mirror the direction where the UV map is mirrored.

    Parameters
    ----------
    build : NodeBuilder
    image_node : bpy.types.Node
        Node of an image from `surface_texture.line_order`.
    uv_map : str
        Name of the UV map.
    """
    color = image_node.outputs["Color"]
    decoded = build.vector_math("MULTIPLY_ADD", color, (2, 2, 1), (-1, -1, 0))
    x, _, length = build("ShaderNodeSeparateXYZ", {0: decoded}).outputs
    tangent = build("ShaderNodeTangent", direction_type="UV_MAP", uv_map=uv_map).outputs["Tangent"]
    angle = build.math("ARCTAN2", _along_bitangent(build, decoded, tangent, uv_map), x)
    # Highlights are drawn out along the tangent, and across the strokes of a brush.
    rotation = build.math("ADD", angle, np.pi / 2)
    rotation.node.label = "Rotation"
    strength = build.math("MULTIPLY", length, ANISOTROPY)
    strength.node.label = "Strength"
    inputs = {
        "Metallic": 1.0,
        "Roughness": BRUSHED_ROUGHNESS,
        "Anisotropic": strength,
        "Anisotropic Rotation": build.math("DIVIDE", rotation, 2 * np.pi),
        "Tangent": tangent,
    }
    return build("ShaderNodeBsdfPrincipled", inputs).outputs["BSDF"]


def _along_bitangent(
    build: NodeBuilder, decoded: bpy.types.NodeSocket, tangent: bpy.types.NodeSocket, uv_map: str
) -> bpy.types.NodeSocket:
    """Add nodes for the component along the bitangent, mirrored where the UV map is: Blender does not mirror it."""
    # In the tangent space of the map, this color is the bitangent.
    bitangent = build("ShaderNodeNormalMap", {"Color": (0.5, 1.0, 0.5, 1.0)}, uv_map=uv_map)
    normal = build("ShaderNodeNewGeometry").outputs["Normal"]
    left = build.vector_math("CROSS_PRODUCT", normal, tangent)
    handedness = build.vector_math("DOT_PRODUCT", left, bitangent.outputs["Normal"])
    mirrored = build.scaled(decoded, build.math("SIGN", handedness))
    return build("ShaderNodeSeparateXYZ", {0: mirrored}).outputs["Y"]
