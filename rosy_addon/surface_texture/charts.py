"""The charts of a UV map, maps between tangents of the surface and the UV plane, and frames for texels.

A chart is a part of the surface whose triangles are connected in the UV map. Tangents of the surface
are complex numbers in the frame of their triangle (see `line_drawing.tangent_mesh`). The map from
tangents to displacements in the UV map is linear: w becomes a w + b conj(w).

The angles of the field are compared from texel to texel, relative to frames. For this, frames must rotate as
little from texel to texel as the surface allows. The frame of a triangle is the tangent that points along u
after the rotation of the UV map, without its stretch (polar decomposition). It is averaged at the corners and
interpolated like the field. Each average is over the triangles around a vertex that are in the same chart and
not separated by sharp edges (a smooth fan).
"""

from dataclasses import dataclass

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.blocks import bincount_rows
from ..field.connectivity import connected_components
from ..field.frames import dot, transport
from ..field.representation import unit_complex
from ..field.surface import Surface
from ..line_drawing.tangent_mesh import SharedEdges, TangentMesh, shared_edges

#: Two corners are at the same point of a UV map if their coordinates differ by at most this much.
SAME_UV = 1e-6

#: Largest coordinate in a UV map. For larger ones, rounding errors exceed single texels.
MAX_COORDINATE = 1000.0

#: Label of the progress.
LABEL = "reading the UV map"


@dataclass(frozen=True, eq=False)
class UvCharts:
    """T triangles of a surface in a UV map. Lengths in the map are in sides of its unit square.

    Attributes
    ----------
    uv : (T, 3) complex128 ndarray
        Positions of the corners in the UV map, u + i v.
    linear, conjugate : (T,) complex128 ndarray
        Coefficients a and b of the map from tangents w, in Blender units, to the UV map: a w + b conj(w).
    gradient : (T, 3) complex128 ndarray
        Gradients of the barycentric coordinates in the UV map; 0 for triangles without area there.
    chart : (T,) int32 ndarray
        Number of the chart to which each triangle belongs.
    frame : (T, 3) complex128 ndarray
        Unit tangents at the corners, as complex numbers in the frame of the triangle. Angles at texels are
        measured from them.
    """

    uv: np.ndarray
    linear: np.ndarray
    conjugate: np.ndarray
    gradient: np.ndarray
    chart: np.ndarray
    frame: np.ndarray

    @property
    def density(self) -> np.ndarray:
        """(T,) float64: area in the UV map of one square Blender unit; negative for mirrored triangles."""
        return np.abs(self.linear) ** 2 - np.abs(self.conjugate) ** 2

    def to_uv(self, triangle: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Map (n,) complex tangents, each in the triangle `triangle[i]`, to displacements in the UV map."""
        return self.linear[triangle] * tangent + self.conjugate[triangle] * tangent.conj()

    def to_surface(self, triangle: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Map (n,) complex displacements in the UV map to tangents, each in the triangle `triangle[i]`.

        The result is 0 for triangles without area in the UV map.
        """
        linear, conjugate = self.inverse(triangle)
        return linear * displacement + conjugate * displacement.conj()

    def inverse(self, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients a and b, each (n,), of the map from the UV map to tangents of triangles.

        A displacement d in the UV map is the tangent a d + b conj(d). `triangle` holds (n,) indices of
        triangles.

        Both coefficients are 0 for triangles without area in the UV map.
        """
        linear, conjugate = self.linear[triangle], self.conjugate[triangle]
        density = np.abs(linear) ** 2 - np.abs(conjugate) ** 2
        scale = np.divide(1, density, out=np.zeros(len(density)), where=density != 0)
        return linear.conj() * scale, -conjugate * scale

    def stretch(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the largest and the smallest length in the UV map of tangents of one Blender unit.

        Both are (T,) float64.
        """
        linear, conjugate = np.abs(self.linear), np.abs(self.conjugate)
        return linear + conjugate, np.abs(linear - conjugate)


def uv_charts(surface: Surface, mesh: TangentMesh, uv: np.ndarray) -> UvCharts:
    """Find the charts of a UV map.

    Parameters
    ----------
    surface : Surface
    mesh : TangentMesh
        Tangent mesh of the surface. Charts also end at edges where its streamlines stop.
    uv : (C, 2) ndarray
        Coordinates u and v at the face corners of the surface.

    Returns
    -------
    UvCharts

    Raises
    ------
    RosyError
        If a coordinate is not finite or too large, or no triangle has an area in the UV map.
    """
    report(0.0, LABEL)
    corner_uv = _checked(surface, uv)[surface.triangles]
    linear = 0.5 * (corner_uv * mesh.gradient.conj()).sum(axis=1)
    conjugate = 0.5 * (corner_uv * mesh.gradient).sum(axis=1)
    gradient = _gradients(corner_uv)
    if not gradient.any():
        raise RosyError(f"{surface.name}: no face has an area in the UV map: unwrap the mesh")
    report(0.2, LABEL)
    edges = _chart_edges(mesh, corner_uv)
    with progress(0.2, 0.4):
        chart = connected_components(len(corner_uv), np.stack(edges[:2], axis=1))
    # The rotation of the polar decomposition turns this tangent to the u axis.
    mirrored = np.abs(conjugate) > np.abs(linear)
    direction = unit_complex(np.where(mirrored, conjugate, linear.conj()))
    with progress(0.4, 1.0):
        frame = _averaged_at_corners(surface, mesh, direction, edges)
    return UvCharts(corner_uv, linear, conjugate, gradient, chart, frame)


def _checked(surface: Surface, uv: np.ndarray) -> np.ndarray:
    """Return (C,) complex128: u + i v. Raise RosyError if a coordinate is not finite or too large."""
    uv = np.asarray(uv, dtype=np.float64)
    wrong = np.flatnonzero(~(np.abs(uv) <= MAX_COORDINATE).all(axis=1))
    if len(wrong):
        face = int(surface.corner_face[wrong[0]])
        raise RosyError(
            f"{surface.name}: face {face} has a UV coordinate that is not finite or above "
            f"{MAX_COORDINATE:g}: unwrap the mesh"
        )
    return uv[:, 0] + 1j * uv[:, 1]


def _gradients(corner_uv: np.ndarray) -> np.ndarray:
    """Return (T, 3) complex gradients of the barycentric coordinates in the UV map.

    They are 0 for triangles without area in the UV map.
    """
    # Edges opposite to the corners. A gradient is perpendicular to its edge.
    edge = corner_uv[:, [2, 0, 1]] - corner_uv[:, [1, 2, 0]]
    double_area = (edge[:, 0].conj() * edge[:, 1]).imag[:, None]
    return np.divide(1j * edge, double_area, out=np.zeros_like(edge), where=double_area != 0)


def _chart_edges(mesh: TangentMesh, corner_uv: np.ndarray) -> SharedEdges:
    """Return the edges that two triangles share both on the surface and in the UV map.

    `corner_uv`, (T, 3) complex128, holds the positions of the corners in the UV map.
    """
    edges = shared_edges(mesh)
    same = np.ones(len(edges.triangle), dtype=bool)
    for corners in edges.ends():
        own, other = corner_uv.ravel()[corners.T]
        same &= np.abs(own - other) <= SAME_UV
    return SharedEdges(*(column[same] for column in edges))


def uv_tangents(surface: Surface, mesh: TangentMesh, charts: UvCharts) -> np.ndarray:
    """Return unit tangents in the direction of u, averaged at the corners over each smooth fan.

    Renderers compute the same tangents for normal maps.

    Returns
    -------
    (T, 3) complex128 ndarray
        Tangents in the frames of the triangles.
    """
    triangle = np.arange(len(charts.linear))
    direction = unit_complex(charts.to_surface(triangle, np.ones(len(triangle))))
    return _averaged_at_corners(surface, mesh, direction, _chart_edges(mesh, charts.uv))


def _averaged_at_corners(
    surface: Surface, mesh: TangentMesh, direction: np.ndarray, edges: SharedEdges
) -> np.ndarray:
    """Average directions of triangles at their corners, over each smooth fan of a chart.

    Parameters
    ----------
    surface : Surface
    mesh : TangentMesh
    direction : (T,) complex128 ndarray
        Unit tangent of each triangle.
    edges : SharedEdges
        Edges inside charts, from `_chart_edges`.

    Returns
    -------
    (T, 3) complex128 ndarray
        Unit tangents at the corners, in the frames of the triangles.
    """
    fan = surface.corner_fan[surface.triangles].ravel()
    pairs = np.concatenate(edges.ends())
    pairs = pairs[fan[pairs[:, 0]] == fan[pairs[:, 1]]]
    with progress(0.0, 0.6, LABEL):
        group = connected_components(len(fan), pairs)
    report(0.6, LABEL)
    vector = mesh.to_world(np.arange(len(direction)), direction) * mesh.area[:, None]
    total = bincount_rows(group, np.repeat(vector, 3, axis=0))
    frame = np.empty((len(direction), 3), dtype=np.complex128)
    for corner in range(3):
        report(0.7 + 0.1 * corner, LABEL)
        tangent, normal = total[group[corner::3]], mesh.corner_normal[:, corner]
        tangent = tangent - dot(tangent, normal)[:, None] * normal
        tangent = transport(tangent, normal, mesh.normal)
        frame[:, corner] = unit_complex(dot(tangent, mesh.x) + 1j * dot(tangent, mesh.y))
    missing = frame == 0
    frame[missing] = np.repeat(direction, 3)[missing.ravel()]
    return frame
