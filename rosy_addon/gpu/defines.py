"""Constants that shaders share with the numpy rooms, as preprocessor definitions.

Each constant is written once, in Python. `shader_defines` precedes the source of every shader.
"""

from __future__ import annotations

import operator
from functools import lru_cache

import numpy as np

from ..color import REC709_LUMINANCE
from ..compositor.compose import COLOR_CONTRAST
from ..compositor.covering import ALL_NEIGHBORS
from ..compositor.drifting_averages import MIN_EFFECTIVE_SAMPLES
from ..compositor.even_lines import COARSE_RATIO, GROWTH_OCTAVES, MAX_BREAK_AMOUNT
from ..compositor.filter_kernel import Kernel
from ..compositor.flow import ONE_WAY_COSINE
from ..compositor.hatching import MIN_COVERAGE, PIXEL_SOFTNESS, RANK_BLEND
from ..compositor.image_noise import (
    CHANNEL_FACTOR,
    FINALIZER_FACTORS,
    HASH_FACTORS,
    NOISE_MEAN,
    SEED_FACTOR,
)
from ..compositor.outline import (
    DEPTH_JUMP,
    EMPTY_BORDER,
    FULL_MARK_LENGTH,
    MIN_MARK_LENGTH,
    MIN_STEP,
    PART_BORDER,
    STEP_RATIO,
)
from ..compositor.streak_statistics import WOBBLE_BREAKS
from ..compositor.surface_noise import (
    CONTRAST_SCALE_RANGE,
    OCTAVE_OFFSET,
    OCTAVES,
    SUBPIXEL_OFFSETS,
)
from ..compositor.undirected import SAMPLE_COUNT as DISC_SAMPLE_COUNT
from ..compositor.wobble import UNIT_VARIANCE_SCALE, WAVE_COUNT, WOBBLE_STD
from ..projection.crease_pixels import LINE_TOLERANCE, MIN_RELATIVE_DEPTH
from ..projection.pixel_coverage import MIN_NORMAL_COSINE
from ..projection.pixel_neighbors import DEPTH_TOLERANCE, MAX_SLOPE, SLOPE_TOLERANCE
from ..projection.rest_coordinates import BARYCENTRIC_RANGE
from ..projection.shadow_maps import PCF_WIDTH
from ..projection.surface_sampling import MIN_FACING_COSINE
from .mesh_buffers import NORMAL_TEXEL, POSITION_TEXEL, ROW_BITS, VALUE_TEXEL
from .surface_records import MAX_TREE_DEPTH

#: The kernels of `filter_kernel`.
KERNELS: dict[Kernel, int] = {"box": 0, "taper": 1, "ramp": 2}

#: How streaks drift: not, along the directions of a field, or toward the guiding angle.
FLOW_NONE, FLOW_ALONG, FLOW_TO_ANGLE = range(3)

#: What the magnitude of the field drives: bit 0 is the color, bit 1 the length of streamlines.
MAGNITUDE_COLOR, MAGNITUDE_LENGTH = 1, 2
MAGNITUDE_MODES = {
    "none": 0,
    "colour": MAGNITUDE_COLOR,
    "length": MAGNITUDE_LENGTH,
    "both": MAGNITUDE_COLOR | MAGNITUDE_LENGTH,
}

#: `Look.tone` in shaders.
TONE_LIGHT, TONE_ATTRIBUTE, TONE_IMAGE, TONE_PICTURE = range(4)
TONE_SOURCES = {
    "light": TONE_LIGHT,
    "attribute": TONE_ATTRIBUTE,
    "image": TONE_IMAGE,
    "picture": TONE_PICTURE,
}

#: Kinds of lights in shaders.
SUN_LIGHT, POINT_LIGHT, HEADLIGHT = range(3)

#: Edges of creases in a row of threads, and threads for each edge.
CREASES_PER_ROW, CREASE_SLICES = 1024, 16

#: Bit of a pixel that contains an edge, besides those of borders in `outline`.
EDGE_BIT = 4

#: Side of the blocks of pixels that one run of `MAX_REDUCE` reduces to one.
REDUCE_BLOCK = 16

FLOAT_CONSTANTS = {
    "NOISE_MEAN": NOISE_MEAN,
    "COLOR_CONTRAST": COLOR_CONTRAST,
    "MIN_CONTRAST_SCALE": CONTRAST_SCALE_RANGE[0],
    "MAX_CONTRAST_SCALE": CONTRAST_SCALE_RANGE[1],
    "MIN_BARYCENTRIC": BARYCENTRIC_RANGE[0],
    "MAX_BARYCENTRIC": BARYCENTRIC_RANGE[1],
    "WOBBLE_AMPLITUDE": UNIT_VARIANCE_SCALE * WOBBLE_STD,
    "WOBBLE_BREAKS": WOBBLE_BREAKS,
    "RANK_BLEND": RANK_BLEND,
    "MAX_BREAK_AMOUNT": MAX_BREAK_AMOUNT,
    "COARSE_RATIO": COARSE_RATIO,
    "GROWTH_START": GROWTH_OCTAVES[0],
    "GROWTH_STOP": GROWTH_OCTAVES[1],
    "MIN_COVERAGE": MIN_COVERAGE,
    "MIN_EFFECTIVE_SAMPLES": MIN_EFFECTIVE_SAMPLES,
    "ONE_WAY_COSINE": ONE_WAY_COSINE,
    "DEPTH_JUMP": DEPTH_JUMP,
    "MIN_STEP": MIN_STEP,
    "STEP_RATIO": STEP_RATIO,
    "LINE_TOLERANCE": LINE_TOLERANCE,
    "MIN_RELATIVE_DEPTH": MIN_RELATIVE_DEPTH,
    "MAX_SLOPE": MAX_SLOPE,
    "DEPTH_TOLERANCE": DEPTH_TOLERANCE,
    "SLOPE_TOLERANCE": SLOPE_TOLERANCE,
    "MIN_FACING_COSINE": MIN_FACING_COSINE,
    "MIN_SAMPLE_COSINE": MIN_NORMAL_COSINE,
    "PIXEL_SOFTNESS": PIXEL_SOFTNESS,
}

VECTOR_CONSTANTS = {
    "LUMINANCE_WEIGHTS": REC709_LUMINANCE,
    **{f"SUBPIXEL_OFFSET_{index}": offset for index, offset in enumerate(SUBPIXEL_OFFSETS)},
}

INT_CONSTANTS = {
    "OCTAVES": OCTAVES,
    "OCTAVE_OFFSET": OCTAVE_OFFSET,
    "SUBPIXEL_COUNT": len(SUBPIXEL_OFFSETS),
    "WAVE_COUNT": WAVE_COUNT,
    "DISC_SAMPLE_COUNT": DISC_SAMPLE_COUNT,
    "MAX_TREE_DEPTH": MAX_TREE_DEPTH,
    "ALL_NEIGHBORS": ALL_NEIGHBORS,
    "PCF_WIDTH": PCF_WIDTH,
    "CREASES_PER_ROW": CREASES_PER_ROW,
    "CREASE_SLICES": CREASE_SLICES,
    "EDGE_BIT": EDGE_BIT,
    "PART_BORDER": PART_BORDER,
    "EMPTY_BORDER": EMPTY_BORDER,
    "MIN_MARK_LENGTH": MIN_MARK_LENGTH,
    "FULL_MARK_LENGTH": FULL_MARK_LENGTH,
    "REDUCE_BLOCK": REDUCE_BLOCK,
    "ROW_BITS": ROW_BITS,
    "POSITION_TEXEL": POSITION_TEXEL,
    "NORMAL_TEXEL": NORMAL_TEXEL,
    "VALUE_TEXEL": VALUE_TEXEL,
    "KERNEL_TAPER": KERNELS["taper"],
    "KERNEL_RAMP": KERNELS["ramp"],
    "FLOW_NONE": FLOW_NONE,
    "FLOW_ALONG": FLOW_ALONG,
    "FLOW_TO_ANGLE": FLOW_TO_ANGLE,
    "MAGNITUDE_COLOR": MAGNITUDE_COLOR,
    "MAGNITUDE_LENGTH": MAGNITUDE_LENGTH,
    "TONE_LIGHT": TONE_LIGHT,
    "TONE_IMAGE": TONE_IMAGE,
    "TONE_PICTURE": TONE_PICTURE,
    "POINT_LIGHT": POINT_LIGHT,
    "HEADLIGHT": HEADLIGHT,
}

UNSIGNED_CONSTANTS = dict(
    zip(
        ("HASH_X", "HASH_Y", "HASH_Z", "HASH_OCTAVE", "HASH_INSTANCE"),
        HASH_FACTORS,
        strict=True,
    )
) | {
    "HASH_SEED": SEED_FACTOR,
    "HASH_CHANNEL": CHANNEL_FACTOR,
    "HASH_FINALIZER_0": FINALIZER_FACTORS[0],
    "HASH_FINALIZER_1": FINALIZER_FACTORS[1],
}


@lru_cache(maxsize=1)
def shader_defines() -> str:
    """Return a ``#define`` for each shared constant, one per line."""
    values = {name: _float_literal(value) for name, value in FLOAT_CONSTANTS.items()}
    for name, vector in VECTOR_CONSTANTS.items():
        values[name] = f"vec{len(vector)}({', '.join(map(_float_literal, vector))})"
    # Fails if a constant is not an integer.
    values |= {name: str(operator.index(value)) for name, value in INT_CONSTANTS.items()}
    values |= {name: f"0x{value:08X}u" for name, value in UNSIGNED_CONSTANTS.items()}
    return "".join(f"#define {name} {text}\n" for name, text in values.items())


def _float_literal(value: float) -> str:
    """Return the shortest decimal number that rounds to the same single precision number."""
    text = str(np.float32(value))
    return f"({text})" if value < 0 else text
