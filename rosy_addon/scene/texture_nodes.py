"""Materials that show a texture: as colors, as hatching in the light of the scene, or as brushed metal."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from bpy.types import Image, Material, Node, NodeSocket

from ..compositor.look import Look
from ..core.color import alpha_from_hex
from .datablocks import Track
from .hatching_nodes import hatching_group, set_hatching_look
from .node_builder import NodeBuilder, new_empty_material

#: Strength of the anisotropy, and roughness, of brushed metal.
ANISOTROPY, BRUSHED_ROUGHNESS = 0.8, 0.3


class Hatching(NamedTuple):
    """Settings with which a material draws hatching from an image of thresholds.

    Attributes
    ----------
    look : Look
        Its settings of ink, paper and tone are used.
    line_count : int
        Number of lines (pairs of opposite directions of the field) through a point.
    """

    look: Look
    line_count: int


def new_texture_material(
    name: str, image: Image, uv_map: str, add_shader: Callable[[NodeBuilder, Node], NodeSocket]
) -> Material:
    """Create a material that shows a texture on a UV map.

    Parameters
    ----------
    name : str
    image : bpy.types.Image
    uv_map : str
        Name of the UV map.
    add_shader : callable
        Function that adds nodes after the image texture node and returns their shader, such as
        `color_shader`.
    """
    material, build = new_empty_material(name)
    coordinates = build("ShaderNodeUVMap", uv_map=uv_map).outputs["UV"]
    image_node = build("ShaderNodeTexImage", {"Vector": coordinates}, image=image)
    build("ShaderNodeOutputMaterial", {"Surface": add_shader(build, image_node)})
    return material


def color_shader(build: NodeBuilder, image_node: Node, *, is_clear: bool = False) -> NodeSocket:
    """Add a diffuse shader with the colors of an image, and return its output.

    If `is_clear`, the shader is transparent where the image is transparent.
    """
    inputs = {"Base Color": image_node.outputs["Color"], "Roughness": 1.0}
    if is_clear:
        inputs["Alpha"] = image_node.outputs["Alpha"]
    return build("ShaderNodeBsdfPrincipled", inputs).outputs["BSDF"]


def hatching_shader(
    build: NodeBuilder, image_node: Node, hatching: Hatching, track: Track
) -> NodeSocket:
    """Add nodes that draw hatching from an image of thresholds. The darker the surface, the denser it is.

    In EEVEE, the tone is the diffuse light on the surface. Cycles has no node that returns this light, so the
    tone is the ambient occlusion there.

    Parameters
    ----------
    build : NodeBuilder
    image_node : bpy.types.Node
        Image texture node with the thresholds; see `compositor.ink_thresholds`.
    hatching : Hatching
    track : function
        Called with the node group of hatching if it is new; see `datablocks.rollback_on_error`.

    Returns
    -------
    bpy.types.NodeSocket
        Output of the shader.
    """
    look, image_color = hatching.look, image_node.outputs["Color"]
    # This node has no visible effect. Blender's glTF exporter takes the color of the first emission node that
    # it finds, and follows all links to it. Through the node group of hatching that would take long.
    exported = build("ShaderNodeEmission", {"Color": image_color}, label="For Exporters")
    white = build("ShaderNodeBsdfDiffuse", {"Color": (1.0, 1.0, 1.0, 1.0)})
    light = build("ShaderNodeShaderToRGB", {"Shader": white.outputs["BSDF"]})
    luminance = build("ShaderNodeRGBToBW", {"Color": light.outputs["Color"]})
    # The factor of the mix is the alpha of the light. It is 1 in EEVEE. Cycles ignores the node of the light
    # and takes the value of the unconnected socket, which is 0.
    occlusion = build("ShaderNodeAmbientOcclusion")
    tone = build.mix("FLOAT", 0.0, occlusion.outputs["AO"], luminance.outputs["Val"])
    build.connect(light.outputs["Alpha"], tone.node.inputs["Factor"])
    inputs = {"Thresholds": image_color, "Spread": image_node.outputs["Alpha"], "Tone": tone}
    ink = build("ShaderNodeGroup", inputs, node_tree=hatching_group(track))
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


def brushed_metal_shader(build: NodeBuilder, image_node: Node, uv_map: str) -> NodeSocket:
    """Add a metal shader that looks brushed along the directions of an anisotropy map, and return its output.

    The nodes are linked as Blender's glTF importer links them, so the exporter recognizes the map. Nodes
    before them mirror the direction where the UV map is mirrored.

    Parameters
    ----------
    build : NodeBuilder
    image_node : bpy.types.Node
        Image texture node with the anisotropy map, which `surface_texture.line_order` makes.
    uv_map : str
        Name of the UV map.
    """
    color = image_node.outputs["Color"]
    decoded = build.vector_math("MULTIPLY_ADD", color, (2, 2, 1), (-1, -1, 0))
    x, _, length = build("ShaderNodeSeparateXYZ", {0: decoded}).outputs
    tangent = build("ShaderNodeTangent", direction_type="UV_MAP", uv_map=uv_map).outputs["Tangent"]
    angle = build.math("ARCTAN2", _along_bitangent(build, decoded, tangent, uv_map), x)
    # The shader stretches highlights along its tangent. On brushed metal they stretch across the strokes of
    # the brush, hence the quarter turn.
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
    build: NodeBuilder, decoded: NodeSocket, tangent: NodeSocket, uv_map: str
) -> NodeSocket:
    """Add nodes that compute the bitangent component of an anisotropy direction, and return their output.

    Where the UV map is mirrored, the component is negated, as Blender does not mirror the bitangent there.

    Parameters
    ----------
    build : NodeBuilder
    decoded : bpy.types.NodeSocket
        The anisotropy direction: its components along the tangent and the bitangent, from -1 to 1, and its
        strength.
    tangent : bpy.types.NodeSocket
        The tangent of the UV map.
    uv_map : str
        Name of the UV map.
    """
    # As a tangent-space normal map, this color is the direction of the bitangent.
    bitangent = build("ShaderNodeNormalMap", {"Color": (0.5, 1.0, 0.5, 1.0)}, uv_map=uv_map)
    normal = build("ShaderNodeNewGeometry").outputs["Normal"]
    left = build.vector_math("CROSS_PRODUCT", normal, tangent)
    handedness = build.vector_math("DOT_PRODUCT", left, bitangent.outputs["Normal"])
    mirrored = build.scaled(decoded, build.math("SIGN", handedness))
    return build("ShaderNodeSeparateXYZ", {0: mirrored}).outputs["Y"]
