"""Spacing that depends on the direction of strokes, so that they do not crowd at silhouettes.

Where a surface turns away from the camera, it is foreshortened in one direction. Strokes along this
direction keep their distance in the picture. Strokes across it, along the silhouette, come nearer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..field.frames import dot
from ..projection.camera import Camera
from .spacing import MIN_FACING_COSINE, foreshortening_factor
from .tangent_mesh import TangentMesh

#: Smallest distance in the picture, relative to the requested spacing. It is that of strokes across the
#: foreshortened direction at the cosine at which `spacing_by_foreshortening` stops to grow.
MIN_PICTURE_RATIO = foreshortening_factor(MIN_FACING_COSINE) * MIN_FACING_COSINE

#: Smallest cosine between the normal and the direction to the camera for which the spacing grows. Below it,
#: lines that approach the silhouette at an angle would end before they reach it.
MIN_COSINE = 0.2


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


def spacing_in_picture(mesh: TangentMesh, values: np.ndarray, camera: Camera) -> CornerSpacing:
    """Widen a spacing across the foreshortened direction, where strokes would crowd in the picture.

    Let c be the cosine between the normal and the direction to the camera, and p the angle between a
    stroke and the foreshortened direction. Strokes at a distance s on the surface are
    s / sqrt(cos^2 p + sin^2 p / c^2) apart in the picture.

    Parameters
    ----------
    mesh : TangentMesh
    values : (T, 3) float64 ndarray
        Spacing at the corners, from `spacing_by_foreshortening`, before tone and curvature or after.
    camera : Camera
    """
    to_eye = camera.view_directions(mesh.points)
    cosine = np.abs(dot(mesh.corner_normal, to_eye))
    relative = MIN_PICTURE_RATIO / foreshortening_factor(np.maximum(cosine, MIN_FACING_COSINE))
    steepness = relative**2 * (1 / np.maximum(cosine, MIN_COSINE) ** 2 - 1)
    tangent = dot(to_eye, mesh.x[:, None]) + 1j * dot(to_eye, mesh.y[:, None])
    norm = np.abs(tangent)
    tangent = np.divide(tangent, norm, out=np.zeros_like(tangent), where=norm > 0)
    mean = relative**2 + steepness / 2
    return CornerSpacing(
        values, mean, steepness / 2 * tangent**2, (relative**2 + steepness > 1).any(axis=1)
    )
