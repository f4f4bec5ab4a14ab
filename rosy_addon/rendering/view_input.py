"""`ViewInput`: everything that a renderer needs to draw one picture."""

from dataclasses import dataclass, replace

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
    """The background color of a rectangle in a 3D view.

    Attributes
    ----------
    color : tuple of float
        Linear red, green and blue.
    low_corner, high_corner : (float, float)
        Lower left and upper right corner of the rectangle, in normalized device coordinates.
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
        Meshes in world space, with their fields, tones and values for the color map. Meshes without a field
        only hide what is behind them.
    camera : Camera
        The camera. Its size is the size of the finished picture.
    look : Look
        Settings of the drawing.
    looks : tuple of Look
        The look of each instance, if they differ. Looks of instances without a field are not used. Empty if
        all instances have the look `look`.
    lights : tuple of Light
        In camera space. Only used if `Look.light` is "scene".
    reference : ReferenceRender or None
        A render from which the tone is taken. Only used if `Look.tone` is "picture".
    clip_planes : (6, 4) float64 ndarray or None
        Plane equations in world space. What is on the negative side of a plane is cut away.
    drift : Drift
        How far streaks have drifted, if they move (`Look.flow`).
    draws_thresholds : bool
        Whether the picture has thresholds of ink instead of colors; see `compose`. Only the numpy renderer
        can draw them.
    """

    instances: tuple[MeshInstance, ...]
    camera: Camera
    look: Look
    lights: tuple[Light, ...] = ()
    reference: ReferenceRender | None = None
    clip_planes: np.ndarray | None = None
    drift: Drift = NO_DRIFT
    draws_thresholds: bool = False
    looks: tuple[Look, ...] = ()

    def by_look(self) -> list["ViewInput"]:
        """Return a view for each look, in which meshes with other looks have no field and only hide others."""
        if not self.looks:
            return [self]
        entries = list(zip(self.instances, self.looks, strict=True))
        looks = dict.fromkeys(look for instance, look in entries if instance.field is not None)
        return [
            replace(
                self,
                look=look,
                looks=(),
                instances=tuple(
                    instance if own == look else replace(instance, field=None)
                    for instance, own in entries
                ),
            )
            for look in looks
        ]

    @property
    def sample_camera(self) -> Camera:
        """The camera at the resolution of samples: with supersampling, several per pixel of the picture."""
        return self.camera.scaled(self.look.supersampling)

    @property
    def samples_per_side(self) -> int:
        """The supersampling factor if each pixel is shaded once; 1 if each of its samples is shaded."""
        return self.look.supersampling if is_shaded_by_pixel(self.look) else 1

    @property
    def shaded_camera(self) -> Camera:
        """The camera at the resolution of shading: one pixel per pixel of the picture, or per sample."""
        return self.camera if self.samples_per_side > 1 else self.sample_camera
