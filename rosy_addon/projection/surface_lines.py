"""Evenly spaced lines on the surface of a mesh instance, independent of the camera.

The phase of the lines (`field.stripe_pattern`) is computed on the rest shape, so lines move and
stretch with the surface. It is evaluated at the visible pixels.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..core.cache import Cache, cached
from ..core.memory import check_memory
from ..core.progress import progress, report
from ..field.bisection import BisectionTree, bisect
from ..field.curvature import with_smooth_normals
from ..field.directional_field import evaluate_harmonics, field_symmetry
from ..field.frames import tangent_frame_components, transform_components
from ..field.representation import signed_power, unit_complex
from ..field.rosy_field import RosyField
from ..field.stripe_pattern import CornerDirections, StripePattern, stripe_pattern
from ..field.surface import Surface
from .corner_field import CornerField, field_at_corners, transport_phase
from .face_values import SIMILARITY_EPS, similarity_scale
from .field_channel import deviations
from .gbuffer import MeshInstance
from .rest_coordinates import matrix_scale
from .vector_components import frame_coordinates

#: Longest edge of the triangles on which the phase is computed, in distances between lines.
MAX_EDGE = 1.4

#: Largest number of triangles on which the phase is computed by default. Beyond it, lines end and begin
#: in fewer places.
MAX_TRIANGLES = 600_000

#: Bytes of memory for a triangle while phases are computed, and for each family of parallel lines on it.
TRIANGLE_BYTES, FAMILY_BYTES = 210, 610


@dataclass(frozen=True, eq=False)
class SurfaceLines:
    """Evenly spaced lines on the T triangles of a surface.

    Attributes
    ----------
    tree : BisectionTree
        The triangles of the surface, and their L leaves: the smaller triangles on which the phase is
        linear.
    pattern : StripePattern
        Phases on the L leaves.
    heading : (2, L) float32 ndarray
        The member of the field in each leaf that belongs to family 0 of `pattern`: a unit vector in the shape
        on which distances are measured (see `surface_lines`). The other families follow counter-clockwise.
        The two components are coefficients of two sides of the surface's triangle: corner 0 to 1, and corner
        0 to 2. 0 where the field is undefined.
    """

    tree: BisectionTree
    pattern: StripePattern
    heading: np.ndarray


def rest_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the (3, 3) stretch of a matrix: the symmetric factor of the polar decomposition.

    The upper left (3, 3) block of a matrix is a rotation or reflection times the stretch, which scales along
    three orthogonal axes. It is a uniform scale if the matrix is a similarity. An object that is rotated
    keeps its lines, as a rotation does not change the stretch.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    if similarity_scale(linear, 4 * SIMILARITY_EPS) is not None:
        return np.eye(3) * matrix_scale(matrix)
    values, axes = np.linalg.eigh(linear.T @ linear)
    return (axes * np.sqrt(np.maximum(values, 0))) @ axes.T


def cached_surface_lines(
    instance: MeshInstance,
    display: str,
    spacing: float,
    cache: Cache | None = None,
    max_triangles: int = MAX_TRIANGLES,
) -> SurfaceLines:
    """Return the result of `surface_lines`, and store it in a cache if one is given.

    Lines are shared by all cameras, and by instances of equal size. `spacing` is the distance between
    neighboring lines in world space, if the mesh is not deformed.
    """
    surface, field = instance.surface, instance.field
    stretch, scale = rest_matrix(instance.matrix), matrix_scale(instance.matrix)
    # Rounded, as rotated matrices have rounding errors.
    spacing = float(f"{spacing / scale:.5g}")
    stretch = np.round(stretch / scale, 5)
    create = partial(surface_lines, surface, stretch, field, display, spacing, max_triangles)
    # Deformations do not change what the lines depend on.
    normals = surface.corner_normal if surface.rest_vertices is None else None
    field_parts = field.degree, field.vectors, field.direction_ratios
    content = surface.rest_shape_key, surface.corner_fan, normals, *field_parts, stretch
    return cached(cache, create, "surface lines", *content, display, spacing, max_triangles)


def surface_lines(
    surface: Surface,
    stretch: np.ndarray,
    field: RosyField,
    display: str,
    spacing: float,
    max_triangles: int = MAX_TRIANGLES,
) -> SurfaceLines:
    """Compute evenly spaced lines along all directions of a field.

    Parameters
    ----------
    surface : Surface
    stretch : (3, 3) ndarray
        Linear map from the rest shape to the shape on which distances are measured.
    field : RosyField
    display : {"smooth", "flat"}
        Whether the field is interpolated between the faces, or constant on each face.
    spacing : float
        Distance between neighboring lines after `stretch`, in Blender units.
    max_triangles : int
        Largest number of triangles on which the phase is computed, unless the mesh has more.

    Returns
    -------
    SurfaceLines

    Raises
    ------
    RosyError
        If there is not enough memory.
    """
    label = "spacing lines"
    report(0.0, label)
    rest = surface
    if surface.rest_vertices is not None:
        with progress(0.0, 0.05, label):
            rest = with_smooth_normals(surface.in_rest_shape(), surface.corner_fan)
    with progress(0.05, 0.1, label):
        corner_field = field_at_corners(rest, stretch, field, display)
    points = transform_components(np.ascontiguousarray(rest.vertices.T), stretch).T
    max_triangles = max(max_triangles, len(rest.triangles))
    report(0.1, label)
    tree = bisect(points, rest.triangle_vertex, MAX_EDGE * spacing, max_triangles)
    count = len(tree.leaf_root)
    needed = count * (TRIANGLE_BYTES + FAMILY_BYTES * field_symmetry(field).line_count)
    subject = f"{surface.name}: the spacing of lines on {count} triangles"
    check_memory(needed, subject, "choose wider lines or streaks instead of even lines")
    report(0.2, label)
    corners = points.take(rest.triangle_vertex, axis=0)
    directions, heading = _leaf_directions(tree, corners, corner_field, field)
    with progress(0.25, 1.0, label):
        pattern = stripe_pattern(tree.leaf_vertex, directions, spacing)
    return SurfaceLines(tree, pattern, heading)


def _leaf_directions(
    tree: BisectionTree, corners: np.ndarray, corner_field: CornerField, field: RosyField
) -> tuple[CornerDirections, np.ndarray]:
    """Interpolate a field to the corners of the leaves of a tree.

    `corners` are the (T, 3, 3) positions of the corners of the surface's triangles in the rest shape, after
    `stretch` of `surface_lines`. `corner_field` is the field at these corners.

    Returns
    -------
    directions : CornerDirections
        Directions of the field at the corners of the leaves, in the planes of the surface's triangles.
    heading : (2, L) float32 ndarray
        `SurfaceLines.heading`.
    """
    frame = tangent_frame_components(corner_field.geometric_normal)
    sides = (corners - corners[:, :1]).transpose(1, 2, 0)
    offset = np.stack([frame_coordinates(side, frame) for side in sides], axis=1)
    to_plane = _rotations_to_planes(corner_field)
    weights = tree.leaf_weights.astype(np.float64)

    def at_leaves(values: np.ndarray, order: int) -> np.ndarray:
        """Interpolate (3, T) values at the corners of triangles to the (L, 3) corners of the leaves.

        The values rotate with the frame by the power `order`.
        """
        pairs = zip(values, to_plane, strict=True)
        in_plane = np.stack([z * signed_power(phase, order) for z, phase in pairs], axis=1)
        return np.einsum("lcr,lr->lc", weights, in_plane.take(tree.leaf_root, axis=0))

    degree = field.degree
    z = at_leaves(corner_field.representation, degree)
    symmetry = field_symmetry(field)
    mean = z.sum(axis=1)
    mean_angle = np.angle(mean) / degree
    angle = mean_angle[:, None] + np.angle(z * mean.conj()[:, None]) / degree
    harmonics = [(j, at_leaves(values, -j)) for j, values in deviations(corner_field.channels)]
    deviation = _deviations(harmonics, angle, degree) if symmetry.harmonic_orders else None
    leaf_offset = np.einsum("lcr,lr->lc", weights, offset.take(tree.leaf_root, axis=0))
    root_area = (offset[:, 1].conj() * offset[:, 2]).imag
    defined = corner_field.representation.any(axis=0) & (root_area > 0)
    directions = CornerDirections(
        degree, symmetry.line_count, leaf_offset, angle, deviation, defined[tree.leaf_root]
    )
    unit = np.exp(1j * mean_angle)
    first, second = (offset[:, corner].take(tree.leaf_root) for corner in (1, 2))
    area = np.where(root_area > 0, root_area, np.inf)[tree.leaf_root]
    heading = np.stack([(unit.conj() * second).imag, (first.conj() * unit).imag]) / area
    heading *= directions.defined
    return directions, heading.astype(np.float32)


def _rotations_to_planes(corner_field: CornerField) -> list[np.ndarray]:
    """Return 3 (T,) complex128 rotations of directions, from corners of triangles to the flat triangles.

    `corner_field` has the values of all corners in the frame of corner 0. Rotation k turns a direction from
    there back into the frame of corner k, and then into the frame of the plane of the triangle.
    """
    plane_frame = tangent_frame_components(corner_field.geometric_normal)
    first_normal = corner_field.corner_normals[0]
    first_frame = tangent_frame_components(first_normal)
    rotations = []
    for corner, normal in enumerate(corner_field.corner_normals):
        phase = transport_phase(normal, corner_field.geometric_normal, *plane_frame)
        phase = phase.astype(np.complex128)
        if corner:
            phase *= transport_phase(normal, first_normal, *first_frame).conj()
        rotations.append(phase)
    return rotations


def _deviations(
    harmonics: list[tuple[int, np.ndarray]], angle: np.ndarray, degree: int
) -> np.ndarray:
    """Return the (L, 3, N) rotations, as unit complex numbers, from members of a RoSy to the directions.

    `harmonics` holds pairs of an order j and the (L, 3) harmonics C_j (see `evaluate_harmonics`). `angle`,
    (L, 3), is the angle of one member of the RoSy at the corners of the leaves; the N members are evenly
    spaced.
    """
    members = np.exp(1j * (angle[..., None] + 2 * np.pi * np.arange(degree) / degree))
    result = np.empty_like(members)
    for direction in range(degree):
        ratio = evaluate_harmonics(harmonics, members[..., direction])
        result[..., direction] = unit_complex(ratio, otherwise=1)
    return result
