"""The shaders, and what each of them reads and writes: all that a device has to be told.

The sources stand beside this, in GLSL without declarations: these differ from one device to the
next, and are made from what is listed here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SOURCES = Path(__file__).with_name("glsl")

#: Pixels of a work group, across and up.
GROUP = (8, 8)

#: Names and types of what a shader is told for one run.
Constants = tuple[tuple[str, str], ...]

_CLIP: Constants = tuple((f"clip_{axis}", "vec4") for axis in "xyzw")
_PLANES: Constants = tuple((f"plane{number}", "vec4") for number in range(6))
_WINDOW: Constants = (("corner", "ivec2"),)
_CAMERA: Constants = (("across", "vec4"), ("shift", "vec2"), ("perspective", "int"))
_COVERING: Constants = (("degree", "int"), ("lines", "int"), ("around", "int"))
_GUIDE: Constants = (("guiding_angle", "float"),)


@dataclass(frozen=True)
class Compute:
    """A shader over the pixels of an image.

    Attributes
    ----------
    name : str
        Of its source.
    textures : tuple of str
        What it reads; names that end in ``[]`` are arrays.
    images : tuple of (str, str)
        What it writes, and the format; names likewise.
    constants : tuple of (str, str)
        Names and GLSL types.
    """

    name: str
    textures: tuple[str, ...]
    images: tuple[tuple[str, str], ...]
    constants: Constants

    @property
    def source(self) -> str:
        """GLSL without declarations."""
        parts = ["common.glsl", f"{self.name}.comp.glsl"]
        if "triangles" in self.textures:
            parts.insert(1, "triangle.glsl")
        return "".join(map(_read, parts))


@dataclass(frozen=True)
class Drawing:
    """A shader over the triangles of a surface.

    Attributes
    ----------
    name : str
        Of its sources.
    textures : tuple of str
    varyings : tuple of (str, str)
        From the vertices to the pixels: names and GLSL types.
    target : str
        What a pixel is given, a vec4.
    constants : tuple of (str, str)
    """

    name: str
    textures: tuple[str, ...]
    varyings: Constants
    target: str
    constants: Constants

    @property
    def vertex_source(self) -> str:
        """GLSL without declarations."""
        return _read(f"{self.name}.vert.glsl")

    @property
    def fragment_source(self) -> str:
        """GLSL without declarations."""
        return _read("common.glsl") + _read(f"{self.name}.frag.glsl")


def _read(name: str) -> str:
    return (SOURCES / name).read_text(encoding="utf-8")


_BEYOND: Constants = (("beyond", "vec4"), ("beyond_too", "vec2"))

SEEN = Drawing("seen", (), (("triangle", "float"),), "seen", (*_CLIP, ("body", "float")))

#: As SEEN, where planes cut something away: looking at them takes a third of its time.
SEEN_CUT = Drawing(
    "seen_cut",
    (),
    (("triangle", "float"), *_BEYOND),
    "seen",
    (*_CLIP, *_PLANES, ("body", "float")),
)

RESOLVE = Compute(
    "resolve",
    ("seen", "triangles"),
    (
        ("normals", "RGBA32F"),
        ("values_seen", "RGBA32F"),
        ("slopes", "RGBA32F"),
        ("traits_seen[]", "RGBA32F"),
    ),
    (
        *_WINDOW,
        *_CAMERA,
        ("pixels_per_unit", "float"),
        ("place_x", "vec4"),
        ("place_y", "vec4"),
        ("place_z", "vec4"),
        ("scale", "float"),
        ("body", "float"),
        ("texels", "int"),
        ("row_bits", "int"),
        ("traits", "int"),
        ("STEEPEST", "float"),
        ("TOLERANCE", "float"),
        ("OBLIQUE_TOLERANCE", "float"),
    ),
)

ANCHORED = Compute(
    "anchored",
    ("seen", "triangles"),
    (("raw_noise", "RGBA32F"),),
    (
        *_WINDOW,
        *_CAMERA,
        ("place_x", "vec4"),
        ("place_y", "vec4"),
        ("place_z", "vec4"),
        ("body", "float"),
        ("texels", "int"),
        ("row_bits", "int"),
        ("lattice_x", "vec4"),
        ("lattice_y", "vec4"),
        ("lattice_z", "vec4"),
        ("unit_of_pixel", "float"),
        ("unit_of_cell", "float"),
        ("least_growth", "float"),
        ("amplitude", "float"),
        ("density", "float"),
        ("bright_below", "int"),
        ("channels", "int"),
        ("seed", "int"),
        ("identity", "int"),
        ("LOWEST", "int"),
        ("OCTAVES", "int"),
    ),
)

WAVER = Compute(
    "waver",
    ("seen", "triangles", "waves"),
    (("wavering", "RGBA32F"),),
    (
        *_WINDOW,
        *_CAMERA,
        ("place_x", "vec4"),
        ("place_y", "vec4"),
        ("place_z", "vec4"),
        ("body", "float"),
        ("texels", "int"),
        ("row_bits", "int"),
        ("on_surface", "int"),
        ("unit_of_pixel", "float"),
        ("unit_of_cell", "float"),
        ("least_growth", "float"),
        ("wave_count", "int"),
        ("evened", "float"),
    ),
)

SMOOTH = Compute(
    "smooth", ("rough",), (("smoother", "RGBA32F"),), (("along", "ivec2"), ("reach", "int"))
)

SETTLE = Compute(
    "settle",
    ("raw_noise", "smooth_noise"),
    (("noise", "RGBA32F"),),
    (("high_passed", "int"),),
)

FLOW = Compute(
    "flow",
    ("normals", "values_seen", "slopes", "traits_seen[]", "noise", "wavering"),
    (("cells", "RGBA32F"), ("ways[]", "RGBA16F")),
    (
        *_WINDOW,
        *_CAMERA,
        *_COVERING,
        *_GUIDE,
        ("to_pixels", "vec4"),
        ("aligned", "float"),
        ("foreshorten", "int"),
        ("harmonics", "int"),
        ("lowest", "int"),
        ("wobble", "float"),
    ),
)

TURNING = Compute(
    "turning",
    ("cells", "ways[]"),
    (("turning[]", "RGBA16F"),),
    (*_WINDOW, *_COVERING[1:]),
)

#: What a light sees.
SHADOW = Drawing("shadow", (), (("away", "float"),), "nearest", (*_CLIP, ("ahead", "vec4")))

REACH = Compute(
    "reach",
    ("normals", "shadow", "reach_before"),
    (("reach", "RGBA16F"),),
    (
        *_WINDOW,
        *_CAMERA,
        ("lamp_x", "vec4"),
        ("lamp_y", "vec4"),
        ("lamp_z", "vec4"),
        ("lens_x", "vec4"),
        ("lens_y", "vec4"),
        ("lamp_perspective", "int"),
        ("offset_of_pixel", "float"),
        ("first_time", "int"),
        ("WIDTH", "int"),
    ),
)

LIT = Compute(
    "lit",
    ("normals", "reach", "lit_before"),
    (("lit", "RGBA32F"),),
    (
        *_WINDOW,
        *_CAMERA,
        ("source", "vec4"),
        ("colour", "vec4"),
        ("kind", "int"),
        ("shadowed", "int"),
        ("first_time", "int"),
    ),
)

TONE = Compute(
    "tone",
    ("seen", "triangles", "normals", "lit", "shown"),
    (("tones", "RGBA32F"),),
    (
        *_WINDOW,
        *_CAMERA,
        ("place_x", "vec4"),
        ("place_y", "vec4"),
        ("place_z", "vec4"),
        ("body", "float"),
        ("texels", "int"),
        ("row_bits", "int"),
        ("pixels_per_unit", "float"),
        ("shading", "float"),
        ("origin_of_tone", "int"),
        ("tone_bends_light", "int"),
        ("tone_lit", "int"),
        ("curve_black", "float"),
        ("curve_scale", "float"),
        ("curve_power", "float"),
        ("image_size", "ivec2"),
        ("image_level", "int"),
        ("taken_x", "vec4"),
        ("taken_y", "vec4"),
        ("taken_w", "vec4"),
        ("EDGEWISE", "float"),
    ),
)

WALK = Compute(
    "walk",
    (
        "cells",
        "turning[]",
        "tones",
        "values_seen",
        "slopes",
        "traits_seen[]",
        "largest",
        "colours",
        "palette",
        "thresholds",
        "inks",
        "wavering",
        "tooth",
    ),
    (("picture", "RGBA32F"),),
    (
        *_WINDOW,
        *_COVERING,
        *_GUIDE,
        ("walk_length", "int"),
        ("taper", "int"),
        ("whole_samples", "float"),
        ("step_length", "float"),
        ("grain", "float"),
        ("crossing", "float"),
        ("gain", "float"),
        ("channels", "int"),
        ("families", "int"),
        ("family_layer", "int"),
        ("sharpness", "float"),
        ("magnitude_drives", "int"),
        ("largest_known", "float"),
        ("paper_light", "vec4"),
        ("ink_count", "int"),
        ("ink_turn", "float"),
        ("ink_floor", "float"),
        ("hatch", "int"),
        ("light_ink", "int"),
        ("clear_paper", "int"),
        ("layers", "int"),
        ("layering", "float"),
        ("softness", "float"),
        ("deviation", "float"),
        ("breaks", "float"),
        ("piece_length", "int"),
        ("run_on", "int"),
        ("outline", "float"),
        ("IN_FRONT", "float"),
        ("piece_samples", "float"),
        ("piece_deviation", "float"),
        ("wobble", "float"),
        ("SWELL", "float"),
        ("tooth_depth", "float"),
        ("tooth_stretch", "int"),
        ("teeth", "int"),
        ("subpixels", "int"),
        ("JOINING", "float"),
        ("EARLY", "float"),
        ("LEAST", "float"),
    ),
)

LARGEST = Compute(
    "largest",
    ("magnitudes",),
    (("tiles", "RGBA32F"),),
    (("degree", "int"), ("first_time", "int")),
)

AVERAGE = Compute("average", ("fine",), (("picture", "RGBA32F"),), (("side", "int"),))

SHOW = Drawing(
    "show",
    ("picture",),
    _BEYOND,
    "shown",
    (
        *_CLIP,
        *_PLANES,
        ("nearer", "float"),
        ("origin", "vec2"),
        ("pixels", "vec2"),
        ("opacity", "float"),
    ),
)

ALL = (
    SEEN,
    SEEN_CUT,
    RESOLVE,
    ANCHORED,
    WAVER,
    SMOOTH,
    SETTLE,
    FLOW,
    TURNING,
    SHADOW,
    REACH,
    LIT,
    TONE,
    WALK,
    LARGEST,
    AVERAGE,
    SHOW,
)
