"""Tones that surfaces have of their own, painted, computed or of an image, from corners to pixels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..field.frames import dot

if TYPE_CHECKING:
    from .gbuffer import Body, GBuffer

#: Pixels that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14

#: How oblique a surface may be for a pixel to be taken for as long as it is: the sine to the ray.
EDGEWISE = 0.1


class Pyramid:
    """An image, and the same at half its size, and at half of that, for pixels of any width.

    Parameters
    ----------
    image : (H, W) float ndarray
        Rows from the bottom.

    Attributes
    ----------
    levels : list of (h, w) float32 ndarray
        From the finest to a single number.
    """

    def __init__(self, image: np.ndarray) -> None:
        self.levels = [np.ascontiguousarray(image, dtype=np.float32)]
        while self.levels[-1].size > 1:
            self.levels.append(_halved(self.levels[-1]))

    def at(self, u: np.ndarray, v: np.ndarray, level: np.ndarray, *, repeat: bool) -> np.ndarray:
        """Values between the centres of the pixels of a level.

        Parameters
        ----------
        u, v : (n,) ndarray
            From 0 to 1 over the width and the height.
        level : (n,) ndarray
            How often the image is halved; the nearest level is taken.
        repeat : bool
            Whether the image begins anew at its borders, or its borders go on for ever.

        Returns
        -------
        (n,) float32 ndarray
        """
        found = np.empty(len(u), dtype=np.float32)
        number = np.clip(np.rint(level), 0, len(self.levels) - 1).astype(np.int32)
        for one in np.flatnonzero(np.bincount(number)).tolist():
            own = np.flatnonzero(number == one)
            found[own] = _between(self.levels[one], u[own], v[own], repeat)
        return found


def _halved(image: np.ndarray) -> np.ndarray:
    height, width = image.shape
    even = np.pad(
        image, ((0, height % 2 if height > 1 else 0), (0, width % 2 if width > 1 else 0)), "edge"
    )
    if height > 1:
        even = 0.5 * (even[::2] + even[1::2])
    if width > 1:
        even = 0.5 * (even[:, ::2] + even[:, 1::2])
    return even.astype(np.float32)


def _between(image: np.ndarray, u: np.ndarray, v: np.ndarray, repeat: bool) -> np.ndarray:
    height, width = image.shape
    ends, shares = [], []
    for place, size in ((v, height), (u, width)):
        place = (place - np.floor(place) if repeat else np.clip(place, 0, 1)) * size - 0.5
        first = np.floor(place)
        shares.append((place - first).astype(np.float32))
        first = first.astype(np.intp)
        both = first, first + 1
        ends.append([end % size if repeat else np.clip(end, 0, size - 1) for end in both])
    (low, high), (left, right) = ends
    up, across = shares
    below = image[low, left] * (1 - across) + image[low, right] * across
    above = image[high, left] * (1 - across) + image[high, right] * across
    return below * (1 - up) + above * up


@dataclass(frozen=True, eq=False)
class SurfaceTone:
    """A tone of a surface's own, linear: 0 is dark, 1 is light.

    Attributes
    ----------
    values : (C, 1) or (C, 2) float32 ndarray
        At the corners of the surface: the tone itself or, with an image, where on it they are, u
        and v, which run from 0 to 1 over its width and its height.
    image : (H, W) float32 ndarray or None
        Rows from the bottom.
    """

    values: np.ndarray
    image: np.ndarray | None = None

    @cached_property
    def pyramid(self) -> Pyramid:
        """The image at all sizes."""
        return Pyramid(self.image)


def surface_tones(gbuffer: GBuffer) -> np.ndarray:
    """The tones that surfaces have of their own, at the pixels of a G-buffer.

    Parameters
    ----------
    gbuffer : GBuffer
        With its bodies.

    Returns
    -------
    (P,) float32 ndarray
        NaN where a body has none.
    """
    tones = np.full(len(gbuffer.pixel), np.nan, dtype=np.float32)
    for body, pixels in _by_body(gbuffer):
        tone = body.tone
        if tone is None:
            continue
        corners = body.surface.triangles.take(gbuffer.triangle[pixels], axis=0)
        at = np.einsum("pi,pik->kp", gbuffer.barycentric[pixels], tone.values[corners])
        if tone.image is None:
            tones[pixels] = at[0]
        else:
            level = 0.5 * np.log2(_texels(gbuffer, body, pixels, corners) + 1e-12)
            tones[pixels] = tone.pyramid.at(*at, level, repeat=True)
    return tones


def _by_body(gbuffer: GBuffer) -> Iterator[tuple[Body, np.ndarray]]:
    """Bodies that are seen, with blocks of their pixels."""
    for number in np.flatnonzero(np.bincount(gbuffer.body)).tolist():
        pixels = np.flatnonzero(gbuffer.body == number)
        for start in range(0, len(pixels), BLOCK):
            yield gbuffer.bodies[number], pixels[start : start + BLOCK]


def _texels(gbuffer: GBuffer, body: Body, pixels: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(n,) how many pixels of the image a pixel of the picture covers."""
    surface, tone = body.surface, body.tone
    linear = np.asarray(body.matrix, dtype=np.float64)[:3, :3]
    places = surface.vertices[surface.corner_vertex[corners]] @ linear.T
    ahead, aside = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    area = np.linalg.norm(np.cross(ahead, aside), axis=1)
    u, v = np.moveaxis(tone.values[corners], -1, 0).astype(np.float64)
    mapped = (u[:, 1] - u[:, 0]) * (v[:, 2] - v[:, 0]) - (u[:, 2] - u[:, 0]) * (v[:, 1] - v[:, 0])
    camera = gbuffer.camera
    depth = -gbuffer.position[pixels, 2] if camera.is_perspective else 1.0
    facing = np.abs(dot(gbuffer.plane_normal[pixels], gbuffer.toward_eye[pixels]))
    covered = (depth / camera.pixels_per_unit) ** 2 / np.maximum(facing, EDGEWISE)
    return np.abs(mapped) * tone.image.size * covered / np.maximum(area, 1e-30)
