"""Lengths of a look in the pixels of the frame that it is drawn in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..projection.camera import Camera
from ..projection.gbuffer import Body
from ..projection.shadows import bounds_of
from .look import Look

#: The settings that are lengths.
LENGTHS = ("length", "grain", "high_pass", "overshoot", "outline")

#: Steps of an octave in which lengths follow a camera: tables of a look last for a while.
STEPS = 32

#: Where the camera is amid what it sees: so much of its size is the least distance of the middle.
NEAREST = 0.25


@dataclass(frozen=True)
class FineLook(Look):
    """A look whose lengths are in the pixels of a frame with subpixels: more than one may ask for."""

    def __post_init__(self) -> None:
        """Nothing is checked again."""


def scaled_look(look: Look) -> FineLook:
    """The look with its lengths in the pixels of the supersampled frame."""
    settings = {entry.name: getattr(look, entry.name) for entry in fields(look)}
    for name in LENGTHS:
        settings[name] *= look.supersampling
    settings["unit_size"] /= look.supersampling
    return FineLook(**settings)


def measured_look(look: Look, camera: Camera, bodies: Sequence[Body]) -> Look:
    """The look with its lengths in pixels, as many as they have at the middle of what is drawn.

    Parameters
    ----------
    look : Look
    camera : Camera
        Of `look.supersampling` times the size of the picture each way.
    bodies : sequence of Body
        All that the camera may see; those with a field count.

    Returns
    -------
    Look
        Its `unit_size` is that of a pixel there, so that it is measured already.
    """
    shown = [bounds_of(body) for body in bodies if body.field is not None]
    if look.unit == "pixels" or not shown:
        return look
    wanted = look.unit_size / (pixel_at_middle(np.concatenate(shown), camera) * look.supersampling)
    times = float(np.clip(2 ** (np.rint(np.log2(wanted) * STEPS) / STEPS), *_room(look)))
    lengths = {name: getattr(look, name) * times for name in LENGTHS}
    lengths["length"] = max(round(lengths["length"]), 1)
    return replace(look, **lengths, unit_size=look.unit_size / times)


def pixel_at_middle(points: np.ndarray, camera: Camera) -> float:
    """How many Blender units a pixel is wide in the middle of (n, 3) points in world space."""
    if not camera.is_perspective:
        return 1 / camera.pixels_per_unit
    low, high = points.min(axis=0), points.max(axis=0)
    ahead = -(camera.view[2, :3] @ (low + high) / 2 + camera.view[2, 3])
    least = max(NEAREST * float(np.linalg.norm(high - low)), 1e-6)
    return max(float(ahead), least) / camera.pixels_per_unit


def unit_of(look: Look) -> dict[str, Any]:
    """What a look says about the cells of noise on surfaces, by the parameters of `surface_noise`.

    Parameters
    ----------
    look : Look
        Measured, with its lengths in the pixels of the frame.
    """
    if look.unit == "pixels":
        return {"pixel": 0.0, "smallest": 0.0}
    return {"pixel": look.unit_size, "smallest": float(look.supersampling)}


def _room(look: Look) -> tuple[float, float]:
    """The least and the most by which a look's lengths can be multiplied.

    Cells of the noise that are finer than pixels are not seen.
    """
    rules = {entry.name: entry.metadata for entry in fields(look)}
    most = min(rules[name]["high"] / max(getattr(look, name), 1e-9) for name in LENGTHS)
    least = max(1.0, rules["grain"]["low"]) / look.grain
    return min(least, 1.0), max(most, 1.0)
