"""Conversion of the lengths of a look to pixels of the frame that is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.settings import pixel_lengths, settings_of, switch
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from .look import Look

#: Lengths in Blender units follow the camera in steps of 1 / 32 octave, so that tables made for a
#: look can be reused while the camera moves.
STEPS_PER_OCTAVE = 32

#: Distances between even lines in pixels are converted to steps of 1 / 8 octave on the surface, so
#: that lines stay as they are while the camera moves a little.
SPACING_STEPS_PER_OCTAVE = 8

#: Minimum distance from the camera to the center of the meshes, as a fraction of their size. It
#: applies when the camera is among them.
MIN_DISTANCE_FACTOR = 0.25


@dataclass(frozen=True)
class PixelLook(Look):
    """A look with its lengths in pixels of the frame that is drawn, which may be out of range."""

    antialiased: bool = switch(
        False,
        "Draw streaks more accurately, as pixels have several samples; see `GBuffer.coverage`",
    )

    def __post_init__(self) -> None:
        """Check nothing: the original look was checked."""


def supersampled_look(look: Look) -> PixelLook:
    """Return the look with its lengths in pixels of the supersampled frame."""
    settings = {name: getattr(look, name) for name in settings_of(Look)}
    for setting in pixel_lengths(Look):
        settings[setting.name] *= look.supersampling
    settings["unit_size"] /= look.supersampling
    return PixelLook(**settings)


def look_in_pixels(look: Look, camera: Camera, instances: Sequence[MeshInstance]) -> Look:
    """Return the look with its lengths converted from Blender units to pixels.

    The scale is that of a pixel at the center of the meshes. A look whose lengths are in pixels is
    returned unchanged.

    Parameters
    ----------
    look : Look
    camera : Camera
        Its resolution is that of the picture times `look.supersampling`, in both directions.
    instances : sequence of MeshInstance
        All meshes in the scene. Only those with a field affect the scale.

    Returns
    -------
    Look
        Its `unit_size` is the size of a pixel at that center, in Blender units.
    """
    bounds = [instance.world_bounds() for instance in instances if instance.field is not None]
    if not look.unit_size:
        return look
    if not bounds:
        return look
    exact_scale = look.unit_size / (
        pixel_world_size(np.concatenate(bounds), camera) * look.supersampling
    )
    return scaled_look(
        look, 2 ** (np.rint(np.log2(exact_scale) * STEPS_PER_OCTAVE) / STEPS_PER_OCTAVE)
    )


def look_on_surface(look: Look, step: float, pixel: float) -> Look:
    """Return the look for lines on a surface that no camera sees, with its lengths in steps.

    Parameters
    ----------
    look : Look
    step : float
        Length of a step of streamlines, in Blender units.
    pixel : float
        Blender units that replace a pixel, if the lengths of the look are in pixels.

    Returns
    -------
    Look
        Foreshortened, as steps have one length on the surface.
    """
    unit_size = look.unit_size or pixel
    look = replace(
        look,
        method="sheets",
        anchor="surface",
        foreshorten=True,
        supersampling=1,
        guiding_angle=0.0,
    )
    return scaled_look(look, unit_size / step)


def scaled_look(look: Look, scale: float) -> Look:
    """Multiply the lengths of a look, as far as their ranges allow."""
    scale = float(np.clip(scale, *_scale_limits(look)))
    lengths = {}
    for setting in pixel_lengths(Look):
        length = getattr(look, setting.name) * scale
        lengths[setting.name] = max(round(length), 1) if setting.is_integer else length
    return replace(look, **lengths, unit_size=look.unit_size / scale)


def preview_look(look: Look, downscale: int) -> Look:
    """Return the look for a preview with fewer pixels, in which streaks appear in the same size.

    Parameters
    ----------
    look : Look
    downscale : int
        Pixels of the view along each side of a pixel of the preview.
    """
    settings: dict[str, Any] = {"supersampling": 1}
    if not look.unit_size:
        for setting in pixel_lengths(Look):
            value = getattr(look, setting.name)
            value = value // downscale if setting.is_integer else value / downscale
            settings[setting.name] = max(value, setting.low, setting.preview_low)
    return replace(look, **settings)


def pixel_world_size(points: np.ndarray, camera: Camera) -> float:
    """Return the width of a pixel, in Blender units, at the center of (n, 3) points in world space.

    The center is that of their bounding box.
    """
    if not camera.is_perspective:
        return 1 / camera.pixels_per_unit
    low, high = points.min(axis=0), points.max(axis=0)
    depth = -(camera.view[2, :3] @ (low + high) / 2 + camera.view[2, 3])
    min_depth = max(MIN_DISTANCE_FACTOR * float(np.linalg.norm(high - low)), 1e-6)
    return max(float(depth), min_depth) / camera.pixels_per_unit


def instance_line_spacing(look: Look, camera: Camera, instance: MeshInstance) -> float:
    """Return the distance between even lines on a mesh instance, in Blender units.

    Parameters
    ----------
    look : Look
        In pixels of the frame; see `look_in_pixels` and `supersampled_look`.
    camera : Camera
        Of the frame.
    instance : MeshInstance
        If the lengths of the look are in pixels, the distance is that of pixels at its center.
    """
    if look.unit_size:
        return look.line_distance * look.unit_size
    exact = look.line_distance * pixel_world_size(instance.world_bounds(), camera)
    step = np.rint(np.log2(exact) * SPACING_STEPS_PER_OCTAVE)
    return float(2 ** (step / SPACING_STEPS_PER_OCTAVE))


def cell_size_args(look: Look) -> dict[str, Any]:
    """Return the parameters of `surface_noise` for the size of noise cells on the surface.

    Parameters
    ----------
    look : Look
        In pixels of the frame; see `look_in_pixels` and `supersampled_look`.
    """
    if not look.unit_size:
        return {"pixel": 0.0, "smallest": 0.0}
    return {"pixel": look.unit_size, "smallest": float(look.supersampling)}


def _scale_limits(look: Look) -> tuple[float, float]:
    """Return the minimum and maximum factors by which the lengths of a look can be multiplied.

    The maximum keeps all lengths within their ranges. The minimum keeps noise cells at least as
    large as a pixel, as smaller ones are not visible.
    """
    max_scale = min(
        setting.high / max(getattr(look, setting.name), 1e-9) for setting in pixel_lengths(Look)
    )
    min_scale = max(1.0, settings_of(Look)["line_width"].low) / look.line_width
    return min(min_scale, 1.0), max(max_scale, 1.0)
