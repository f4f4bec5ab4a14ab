"""Smooth fields that follow given guide vectors."""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from ..memory import raise_mmap_threshold
from ..progress import progress, report
from .conjugate_gradient import RELATIVE_TOLERANCE
from .guided_system import guided_system
from .rosy_field import RosyField, check_degree
from .smoothest import smoothest_field
from .surface import Surface


def guided_field(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float,
    hard: np.ndarray | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> RosyField:
    """Compute the smooth field that follows guides.

    Parameters
    ----------
    surface : Surface
    degree : int
    guides : (F, 3) ndarray
        One member vector for each face, in object space; zero where there is no guide. Lengths
        matter: a guide of length 1/2 requests a field of magnitude 1/2.
    weight : (F,) ndarray or float
        Weight of the guide of each face, in units of 1 / area. The influence of a guide of weight w
        falls off over a distance of about 1 / sqrt(w).
    hard : (F,) bool ndarray, optional
        Faces on which the guide is followed exactly.
    tolerance : float
        Residual norm relative to that of the right-hand side at which the solver stops.

    Returns
    -------
    RosyField
        Of magnitude 1; zero on connected components without a guide and on faces without area.

    Raises
    ------
    RosyError
        If no face with an area has a guide, or the degree is out of range.
    """
    degree = check_degree(degree)
    raise_mmap_threshold()
    system = guided_system(surface, degree)
    target = system.to_representation(np.asarray(guides, dtype=np.float64))
    if not target.any():
        raise RosyError(f"{surface.name}: all guides are zero, or on faces without area")
    weight = np.where(target != 0, np.broadcast_to(weight, target.shape), 0.0)
    is_hard = np.zeros(surface.face_count, dtype=bool) if hard is None else hard & (target != 0)
    node_guides = system.node_guides(target, weight, is_hard)
    with progress(0.12, 0.95):
        z = system.solve(node_guides, tolerance=tolerance)
    report(0.95, "averaging the field on the faces")
    face_z = unit_representations(system.averages.face_sums(z, degree))
    face_z[is_hard] = target[is_hard] / np.abs(target[is_hard])
    return RosyField(degree, system.to_vectors(face_z))


def unit_representations(z: np.ndarray) -> np.ndarray:
    """Divide (F,) representations by their moduli; 0 where the modulus is a rounding error."""
    modulus = np.abs(z)
    is_defined = modulus > 1e-9 * max(float(modulus.max()), 1e-300)
    return np.divide(z, modulus, out=np.zeros_like(z), where=is_defined)


def guided_or_smoothest(
    surface: Surface,
    degree: int,
    guides: np.ndarray,
    weight: np.ndarray | float | None = None,
    hard: np.ndarray | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> RosyField:
    """A guided field, with the smoothest field on connected components without a guide.

    Without `weight`, all guides are followed exactly. The parameters are those of `guided_field`.
    """
    if weight is None:
        weight, hard = 0.0, guides.any(axis=1)
    with progress(0.0, 0.8):
        field = guided_field(surface, degree, guides, weight, hard, tolerance)
    unguided = ~field.vectors.any(axis=1) & surface.face_normal.any(axis=1)
    if not unguided.any():
        return field
    with progress(0.8, 1.0):
        smoothest = smoothest_field(surface, degree)
    return RosyField(degree, np.where(unguided[:, None], smoothest.vectors, field.vectors))
