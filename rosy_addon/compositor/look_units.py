"""`PixelLook`: a look with its lengths in pixels of the frame that is drawn; and functions that scale looks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.settings import Number, Stage, pixel_lengths, settings_of
from ..field.symmetry import FieldSymmetry
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance, with_field
from .filter_kernel import KERNEL_OF_FADE, Kernel
from .flow import MAX_AXIAL_STEPS, NO_DRIFT, Drift, cycle_distance
from .look import Look, has_colored_noise, has_flow, magnitude_range

#: Lengths in Blender units follow the camera in steps of 1 / 32 octave, so that tables made for a
#: look can be reused while the camera moves.
STEPS_PER_OCTAVE = 32

#: Distances between even lines on the surface are rounded to steps of 1 / 8 octave if they are set in
#: pixels, so that lines do not change while the camera moves a little.
SPACING_STEPS_PER_OCTAVE = 8

#: Width of the picture in pixels, and resolution of the print in dpi, for which the automatic size of the unit of
#: a look is a pixel.
REFERENCE_WIDTH, REFERENCE_DPI = 1920, 300

#: Width, in pixels, of a picture that a mesh fills, for lengths on surfaces that no camera sees.
MESH_PIXELS = 1024

#: Units of looks whose lengths do not change with the number of pixels of the picture.
SCALE_FREE_UNITS = ("percent", "scene")

#: Millimeters per inch.
INCH = 25.4

#: Minimum distance from the camera to the center of the meshes, as a fraction of their size. It
#: applies when the camera is among them.
MIN_DISTANCE_FACTOR = 0.25


@dataclass(frozen=True, kw_only=True)
class PixelLook:
    """A look for one frame: its lengths are in pixels of the frame, and its streaks have drifted to a phase.

    The settings of the look are attributes as well: ``pixel_look.crispness``. Lengths among them, such as
    ``pixel_look.line_width``, are in pixels of the frame, and may be outside of the range that the setting
    allows.

    Attributes
    ----------
    look : Look
        The settings of the user.
    scale : float
        Factor from the lengths of `look` to pixels of the picture (or to steps, for lines on a surface).
    length : int
        Steps of streamlines in each direction.
    supersampling : int
        Pixels of the frame along a side of a pixel of the picture.
    pixel_size : float
        If `look` has lengths in Blender units: the Blender units that one pixel of the frame stands for.
        Otherwise 0.
    color_range : (float, float)
        The setting `Look.color_range`, or the `magnitude_ends` of a field (see `with_magnitude_range`).
    kernel : {"box", "taper", "ramp"}
        The filter kernel.
    flow_phase : float
        Position of drifting streaks in their cycle, 0 to 1; see `flow`.
    flow_distance : float
        Distance in pixels that streaks drift in a cycle.
    is_antialiased : bool
        Whether streaks are drawn more accurately, because pixels have several samples; see
        `GBuffer.coverage`.
    is_on_surface : bool
        Whether steps of streamlines have a constant length on the surface (as for textures). Otherwise
        they have a constant length in the picture.
    """

    look: Look
    scale: float
    length: int
    supersampling: int = 1
    pixel_size: float = 0.0
    color_range: tuple[float, float]
    kernel: Kernel
    flow_phase: float = 0.0
    flow_distance: float = 0.0
    is_antialiased: bool = False
    is_on_surface: bool = False

    def __getattr__(self, name: str) -> Any:
        """Return a setting of the look, lengths in pixels of the frame."""
        setting = settings_of(Look).get(name)
        if setting is None:
            raise AttributeError(name)
        if isinstance(setting, Number) and setting.is_pixel_length:
            return _scaled_length(self.look, setting, self.scale) * self.supersampling
        return getattr(self.look, name)

    def settings(self) -> dict[str, Any]:
        """Return the settings of the look by name, with the lengths in pixels of the frame."""
        return {name: getattr(self, name) for name in settings_of(Look)}

    def lic_key(self) -> tuple[Any, ...]:
        """Return a key of all that LIC images depend on.

        Two looks with equal keys have the same LIC images of the same G-buffer.
        """
        applied = (
            getattr(self, name) if setting.applies(self) else setting.default
            for name, setting in settings_of(Look).items()
            if setting.stage <= Stage.LIC
        )
        length_range = magnitude_range(self) if self.magnitude_length else None
        return (
            *(*applied, has_colored_noise(self), length_range),
            *(self.pixel_size, self.kernel, self.flow_phase, self.flow_distance),
            *(self.is_antialiased, self.is_on_surface),
        )

    def streamline_reach(self) -> int:
        """Return the maximum number of steps that the kernel extends from its pixel in each direction."""
        if not has_flow(self):
            return self.length
        return self.length + math.ceil(self.flow_distance / 2) + MAX_AXIAL_STEPS + 1

    def for_symmetry(self, symmetry: FieldSymmetry) -> PixelLook:
        """Return the look for fields of a symmetry.

        In a field with opposite directions, streaks cannot have a head and a tail, so the ramp kernel is
        not used.
        """
        if self.kernel == "ramp" and symmetry.has_opposites:
            return replace(self, kernel="box")
        return self

    def with_length(self, length: int) -> PixelLook:
        """Return the look with streamlines of another length, in steps."""
        return replace(self, length=length)

    def for_means(self, length: int) -> PixelLook:
        """Return the look for unweighted means over `length` steps in each direction: no fading, no drift.

        The weights of the method "ibfv" fall exponentially and would reach too far, so "sheets" replaces it.
        """
        method = "sheets" if self.method == "ibfv" else self.method
        still = replace(self.look, flow=0.0, method=method)
        return replace(self, look=still, length=length, kernel="box", is_antialiased=False)

    def in_samples(self, side: int) -> PixelLook:
        """Return the look for a frame with `side` x `side` samples in place of each pixel."""
        return replace(
            self,
            length=self.length * side,
            supersampling=self.supersampling * side,
            pixel_size=self.pixel_size / side,
            flow_distance=self.flow_distance * side,
        )


def pixel_look(
    look: Look,
    camera: Camera | None = None,
    instances: Sequence[MeshInstance] = (),
    supersampling: int = 1,
    drift: Drift = NO_DRIFT,
    is_antialiased: bool = False,
) -> PixelLook:
    """Return a look in pixels of a frame.

    Lengths in Blender units are converted to pixels with the scale at the center of the meshes.

    Parameters
    ----------
    look : Look
    camera : Camera, optional
        The camera of the frame. Needed unless lengths are in pixels.
    instances : sequence of MeshInstance
        All meshes in the scene. Only those with a field affect the scale.
    supersampling : int
        Pixels of the frame along a side of a pixel of the picture.
    drift : Drift
        How far the streaks have drifted.
    is_antialiased : bool
        Whether streaks are drawn more accurately, because pixels have several samples.
    """
    scale, unit_size = 1.0, 0.0
    bounds = [instance.world_bounds() for instance in with_field(instances)]
    if look.unit == "scene" and bounds:
        points = np.concatenate(bounds)
        unit_size = look.unit_size or float(np.linalg.norm(np.ptp(points, axis=0))) / MESH_PIXELS
        exact_scale = unit_size / (pixel_world_size(points, camera) * supersampling)
        scale = 2 ** (np.rint(np.log2(exact_scale) * STEPS_PER_OCTAVE) / STEPS_PER_OCTAVE)
    elif camera is not None:
        scale = unit_in_pixels(look, camera.width * camera.picture_share / supersampling)
    in_picture = _scaled_pixel_look(look, scale, unit_size, drift)
    return replace(in_picture.in_samples(supersampling), is_antialiased=is_antialiased)


def surface_pixel_look(look: Look, step: float, pixel: float, drift: Drift = NO_DRIFT) -> PixelLook:
    """Return a look for lines on a surface that no camera sees, with its lengths in steps.

    Its streaks are traced with the method "sheets" and anchored to the surface. The guiding angle, which
    refers to a picture, is not used.

    Parameters
    ----------
    look : Look
    step : float
        Length of a step of streamlines, in Blender units.
    pixel : float
        Length on the surface, in Blender units, for a pixel of a picture that is `MESH_PIXELS` pixels wide.
    drift : Drift
        How far the streaks have drifted.
    """
    unit_size = pixel * unit_in_pixels(look, MESH_PIXELS)
    if look.unit == "scene":
        unit_size = look.unit_size or pixel
    look = replace(look, method="sheets", anchor="surface", guiding_angle=0.0, supersampling=1)
    # Cells of noise are at least one step.
    scale = max(unit_size / step, min(1.0 / look.line_width, 1.0))
    return replace(_scaled_pixel_look(look, scale, unit_size, drift), is_on_surface=True)


def unit_in_pixels(look: Look, width: float) -> float:
    """Return the size, in pixels, of a length of 1 in a look, for a picture that is `width` pixels wide.

    The size is 1 if the lengths of the look are in Blender units.
    """
    if look.unit == "percent":
        return (look.unit_size or 100 / REFERENCE_WIDTH) / 100 * width
    if look.unit == "millimeters":
        return (look.unit_size or INCH / REFERENCE_DPI) * look.dpi / INCH
    return 1.0


def in_percent(look: Look, width: int) -> Look:
    """Convert a look in millimeters to percent of `width`, the width of a picture in pixels; keep other looks."""
    if look.unit != "millimeters":
        return look
    return replace(look, unit="percent", unit_size=100 * unit_in_pixels(look, width) / width)


def _scaled_pixel_look(look: Look, scale: float, unit_size: float, drift: Drift) -> PixelLook:
    """Return the `PixelLook` whose lengths are `scale` times the lengths of `look`.

    A length of 1 of `look` is `unit_size` Blender units; 0 if its lengths do not depend on Blender units.
    """
    scale = _possible_scale(look, scale)
    if not has_flow(look):
        drift = NO_DRIFT
    length = _scaled_length(look, settings_of(Look)["length"], scale)
    return PixelLook(
        look=look,
        scale=scale,
        length=length,
        pixel_size=unit_size / scale,
        color_range=look.color_range,
        kernel=KERNEL_OF_FADE[look.fade],
        flow_phase=drift.phase,
        flow_distance=cycle_distance(length, look.method) * drift.cycle,
    )


def scaled_look(look: Look, scale: float) -> Look:
    """Return the look with all lengths multiplied by `scale`, as far as the ranges of settings allow.

    Lengths in Blender units or in percent of the picture stay the same.
    """
    if look.unit in SCALE_FREE_UNITS:
        return look
    scale = _possible_scale(look, scale)
    lengths = {item.name: _scaled_length(look, item, scale) for item in pixel_lengths(Look)}
    return replace(look, **lengths)


def _possible_scale(look: Look, scale: float) -> float:
    """Return the scale nearest to `scale` with which all lengths of a look are in their allowed ranges.

    Noise cells stay at least as large as `Look.line_width` may be in pixels.
    """
    lengths = pixel_lengths(Look)
    max_scale = min(item.high / max(getattr(look, item.name), 1e-9) for item in lengths)
    min_scale = settings_of(Look)["line_width"].low / look.line_width
    return float(np.clip(scale, min(min_scale, 1.0), max(max_scale, 1.0)))


def _scaled_length(look: Look, setting: Number, scale: float) -> Any:
    """Return the value of a length setting times `scale`. Whole numbers are rounded to at least 1."""
    length = getattr(look, setting.name) * scale
    return max(round(length), 1) if setting.is_integer else length


def preview_look(look: Look, downscale: int) -> Look:
    """Return the look for a preview with fewer pixels, in which streaks have the same size on screen.

    Parameters
    ----------
    look : Look
    downscale : int
        Pixels of the view along each side of a pixel of the preview.
    """
    settings: dict[str, Any] = {"supersampling": 1}
    if look.unit not in SCALE_FREE_UNITS:
        for setting in pixel_lengths(Look):
            value = getattr(look, setting.name)
            value = value // downscale if setting.is_integer else value / downscale
            settings[setting.name] = max(value, setting.low, setting.preview_low)
    return replace(look, **settings)


def pixel_world_size(points: np.ndarray, camera: Camera) -> float:
    """Return the width of a pixel, in Blender units, at the center of (n, 3) points in world space.

    The center is the center of their bounding box.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    depth = -(camera.view[2, :3] @ (low + high) / 2 + camera.view[2, 3])
    min_depth = max(MIN_DISTANCE_FACTOR * float(np.linalg.norm(high - low)), 1e-6)
    return float(camera.pixel_sizes(max(float(depth), min_depth)))


def instance_line_spacing(look: PixelLook, camera: Camera, instance: MeshInstance) -> float:
    """Return the distance between even lines on a mesh instance, in Blender units.

    Parameters
    ----------
    look : PixelLook
    camera : Camera
        The camera of the frame.
    instance : MeshInstance
        If the lengths of the look are in pixels (not in Blender units), they are pixels at the center of the
        instance.
    """
    if look.pixel_size:
        return look.line_distance * look.pixel_size
    exact = look.line_distance * pixel_world_size(instance.world_bounds(), camera)
    step = np.rint(np.log2(exact) * SPACING_STEPS_PER_OCTAVE)
    return float(2 ** (step / SPACING_STEPS_PER_OCTAVE))
