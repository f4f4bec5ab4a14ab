"""The G-buffer: what the camera sees of the RoSy surfaces, as one flat list of pixels."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Any

import numpy as np

from ..field.rosy_field import RosyField
from ..field.surface import Surface
from .camera import Camera
from .carried import Carried, Trait
from .tone import SurfaceTone


@dataclass(frozen=True, eq=False)
class Body:
    """One thing in front of the camera: a surface, where it stands, and its field.

    Attributes
    ----------
    surface : Surface
        In object space. Instances share one.
    matrix : (4, 4) float64 ndarray
        Object to world space.
    field : RosyField or None
        On the faces of `surface`; None for what only hides others.
    tone : SurfaceTone or None
        How light it is to be, if that is its own affair.
    carried : dict of str to Carried
        What does not depend on the camera, by the display it is for: kept from one to the next.
    """

    surface: Surface
    matrix: np.ndarray
    field: RosyField | None = None
    tone: SurfaceTone | None = None
    carried: dict[str, Carried] = dataclass_field(default_factory=dict, repr=False)

    def world_points(self) -> np.ndarray:
        """(V, 3) float64: the vertices in world space."""
        matrix = np.asarray(self.matrix, dtype=np.float64)
        return self.surface.vertices @ matrix[:3, :3].T + matrix[:3, 3]


@dataclass(frozen=True, eq=False)
class GBuffer:
    """The visible pixels of all RoSy surfaces, P of them, in ascending order of pixel index.

    All vectors are in camera space.

    Attributes
    ----------
    camera : Camera
    names : tuple of str
        Name a body, in the order of the bodies given.
    degrees : tuple of int
        Degree a body; 0 for one without a field.
    pixel : (P,) int32 ndarray
        Flat index into the frame, from the lower left, rows first.
    body : (P,) int32 ndarray
        Which body is seen.
    face : (P,) int32 ndarray
        Which of its faces (polygons).
    barycentric : (P, 3) float32 ndarray
        Perspective-correct, in the triangle that is seen.
    triangle : (P,) int32 ndarray
        Which triangle of the body's surface.
    position : (P, 3) float32 ndarray
        Blender units.
    normal : (P, 3) float32 ndarray
        Unit shading normal, turned toward the eye.
    toward_eye : (P, 3) float32 ndarray
        Unit direction to the eye; (0, 0, 1) throughout for an orthographic camera.
    representation : (P,) complex64 ndarray
        z = rho exp(i N t), with t the angle of a member rotated into the view plane (the plane
        across `toward_eye`), in that plane's frame (`frames.view_frame`). Zero is undefined.
    plane_normal : (P, 3) float32 ndarray
        Unit normal of the triangle that is seen, as it is without shading, turned toward the eye.
        `normal` if not given.
    front : (P,) bool ndarray
        Whether the side of the triangle is seen on which its corners run counter-clockwise. True
        throughout if not given.
    traits : dict of Trait to (P,) complex64 ndarray
        What some fields have besides (`carried.Trait`), in the same frame; elsewhere what a RoSy
        would have.
    bodies : tuple of Body
        What it was made of; empty if that is not known.
    made : dict
        What has been made of it for a look, for the next one.
    """

    camera: Camera
    names: tuple[str, ...]
    degrees: tuple[int, ...]
    pixel: np.ndarray
    body: np.ndarray
    face: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    toward_eye: np.ndarray
    representation: np.ndarray
    plane_normal: np.ndarray | None = None
    front: np.ndarray | None = None
    traits: dict[Trait, np.ndarray] = dataclass_field(default_factory=dict)
    bodies: tuple[Body, ...] = ()
    made: dict[Any, Any] = dataclass_field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if self.plane_normal is None:
            object.__setattr__(self, "plane_normal", self.normal)
        if self.front is None:
            object.__setattr__(self, "front", np.ones(len(self.pixel), dtype=bool))
