"""Spacing that depends on the direction of strokes, so that they do not crowd at silhouettes.

Where a surface turns away from the camera, it is foreshortened in one direction. Strokes along this
direction keep their distance in the picture. Strokes across it, along the silhouette, come nearer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.frames import dot
from ..projection.camera import Camera
from .tangent_mesh import TangentMesh, unit
from .visibility import pixel_size

#: Smallest cosine between the normal and the direction to the camera for which the density is kept.
MIN_FACING_COSINE = 1 / 3


def foreshortening_factor(cosine: np.ndarray | float) -> np.ndarray:
    """Return the factor of the spacing that keeps the density even; see `spacing_in_picture`."""
    return (1 + cosine) / (2 * cosine)


#: Smallest distance in the picture, relative to the requested spacing. It is that of strokes across the
#: foreshortened direction at `MIN_FACING_COSINE`.
MIN_PICTURE_RATIO = foreshortening_factor(MIN_FACING_COSINE) * MIN_FACING_COSINE

#: Limits of the smallest cosine between the normal and the direction to the camera for which the spacing
#: grows. Between them, the part of the surface with smaller cosines is this many spacings wide in the
#: picture. Lines that approach a silhouette at an angle would otherwise end before they reach it.
MIN_COSINES, SILHOUETTE_SPACINGS = (0.03, 0.2), 2.0


@dataclass(frozen=True, eq=False)
class CornerSpacing:
    """The spacing of strokes at the corners of T triangles, in world space.

    Let d be the unit direction of a stroke in the frame of its triangle. The spacing is `values` times
    the square root of mean - Re(conj(double) d^2), or times 1 if this is less.

    Attributes
    ----------
    values : (T, 3) float64 ndarray
    mean : (T, 3) float64 ndarray or None
    double : (T, 3) complex128 ndarray or None
        None if the spacing does not depend on the direction.
    is_directional : (T,) bool ndarray or None
        Whether the factor may be above 1.
    """

    values: np.ndarray
    mean: np.ndarray | None = None
    double: np.ndarray | None = None
    is_directional: np.ndarray | None = None

    def take(self, kept: np.ndarray) -> CornerSpacing:
        """Return the spacing on some triangles; `kept` is (T,) bool."""
        columns = vars(self).values()
        return CornerSpacing(*(None if column is None else column[kept] for column in columns))

    def at(self, triangle: np.ndarray, weights: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return (n,) float64: the spacing at barycentric coordinates, for unit directions."""
        spacing = np.einsum("nk,nk->n", weights, self.values[triangle])
        if self.is_directional is None:
            return spacing
        changed = np.flatnonzero(self.is_directional[triangle])
        if len(changed):
            triangle, weights, direction = triangle[changed], weights[changed], direction[changed]
            mean = np.einsum("nk,nk->n", weights, self.mean[triangle])
            double = np.einsum("nk,nk->n", weights, self.double[triangle])
            factor = mean - (double.conj() * direction**2).real
            spacing[changed] *= np.sqrt(np.maximum(factor, 1))
        return spacing


def spacing_in_picture(mesh: TangentMesh, camera: Camera, pixels: float) -> CornerSpacing:
    """Return the spacing in world space of strokes that are some pixels apart in the picture.

    Let c be the cosine between the normal and the direction to the camera. The visible area of the
    surface is c times its area. Lines on it appear between c and 1 times as long, and (1 + c) / 2
    times on average over their directions. So the spacing grows by (1 + c) / (2 c), to keep the
    density even.

    It grows more for strokes that would crowd. Let p be the angle between a stroke and the foreshortened
    direction. Strokes at a distance s on the surface are s / sqrt(cos^2 p + sin^2 p / c^2) apart in the
    picture.

    Parameters
    ----------
    mesh : TangentMesh
    camera : Camera
    pixels : float
        Spacing for a surface that faces the camera.

    """
    to_eye = camera.view_directions(mesh.points)
    cosine = np.abs(dot(mesh.corner_normal, to_eye))
    factor = foreshortening_factor(np.maximum(cosine, MIN_FACING_COSINE))
    facing_values = pixels * pixel_size(mesh.points.reshape(-1, 3), camera).reshape(-1, 3)
    relative = MIN_PICTURE_RATIO / factor
    # On a surface of curvature k, c is below a limit in a band as wide as limit^2 / (2 k).
    band = 2 * SILHOUETTE_SPACINGS * facing_values * _curvature(mesh)[:, None]
    steepness = relative**2 * (
        1 / np.maximum(cosine, np.clip(np.sqrt(band), *MIN_COSINES)) ** 2 - 1
    )
    tangent = dot(to_eye, mesh.x[:, None]) + 1j * dot(to_eye, mesh.y[:, None])
    tangent = unit(tangent, np.zeros_like(tangent))
    mean = relative**2 + steepness / 2
    return CornerSpacing(
        facing_values * factor,
        mean,
        steepness / 2 * tangent**2,
        (relative**2 + steepness > 1).any(axis=1),
    )


def _curvature(mesh: TangentMesh) -> np.ndarray:
    """Return (T,) float64: the largest change of the normal along an edge, over its length."""
    curvature = np.zeros(len(mesh.points))
    for first, second in ((0, 1), (1, 2), (2, 0)):
        turn = mesh.corner_normal[:, first] - mesh.corner_normal[:, second]
        edge = mesh.points[:, first] - mesh.points[:, second]
        squared_length = np.maximum(dot(edge, edge), 1e-300)
        curvature = np.maximum(curvature, np.sqrt(dot(turn, turn) / squared_length))
    return curvature
