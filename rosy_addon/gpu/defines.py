"""Constants that shaders share with the numpy rooms, as preprocessor definitions.

Each constant is written once, in Python. `shader_defines` precedes the source of every shader.
"""

import operator
from collections.abc import Sequence
from functools import cache
from types import ModuleType

import numpy as np

from ..compositor import (
    compose,
    covering,
    drifting_averages,
    even_lines,
    flow,
    hatching,
    image_noise,
    outline,
    streak_statistics,
    surface_noise,
    wobble,
)
from ..compositor.filter_kernel import Kernel
from ..compositor.undirected import SAMPLE_COUNT as DISC_SAMPLE_COUNT
from ..core.color import REC709_LUMINANCE
from ..projection import (
    crease_pixels,
    pixel_coverage,
    pixel_neighbors,
    shadow_maps,
    surface_sampling,
)
from ..projection.rest_coordinates import BARYCENTRIC_RANGE
from . import mesh_buffers, surface_records

#: The numbers of the filter kernels (`filter_kernel`) in shaders.
KERNELS: dict[Kernel, int] = {"box": 0, "taper": 1, "ramp": 2}

#: Drift of the streaks: none, along the directions of a field, or toward the guiding angle.
FLOW_NONE, FLOW_ALONG, FLOW_TO_ANGLE = range(3)

#: The numbers of the values of `Look.tone` in shaders.
TONE_SOURCES = {"light": 0, "attribute": 1, "image": 2, "picture": 3}

#: The numbers of the results of `look.undefined_drawing` in shaders.
UNDEFINED_DRAWINGS = {"texture": 0, "paper": 1, "hidden": 2}

#: The numbers of the types of lights in shaders.
SUN_LIGHT, POINT_LIGHT, HEADLIGHT = range(3)

#: The pass `outline_creases`: edges of creases in each row of threads, and threads for each edge.
CREASES_PER_ROW, CREASE_SLICES = 1024, 16

#: Bit that is set for a pixel that contains an edge. The bits for borders are in `outline`.
EDGE_BIT = 4

#: Side, in pixels, of the blocks that one run of the pass `max_reduce` reduces to one pixel.
REDUCE_BLOCK = 16

#: Constants that have the same name in shaders as in their Python module, by module.
SHARED_NAMES: dict[ModuleType, tuple[str, ...]] = {
    compose: ("COLOR_CONTRAST",),
    covering: ("ALL_NEIGHBORS",),
    drifting_averages: ("MIN_EFFECTIVE_SAMPLES",),
    even_lines: ("COARSE_RATIO", "MAX_BREAK_AMOUNT"),
    flow: ("ONE_WAY_COSINE",),
    hatching: ("MIN_COVERAGE", "PIXEL_SOFTNESS", "RANK_BLEND"),
    image_noise: ("NOISE_MEAN",),
    outline: (
        *("DEPTH_JUMP", "MIN_STEP", "STEP_RATIO", "PART_BORDER", "EMPTY_BORDER"),
        *("MIN_MARK_LENGTH", "FULL_MARK_LENGTH"),
    ),
    streak_statistics: ("NO_INK", "WOBBLE_BREAKS"),
    surface_noise: ("OCTAVES", "OCTAVE_OFFSET"),
    wobble: ("WAVE_COUNT",),
    crease_pixels: ("LINE_TOLERANCE", "MIN_RELATIVE_DEPTH"),
    pixel_neighbors: ("MAX_SLOPE", "DEPTH_TOLERANCE", "SLOPE_TOLERANCE"),
    shadow_maps: ("PCF_WIDTH",),
    surface_sampling: ("MIN_FACING_COSINE",),
    mesh_buffers: ("ROW_BITS", "POSITION_TEXEL", "NORMAL_TEXEL", "MAGNITUDE_TEXEL", "VALUE_TEXEL"),
    surface_records: ("MAX_TREE_DEPTH",),
}

#: Constants of shaders, by their names there: floats, integers and vectors.
CONSTANTS: dict[str, float | int | Sequence[float]] = {
    **{name: getattr(module, name) for module, names in SHARED_NAMES.items() for name in names},
    "MIN_CONTRAST_SCALE": surface_noise.CONTRAST_SCALE_RANGE[0],
    "MAX_CONTRAST_SCALE": surface_noise.CONTRAST_SCALE_RANGE[1],
    "MIN_BARYCENTRIC": float(BARYCENTRIC_RANGE[0]),
    "MAX_BARYCENTRIC": float(BARYCENTRIC_RANGE[1]),
    "WOBBLE_AMPLITUDE": wobble.UNIT_VARIANCE_SCALE * wobble.WOBBLE_STD,
    "GROWTH_START": even_lines.GROWTH_OCTAVES[0],
    "GROWTH_STOP": even_lines.GROWTH_OCTAVES[1],
    "MIN_SAMPLE_COSINE": pixel_coverage.MIN_NORMAL_COSINE,
    "LUMINANCE_WEIGHTS": REC709_LUMINANCE,
    "SUBPIXEL_COUNT": len(surface_noise.SUBPIXEL_OFFSETS),
    **{f"SUBPIXEL_OFFSET_{i}": xy for i, xy in enumerate(surface_noise.SUBPIXEL_OFFSETS)},
    "DISC_SAMPLE_COUNT": DISC_SAMPLE_COUNT,
    "CREASES_PER_ROW": CREASES_PER_ROW,
    "CREASE_SLICES": CREASE_SLICES,
    "EDGE_BIT": EDGE_BIT,
    "REDUCE_BLOCK": REDUCE_BLOCK,
    "KERNEL_TAPER": KERNELS["taper"],
    "KERNEL_RAMP": KERNELS["ramp"],
    "FLOW_NONE": FLOW_NONE,
    "FLOW_ALONG": FLOW_ALONG,
    "FLOW_TO_ANGLE": FLOW_TO_ANGLE,
    "TONE_LIGHT": TONE_SOURCES["light"],
    "TONE_IMAGE": TONE_SOURCES["image"],
    "TONE_PICTURE": TONE_SOURCES["picture"],
    "UNDEFINED_TEXTURE": UNDEFINED_DRAWINGS["texture"],
    "UNDEFINED_HIDDEN": UNDEFINED_DRAWINGS["hidden"],
    "POINT_LIGHT": POINT_LIGHT,
    "HEADLIGHT": HEADLIGHT,
}

_HASH_NAMES = ("HASH_X", "HASH_Y", "HASH_Z", "HASH_OCTAVE", "HASH_INSTANCE")

UNSIGNED_CONSTANTS = {
    **dict(zip(_HASH_NAMES, image_noise.HASH_FACTORS, strict=True)),
    "HASH_SEED": image_noise.SEED_FACTOR,
    "HASH_CHANNEL": image_noise.CHANNEL_FACTOR,
    "HASH_FINALIZER_0": image_noise.FINALIZER_FACTORS[0],
    "HASH_FINALIZER_1": image_noise.FINALIZER_FACTORS[1],
}


@cache
def shader_defines() -> str:
    """Return a ``#define`` for each shared constant, one per line."""
    values = {name: _literal(value) for name, value in CONSTANTS.items()}
    values |= {name: f"0x{value:08X}u" for name, value in UNSIGNED_CONSTANTS.items()}
    return "".join(f"#define {name} {text}\n" for name, text in values.items())


def _literal(value: float | int | Sequence[float]) -> str:
    """Return the GLSL literal of a constant.

    A float becomes the shortest decimal number that GLSL rounds to the same single precision number.
    """
    if isinstance(value, (float, np.floating)):
        text = str(np.float32(value))
        return f"({text})" if value < 0 else text
    if np.ndim(value):
        return f"vec{len(value)}({', '.join(map(_literal, value))})"
    return str(operator.index(value))
