"""Generate fields that follow the form of a surface, as an illustrator's hatching does.

The field follows salient edges, and it follows principal directions where they are clear. They are clear
where the two principal curvatures differ by more than the noise of the mesh could cause. Elsewhere the
field is smooth.
"""

from functools import partial

import numpy as np

from ..core.progress import progress, report
from .conjugate_gradient import conjugate_gradient
from .connection import laplacian
from .creases import weighted_median
from .curvature import outer_sides
from .edge_guides import coherent_edge_guides
from .feature_curvature import NoisyCurvature, noisy_curvature, of_unit_extent
from .frames import dot, transport
from .guided_system import GuidedSystem, guided_field
from .representation import from_representation, unit_complex
from .rosy_field import RosyField, check_degree
from .smoothest import smoothest_field
from .surface import Surface
from .surface_averages import AVERAGE_TOLERANCE
from .unfolding import unfolded

#: Distances over which curvature may be averaged, relative to `principal_extent`.
SCALES = (0.01, 0.02, 0.04, 0.08)

#: The smallest of these distances is used at which noise rotates half of the directions by less than this
#: angle, in radians. The rotation is measured by adding random noise, as strong as the noise of the mesh.
MAX_TURN = np.radians(6)

#: Ratio of curvature to the curvature of noise at which the confidence in a direction is 1/2.
CLEAR_RATIO = 3.0

#: Confidence below which directions are ignored, as on spheres.
MIN_CONFIDENCE = 0.05

#: Curvature below which a surface counts as flat, relative to the inverse of `principal_extent`.
FLAT_CURVATURE = 0.05

#: Distance over which the influence of directions with confidence 1 falls off, relative to `principal_extent`.
REACH = 0.04

#: Distance over which salient edges decide against principal directions that contradict them, relative to
#: `principal_extent`. Where three cylinders intersect, the field has 8 singularities with values from 0.2 to 1, for
#: all meshes that were tried, and up to 100 with 0.05.
EDGE_REACH = 0.2

#: Relative norm of the residual at which the solver for the field stops. With 1e-4, the numbering of a mesh changes
#: directions near singularities by up to 0.5 degrees, with 1e-6 by 0.005, in 3 % more time.
FIELD_TOLERANCE = 1e-6


def form(surface: Surface, degree: int) -> RosyField:
    """Generate a field that follows the form of a surface.

    Fields of degree 2 and of multiples of 4 follow principal directions. For other degrees, which cannot
    follow them, the result is the smoothest field.

    Parameters
    ----------
    surface : Surface
    degree : int
        N.

    Returns
    -------
    RosyField
        A field of magnitude 1; zero on faces without area.

    Raises
    ------
    RosyError
        If no face has an area, or the degree is out of range.

    References
    ----------
    Averaging curvature makes it robust, as in Cohen-Steiner and Morvan, "Restricted Delaunay
    Triangulations and Normal Cycle", SoCG 2003. Choosing the scale by adding noise is a parametric
    bootstrap (Efron and Tibshirani, "An Introduction to the Bootstrap", 1993).
    """
    degree = check_degree(degree)
    # Degree 2 follows one principal direction, and multiples of 4 follow both of them equally.
    follows_curvature = degree == 2 or degree % 4 == 0
    if not follows_curvature or not surface.face_normal.any():
        return smoothest_field(surface, degree)
    original, flat = surface, unfolded(surface)
    surface = of_unit_extent(flat)
    with progress(0.0, 0.2):
        measured = noisy_curvature(surface)
    with progress(0.2, 0.5):
        guides, confidence = _curvature_guides(measured, degree)
    report(0.5, "finding guides")
    edge_guides = coherent_edge_guides(surface, measured.salient_ends, degree)
    at_edge = edge_guides.any(axis=1)
    if at_edge.any():
        with progress(0.5, 0.55):
            confidence *= _agreement(measured, degree, guides, edge_guides)
    guides = np.where(at_edge[:, None], edge_guides, guides)
    weight = np.where(at_edge, 0.0, (confidence / REACH) ** 2)
    if not guides.any():
        with progress(0.55, 1.0):
            return smoothest_field(original, degree)
    with progress(0.55, 1.0):
        field = guided_field(surface, degree, guides, weight, at_edge, FIELD_TOLERANCE)
    if flat is original:
        return field
    # Transport the vectors to the planes of the original faces, which may have the opposite orientation.
    source, target = surface.face_normal, original.face_normal
    side = np.copysign(1.0, dot(source, target))
    vectors = transport(field.vectors, source, side[:, None] * target)
    return RosyField(degree, vectors * target.any(axis=1)[:, None])


def _curvature_guides(measured: NoisyCurvature, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Compute principal directions on the faces, and the confidence in them.

    Returns
    -------
    guides : (F, 3) float64 ndarray
        Unit vectors along principal directions; zero where there is none.
    confidence : (F,) float64 ndarray
        Confidence in each guide, from 0 to 1.
    """
    averages = measured.averages
    matrix, flat_matrix = averages.laplacian(2), averages.laplacian(0)
    deviators = [averages.node_sums(d, 2) for d in (measured.deviator, measured.deviator_noise)]
    z = z_noise = None
    for index, scale in enumerate(SCALES):
        report(index / len(SCALES), "averaging curvature")
        area = scale**2
        z = averages.smooth(matrix, area, deviators[0], z)
        z_noise = averages.smooth(matrix, area, deviators[1], z_noise)
        # The phase of a deviator is twice the angle of the principal direction. The pair of both principal
        # directions has a symmetry of four, so the phase is doubled again, and divided by 4 to get the angle.
        turn = np.abs(np.angle(((z + z_noise) * z.conj()) ** 2)) / 4
        modulus = np.abs(z)
        clear = averages.connection.positive_mass * modulus / (modulus + 1)
        if weighted_median(turn, clear) <= MAX_TURN:
            break
    mean = averages.smooth(flat_matrix, area, averages.node_sums(measured.mean, 0))
    power = averages.connection.positive_mass * np.abs(z_noise) ** 2
    power = averages.smooth(flat_matrix, 4 * area, power)
    power = np.maximum(power, 0.0) * CLEAR_RATIO**2
    modulus = np.abs(z)
    curvature = np.maximum(np.abs(mean), modulus) + FLAT_CURVATURE
    signal = modulus**2
    confidence = modulus / curvature * (signal / np.maximum(signal + power, 1e-300))
    confidence = np.clip((confidence - MIN_CONFIDENCE) / (1 - MIN_CONFIDENCE), 0.0, 1.0)
    face_z = averages.face_means(confidence * unit_complex(z), 2)
    if degree % 4:
        face_z *= outer_sides(averages.surface, measured.mean)
    z = unit_complex(face_z) ** (degree // 2)
    return from_representation(z, averages.x, averages.y, degree), np.abs(face_z)


def _agreement(
    measured: NoisyCurvature, degree: int, guides: np.ndarray, edge_guides: np.ndarray
) -> np.ndarray:
    """Return (F,) float64: how well guides agree with salient edges near them, from 0 (to be ignored) to 1.

    The direction of the edges is continued smoothly over the surface, with a modulus that falls off over the
    distance `EDGE_REACH`. Guides near an edge that contradict this direction are ignored. Otherwise the field would
    have to rotate between the edge and the guides. If a guide is halfway between two members, it is arbitrary whether
    the field rotates to the left or to the right.

    Parameters
    ----------
    measured : NoisyCurvature
    degree : int
        N.
    guides, edge_guides : (F, 3) float64 ndarray
        Guides along principal directions, and along salient edges.
    """
    averages = measured.averages
    matrix = laplacian(averages.connection, degree, EDGE_REACH**-2)
    system = GuidedSystem(averages.surface, degree, averages, matrix)
    at_edge = system.to_representation(edge_guides)
    nodes = system.node_guides(at_edge, np.zeros(len(at_edge)), at_edge != 0)
    scale, label = partial(np.multiply, 1 / matrix.diagonal), "continuing salient edges"
    fixed = nodes.fixed, nodes.is_fixed
    z = conjugate_gradient(matrix, nodes.rhs, AVERAGE_TOLERANCE, scale, label, *fixed)
    edge = averages.face_means(z, degree)
    cosine = (system.to_representation(guides) * edge.conj()).real
    return np.clip(1 - np.abs(edge) + cosine, 0, 1)
