"""`UvCharts`: the triangles of a tangent mesh in a UV map, and frames that turn little in it.

A chart is a part of the surface whose triangles are connected in the UV map. Tangents of the surface
are complex numbers in the frame of their triangle (see `line_drawing.tangent_mesh`). The map from
them to displacements in the UV map is linear: w becomes a w + b conj(w).

The angles of the field are compared from texel to texel, so they need frames that turn no more than
the surface requires. Such a frame is the direction that the UV map rotates to its u axis, averaged at
the corners over each smooth fan and interpolated like the field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress, report
from ..field.connectivity import connected_components
from ..field.frames import dot, transport
from ..field.surface import Surface
from ..line_drawing.tangent_mesh import SharedEdges, TangentMesh, shared_edges

#: Corners are at the same point of a UV map if their coordinates differ by at most this much.
SAME_UV = 1e-6

#: Largest coordinate in a UV map. Beyond it, single texels can no longer be told apart.
MAX_COORDINATE = 1000.0

#: Label of the progress.
LABEL = "reading the UV map"


@dataclass(frozen=True, eq=False)
class UvCharts:
    """T triangles in a UV map. Lengths are in the side of the map.

    Attributes
    ----------
    uv : (T, 3) complex128 ndarray
        u + i v of the corners.
    linear, conjugate : (T,) complex128 ndarray
        The map from tangents, in Blender units, to the UV map; see above.
    gradient : (T, 3) complex128 ndarray
        Gradients of the barycentric coordinates in the UV map; 0 for triangles without area there.
    chart : (T,) int32 ndarray
        Number of the chart.
    frame : (T, 3) complex128 ndarray
        Unit tangents at the corners, in the frame of the triangle.
    """

    uv: np.ndarray
    linear: np.ndarray
    conjugate: np.ndarray
    gradient: np.ndarray
    chart: np.ndarray
    frame: np.ndarray

    @property
    def density(self) -> np.ndarray:
        """(T,) area in the UV map of a square Blender unit; negative for mirrored triangles."""
        return np.abs(self.linear) ** 2 - np.abs(self.conjugate) ** 2

    def to_uv(self, triangle: np.ndarray, tangent: np.ndarray) -> np.ndarray:
        """Map (n,) complex tangents to the UV map."""
        return self.linear[triangle] * tangent + self.conjugate[triangle] * tangent.conj()

    def to_surface(self, triangle: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Map (n,) complex displacements in the UV map to tangents; 0 if there is no area."""
        linear, conjugate = self.inverse(triangle)
        return linear * displacement + conjugate * displacement.conj()

    def inverse(self, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (n,) a and b of the map from the UV map to tangents; 0 if there is no area."""
        linear, conjugate = self.linear[triangle], self.conjugate[triangle]
        density = np.abs(linear) ** 2 - np.abs(conjugate) ** 2
        scale = np.divide(1, density, out=np.zeros(len(density)), where=density != 0)
        return linear.conj() * scale, -conjugate * scale

    def stretch(self) -> tuple[np.ndarray, np.ndarray]:
        """(T,) largest and smallest length in the UV map of a Blender unit."""
        linear, conjugate = np.abs(self.linear), np.abs(self.conjugate)
        return linear + conjugate, np.abs(linear - conjugate)


def uv_charts(surface: Surface, mesh: TangentMesh, uv: np.ndarray) -> UvCharts:
    """Find the charts of a UV map.

    Parameters
    ----------
    surface : Surface
    mesh : TangentMesh
        Of the surface. Charts end where its streamlines stop.
    uv : (C, 2) ndarray
        u and v at the corners of the surface.

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
    direction = _unit(np.where(mirrored, conjugate, linear.conj()))
    with progress(0.4, 1.0):
        frame = _averaged_at_corners(surface, mesh, direction, edges)
    return UvCharts(corner_uv, linear, conjugate, gradient, chart, frame)


def _checked(surface: Surface, uv: np.ndarray) -> np.ndarray:
    """Return (C,) complex128 coordinates."""
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
    """(T, 3) complex gradients of the barycentric coordinates; 0 for triangles without area."""
    # Edges opposite to the corners. A gradient is perpendicular to its edge.
    edge = corner_uv[:, [2, 0, 1]] - corner_uv[:, [1, 2, 0]]
    double_area = (edge[:, 0].conj() * edge[:, 1]).imag[:, None]
    return np.divide(1j * edge, double_area, out=np.zeros_like(edge), where=double_area != 0)


def _chart_edges(mesh: TangentMesh, corner_uv: np.ndarray) -> SharedEdges:
    """Find the edges that two triangles share on the surface and in the UV map."""
    edges = shared_edges(mesh)
    same = np.ones(len(edges.triangle), dtype=bool)
    for corners in edges.ends():
        own, other = corner_uv.ravel()[corners.T]
        same &= np.abs(own - other) <= SAME_UV
    return SharedEdges(*(column[same] for column in edges))


def uv_tangents(surface: Surface, mesh: TangentMesh, charts: UvCharts) -> np.ndarray:
    """Compute unit tangents in the direction of u, averaged at the corners over each smooth fan.

    As renderers do for normal maps.

    Returns
    -------
    (T, 3) complex128 ndarray
        In the frame of the triangle.
    """
    triangle = np.arange(len(charts.linear))
    direction = _unit(charts.to_surface(triangle, np.ones(len(triangle))))
    edges = _chart_edges(mesh, charts.uv)
    return _averaged_at_corners(surface, mesh, direction, edges)


def _averaged_at_corners(
    surface: Surface, mesh: TangentMesh, direction: np.ndarray, edges: SharedEdges
) -> np.ndarray:
    """Average directions at the corners of triangles over each smooth fan of a chart.

    Parameters
    ----------
    direction : (T,) complex128 ndarray
        Unit tangents.
    edges : SharedEdges
        From `_chart_edges`.

    Returns
    -------
    (T, 3) complex128 ndarray
        Unit tangents.
    """
    fan = surface.corner_fan[surface.triangles].ravel()
    pairs = np.concatenate(edges.ends())
    pairs = pairs[fan[pairs[:, 0]] == fan[pairs[:, 1]]]
    with progress(0.0, 0.6, LABEL):
        group = connected_components(len(fan), pairs)
    report(0.6, LABEL)
    vector = mesh.to_world(np.arange(len(direction)), direction) * mesh.area[:, None]
    total = np.stack(
        [np.bincount(group, np.repeat(component, 3)) for component in vector.T], axis=1
    )
    frame = np.empty((len(direction), 3), dtype=np.complex128)
    for corner in range(3):
        report(0.7 + 0.1 * corner, LABEL)
        tangent, normal = total[group[corner::3]], mesh.corner_normal[:, corner]
        tangent = tangent - dot(tangent, normal)[:, None] * normal
        tangent = transport(tangent, normal, mesh.normal)
        frame[:, corner] = _unit(dot(tangent, mesh.x) + 1j * dot(tangent, mesh.y))
    missing = frame == 0
    frame[missing] = np.repeat(direction, 3)[missing.ravel()]
    return frame


def _unit(values: np.ndarray) -> np.ndarray:
    """Scale complex numbers to the modulus 1; 0 and tiny numbers become 0."""
    norm = np.abs(values)
    return np.divide(values, norm, out=np.zeros_like(values), where=norm > 1e-300)
