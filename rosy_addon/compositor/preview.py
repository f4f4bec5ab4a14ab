"""The small picture of a look: the same form for all, so that looks can be told apart."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..field.generate import curvature_field
from ..field.rosy_field import RosyField
from ..field.surface import Surface, build_surface
from ..projection.camera import orbit_camera
from ..projection.gbuffer import Body
from ..projection.project import project
from .colour import from_hex, to_linear
from .compose import compose
from .look import Look

#: Pixels on each side: twice what the panel shows, for screens with small pixels.
SIDE = 256

#: Azimuth and elevation in degrees: the knot from above, a little from the front.
VIEW = (0.0, 68.0)

#: Behind what is not drawn on paper: display values, dark as Blender's own panels.
GROUND = "#292929"


def draw_preview(look: Look) -> np.ndarray:
    """A trefoil knot in a look, its field along the principal curvatures.

    Drawn in a second or so whatever the look: see `_quick`.

    Parameters
    ----------
    look : Look

    Returns
    -------
    (SIDE, SIDE, 4) float32 ndarray
        Linear light, opaque, rows from the bottom.
    """
    look = _quick(look)
    form, field = _knot()
    side = SIDE * look.supersampling
    camera = orbit_camera(form, *VIEW, side, side, margin=0.03)
    gbuffer = project([Body(form, np.eye(4), field)], camera, look.display)
    return _laid_on(compose(gbuffer, look).rgba, look)


def _quick(look: Look) -> Look:
    """A look without what takes long and is not to be seen in a small picture.

    Brute force gives way to sheets, which draw the same streamlines; the members method, whose
    cost grows with every sample of every step, does without smooth edges; nothing is larger than
    the picture.
    """
    return look.with_settings(
        {
            "method": "sheets" if look.method == "brute" else look.method,
            "supersampling": 1 if look.method == "members" else 2,
            "unit": "pixels",
            "length": min(look.length, SIDE // 2),
            "grain": min(look.grain, SIDE / 2),
            "high_pass": min(look.high_pass, SIDE / 4),
        }
    )


def _laid_on(rgba: np.ndarray, look: Look) -> np.ndarray:
    """A picture on the look's paper, or before a dark ground if it has none."""
    ground = to_linear(from_hex(look.paper_colour if look.ink == "hatch" else GROUND))
    alpha = rgba[..., 3:]
    opaque = np.ones_like(rgba)
    opaque[..., :3] = rgba[..., :3] * alpha + ground * (1 - alpha)
    return opaque


@cache
def _knot(tube: float = 0.66, around: int = 300, across: int = 40) -> tuple[Surface, RosyField]:
    """A thick tube about a trefoil, and its directions of curvature.

    The tube bends both ways, passes over itself and lies in every light.
    """
    t = np.arange(around) * (2 * np.pi / around)
    line, ahead = _trefoil(t)
    # The knot winds about a circle of radius 2, and never along the way out from there.
    out = line - 2 * np.stack([np.cos(2 * t), np.sin(2 * t), 0 * t], axis=1)
    out -= np.sum(out * ahead, axis=1, keepdims=True) * ahead
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    v = np.arange(across)[None, :, None] * (2 * np.pi / across)
    ring = np.cos(v) * out[:, None] + np.sin(v) * np.cross(ahead, out)[:, None]
    points = (line[:, None] + tube * ring).reshape(-1, 3)
    number = np.arange(len(points), dtype=np.int32).reshape(around, across)
    onward, upward = np.roll(number, -1, axis=0), np.roll(number, -1, axis=1)
    corners = np.stack([number, onward, np.roll(onward, -1, axis=1), upward], axis=-1)
    start = np.arange(number.size + 1) * 4
    form = build_surface(points, corners.ravel(), start, name="knot")
    return form, curvature_field(form, 4)


def _trefoil(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the knot and unit vectors along it."""
    reach, height = 2 + np.cos(3 * t), 1.1
    line = np.stack([reach * np.cos(2 * t), reach * np.sin(2 * t), height * np.sin(3 * t)], axis=1)
    outward = -3 * np.sin(3 * t)
    ahead = np.stack(
        [
            outward * np.cos(2 * t) - 2 * reach * np.sin(2 * t),
            outward * np.sin(2 * t) + 2 * reach * np.cos(2 * t),
            3 * height * np.cos(3 * t),
        ],
        axis=1,
    )
    return line, ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
