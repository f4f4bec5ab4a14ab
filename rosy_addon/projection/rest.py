"""Where on the undeformed bodies the pixels of a G-buffer lie: what stays with a surface that moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.frames import transformed
from .gbuffer import Body, GBuffer

#: Pixels that are worked on at once.
BLOCK = 1 << 14


@dataclass(frozen=True, eq=False)
class RestPlaces:
    """Places on the undeformed bodies, at the centres of pixels and beside them.

    Attributes
    ----------
    weight, across, upward : (3, P) float32 ndarray
        Homogeneous barycentrics at the centre, and by how much they grow to the next pixel on the
        right and above, in the plane of the triangle.
    corners : 3 (3, P) float32 ndarrays
        The corners of the triangle at rest, object space.
    size : (P,) float32 ndarray
        What a pixel is wide there, parallel to the picture, in units of that space.
    """

    weight: np.ndarray
    across: np.ndarray
    upward: np.ndarray
    corners: tuple[np.ndarray, np.ndarray, np.ndarray]
    size: np.ndarray

    def block(self, pixels: slice) -> RestPlaces:
        """Those of some of the pixels."""
        return RestPlaces(
            self.weight[:, pixels],
            self.across[:, pixels],
            self.upward[:, pixels],
            tuple(corner[:, pixels] for corner in self.corners),
            self.size[pixels],
        )

    def at(self, x: float, y: float) -> np.ndarray:
        """(3, P) float32: the places that many pixels to the right of the centres, and above."""
        weight = self.weight + np.float32(x) * self.across
        weight += np.float32(y) * self.upward
        total = weight.sum(axis=0)
        total[np.abs(total) < 1e-30] = 1
        weight /= total
        # Where a plane is seen from its edge a pixel may reach far beyond the triangle.
        np.clip(weight, -4, 5, out=weight)
        return sum(share * corner for share, corner in zip(weight, self.corners, strict=True))


def rest_places(gbuffer: GBuffer) -> RestPlaces:
    """Where the pixels of a G-buffer lie on the bodies as they were before any deformation.

    Parameters
    ----------
    gbuffer : GBuffer
        With its bodies.
    """
    count = len(gbuffer.pixel)
    found = RestPlaces(
        *(np.empty((3, count), dtype=np.float32) for _ in range(3)),
        corners=tuple(np.empty((3, count), dtype=np.float32) for _ in range(3)),
        size=np.empty(count, dtype=np.float32),
    )
    for number in np.flatnonzero(np.bincount(gbuffer.body)).tolist():
        pixels = np.flatnonzero(gbuffer.body == number)
        body = gbuffer.bodies[number]
        for start in range(0, len(pixels), BLOCK):
            _fill(found, gbuffer, body, pixels[start : start + BLOCK])
    return found


def _fill(found: RestPlaces, gbuffer: GBuffer, body: Body, pixels: np.ndarray) -> None:
    """Write some pixels of one body."""
    camera, surface = gbuffer.camera, body.surface
    rest = surface.vertices if surface.rest is None else surface.rest
    vertices = surface.triangle_vertex.take(gbuffer.triangle[pixels], axis=0).T
    clip = camera.projection @ camera.view @ np.asarray(body.matrix, dtype=np.float64)
    row, column = np.divmod(gbuffer.pixel[pixels], camera.width)
    offsets = []
    for corner, out in zip(vertices, found.corners, strict=True):
        point = surface.vertices.take(corner, axis=0).T
        x, y, _, w = transformed(point, clip[:, :3], clip[:, 3])
        # In pixels times depth, from the centre of the pixel.
        x = (x + w) * (0.5 * camera.width) - (column + 0.5) * w
        y = (y + w) * (0.5 * camera.height) - (row + 0.5) * w
        offsets.append((x, y, w))
        out[:, pixels] = rest.take(corner, axis=0).T
    for edge in range(3):
        (bx, by, bw), (cx, cy, cw) = offsets[(edge + 1) % 3], offsets[(edge + 2) % 3]
        # Homogeneous edge functions are linear over the screen.
        found.weight[edge, pixels] = bx * cy - cx * by
        found.across[edge, pixels] = cw * by - bw * cy
        found.upward[edge, pixels] = bw * cx - cw * bx
    _scale(found, pixels)
    depth = -gbuffer.position[pixels, 2] if camera.is_perspective else 1.0
    found.size[pixels] = depth / (camera.pixels_per_unit * growth(body.matrix))


def growth(matrix: np.ndarray) -> float:
    """By how much a (4, 4) matrix makes things larger, as the side of a cube; 1 if it flattens."""
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    return float(np.cbrt(abs(np.cross(linear[0], linear[1]) @ linear[2]))) or 1.0


def _scale(found: RestPlaces, pixels: np.ndarray) -> None:
    """Homogeneous weights to a sum of 1 at the centre, so that single precision holds them."""
    total = found.weight[:, pixels].sum(axis=0)
    total[total == 0] = 1
    for weights in (found.weight, found.across, found.upward):
        weights[:, pixels] /= total
