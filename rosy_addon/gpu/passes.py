"""The shader passes, with the inputs, outputs and uniforms of each.

The sources are GLSL files in the folder `glsl`, without declarations. Each device generates the
declarations in its own form from the lists here.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..compositor.look import Look
from ..settings import Number, settings_of
from .defines import shader_defines

SHADER_FOLDER = Path(__file__).with_name("glsl")

#: Width and height of a work group, in pixels.
WORKGROUP_SIZE = (8, 8)

#: Names and GLSL types of the uniforms, or of the varyings, of a shader.
Uniforms = tuple[tuple[str, str], ...]

_CLIP_MATRIX: Uniforms = tuple((f"clip_{axis}", "vec4") for axis in "xyzw")
_CLIP_PLANES: Uniforms = tuple((f"plane{number}", "vec4") for number in range(6))
_BOX_ORIGIN: Uniforms = (("box_origin", "ivec2"),)
_CAMERA: Uniforms = (("clip_to_camera", "vec4"), ("lens_shift", "vec2"), ("is_perspective", "int"))
_INSTANCE: Uniforms = (
    ("model_view_x", "vec4"),
    ("model_view_y", "vec4"),
    ("model_view_z", "vec4"),
    ("first_triangle_id", "int"),
    ("triangle_count", "int"),
    ("texels_per_record", "int"),
)
_COVERING: Uniforms = (("degree", "int"), ("line_count", "int"), ("sheet_count", "int"))
_GUIDING: Uniforms = (("guiding_angle", "float"),)

#: Settings of a look that shaders read unchanged, as uniforms of the same names. Lengths are in
#: pixels of the frame.
LIC_SETTINGS = ("grain",)
INK_SETTINGS = ("clear_paper", "layers", "layering", "breaks", "outline")
TONE_SETTINGS = ("shading", "tone_lit")


def setting_uniforms(names: tuple[str, ...]) -> Uniforms:
    """Return the names and GLSL types of uniforms for settings of a look."""
    settings = [settings_of(Look)[name] for name in names]
    return tuple(
        (
            setting.name,
            "float" if isinstance(setting, Number) and not setting.is_integer else "int",
        )
        for setting in settings
    )


@dataclass(frozen=True)
class ComputePass:
    """A compute shader over the pixels of an image.

    Attributes
    ----------
    name : str
        Of the source file.
    textures : tuple of str
        Textures that it reads. Names that end in ``[]`` are texture arrays.
    images : tuple of (str, str)
        Images that it writes, with their formats. Names as those of textures.
    uniforms : tuple of (str, str)
        Names and GLSL types.
    includes : tuple of str
        Names of source files that precede it, besides ``common``.
    switches : tuple of str
        Integer uniforms whose values are compiled in; see `variant`.
    constants : tuple of (str, int)
        Names and values that are compiled in.
    """

    name: str
    textures: tuple[str, ...]
    images: tuple[tuple[str, str], ...]
    uniforms: Uniforms
    includes: tuple[str, ...] = ()
    switches: tuple[str, ...] = ()
    constants: tuple[tuple[str, int], ...] = ()

    def variant(self, values: Mapping[str, Any]) -> ComputePass:
        """Return the shader for some values of its uniforms.

        The values of its switches become constants. What they switch off then costs nothing: its registers
        would let fewer threads run at once.
        """
        return _with_constants(self, tuple((name, int(values[name])) for name in self.switches))

    @property
    def key(self) -> Hashable:
        """What tells compiled shaders apart."""
        return self.name, self.images, self.constants

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the source files, in their order."""
        shared = [f"{name}.glsl" for name in ("common", *self.includes)]
        return (*shared, f"{self.name}.comp.glsl")

    @property
    def source(self) -> str:
        """GLSL without declarations."""
        constants = "".join(f"#define {name} {value}\n" for name, value in self.constants)
        return shader_defines() + constants + "".join(map(read_source, self.files))


@lru_cache(maxsize=256)
def _with_constants(shader: ComputePass, constants: tuple[tuple[str, int], ...]) -> ComputePass:
    """Return a shader with the values of all its switches compiled in."""
    if not shader.switches:
        return shader
    uniforms = tuple(uniform for uniform in shader.uniforms if uniform[0] not in shader.switches)
    constants = (*shader.constants, *constants)
    return replace(shader, uniforms=uniforms, switches=(), constants=constants)


@dataclass(frozen=True)
class RasterPass:
    """A vertex and a fragment shader for the triangles of a mesh.

    Attributes
    ----------
    name : str
        Of the source files.
    textures : tuple of str
    varyings : tuple of (str, str)
        Names and GLSL types.
    output : str
        Name of the fragment's output, a vec4.
    uniforms : tuple of (str, str)
    """

    name: str
    textures: tuple[str, ...]
    varyings: Uniforms
    output: str
    uniforms: Uniforms
    switches = ()

    @property
    def key(self) -> Hashable:
        """What tells compiled shaders apart."""
        return self.name

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the source files."""
        return "common.glsl", f"{self.name}.vert.glsl", f"{self.name}.frag.glsl"

    @property
    def vertex_source(self) -> str:
        """GLSL without declarations."""
        return read_source(f"{self.name}.vert.glsl")

    @property
    def fragment_source(self) -> str:
        """GLSL without declarations."""
        files = "common.glsl", f"{self.name}.frag.glsl"
        return shader_defines() + "".join(map(read_source, files))


def read_source(name: str) -> str:
    """Return the text of a source file."""
    return (SHADER_FOLDER / name).read_text(encoding="utf-8")


_CLIP_DISTANCES: Uniforms = (("clip_distances", "vec4"), ("more_clip_distances", "vec2"))

VISIBILITY = RasterPass(
    "visibility",
    (),
    (("triangle_id", "float"),),
    "visibility",
    (*_CLIP_MATRIX, ("first_triangle_id", "int")),
)

#: `VISIBILITY` with clip planes. It is a separate pass, as the planes take a third of its time.
VISIBILITY_CLIPPED = RasterPass(
    "visibility_clipped",
    (),
    (("triangle_id", "float"), *_CLIP_DISTANCES),
    "visibility",
    (*_CLIP_MATRIX, *_CLIP_PLANES, ("first_triangle_id", "int")),
)

RESOLVE = ComputePass(
    "resolve",
    ("visibility", "triangle_records"),
    (
        ("normals", "RGBA32F"),
        ("field_values", "RGBA32F"),
        ("depth_slopes", "RGBA32F"),
        ("field_channels[]", "RGBA32F"),
    ),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        ("pixels_per_unit", "float"),
        *_INSTANCE,
        ("instance_id", "float"),
        ("model_scale", "float"),
        ("channel_count", "int"),
    ),
    includes=("triangle_record",),
    switches=("channel_count",),
)

#: The triangle that each pixel sees, at its center or else at the nearest sample.
PIXEL_VISIBILITY = ComputePass(
    "pixel_visibility",
    ("center_visibility", "sample_visibility"),
    (("visibility", "R32F"),),
    (*_BOX_ORIGIN, ("samples_per_side", "int"), ("occluder_id", "int")),
)

#: The pixel whose surface each sample of an instance shows.
SAMPLE_ENTRIES = ComputePass(
    "sample_entries",
    ("visibility", "sample_visibility", "triangle_records", "field_values", "depth_slopes"),
    (("sample_entries", "R32F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        *_INSTANCE,
        ("instance_id", "float"),
        ("samples_per_side", "int"),
    ),
    includes=("triangle_record",),
)

SURFACE_NOISE = ComputePass(
    "surface_noise",
    ("visibility", "triangle_records", "feature_curvature"),
    (("raw_noise", "RGBA32F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        *_INSTANCE,
        ("lattice_x", "vec4"),
        ("lattice_y", "vec4"),
        ("lattice_z", "vec4"),
        ("pixel_size", "float"),
        ("cell_size", "float"),
        ("min_cell_scale", "float"),
        ("feature_grains", "float"),
        ("max_bend", "float"),
        ("amplitude", "float"),
        ("density", "float"),
        ("density_threshold", "int"),
        ("noise_channels", "int"),
        ("seed", "int"),
        ("instance_hash", "int"),
    ),
    includes=("triangle_record",),
)

WOBBLE = ComputePass(
    "wobble",
    ("visibility", "triangle_records", "wave_table"),
    (("wobble_angles", "RGBA32F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        *_INSTANCE,
        ("on_surface", "int"),
        ("pixel_size", "float"),
        ("cell_size", "float"),
        ("min_cell_scale", "float"),
    ),
    includes=("triangle_record",),
)

BOX_BLUR = ComputePass(
    "box_blur",
    ("source_image",),
    (("blurred_image", "RGBA32F"),),
    (("blur_axis", "ivec2"), ("radius", "int")),
)

CENTER_NOISE = ComputePass(
    "center_noise",
    ("raw_noise", "blurred_noise"),
    (("noise", "RGBA32F"),),
    (("high_passed", "int"),),
)

#: What `screen_direction.glsl` uses.
_DIRECTIONS: Uniforms = (
    ("camera_to_pixels", "vec4"),
    ("harmonic_count", "int"),
    ("first_harmonic", "int"),
)

EVEN_LINES = ComputePass(
    "even_lines",
    (
        "visibility",
        "triangle_records",
        "line_records",
        "normals",
        "field_values",
        "field_channels[]",
        "wobble_angles",
    ),
    (("line_image[]", "RGBA16F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        *_INSTANCE,
        *_COVERING,
        *_GUIDING,
        *_DIRECTIONS,
        ("wobble_strength", "float"),
        ("wobble_shift", "float"),
        ("spacing_pixels", "float"),
        ("asked_pixels", "float"),
        ("node_count", "int"),
        ("first_layer", "int"),
    ),
    includes=("triangle_record", "screen_direction", "line_member"),
)

DIRECTIONS = ComputePass(
    "directions",
    ("normals", "field_values", "depth_slopes", "field_channels[]", "noise", "wobble_angles"),
    (("cells", "RG32F"), ("directions[]", "RGBA16F")),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        *_COVERING,
        *_GUIDING,
        *_DIRECTIONS,
        ("min_normal_cosine", "float"),
        ("foreshorten", "int"),
        ("wobble_strength", "float"),
    ),
    includes=("surface_continuity", "screen_direction"),
    switches=(
        "degree",
        "line_count",
        "sheet_count",
        "harmonic_count",
        "first_harmonic",
        "foreshorten",
    ),
)

#: `DIRECTIONS` for noise of three channels.
COLOR_DIRECTIONS = replace(DIRECTIONS, images=(("cells", "RGBA32F"), *DIRECTIONS.images[1:]))

#: The pixels next to creases, one thread for some of the crossings of each edge.
OUTLINE_CREASES = ComputePass(
    "outline_creases",
    ("crease_points", "field_values", "depth_slopes"),
    (("crease_marks", "R32F"),),
    (
        ("clip_x", "vec4"),
        ("clip_y", "vec4"),
        ("clip_w", "vec4"),
        ("model_view_z", "vec4"),
        ("instance_id", "float"),
        ("is_perspective", "int"),
        ("crease_count", "int"),
    ),
)

OUTLINE_EDGES = ComputePass(
    "outline_edges",
    ("visibility", "normals", "field_values", "depth_slopes", "crease_marks", "triangle_parts"),
    (("outline_edges", "RG32F"),),
    (
        *_BOX_ORIGIN,
        ("instance_id", "float"),
        ("first_triangle_id", "int"),
        *setting_uniforms(("outline",)),
        ("min_normal_cosine", "float"),
        ("has_creases", "int"),
        ("has_parts", "int"),
    ),
    includes=("surface_continuity",),
)

OUTLINE_BLOCKS = ComputePass(
    "outline_blocks",
    ("outline_edges",),
    (("outline_blocks", "R32F"),),
    (*_BOX_ORIGIN, ("supersampling", "int")),
)

OUTLINE_WIDTHS = ComputePass(
    "outline_widths",
    ("outline_edges", "outline_blocks"),
    (("outline_widths", "R32F"),),
    (*_BOX_ORIGIN, *setting_uniforms(("outline",)), ("supersampling", "int")),
)

#: The share of each pixel that outlines cover.
OUTLINE_COVERAGE = ComputePass(
    "outline_coverage",
    ("outline_widths", "field_values", "depth_slopes"),
    (("outline_coverage", "R32F"),),
    (*_BOX_ORIGIN, *setting_uniforms(("outline",))),
)

#: The same for pixels, from that of their samples.
OUTLINE_MEAN = ComputePass(
    "outline_mean",
    ("sample_entries", "sample_coverage"),
    (("outline_coverage", "R32F"),),
    (*_BOX_ORIGIN, ("samples_per_side", "int")),
    includes=("sample_entry",),
)

ANGLE_GRADIENT = ComputePass(
    "angle_gradient",
    ("cells", "directions[]"),
    (("angle_gradients[]", "RGBA16F"),),
    (*_BOX_ORIGIN, *_COVERING[1:]),
    includes=("line_neighbor",),
    switches=("line_count", "sheet_count"),
)

#: The derivatives of the noise, for streaks of pixels that have several samples.
NOISE_GRADIENTS = ComputePass(
    "noise_gradients",
    ("cells",),
    (("noise_gradients[]", "RGBA16F"),),
    (*_BOX_ORIGIN, ("noise_layers", "int")),
)

#: The depth map of a light.
SHADOW_MAP = RasterPass(
    "shadow_map",
    (),
    (("light_depth", "float"),),
    "shadow_depth",
    (*_CLIP_MATRIX, ("depth_row", "vec4")),
)

SHADOW_VISIBILITY = ComputePass(
    "shadow_visibility",
    ("normals", "shadow_map", "previous_visibility"),
    (("shadow_visibility", "RGBA16F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        ("light_view_x", "vec4"),
        ("light_view_y", "vec4"),
        ("light_view_z", "vec4"),
        ("light_projection_x", "vec4"),
        ("light_projection_y", "vec4"),
        ("light_is_perspective", "int"),
        ("normal_bias", "float"),
        ("is_first", "int"),
    ),
)

LIGHTING = ComputePass(
    "lighting",
    ("normals", "shadow_visibility", "previous_lighting"),
    (("lighting", "RGBA32F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        ("light_vector", "vec4"),
        ("light_color", "vec4"),
        ("light_kind", "int"),
        ("is_shadowed", "int"),
        ("is_first", "int"),
    ),
    switches=("light_kind", "is_shadowed", "is_first"),
)

TONE = ComputePass(
    "tone",
    ("visibility", "triangle_records", "normals", "lighting", "tone_image"),
    (("tones", "RGBA32F"),),
    (
        *_BOX_ORIGIN,
        *_CAMERA,
        *_INSTANCE,
        ("pixels_per_unit", "float"),
        *setting_uniforms(TONE_SETTINGS),
        ("tone_source", "int"),
        ("curve_light", "int"),
        ("curve_black", "float"),
        ("curve_scale", "float"),
        ("curve_power", "float"),
        ("image_size", "ivec2"),
        ("image_level", "int"),
        ("to_reference_x", "vec4"),
        ("to_reference_y", "vec4"),
        ("to_reference_w", "vec4"),
        ("values_texel", "int"),
        ("values_bottom", "float"),
        ("values_scale", "float"),
    ),
    includes=("triangle_record",),
    switches=("tone_source", "curve_light", "tone_lit"),
    constants=(("HAS_VALUES", 0),),
)

#: `TONE` with the places of numbers in the color map, in the last component.
TONE_AND_VALUES = replace(TONE, constants=(("HAS_VALUES", 1),))

#: Uniforms of the wobble of lines.
_WOBBLE: Uniforms = (*_GUIDING, ("wobble_strength", "float"))

_MAGNITUDE: Uniforms = (("magnitude_mode", "int"), ("magnitude_range", "float"))

_FLOW: Uniforms = (("flow_mode", "int"), ("flow_shifts", "vec4"), ("flow_weights", "vec4"))

#: Textures and uniforms of `lic_lines.glsl`, for lines without breaks and overshoot.
_LINE_TEXTURES = (
    *("cells", "angle_gradients[]", "tones", "field_values", "max_magnitude", "wobble_angles"),
    "noise_gradients[]",
)
_LINES: Uniforms = (
    *_BOX_ORIGIN,
    *_COVERING,
    *_WOBBLE,
    *setting_uniforms(LIC_SETTINGS),
    *_MAGNITUDE,
    *_FLOW,
    ("kernel", "int"),
    ("half_length", "int"),
    ("full_samples", "float"),
    ("step_length", "float"),
    ("noise_channels", "int"),
    ("break_samples", "float"),
    ("is_antialiased", "int"),
)
_LINE_FILES = ("magnitude", "line_angle", "pixel_tone", "gray", "lic_trace", "lic_lines")
_LINE_SWITCHES = (
    *("degree", "line_count", "sheet_count"),
    *("kernel", "flow_mode", "magnitude_mode", "noise_channels", "is_antialiased"),
)

#: The picture of a look without ink.
LIC = ComputePass(
    "lic",
    (*_LINE_TEXTURES, "field_channels[]", "color_map", "palette"),
    (("picture", "RGBA32F"),),
    (
        *_LINES,
        ("crossing_correlation", "float"),
        ("gain", "float"),
        ("family_count", "int"),
        ("family_channel", "int"),
        ("hue_sharpness", "float"),
        ("colors_values", "int"),
    ),
    includes=(*_LINE_FILES, "line_family", "mapped_color"),
    switches=(*_LINE_SWITCHES, "colors_values", "family_count"),
    constants=(("break_steps", 0), ("overshoot_steps", 0), ("even_lines", 0)),
)

#: The streaks of a look with ink, a layer for each line.
STREAKS = ComputePass(
    "streaks",
    _LINE_TEXTURES,
    (("line_means[]", "RGBA16F"),),
    (
        *_LINES,
        ("break_steps", "int"),
        ("overshoot_steps", "int"),
        ("even_lines", "int"),
    ),
    includes=_LINE_FILES,
    switches=(*_LINE_SWITCHES, "even_lines"),
)

#: The same of pixels that have several samples, smoother.
SMOOTH_STREAKS = ComputePass(
    "smooth_streaks",
    ("cells", "directions[]", "line_means[]"),
    (("smooth_means[]", "RGBA16F"),),
    (*_BOX_ORIGIN, *_COVERING[1:]),
    includes=("line_neighbor",),
)

#: The picture of a look with ink. Its array ``line_image`` is that of `EVEN_LINES`. Some cards read no more
#: than 16 textures.
INK = ComputePass(
    "ink",
    (
        "cells",
        "directions[]",
        "line_means[]",
        "tones",
        "field_values",
        "outline_coverage",
        "field_channels[]",
        "max_magnitude",
        "color_map",
        "ink_thresholds",
        "disc_offsets",
        "ink_table",
        "wobble_angles",
        "paper_grain",
        "line_image[]",
    ),
    (("picture", "RGBA32F"),),
    (
        *_BOX_ORIGIN,
        *_COVERING,
        *_WOBBLE,
        *setting_uniforms(INK_SETTINGS),
        *_MAGNITUDE,
        ("flow_mode", "int"),
        ("flow_weights", "vec4"),
        ("noise_channels", "int"),
        ("family_count", "int"),
        ("family_channel", "int"),
        ("colors_values", "int"),
        ("paper_color", "vec4"),
        ("ink_count", "int"),
        ("ink_mid_tone", "float"),
        ("min_transmittance", "float"),
        ("is_light_ink", "int"),
        ("is_antialiased", "int"),
        ("softness", "float"),
        ("streak_std", "float"),
        ("break_steps", "int"),
        ("overshoot_steps", "int"),
        ("break_std", "float"),
        ("disc_std", "float"),
        ("paper_grain_depth", "float"),
        ("paper_grain_shift", "int"),
        ("paper_grain_channels", "int"),
        ("onset_range", "float"),
        ("onset_lead", "float"),
        ("even_lines", "int"),
        ("min_edge_width", "float"),
        ("fade_pixels", "vec2"),
        ("crowded_pixels", "vec2"),
    ),
    includes=(
        *(
            "magnitude",
            "line_angle",
            "line_family",
            "line_member",
            "pixel_tone",
            "gray",
            "mapped_color",
        ),
        *("inks", "ink_even_lines", "line_neighbor"),
    ),
    switches=(
        *("flow_mode", "magnitude_mode", "colors_values", "noise_channels", "family_count"),
        *("is_light_ink", "is_antialiased", "even_lines", "ink_count"),
    ),
)

MAX_REDUCE = ComputePass(
    "max_reduce",
    ("source_values",),
    (("tiles", "RGBA32F"),),
    (("degree", "int"), ("is_first", "int")),
)

#: The picture, from the colors of pixels and the shares of them that its samples show.
BLEND_SAMPLES = ComputePass(
    "blend_samples",
    ("sample_entries", "shaded_picture"),
    (("picture", "RGBA32F"),),
    (("samples_per_side", "int"),),
    includes=("sample_entry",),
)

COMPOSITE = RasterPass(
    "composite",
    ("picture",),
    _CLIP_DISTANCES,
    "view_color",
    (
        *_CLIP_MATRIX,
        *_CLIP_PLANES,
        ("depth_bias", "float"),
        ("view_origin", "vec2"),
        ("pixel_scale", "vec2"),
        ("opacity", "float"),
    ),
)

BACKGROUND = RasterPass(
    "background",
    (),
    (("background_position", "vec2"),),
    "view_color",
    (("background_color", "vec4"), ("low_corner", "vec2"), ("high_corner", "vec2")),
)


def clear_pass(texel_format: str) -> ComputePass:
    """Return the pass that sets an image of a format to 0."""
    return ComputePass("clear", (), (("cleared", texel_format),), _BOX_ORIGIN)


ALL_PASSES = (
    clear_pass("RGBA32F"),
    VISIBILITY,
    VISIBILITY_CLIPPED,
    PIXEL_VISIBILITY,
    RESOLVE,
    SAMPLE_ENTRIES,
    SURFACE_NOISE,
    WOBBLE,
    BOX_BLUR,
    CENTER_NOISE,
    EVEN_LINES,
    DIRECTIONS,
    OUTLINE_CREASES,
    OUTLINE_EDGES,
    OUTLINE_BLOCKS,
    OUTLINE_WIDTHS,
    OUTLINE_COVERAGE,
    OUTLINE_MEAN,
    ANGLE_GRADIENT,
    NOISE_GRADIENTS,
    SHADOW_MAP,
    SHADOW_VISIBILITY,
    LIGHTING,
    TONE,
    LIC,
    STREAKS,
    SMOOTH_STREAKS,
    INK,
    MAX_REDUCE,
    BLEND_SAMPLES,
    COMPOSITE,
    BACKGROUND,
)
