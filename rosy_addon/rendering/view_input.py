"""`ViewInput`: everything that a renderer needs to draw one picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..compositor.flow import NO_DRIFT, Drift
from ..compositor.hatching import is_shaded_by_pixel
from ..compositor.look import Look
from ..compositor.shading import Light
from ..compositor.target_tone import ReferenceRender
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance


@dataclass(frozen=True)
class Background:
    """The color behind everything in a 3D view.

    Attributes
    ----------
    color : tuple of float
        Linear red, green and blue.
    low_corner, high_corner : (float, float)
        Lower left and upper right of the part that is filled, in normalized device coordinates.
    """

    color: tuple[float, float, float]
    low_corner: tuple[float, float] = (-1.0, -1.0)
    high_corner: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True, eq=False)
class ViewInput:
    """Everything that a renderer needs to draw one picture.

    Attributes
    ----------
    instances : tuple of MeshInstance
        Meshes with their fields, tones and numbers, in world space. Those without a field only occlude.
    camera : Camera
        Its size is the size of the finished picture.
    look : Look
    lights : tuple of Light
        Camera space. Used by the light "scene".
    reference : ReferenceRender or None
        Used by the tone "picture".
    clip_planes : (6, 4) float64 ndarray or None
        World space. The negative side of each plane is cut away.
    drift : Drift
        How far streaks have drifted, if the look has flow.
    draws_thresholds : bool
        Whether the picture has the thresholds of its ink; see `compose`. Only numpy draws
        them.
    """

    instances: tuple[MeshInstance, ...]
    camera: Camera
    look: Look
    lights: tuple[Light, ...] = ()
    reference: ReferenceRender | None = None
    clip_planes: np.ndarray | None = None
    drift: Drift = NO_DRIFT
    draws_thresholds: bool = False

    @property
    def sample_camera(self) -> Camera:
        """The camera with a pixel for each sample."""
        return self.camera.scaled(self.look.supersampling)

    @property
    def samples_per_side(self) -> int:
        """Samples along each side of a pixel that numpy shades once; 1 if it shades each."""
        return self.look.supersampling if is_shaded_by_pixel(self.look) else 1

    @property
    def shaded_camera(self) -> Camera:
        """The camera with a pixel for each point that numpy shades: a pixel of the picture, or a sample."""
        return self.camera if self.samples_per_side > 1 else self.sample_camera
