"""The uniforms of shaders, computed from cameras, looks, lights and draw items."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..compositor import hatching, streak_statistics
from ..compositor.contrast import expected_std, streak_args
from ..compositor.even_lines import FADE_PIXELS, MAX_EDGE_WIDTH, WOBBLE_SHIFT, crowded_pixels
from ..compositor.family_hues import SOFTMAX_SHARPNESS
from ..compositor.filter_kernel import full_sample_count
from ..compositor.flow import channel_shifts, channel_weights, noise_channel_count
from ..compositor.image_noise import NOISE_STD, NoiseSettings, streak_moments
from ..compositor.inks import ink_count, inks_of
from ..compositor.lic_images import distinct_ends
from ..compositor.look import (
    Look,
    colors_magnitude,
    colors_values,
    crease_angle_of,
    has_flow,
    is_even,
    is_hatched,
    magnitude_range,
    undefined_drawing,
)
from ..compositor.look_units import PixelLook, instance_line_spacing
from ..compositor.paper_grain import PAPER_GRAIN_CHANNELS, PAPER_GRAIN_STRENGTH, line_offset
from ..compositor.shading import Light, casts_shadows, light_source, lights_of
from ..compositor.surface_noise import FEATURE_CELLS, LATTICE_SCALE, SUBPIXEL_OFFSETS, lattice_axes
from ..compositor.target_tone import ReferenceRender, tone_curve
from ..compositor.wobble import MEAN_WAVELENGTH_WIDTHS, WOBBLE_STD, has_wobble
from ..projection.camera import Camera
from ..projection.shadow_maps import NORMAL_BIAS_PIXELS
from . import defines
from .mesh_buffers import FieldKind
from .resources import DrawItem

#: Six clip planes (x, y, z, w) that cut nothing away.
NO_CLIP_PLANES = np.tile([0.0, 0.0, 0.0, 1.0], (6, 1))


def matrix_rows(name: str, labels: Iterable[Any], rows: np.ndarray) -> dict[str, tuple[float, ...]]:
    """Return each row of a matrix as a uniform, whose name is `name` with one of the labels."""
    return {f"{name}_{label}": tuple(row) for label, row in zip(labels, rows, strict=True)}


def clip_uniforms(
    item: DrawItem, camera: Camera, clip_planes: np.ndarray | None
) -> dict[str, tuple[float, ...]]:
    """Return the rows of the model-to-clip matrix, and the clip planes in model space.

    `clip_planes` are (6, 4) plane equations in world space, or None.
    """
    clip = camera.projection @ camera.view @ item.model_matrix
    planes = NO_CLIP_PLANES if clip_planes is None else np.asarray(clip_planes)
    object_planes = planes @ item.model_matrix
    return matrix_rows("clip", "xyzw", clip) | matrix_rows("plane", range(6), object_planes)


def camera_uniforms(camera: Camera) -> dict[str, Any]:
    """Return the uniforms that map pixels to the rays through their centers."""
    projection = camera.projection
    shift = projection[:2, 2] if camera.is_perspective else -projection[:2, 3]
    return {
        "clip_to_camera": tuple(camera.clip_to_camera_xy.ravel()),
        "lens_shift": tuple(shift),
        "is_perspective": int(camera.is_perspective),
    }


def look_uniforms(kind: FieldKind, look: PixelLook) -> dict[str, Any]:
    """Return the uniforms of line integral convolution and ink that are computed from the look.

    Settings that shaders use unchanged are not included; `Frame.run` adds them.
    """
    look = look.for_symmetry(kind.symmetry)
    kernel, break_length = look.kernel, streak_statistics.break_steps(look)
    _, crossing = streak_moments(*streak_args(look), kind.line_count, kernel=kernel)
    inks = inks_of(look.look, ink_count(look.look, kind.line_count, kind.family_count))
    statistics = streak_statistics.look_streak_statistics(look) if is_hatched(look) else None
    ends, grain_depth = magnitude_range(look), 0.0
    if statistics is not None and hatching.has_paper_grain(look):
        grain_depth = PAPER_GRAIN_STRENGTH * look.paper_grain / statistics.paper_grain_std
    return {
        **covering_uniforms(kind),
        "kernel": defines.KERNELS[kernel],
        **_flow_uniforms(kind, look),
        "half_length": 0 if is_even(look) else look.length,
        "full_samples": full_sample_count(look.length, kernel),
        "crossing_correlation": crossing,
        # Streaks that drift have one channel, although their noise has several.
        "noise_channels": 1 if has_flow(look) else noise_channel_count(look),
        "family_count": kind.family_count if look.hue == "families" else 1,
        "family_channel": len(kind.channels) - 1,
        "hue_sharpness": SOFTMAX_SHARPNESS / expected_std(look),
        "colors_magnitude": int(colors_magnitude(look)),
        "magnitude_ends": distinct_ends(*ends) if ends else (0.0, 0.0),
        "colors_values": int(colors_values(look)),
        "undefined_drawing": defines.UNDEFINED_DRAWINGS[undefined_drawing(look)],
        "paper_color": (*inks.paper, inks.paper_alpha),
        "ink_count": len(inks.dark),
        "min_transmittance": inks.min_transmittance,
        "is_light_ink": int(inks.is_light),
        "softness": streak_statistics.softness(look.crispness),
        "streak_std": statistics.std if statistics else 1.0,
        "break_steps": break_length if hatching.has_breaks(look) else 0,
        "overshoot_steps": hatching.overshoot_steps(look) if hatching.has_overshoot(look) else 0,
        "break_samples": full_sample_count(break_length, kernel),
        "break_std": statistics.break_std if statistics else 1.0,
        "disc_std": statistics.disc_std if statistics else 1.0,
        "wobble_strength": look.wobble if has_wobble(look) else 0.0,
        "paper_grain_depth": grain_depth,
        "paper_grain_channels": PAPER_GRAIN_CHANNELS if look.anchor == "surface" else 0,
        "paper_grain_shift": line_offset(look.line_width),
        # These are not `#define`s: compilers reorder sums with constants, which would change the result.
        "onset_range": hatching.ONSET_RANGE,
        "onset_lead": hatching.ONSET_LEAD,
        "even_lines": int(is_even(look)),
        "min_edge_width": MAX_EDGE_WIDTH * (1 - look.crispness) ** 2,
        "fade_pixels": FADE_PIXELS,
        "crowded_pixels": crowded_pixels(look),
    }


def _flow_uniforms(kind: FieldKind, look: PixelLook) -> dict[str, Any]:
    """Return the uniforms of drifting streaks: the kind of drift, and the state of the noise channels.

    For each of the three channels, these are the shift along the line, in steps of the streamline, and the
    weight; see `flow.channel_shifts` and `flow.channel_weights`.
    """
    if not has_flow(look):
        zeros = (0.0,) * 4
        return {"flow_mode": defines.FLOW_NONE, "flow_shifts": zeros, "flow_weights": zeros}
    return {
        "flow_mode": defines.FLOW_TO_ANGLE if kind.symmetry.has_opposites else defines.FLOW_ALONG,
        "flow_shifts": (*channel_shifts(look.flow_phase, look.flow_distance), 0.0),
        "flow_weights": (*channel_weights(look.flow_phase), 0.0),
    }


def light_uniforms(look: Look, lights: Sequence[Light]) -> list[dict[str, Any]]:
    """Return the uniforms of each light; if there is none, the uniforms of a black headlight.

    `lights` are in camera space.
    """
    headlight = {"light_kind": defines.HEADLIGHT, "light_vector": (0.0,) * 4, "is_shadowed": 0}
    has_shadows = casts_shadows(look, lights)
    if light_source(look, lights) == "headlight":
        return [{**headlight, "light_color": (1.0,) * 4}]
    result = [
        {
            "light_kind": defines.SUN_LIGHT if light.kind == "sun" else defines.POINT_LIGHT,
            "light_vector": (*np.asarray(light.vector, dtype=float), 0.0),
            "light_color": (*np.asarray(light.color) * light.strength, 1.0),
            "is_shadowed": int(has_shadows and light.has_shadow),
        }
        for light in lights_of(look, lights)
    ]
    return result or [{**headlight, "light_color": (0.0,) * 4}]


def tone_uniforms(look: Look, camera: Camera, reference: ReferenceRender | None) -> dict[str, Any]:
    """Return the uniforms of the tone pass that all instances share.

    `reference` is the render whose luminance is the tone, or None if the look uses none.
    """
    scale, black = tone_curve(look)
    to_reference = np.zeros((4, 4)) if reference is None else reference.reprojection(camera)
    return {
        "pixels_per_unit": camera.pixels_per_unit,
        "curve_light": int(look.tone == "light"),
        "curve_black": black,
        "curve_scale": scale,
        "curve_power": 1 / look.tone_levels[2],
        **matrix_rows("to_reference", "xyw", to_reference[[0, 1, 3]]),
    }


def shadow_uniforms(item: DrawItem, light_view: Camera) -> dict[str, Any]:
    """Return the uniforms that render a shadow map, as rows of matrices.

    They are the matrix from model space to the clip space of the light, and the row that maps model space to
    the depth along the axis of the light's camera.
    """
    clip = light_view.projection @ light_view.view @ item.model_matrix
    depth_row = tuple(-(light_view.view @ item.model_matrix)[2])
    return {**matrix_rows("clip", "xyzw", clip), "depth_row": depth_row}


def light_view_uniforms(light_view: Camera, camera: Camera) -> dict[str, Any]:
    """Return the uniforms that look up a shadow map: two matrices, as rows, and the normal bias.

    The first matrix maps camera space to the camera space of the light, the second maps the latter to x and y
    of the light's clip space. The bias is in Blender units. If the light's camera is perspective, it is the
    bias at depth 1, which the shader multiplies by the depth.
    """
    return {
        **matrix_rows("light_view", "xyz", (light_view.view @ camera.to_world)[:3]),
        **matrix_rows("light_projection", "xy", light_view.projection[:2]),
        "light_is_perspective": int(light_view.is_perspective),
        "normal_bias": NORMAL_BIAS_PIXELS / light_view.pixels_per_unit,
    }


def covering_uniforms(kind: FieldKind) -> dict[str, Any]:
    """Return the uniforms from which shaders compute the index of a sheet of the covering surface.

    They are the degree, and the numbers of line directions and sheets.
    """
    return {
        "degree": kind.degree,
        "line_count": kind.line_count,
        "sheet_count": kind.symmetry.sheets_per_turn,
    }


def min_normal_cosine(look: PixelLook) -> float:
    """Return the cosine of the crease angle. Without creases, return -2, which is below all cosines."""
    angle = crease_angle_of(look)
    return -2.0 if angle is None else float(np.cos(angle))


def direction_uniforms(kind: FieldKind, look: PixelLook, camera: Camera) -> dict[str, Any]:
    """Return the uniforms of the pass that computes the covering and the directions of members on screen."""
    orders = kind.harmonic_orders
    return {
        **covering_uniforms(kind),
        "min_normal_cosine": min_normal_cosine(look),
        "camera_to_pixels": tuple(camera.view_to_pixels.ravel()),
        "harmonic_count": len(orders),
        "first_harmonic": orders[0] if orders else 0,
        "wobble_strength": look.wobble if has_wobble(look) else 0.0,
    }


def even_line_uniforms(look: PixelLook, item: DrawItem, camera: Camera) -> dict[str, Any]:
    """Return the uniforms of the pass that evaluates the evenly spaced lines of one instance.

    `camera` is the camera of the frame.
    """
    spacing = instance_line_spacing(look, camera, item.instance)
    asked_pixels = 0.0 if look.pixel_size else look.line_distance
    return {
        **direction_uniforms(item.kind, look, camera),
        "wobble_shift": WOBBLE_SHIFT / WOBBLE_STD,
        "spacing_pixels": spacing * camera.pixels_per_unit,
        "asked_pixels": asked_pixels,
    }


def noise_uniforms(settings: NoiseSettings, look: PixelLook, detail: float) -> dict[str, Any]:
    """Return the uniforms of surface noise that all surfaces share.

    Parameters
    ----------
    settings : NoiseSettings
    look : PixelLook
    detail : float
        Cells on small features of the surface are smaller by up to this fraction.
    """
    density = settings.density
    amplitude = NOISE_STD / np.sqrt(density * (1 - density)) / len(SUBPIXEL_OFFSETS)
    return {
        **matrix_rows("lattice", "xyz", np.pad(lattice_axes(), ((0, 0), (0, 1)))),
        "amplitude": amplitude,
        "density": density,
        "density_threshold": round(density * 2**24),
        "noise_channels": settings.channels,
        "seed": settings.seed,
        "min_cell_scale": look.supersampling / settings.cell,
        "feature_cells": FEATURE_CELLS / LATTICE_SCALE,
        "max_bend": 1 / (1 - detail),
    }


def surface_cell_uniforms(
    cell: float, look: PixelLook, item: DrawItem, camera: Camera
) -> dict[str, Any]:
    """Return the uniforms for the size of the noise cells of one surface, in units of its object space.

    `cell` is the side of a cell in pixels.
    """
    cell = cell * LATTICE_SCALE
    return {
        "pixel_size": cell / (camera.pixels_per_unit * item.object_scale),
        "cell_size": cell * look.pixel_size / item.object_scale,
    }


def wobble_uniforms(look: PixelLook, item: DrawItem, camera: Camera) -> dict[str, Any]:
    """Return the uniforms for the wavelength of the wobble.

    It is in units of the object space of the item if the noise is anchored to surfaces, otherwise in pixels.
    """
    wavelength = look.line_width * MEAN_WAVELENGTH_WIDTHS
    on_surface = look.anchor == "surface"
    pixels_per_object_unit = camera.pixels_per_unit * item.object_scale if on_surface else 1.0
    return {
        "on_surface": int(on_surface),
        "pixel_size": wavelength / pixels_per_object_unit,
        "cell_size": wavelength * look.pixel_size * on_surface / item.object_scale,
        "min_cell_scale": look.supersampling / look.line_width,
    }
