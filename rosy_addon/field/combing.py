"""A field that follows its guides while a brush changes them.

The field is at all times a solution of the system of its guides: near the brush at once, and everywhere
after `Combing.settle`.
"""

from __future__ import annotations

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress
from .conjugate_gradient import RELATIVE_TOLERANCE
from .guided_system import (
    EXACT_FIRMNESS,
    GuidedSystem,
    NodeGuides,
    firmness_weights,
    unit_representations,
)
from .representation import unit_complex
from .rosy_field import RosyField

#: Nodes around changed guides that are solved at once, and the iterations of the solver.
NEAR_NODES, NEAR_ITERATIONS = 3000, 30

#: Least reach in lengths of edges: the guides that keep the rest of the field stay weak.
MIN_REACH_EDGES = 2.0


class Combing:
    """A field and the guides that it follows; made by `start_combing`.

    Attributes
    ----------
    system : GuidedSystem
    guides : (F,) complex128 ndarray
        Representations of the guides, whose moduli are their firmness. Call `follow` after a change.
    magnitude : (F,) float64 ndarray
        Magnitude of the field.
    """

    def __init__(
        self, system: GuidedSystem, guides: np.ndarray, start: np.ndarray, magnitude: np.ndarray
    ) -> None:
        self.system = system
        self.guides = guides
        self.magnitude = magnitude
        self._node_guides: NodeGuides | None = None
        self._z = start
        self._face_z = unit_representations(system.averages.face_sums(start, system.degree))

    @property
    def vectors(self) -> np.ndarray:
        """(F, 3) float64: the field."""
        return self.system.to_vectors(self.magnitude * self._face_z)

    @property
    def guide_vectors(self) -> np.ndarray:
        """(F, 3) float64: member vectors of the guides, whose lengths are their firmness."""
        return self.system.to_vectors(self.guides)

    @property
    def representations(self) -> tuple[np.ndarray, np.ndarray]:
        """(n,) complex128 at the nodes and (F,) complex128 on the faces: the state that is solved for."""
        return self._z, self._face_z

    @representations.setter
    def representations(self, representations: tuple[np.ndarray, np.ndarray]) -> None:
        self._z, self._face_z = representations

    def follow(self, face: np.ndarray) -> None:
        """Let the field follow changed guides on (m,) faces, near them."""
        if not len(face):
            return
        node = self.system.nodes_of_faces(face)
        self._update_node_guides(node)
        near = self.system.nodes_near(node, NEAR_NODES)
        self._z[near] = self.system.solve_near(self._node_guides, self._z, near, NEAR_ITERATIONS)
        corner = self.system.corners_of_nodes(near)
        changed = np.unique(self.system.surface.triangle_face[corner // 3])
        self._set_face_z(self.system.face_representations_at(self._z, changed), changed)

    def settle(self, tolerance: float = RELATIVE_TOLERANCE) -> tuple[np.ndarray, np.ndarray]:
        """Solve the whole system, and return `representations`. Without any guide, the field stays."""
        if not self.guides.any():
            return self.representations
        self._node_guides = self._guides_at_nodes()
        with progress(0.1, 0.95):
            self._z = self.system.solve(self._node_guides, self._z, tolerance)
        face_z = self.system.averages.face_sums(self._z, self.system.degree)
        self._set_face_z(face_z, np.arange(len(self.guides)))
        return self.representations

    def _update_node_guides(self, node: np.ndarray) -> None:
        """Bring the guides at nodes up to date."""
        if self._node_guides is None:
            self._node_guides = self._guides_at_nodes()
            return
        corner = self.system.corners_of_nodes(node)
        new = self._guides_at_nodes(corner)
        for name, values in vars(new).items():
            getattr(self._node_guides, name)[node] = values[node]

    def _guides_at_nodes(self, corner: np.ndarray | slice = slice(None)) -> NodeGuides:
        firmness = np.abs(self.guides)
        weight, is_exact = firmness_weights(firmness, self.system.surface.mean_edge_length)
        return self.system.node_guides(unit_complex(self.guides), weight, is_exact, corner)

    def _set_face_z(self, z: np.ndarray, face: np.ndarray) -> None:
        """Set the field from its representations on (m,) faces."""
        z = unit_representations(z)
        guides = self.guides[face]
        is_exact = np.abs(guides) >= EXACT_FIRMNESS
        z[is_exact] = guides[is_exact] / np.abs(guides[is_exact])
        self._face_z[face] = z


def start_combing(
    system: GuidedSystem, field: RosyField, guide_vectors: np.ndarray, reach: float
) -> Combing:
    """Prepare a field for combing.

    Parameters
    ----------
    system : GuidedSystem
        The system of the surface, for the degree of the field.
    field : RosyField
        A RoSy.
    guide_vectors : (F, 3) ndarray
        Member vectors whose lengths are the firmness of guides. On faces without a guide, the field itself
        becomes a weak one, so that it stays what it is away from the strokes.
    reach : float
        Distance from the strokes at which a field that had no guides is what it was. Object space.

    Raises
    ------
    RosyError
        If the directions are not a RoSy, or the field is undefined everywhere.
    """
    surface = system.surface
    field.check_rosy(surface.name)
    z = system.to_representation(field.vectors)
    magnitude = np.abs(z)
    if not magnitude.any():
        raise RosyError(f"{surface.name}: its field is undefined everywhere: make a field first")
    unit_z = unit_complex(z)
    guides = system.to_representation(guide_vectors)
    guides /= np.maximum(np.abs(guides), 1)
    edges = max(reach / surface.mean_edge_length, MIN_REACH_EDGES)
    weak_guides = unit_z / (1 + edges**2)
    guides = np.where(guides == 0, weak_guides, guides)
    start = system.averages.node_sums(unit_z, system.degree) / system.averages.mass
    return Combing(system, guides, start, np.where(magnitude > 0, magnitude, 1.0))
