"""The node group *RoSy Hatching*, which draws hatching of a given tone from an image of thresholds.

A tone requires that each of up to three layers of hatching lines covers a part of the paper. The group
compares the thresholds of the layers (`compositor.ink_from_thresholds`) with these coverages. It computes the
same formulas as `compositor.hatching`, so it draws what a picture in the same light shows. All of its nodes
are Blender's own, so it works where RoSy is not installed.
"""

from functools import reduce
from operator import add
from typing import Any, NamedTuple

import bpy

from ..compositor.hatching import ONSET_LEAD, ONSET_RANGE
from ..compositor.ink_from_thresholds import (
    DENSITY_FACTOR,
    MIN_TRANSMITTANCE,
    filtered_edges,
    layer_coverage,
    layer_inks,
)
from ..compositor.ink_thresholds import MAX_LAYERS
from ..compositor.look import Look, has_tone_inks
from ..compositor.streak_statistics import MAX_SOFTNESS, MIN_SOFTNESS
from ..compositor.target_tone import MIN_TONE_RANGE
from ..core.color import from_hex, to_linear
from .datablocks import OWNED_TAG, Track
from .node_builder import NodeBuilder, Number

#: Name of the node group.
GROUP_NAME = "RoSy Hatching"

#: Names of the inputs with the ink colors of the three layers of lines, in the order of the layers.
INK_NAMES = ("Ink", "Second Ink", "Third Ink")


class _Input(NamedTuple):
    """An input socket of the node group, with its default and its range."""

    name: str
    kind: str
    default: Any
    description: str
    low: float = 0.0
    high: float = 1.0


_COLOR, _FLOAT, _FACTOR = "NodeSocketColor", "NodeSocketFloat", "FACTOR"

#: The inputs of the group, in the order in which the node shows them.
_INPUTS = (
    _Input("Thresholds", _COLOR, (1.0, 1.0, 1.0, 1.0), "Color of the texture of thresholds"),
    _Input("Spread", _FLOAT, 1.0, "Alpha of the texture of thresholds"),
    _Input("Tone", _FLOAT, 0.5, "How light the hatching is: 0 is covered by ink, 1 is paper"),
    _Input("Shading", _FLOAT, 1.0, "Strength of the tone. 0: paper everywhere"),
    _Input("Black", _FLOAT, 0.0, "Tone that becomes black", -1e6, 1e6),
    _Input("White", _FLOAT, 1.0, "Tone that becomes white", -1e6, 1e6),
    _Input("Gamma", _FLOAT, 1.0, "Gamma of the tones between", 0.05, 20.0),
    _Input("Layers", _FLOAT, 3.0, "Maximum number of lines that cross in the darkest tones", 1, 3),
    _Input("Layering", _FLOAT, 0.3, "Difference in darkness at which the next lines begin"),
    _Input("Crispness", _FLOAT, 0.7, "Edges of lines, from soft to sharp"),
    _Input("Ink", _COLOR, (0.0, 0.0, 0.0, 1.0), "Color of the first lines"),
    _Input("Second Ink", _COLOR, (0.0, 0.0, 0.0, 1.0), "Color of the second lines"),
    _Input("Third Ink", _COLOR, (0.0, 0.0, 0.0, 1.0), "Color of the third lines"),
    _Input("Highlights", _FLOAT, 0.0, "How much the inks become the highlight color in the lights"),
    _Input("Highlight Color", _COLOR, (0.5, 0.2, 0.1, 1.0), "Color of the inks in the lights"),
    _Input("Paper", _COLOR, (1.0, 1.0, 1.0, 1.0), "Color of the paper"),
)


def hatching_group(track: Track) -> bpy.types.NodeTree:
    """Return the node group in the open .blend file. If there is none, create it and call `track` with it."""
    for group in bpy.data.node_groups:
        is_own = group.library is None and group.get(OWNED_TAG)
        is_hatching = group.bl_idname == "ShaderNodeTree" and group.name.startswith(GROUP_NAME)
        if is_own and is_hatching:
            return group
    return track(_new_hatching_group())


def set_hatching_look(node: bpy.types.Node, look: Look, line_count: int) -> None:
    """Set the inputs of a node with this group to the settings of a look.

    Parameters
    ----------
    node : bpy.types.Node
    look : Look
    line_count : int
        Number of lines (pairs of opposite directions of the field) through a point.
    """
    layers, inks = layer_inks(look, line_count)
    ramp = look.ink_color_light if has_tone_inks(look) else look.ink_color
    values = {
        "Shading": look.shading,
        **dict(zip(("Black", "White", "Gamma"), look.tone_levels, strict=True)),
        "Layers": layers,
        "Layering": look.layering,
        "Crispness": look.crispness,
        "Highlights": float(has_tone_inks(look)),
        "Highlight Color": (*to_linear(from_hex(ramp)).tolist(), 1.0),
        "Paper": (*to_linear(from_hex(look.paper_color)).tolist(), 1.0),
    }
    for layer, name in enumerate(INK_NAMES):
        values[name] = (*inks.dark[min(layer, len(inks.dark) - 1)].tolist(), 1.0)
    for name, value in values.items():
        node.inputs[name].default_value = value


def _new_hatching_group() -> bpy.types.NodeTree:
    """Create the node group."""
    group = bpy.data.node_groups.new(GROUP_NAME, "ShaderNodeTree")
    interface = group.interface
    for item in _INPUTS:
        socket = interface.new_socket(
            item.name, description=item.description, in_out="INPUT", socket_type=item.kind
        )
        socket.default_value = item.default
        if item.kind == _FLOAT:
            socket.min_value, socket.max_value = item.low, item.high
            if (item.low, item.high) == (0.0, 1.0):
                socket.subtype = _FACTOR
    for name, kind, description in (
        ("Color", _COLOR, "Ink on paper"),
        ("Ink", _COLOR, "Color of the ink alone"),
        ("Coverage", _FLOAT, "How much of the paper is covered by ink"),
    ):
        interface.new_socket(name, description=description, in_out="OUTPUT", socket_type=kind)
    build = NodeBuilder(group)
    _build_hatching(build, build("NodeGroupInput").outputs)
    return group


def _build_hatching(build: NodeBuilder, source: Any) -> None:
    """Add the nodes between the inputs and the outputs of the group.

    `source` has the output sockets of the Group Input node.
    """

    def number(name: str) -> Number:
        return Number(build, source[name])

    def luminance(color: bpy.types.NodeSocket) -> Number:
        return Number(build, build("ShaderNodeRGBToBW", {"Color": color}).outputs["Val"])

    tone = _tone(number)
    paper = luminance(source["Paper"])
    # If the ink is lighter than the paper, lighter tones need more ink. Luminances are then complemented.
    is_light = luminance(source["Ink"]) > paper

    def complement_if_light(value: Number) -> Number:
        return value + is_light * (1 - value * 2)

    paper_light = complement_if_light(paper).at_least(MIN_TRANSMITTANCE)

    def transmittance(ink: bpy.types.NodeSocket) -> Number:
        return complement_if_light(luminance(ink)) / paper_light

    solid = reduce(Number.at_least, [transmittance(source[name]) for name in INK_NAMES])
    required = solid + complement_if_light(tone) * (1 - solid)
    highlights = number("Highlights") * tone
    light_ink = source["Highlight Color"]
    inks = [build.mix("RGBA", highlights.socket, source[name], light_ink) for name in INK_NAMES]
    # For each ink, the fraction of light that black ink would have to leave to give the same tone.
    left = [
        1 - ((1 - required) / (1 - transmittance(ink)).at_least(MIN_TRANSMITTANCE)).at_most(1.0)
        for ink in inks
    ]
    darkness = 1 - left[0]
    layers, layering = number("Layers"), number("Layering")
    begun = []
    for layer in range(MAX_LAYERS):
        onset = layering * float(layer)
        weight = darkness.smoothstep(onset - ONSET_LEAD, onset + ONSET_RANGE)
        begun.append(weight * (layers > layer + 0.5) if layer else weight)
    total = reduce(add, begun).at_least(1e-6)
    thresholds = build("ShaderNodeSeparateColor", {"Color": source["Thresholds"]})
    channels = [Number(build, socket) for socket in thresholds.outputs]
    filtered = filtered_edges(number("Spread"), channels)
    softness = build.math("POWER", MIN_SOFTNESS / MAX_SOFTNESS, source["Crispness"])
    edge_factor = Number(build, softness) * (DENSITY_FACTOR * MAX_SOFTNESS)
    bare, color, ink_color = None, source["Paper"], inks[-1]
    # The first layer is drawn last, on top of the others.
    for layer, threshold in reversed(list(enumerate(channels))):
        share = begun[layer] / total
        covered = layer_coverage(left[layer], share, threshold, filtered, edge_factor)
        color = build.mix("RGBA", covered.socket, color, inks[layer])
        if bare is None:
            bare = 1 - covered
        else:
            bare = bare * (1 - covered)
            part = covered / (1 - bare).at_least(1e-6)
            ink_color = build.mix("RGBA", part.socket, ink_color, inks[layer])
    coverage = (1 - bare).socket
    build("NodeGroupOutput", {"Color": color, "Ink": ink_color, "Coverage": coverage})


def _tone(number: Any) -> Number:
    """Return the input Tone, changed by the strength of the shading and by the tone curve.

    `number` is a function that returns the input with a name as a `Number`.
    """
    shading = number("Shading")
    tone = 1 - shading + shading * number("Tone")
    black, white = number("Black"), number("White")
    difference = white - black
    # If black and white are the same tone, a small range is taken.
    is_small = (difference * difference) > MIN_TONE_RANGE**2
    difference = difference * is_small + (1 - is_small) * MIN_TONE_RANGE
    stretched = ((tone - black) / difference).at_least(0.0)
    return (stretched ** (1.0 / number("Gamma"))).at_most(1.0)
