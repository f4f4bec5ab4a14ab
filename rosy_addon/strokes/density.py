"""How near strokes are to be: by what a camera sees, by tone, and by curvature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from ..errors import RosyError
from ..field.frames import dot, unit
from ..field.generate import curvature_magnitude
from ..field.surface import Surface, mix_over_fans
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from .seen import pixel_size
from .strokes import Strokes

#: Spacings are at most and at least so many times what was asked for.
LIGHTEST, DARKEST = 3.0, 0.5

#: Part of its width at which a stroke is lifted from the paper.
THINNEST = 0.12

#: Cosine of the slant up to which strokes are moved apart for it.
SLANT = 1 / 3

#: Share of each channel in what is seen of a linear colour (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class Lamp(Protocol):
    """A light in the space of a camera.

    Attributes
    ----------
    kind : {"sun", "point"}
    vector : (3,) ndarray
        The unit direction to a sun, the position of a point.
    colour : (3,) ndarray
        Linear.
    strength : float
        What a white surface facing it sends out; of a point, at a distance of 1.
    """

    kind: str
    vector: np.ndarray
    colour: np.ndarray
    strength: float


def pixel_spacing(body: Body, camera: Camera, pixels: float) -> np.ndarray:
    """(V,) float64: spacings in world space that are so many pixels, facing the camera.

    Raises
    ------
    RosyError
        If they are not above 0.
    """
    if not (np.isfinite(pixels) and pixels > 0):
        raise RosyError(f"a spacing of {pixels:g} pixels is not above 0")
    return pixels * pixel_size(body.world_points(), camera)


def foreshortened(body: Body, camera: Camera, spacing: np.ndarray) -> np.ndarray:
    """(V,) wider where the surface turns away from a camera, so that strokes do not crowd there.

    Seen at a slant of cosine c, a surface has c times its area, and lines on it are between c and 1
    times as long, (1 + c) / 2 on average over their directions.

    Parameters
    ----------
    body : Body
    camera : Camera
    spacing : (V,) ndarray
        Where the surface faces the camera.
    """
    toward = camera.toward(body.world_points())
    cosine = np.maximum(np.maximum(lambert(body, toward), lambert(body, -toward)), SLANT)
    return spacing * (1 + cosine) / (2 * cosine)


def by_tone(
    spacing: np.ndarray | float, tone: np.ndarray, lightest: float = LIGHTEST
) -> np.ndarray:
    """Nearer where it is darker: ink on paper is the width of strokes over their spacing.

    Parameters
    ----------
    spacing : float or ndarray
        Where it is black.
    tone : ndarray
        From 0, black, to 1, white; at vertices or faces.
    lightest : float
        How many times as far strokes are at most.

    Raises
    ------
    RosyError
        If a tone is not a number.
    """
    tone = np.asarray(tone, dtype=np.float64)
    if not np.isfinite(tone).all():
        raise RosyError("a tone is not a number")
    ink = np.maximum(1 - np.clip(tone, 0, 1), 1 / lightest)
    return np.asarray(spacing) / ink


def by_curvature(surface: Surface, spacing: np.ndarray | float, amount: float = 0.5) -> np.ndarray:
    """(V,) nearer where the surface bends more.

    Parameters
    ----------
    surface : Surface
    spacing : float or (V,) ndarray
    amount : float
        Power of the curvature, relative to its median, that the spacing is divided by: 0 changes
        nothing, at 1 it is as the radius of curvature. Between `DARKEST` and `LIGHTEST` times as
        far.
    """
    bend = curvature_magnitude(surface, "curvature")
    corner = surface.corner_vertex
    count = np.bincount(corner, minlength=len(surface.vertices))
    mean = np.bincount(corner, bend[surface.corner_face], len(surface.vertices))
    mean = mean / np.maximum(count, 1)
    middle = float(np.median(mean[count > 0]))
    share = np.maximum(mean, 1e-3 * max(middle, 1e-9)) / max(middle, 1e-9)
    return np.asarray(spacing) * np.clip(share**-amount, DARKEST, LIGHTEST)


def headlight(body: Body, camera: Camera) -> np.ndarray:
    """(V,) tones of a matt surface lit from the camera: 1 where it faces it."""
    return lambert(body, camera.toward(body.world_points()))


def lit(body: Body, camera: Camera, lights: Sequence[Lamp]) -> np.ndarray:
    """(V,) tones of a matt surface under several lights, 1 at most; `headlight` without any.

    Nothing casts shadows.

    Parameters
    ----------
    body : Body
    camera : Camera
        In whose space the lights are.
    lights : sequence of Lamp
    """
    if not lights:
        return headlight(body, camera)
    turned = camera.view[:3, :3]
    tone = np.zeros(len(body.surface.vertices))
    for light in lights:
        strength = light.strength * float(LUMINANCE @ light.colour)
        if light.kind == "sun":
            tone += strength * lambert(body, turned.T @ light.vector)
            continue
        way = turned.T @ (light.vector - camera.view[:3, 3]) - body.world_points()
        tone += strength / np.maximum(dot(way, way), 1e-12) * lambert(body, way)
    return np.minimum(tone, 1)


def lambert(body: Body, light: np.ndarray) -> np.ndarray:
    """(V,) tones of a matt surface.

    Parameters
    ----------
    body : Body
    light : (3,) or (V, 3) array_like
        Toward the light, world space.
    """
    matrix = np.asarray(body.matrix, dtype=np.float64)[:3, :3]
    surface = body.surface
    cofactors = np.array([np.cross(matrix[k - 2], matrix[k - 1]) for k in range(3)])
    fan = mix_over_fans(surface.corner_normal, surface.corner_vertex)
    normal = np.zeros_like(surface.vertices)
    normal[: len(fan)] = fan @ cofactors.T
    return np.clip(dot(unit(normal), unit(np.broadcast_to(light, normal.shape) + 0.0)), 0, 1)


def weighed_by_tone(
    strokes: Strokes, tone: np.ndarray, layering: float, lightest: float = LIGHTEST
) -> Strokes:
    """Families one after the other as it gets darker, thinner in the lights, and none in the brightest.

    In the first one width over spacing goes on where `by_tone` has spread strokes as far as they
    may be: the ink on paper falls to nothing.

    Parameters
    ----------
    strokes : Strokes
        As they were traced.
    tone : (n,) ndarray
        At their points, 0 to 1; `at_points` gives it.
    layering : float
        How much darker it has to be for each next family to begin.
    lightest : float
        As of `by_tone`.
    """
    dark = 1 - np.clip(tone, 0, 1) - layering * strokes.family[strokes.stroke]
    weight = np.clip(dark * lightest, 0, 1)
    weighed = replace(strokes, width=strokes.width * weight)
    return replace(weighed.runs(weight > THINNEST), names=strokes.names)


def at_points(strokes: Strokes, surface: Surface, values: np.ndarray) -> np.ndarray:
    """(n,) values of (V,) vertices at the points of strokes; not after `seen`, which adds points."""
    vertex = surface.triangle_vertex[strokes.triangle]
    return np.einsum("nk,nk->n", strokes.weights, np.asarray(values, dtype=np.float64)[vertex])
