"""Compute the spacing of strokes: even in the picture or on the surface, and changed by tone and curvature.

Where a surface turns away from the camera, it is foreshortened in one direction. In the picture, strokes
along this direction keep their distance, but strokes across it, along the silhouette, come nearer. So the
spacing depends on the direction of strokes, so that they do not crowd at silhouettes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.color import REC709_LUMINANCE
from ..field.blocks import bincount_rows
from ..field.curvature import face_magnitude
from ..field.frames import dot, normalize
from ..field.representation import unit_complex
from ..field.surface import Surface
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.vector_components import cofactor_matrix
from .stroke_set import Strokes
from .tangent_mesh import TangentMesh
from .visibility import pixel_size

#: Largest and smallest factor by which tone and curvature change a spacing.
MAX_SPACING_RATIO, MIN_SPACING_RATIO = 3.0, 0.5

#: Strokes end where the tone reduces their width to this fraction.
MIN_STROKE_WIDTH = 0.12


# --- in the picture -------------------------------------------------------------------------------------


#: Smallest cosine between the normal and the direction to the camera for which the density is kept.
MIN_FACING_COSINE = 1 / 3


def foreshortening_factor(cosine: np.ndarray | float) -> np.ndarray:
    """Return the factor of the spacing that keeps the density of strokes in the picture even.

    `cosine` is the cosine between the normal of the surface and the direction to the camera. See
    `spacing_in_picture`.
    """
    return (1 + cosine) / (2 * cosine)


#: Smallest distance in the picture, relative to the requested spacing: the distance of strokes across the
#: foreshortened direction at `MIN_FACING_COSINE`.
MIN_PICTURE_RATIO = foreshortening_factor(MIN_FACING_COSINE) * MIN_FACING_COSINE

#: Limit for the cosine between the normal and the direction to the camera: where the cosine is smaller, the
#: spacing does not grow further. Otherwise, strokes that approach a silhouette at an angle would end before
#: they reach it. The limit is chosen such that the band with smaller cosines is `SILHOUETTE_SPACINGS` wide in
#: the picture. It is clipped to the range `MIN_COSINES`.
MIN_COSINES, SILHOUETTE_SPACINGS = (0.03, 0.2), 2.0


@dataclass(frozen=True, eq=False)
class CornerSpacing:
    """The spacing of strokes at the corners of T triangles, in world space.

    Let d be the unit direction of a stroke in the frame of its triangle. The spacing is `values` times
    a factor for the direction: the square root of mean - Re(conj(double) d^2), but at least 1.

    Attributes
    ----------
    values : (T, 3) float64 ndarray
        Spacing without the factor for the direction.
    mean : (T, 3) float64 ndarray or None
    double : (T, 3) complex128 ndarray or None
        Coefficients of the factor; None if the spacing does not depend on the direction.
    is_directional : (T,) bool ndarray or None
        Whether the factor is above 1 for some direction; None if the spacing does not depend on the
        direction.
    """

    values: np.ndarray
    mean: np.ndarray | None = None
    double: np.ndarray | None = None
    is_directional: np.ndarray | None = None

    def at(self, triangle: np.ndarray, weights: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return (n,) float64: the spacing at points of triangles, for strokes in given directions.

        `weights` are (n, 3) barycentric coordinates, and `direction` (n,) complex unit tangents in the frames
        of the triangles.
        """
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
    """Return the spacing, in world space, of strokes that are about `pixels` pixels apart in the picture.

    Let c be the cosine between the normal and the direction to the camera. The visible area of the
    surface is c times its area. Lines on it appear between c and 1 times as long, and (1 + c) / 2
    times on average over their directions. So the spacing grows by (1 + c) / (2 c), to keep the
    density even.

    It grows more for strokes across the foreshortened direction, which would crowd. Let p be the angle
    between a stroke and the foreshortened direction. Strokes at a distance s on the surface are
    s / sqrt(cos^2 p + sin^2 p / c^2) apart in the picture.

    Parameters
    ----------
    mesh : TangentMesh
    camera : Camera
    pixels : float
        Spacing, in pixels, on a surface that faces the camera.
    """
    to_eye = camera.view_directions(mesh.points)
    cosine = np.abs(dot(mesh.corner_normal, to_eye))
    factor = foreshortening_factor(np.maximum(cosine, MIN_FACING_COSINE))
    facing_values = pixels * pixel_size(mesh.points.reshape(-1, 3), camera).reshape(-1, 3)
    relative = MIN_PICTURE_RATIO / factor
    # On a surface of curvature k, c is below a limit in a band as wide as limit^2 / (2 k).
    band = 2 * SILHOUETTE_SPACINGS * facing_values * _curvature(mesh)[:, None]
    limit = np.clip(np.sqrt(band), *MIN_COSINES)
    steepness = relative**2 * (1 / np.maximum(cosine, limit) ** 2 - 1)
    tangent = dot(to_eye, mesh.x[:, None]) + 1j * dot(to_eye, mesh.y[:, None])
    double = steepness / 2 * unit_complex(tangent) ** 2
    is_directional = (relative**2 + steepness > 1).any(axis=1)
    mean = relative**2 + steepness / 2
    return CornerSpacing(facing_values * factor, mean, double, is_directional)


def _curvature(mesh: TangentMesh) -> np.ndarray:
    """Return (T,) float64: the curvature of triangles, estimated from the shading normals.

    It is the largest difference between the normals at both ends of an edge, over the length of the edge.
    """
    turn = mesh.corner_normal - np.roll(mesh.corner_normal, -1, axis=1)
    edge = mesh.points - np.roll(mesh.points, -1, axis=1)
    squared_length = np.maximum(dot(edge, edge), 1e-300)
    return np.sqrt(dot(turn, turn) / squared_length).max(axis=1)


# --- by tone and curvature ------------------------------------------------------------------------------


def with_vertices_of_fans(instance: MeshInstance) -> MeshInstance:
    """Return a mesh instance with a vertex for each smooth fan, so that each vertex has one normal.

    A smooth fan is the set of corners around a vertex that are not separated by sharp edges. In the result,
    the two sides of a sharp edge have different vertices, and so can have different spacings and tones. With
    the original vertices, these would be averaged: a dark face would become lighter near its edges, and a
    light face darker.

    Returns
    -------
    MeshInstance
        Vertex k is at the vertex of fan k. Faces, corners and triangles are the same.
    """
    surface = instance.surface
    vertices, fan = surface.vertices[fan_vertices(surface)], surface.corner_fan
    split = surface.with_parts(vertices=vertices, corner_vertex=fan, rest_vertices=None)
    return replace(instance, surface=split)


def fan_vertices(surface: Surface) -> np.ndarray:
    """Return (K,) int32: the vertex of each of the K smooth fans of a surface."""
    vertex = np.zeros(int(surface.corner_fan.max()) + 1, dtype=np.int32)
    vertex[surface.corner_fan] = surface.corner_vertex
    return vertex


def spacing_by_tone(tone: np.ndarray, max_ratio: float) -> np.ndarray:
    """Return the factor of the spacing for each tone: 1 over the darkness, 1 - tone.

    The fraction of the paper that is covered with ink, the width of strokes over their spacing, is then
    proportional to the darkness. The factor is 1 for black.

    Parameters
    ----------
    tone : ndarray
        Tones at vertices or faces, from 0 (black) to 1 (white).
    max_ratio : float
        Largest factor.
    """
    return 1 / np.maximum(1 - np.clip(tone, 0, 1), 1 / max_ratio)


def spacing_by_curvature(surface: Surface, exponent: float) -> np.ndarray:
    """Return factors of the spacing, which are smaller where the surface is more curved.

    The spacing is divided by a power of the ratio of the curvature to its median. The factor is limited to
    the range from `MIN_SPACING_RATIO` to `MAX_SPACING_RATIO`.

    Parameters
    ----------
    surface : Surface
    exponent : float
        The power. 0 changes nothing; with 1 the spacing is proportional to the radius of curvature.

    Returns
    -------
    (V,) float64 ndarray
        Factor at each vertex.
    """
    curvature = face_magnitude(surface, "curvature") * surface.extent
    corner = surface.corner_vertex
    count = np.bincount(corner, minlength=len(surface.vertices))
    vertex_curvature = np.bincount(corner, curvature[surface.corner_face], len(surface.vertices))
    vertex_curvature = vertex_curvature / np.maximum(count, 1)
    median = float(np.median(vertex_curvature[count > 0]))
    relative = np.maximum(vertex_curvature, 1e-3 * max(median, 1e-9)) / max(median, 1e-9)
    return np.clip(relative**-exponent, MIN_SPACING_RATIO, MAX_SPACING_RATIO)


def lit_tone(instance: MeshInstance, camera: Camera, lights: Sequence[Any]) -> np.ndarray:
    """Return the tones of a matte surface under several lights, without shadows.

    Parameters
    ----------
    instance : MeshInstance
    camera : Camera
        Camera. The lights are in its space.
    lights : sequence of compositor.shading.Light
        In camera space. If there are none, the light is at the camera.

    Returns
    -------
    (V,) float64 ndarray
        Tones at the vertices, from 0 (black) to 1 (white).
    """
    if not lights:
        return lambert_tone(instance, camera.view_directions(instance.world_points()))
    rotation = camera.view[:3, :3]
    tone = np.zeros(len(instance.surface.vertices))
    for light in lights:
        strength = light.strength * float(np.array(REC709_LUMINANCE) @ light.color)
        if light.kind == "sun":
            tone += strength * lambert_tone(instance, rotation.T @ light.vector)
            continue
        to_light = rotation.T @ (light.vector - camera.view[:3, 3]) - instance.world_points()
        received = strength / np.maximum(dot(to_light, to_light), 1e-12)
        tone += received * lambert_tone(instance, to_light)
    return np.minimum(tone, 1)


def lambert_tone(instance: MeshInstance, to_light: np.ndarray) -> np.ndarray:
    """Return (V,) tones of a matte surface: the cosines between normals and the light, clipped to 0 to 1.

    Parameters
    ----------
    instance : MeshInstance
    to_light : (3,) or (V, 3) array_like
        Directions to the light in world space, of any length.
    """
    matrix = np.asarray(instance.matrix, dtype=np.float64)[:3, :3]
    surface = instance.surface
    fan_normal = bincount_rows(surface.corner_vertex, surface.corner_normal)
    normal = np.zeros_like(surface.vertices)
    normal[: len(fan_normal)] = fan_normal @ cofactor_matrix(matrix).T
    direction = normalize(np.broadcast_to(to_light, normal.shape) + 0.0)
    return np.clip(dot(normalize(normal), direction), 0, 1)


def weight_by_tone(
    strokes: Strokes, tone: np.ndarray, layering: float, max_ratio: float = MAX_SPACING_RATIO
) -> Strokes:
    """Reduce the width of strokes in light areas, and remove strokes in the lightest areas.

    With the darkness d = 1 - tone, the strokes of family k have the width 0 where d <= k * `layering`. Above
    that, their width grows linearly, and they have their full width from d = k * `layering` + 1 / `max_ratio`
    on. `spacing_by_tone` reaches its largest factor at d = 1 / `max_ratio`. Where d is smaller, only the
    width of the first family still falls, so the ink coverage falls continuously to zero.

    Parameters
    ----------
    strokes : Strokes
        Strokes as they were traced.
    tone : (n,) ndarray
        Tones at the points of strokes, from 0 to 1; see `values_at_points`.
    layering : float
        Difference in darkness between the tones at which successive families begin.
    max_ratio : float
        Largest factor by which `spacing_by_tone` increases the spacing.

    Returns
    -------
    Strokes
        The strokes with smaller widths. They are cut where the width falls to `MIN_STROKE_WIDTH`. Ends at
        cuts are free ends.
    """
    darkness = 1 - np.clip(tone, 0, 1) - layering * strokes.family[strokes.stroke]
    weight = np.clip(darkness * max_ratio, 0, 1)
    thinned = replace(strokes, width=strokes.width * weight)
    return replace(thinned.runs_where(weight > MIN_STROKE_WIDTH), names=strokes.names)


def values_at_points(strokes: Strokes, surface: Surface, values: np.ndarray) -> np.ndarray:
    """Interpolate (V,) values at vertices to the (n,) points of strokes.

    All points must have barycentric weights. `clip_to_visible` adds points without weights, so call this
    function before it.
    """
    vertex = surface.triangle_vertex[strokes.triangle]
    return np.einsum("nk,nk->n", strokes.weights, np.asarray(values, dtype=np.float64)[vertex])
