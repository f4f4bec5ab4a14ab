"""Combing: a brush that changes the guides of a field along strokes, and the field that follows these guides.

The guide of a face is the RoSy that the field should have there, stored as a representation (see
`representation`). Its modulus is the *firmness* of the guide: how strictly the field follows it, from 0 to
1 (see `guided_system.firmness_weights`). The field is the solution of a linear system. During a stroke, it
is solved near the brush only; `Combing.settle` solves it everywhere.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..core.errors import RosyError
from ..core.progress import progress
from .frames import dot, normalize
from .guided_system import GuidedSystem, NodeGuides, firmness_weights, unit_representations
from .representation import to_representation, unit_complex
from .rosy_field import RosyField

#: Distance between dabs (the samples at which a brush takes effect) along a stroke, relative to the radius of
#: the brush.
DAB_SPACING = 1 / 6

#: Smallest distance between dabs, relative to `Surface.extent`, and largest number of dabs between two points
#: of a stroke.
MIN_SPACING, MAX_DABS = 2.0**-12, 100_000

#: A face that a stroke reaches again is combed anew if the stroke was elsewhere for this arc length, relative
#: to the radius.
PASS_GAP = 2.0

#: Firmness of a combed guide that is not exact, where the brush has its full effect.
SOFT_FIRMNESS = 0.98

#: Guides with a smaller firmness than this are removed.
LEAST_FIRMNESS = 1e-6

#: A face is combed only if the unit direction of the stroke, projected to the face, has at least this length.
MIN_PROJECTION = 0.2

#: The effects of a brush, with the descriptions shown in the interface.
EFFECTS = {
    "comb": "Turn the field along the stroke",
    "erase": "Remove guides",
    "smooth": "Average guides with those around them",
}

#: Number of nodes around changed guides for which the field is solved during a stroke, and largest number of
#: iterations of the solver.
NEAR_NODES, NEAR_ITERATIONS = 3000, 30

#: Smallest `reach` of `start_combing`, in mean edge lengths. It keeps the guides that preserve the rest of
#: the field weak.
MIN_REACH_EDGES = 2.0


class Combing:
    """A field that is being combed, and the guides that it follows. `start_combing` makes one.

    Attributes
    ----------
    system : GuidedSystem
        The linear system for fields that follow guides.
    guides : (F,) complex128 ndarray
        Representations of the guides in `Surface.face_frames`, whose moduli are their firmness. Call
        `follow` after changing them.
    magnitude : (F,) float64 ndarray
        Magnitude of the field.
    representations : ((n,) complex128 ndarray, (F,) complex128 ndarray)
        The current field: representations at the nodes, and on the faces. Those on the faces have modulus 1, or
        0 where the field is undefined.
    """

    def __init__(
        self, system: GuidedSystem, guides: np.ndarray, start: np.ndarray, magnitude: np.ndarray
    ) -> None:
        self.system = system
        self.guides = guides
        self.magnitude = magnitude
        self._node_guides: NodeGuides | None = None
        face_z = unit_representations(system.averages.face_sums(start, system.degree))
        self.representations = start, face_z

    @property
    def vectors(self) -> np.ndarray:
        """(F, 3) float64: the current field, as one member vector for each face."""
        return self.system.to_vectors(self.magnitude * self.representations[1])

    @property
    def guide_vectors(self) -> np.ndarray:
        """(F, 3) float64: member vectors of the guides, whose lengths are their firmness."""
        return self.system.to_vectors(self.guides)

    def follow(self, face: np.ndarray) -> None:
        """Update the field near faces whose guides have changed; `face` holds these (m,) faces."""
        if not len(face):
            return
        node = self.system.nodes_of_faces(face)
        self._update_node_guides(node)
        near, z = self.system.nodes_near(node, NEAR_NODES), self.representations[0]
        z[near] = self.system.solve_near(self._node_guides, z, near, NEAR_ITERATIONS)
        corner = self.system.corners_of_nodes(near)
        changed = np.unique(self.system.surface.triangle_face[corner // 3])
        self._set_face_z(self.system.face_representations_at(z, changed), changed)

    def settle(self) -> tuple[np.ndarray, np.ndarray]:
        """Compute the field on the whole surface from the guides, and return the new `representations`.

        Without guides, the field does not change.
        """
        if not self.guides.any():
            return self.representations
        self._node_guides = self._guides_at_nodes()
        with progress(0.1, 0.95):
            z = self.system.solve(self._node_guides, self.representations[0])
        self.representations = z, self.representations[1]
        face_z = self.system.averages.face_sums(z, self.system.degree)
        self._set_face_z(face_z, np.arange(len(self.guides)))
        return self.representations

    def _update_node_guides(self, node: np.ndarray) -> None:
        """Recompute the guides at the given nodes from the guides on the faces around them."""
        if self._node_guides is None:
            self._node_guides = self._guides_at_nodes()
            return
        new = self._guides_at_nodes(self.system.corners_of_nodes(node))
        for name, values in vars(new).items():
            getattr(self._node_guides, name)[node] = values[node]

    def _guides_at_nodes(self, corner: np.ndarray | slice = slice(None)) -> NodeGuides:
        weights = firmness_weights(np.abs(self.guides), self.system.surface.mean_edge_length)
        return self.system.node_guides(unit_complex(self.guides), *weights, corner)

    def _set_face_z(self, z: np.ndarray, face: np.ndarray) -> None:
        """Set the field on the given (m,) faces to (m,) representations, which are normalized.

        A face with a guide of firmness 1, which is followed exactly, gets the representation of its guide.
        """
        guides = self.guides[face]
        _, is_exact = firmness_weights(np.abs(guides), self.system.surface.mean_edge_length)
        z = np.where(is_exact, unit_complex(guides), unit_representations(z))
        self.representations[1][face] = z


def start_combing(
    system: GuidedSystem, field: RosyField, guide_vectors: np.ndarray, reach: float
) -> Combing:
    """Return a `Combing` with the given field and guides.

    Parameters
    ----------
    system : GuidedSystem
        The linear system of the surface, for the degree of the field.
    field : RosyField
        A field whose directions are rotationally symmetric.
    guide_vectors : (F, 3) ndarray
        Member vectors whose lengths are the firmness of the guides; zero on faces without a guide. Faces
        without a guide get the field itself as a weak guide. So the field does not change far from strokes.
    reach : float
        Distance from a stroke, in object space, over which the change of the field falls off where there are
        no guides.

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
    guides = np.where(guides == 0, unit_z / (1 + edges**2), guides)
    averages = system.averages
    start = averages.node_sums(unit_z, system.degree) / averages.connection.positive_mass
    return Combing(system, guides, start, np.where(magnitude > 0, magnitude, 1.0))


@dataclass(frozen=True)
class GuideBrush:
    """The settings of a combing brush.

    Attributes
    ----------
    radius : float
        Radius in object space.
    strength : float
        Strength of the effect, from 0 to 1.
    effect : {"comb", "erase", "smooth"}
        Turn the guides along the stroke, remove guides, or average them with those around them.
    is_exact : bool
        Whether the field follows combed guides exactly, in the whole radius of the brush.
    front_faces : bool
        Whether to skip faces that face away from the surface under the brush: the angle between the normals
        is at least 90 degrees.
    mirror : sequence of 3 bools
        For each of the planes x = 0, y = 0 and z = 0 of object space, whether to repeat the stroke on the
        other side.
    """

    radius: float
    strength: float = 1.0
    effect: str = "comb"
    is_exact: bool = False
    front_faces: bool = True
    mirror: Sequence[bool] = (False, False, False)

    def falloff(self, distance: np.ndarray) -> np.ndarray:
        """Return (n,) factors of the effect at (n,) distances from the stroke: 1 on it, and 0 at the radius.

        Distances are in object space. If the brush combs exactly, the factor is 1 everywhere within the
        radius.
        """
        if self.is_exact and self.effect == "comb":
            return (distance < self.radius).astype(np.float64)
        x = np.clip(1 - (distance / self.radius) ** 2, 0, 1)
        return x * x


@dataclass(frozen=True, eq=False)
class _Dab:
    """A dab, one sample of a brush stroke: its (3,) position, pressure, and arc length from the start."""

    position: np.ndarray
    pressure: float
    arc_length: float


class BrushStroke:
    """A brush stroke, drawn point by point, that changes guides.

    The result does not depend on how the points are divided between calls of `extend`.

    Parameters
    ----------
    system : GuidedSystem
    guides : (F,) complex128 ndarray
        Representations of the guides in `Surface.face_frames`. They are changed in place.
    brush : GuideBrush
    locate : callable
        Function that returns the (n,) int faces closest to (n, 3) points in object space; -1 for no face.
    """

    def __init__(
        self,
        system: GuidedSystem,
        guides: np.ndarray,
        brush: GuideBrush,
        locate: Callable[[np.ndarray], np.ndarray],
    ) -> None:
        self.guides = guides
        self._system = system
        self._surface = system.surface
        self._brush = brush
        self._locate = locate
        self._spacing = max(DAB_SPACING * brush.radius, MIN_SPACING * self._surface.extent)
        signs = [(1.0, -1.0) if is_mirrored else (1.0,) for is_mirrored in reversed(brush.mirror)]
        self._signs = np.array(list(product(*signs)))[:, ::-1]
        self._start_arc_length = 0.0
        self._end: _Dab | None = None  # the last point, which need not be a dab
        self._dabs: list[_Dab] = []  # the last dabs that were drawn, and new ones
        # State of each face in the current pass of the stroke over it.
        count = self._surface.face_count
        self._last_arc_length = np.full(count, -np.inf)
        self._least_distance = np.full(count, np.inf)
        self._coverage = np.zeros(count)
        self._base = np.zeros(count, dtype=np.complex128)

    def extend(self, points: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Continue the stroke through (n, 3) points in object space, with (n,) pressures from 0 to 1.

        Returns
        -------
        (m,) intp ndarray
            Faces whose guides may have changed. The last piece of the stroke, up to two dabs long, is drawn
            by the next call or by `finish`.

        Raises
        ------
        RosyError
            If a point is not finite, or if the way to it needs more than `MAX_DABS` dabs.
        """
        for point, value in zip(points, pressure, strict=True):
            self._add_dabs_to(np.asarray(point, dtype=np.float64), float(value))
        return self._draw()

    def finish(self) -> np.ndarray:
        """Draw the last piece of the stroke, and return the (m,) intp faces whose guides may have changed.

        Points that are added after this begin a new stroke.
        """
        end = self._end
        if end is None:
            return np.empty(0, dtype=np.intp)
        if end.arc_length - self._dabs[-1].arc_length > 1e-3 * self._spacing:
            self._dabs.append(end)
        self._dabs.append(self._dabs[-1])  # the end has no later dab
        changed = self._draw()
        self._end = None
        self._start_arc_length = end.arc_length + 2 * PASS_GAP * self._brush.radius
        return changed

    def _add_dabs_to(self, point: np.ndarray, pressure: float) -> None:
        """Add dabs at equal distances on the straight line from the last point to this one.

        `point` is (3,) in object space. `pressure` is the pressure at the point, from 0 to 1.
        """
        if self._end is None:
            self._end = _Dab(point, pressure, self._start_arc_length)
            self._dabs = [self._end, self._end]  # the start has no earlier dab
            return
        start = self._end
        length = float(np.linalg.norm(point - start.position))
        if not length <= MAX_DABS * self._spacing:
            raise RosyError(
                f"{self._surface.name}: the stroke has a point far away from the surface, at "
                f"({', '.join(f'{value:.4g}' for value in point)}): remove it"
            )
        arc_length = self._dabs[-1].arc_length + self._spacing
        while arc_length <= start.arc_length + length:
            t = (arc_length - start.arc_length) / max(length, 1e-300)
            position = (1 - t) * start.position + t * point
            value = (1 - t) * start.pressure + t * pressure
            self._dabs.append(_Dab(position, value, arc_length))
            arc_length += self._spacing
        self._end = _Dab(point, pressure, start.arc_length + length)

    def _draw(self) -> np.ndarray:
        """Draw the segments between dabs that are not drawn yet, and return the faces near these segments.

        The tangent at a dab needs the dab before and the dab after it. So a segment is drawn as soon as
        there are dabs before and after both of its ends.
        """
        dabs = self._dabs
        if len(dabs) < 4 and not (len(dabs) == 3 and dabs[1] is dabs[2]):
            return np.empty(0, dtype=np.intp)
        positions = np.array([dab.position for dab in dabs])
        tangents = normalize(positions[2:] - positions[:-2])
        inner = positions[1:-1]
        copies = [inner * sign for sign in self._signs]
        faces = list(map(self._locate, copies))
        near = list(map(self._near_faces, copies, faces))
        for first in range(max(len(inner) - 1, 1)):
            segment = slice(first, first + 2)
            for sign, candidates, located in zip(self._signs, near, faces, strict=True):
                path = inner[segment] * sign, tangents[segment] * sign, dabs[1:-1][segment]
                self._draw_segment(candidates, *path, located[segment])
        self._dabs = dabs[-3:]
        return np.unique(np.concatenate(near))

    def _near_faces(self, positions: np.ndarray, located: np.ndarray) -> np.ndarray:
        """Return the indices of the faces that may be within the radius of n dabs.

        The dabs have (n, 3) positions in object space. `located` holds the (n,) faces under the dabs, which
        are always in the result; -1 for a dab without a face.
        """
        low, high = positions.min(axis=0), positions.max(axis=0)
        center = self._surface.face_center
        excess = np.maximum(np.maximum(low - center, center - high), 0)
        is_near = dot(excess, excess) < self._brush.radius**2
        is_near[located[located >= 0]] = True
        return np.flatnonzero(is_near)

    def _draw_segment(
        self,
        near: np.ndarray,
        positions: np.ndarray,
        tangents: np.ndarray,
        dabs: Sequence[_Dab],
        located: np.ndarray,
    ) -> None:
        """Apply the effect of the brush to faces near the segment between two dabs, or near a single dab.

        Parameters
        ----------
        near : (m,) intp ndarray
            Faces that may be within the radius of the segment.
        positions, tangents : (k, 3) float64 ndarray
            Positions and unit directions of the stroke at its k dabs (1 or 2), in object space. For a
            mirrored copy of the stroke, they are mirrored.
        dabs : sequence of _Dab
            The k dabs. Their pressures and arc lengths are used, and not their positions.
        located : (k,) int ndarray
            The face under each dab; -1 if there is none.
        """
        brush, normal = self._brush, self._surface.face_normal
        on_face = located[located >= 0]
        if not len(on_face):
            return
        start, along = positions[0], positions[-1] - positions[0]
        offset = self._surface.face_center[near] - start
        t = np.clip(offset @ along / max(float(along @ along), 1e-300), 0, 1)
        offset -= t[:, None] * along
        distance = np.sqrt(dot(offset, offset))
        is_on_face = np.isin(near, on_face)
        is_reached = is_on_face | (distance < brush.radius)
        if brush.front_faces:
            is_reached &= normal[near] @ normal[on_face].sum(axis=0) > 0
        direction = (1 - t)[:, None] * tangents[0] + t[:, None] * tangents[-1]
        x, y = self._system.averages.x[near], self._system.averages.y[near]
        member = np.hypot(dot(direction, x), dot(direction, y))
        if brush.effect == "comb":
            is_reached &= member > MIN_PROJECTION
        face, t, distance = near[is_reached], t[is_reached], distance[is_reached]
        if not len(face):
            return
        pressure = (1 - t) * dabs[0].pressure + t * dabs[-1].pressure
        # A face under the brush is reached even if its center is far away.
        effect = brush.falloff(np.where(is_on_face[is_reached], 0.0, distance))
        if not (brush.is_exact and brush.effect == "comb"):
            effect *= brush.strength * pressure
        arc_length = dabs[-1].arc_length
        if brush.effect == "smooth":
            mean = self._system.neighbor_means(self.guides, face)
            self._store(face, self.guides[face] + effect * (mean - self.guides[face]))
            return
        self._begin_passes(face, arc_length)
        self._coverage[face] = np.maximum(self._coverage[face], effect)
        if brush.effect == "erase":
            self._store(face, (1 - self._coverage[face]) * self._base[face])
        else:
            self._comb(face, distance, direction[is_reached])

    def _begin_passes(self, face: np.ndarray, arc_length: float) -> None:
        """Begin a new pass over faces that the stroke reaches for the first time, or again after a gap.

        `arc_length` is the arc length of the stroke up to the end of the segment that is drawn, in object
        space. A gap is an arc length of more than `PASS_GAP` brush radii in which the stroke does not reach
        the face. The effect of a pass is applied to the guides that the face had when the pass began.
        """
        is_new = face[arc_length - self._last_arc_length[face] > PASS_GAP * self._brush.radius]
        self._last_arc_length[face] = arc_length
        self._base[is_new] = self.guides[is_new]
        self._least_distance[is_new] = np.inf
        self._coverage[is_new] = 0

    def _comb(self, face: np.ndarray, distance: np.ndarray, direction: np.ndarray) -> None:
        """Turn the guides of m faces to the direction of the stroke where the stroke is nearest to the face.

        `face` holds the (m,) faces, `distance` their (m,) distances from the segment that is drawn, in object
        space, and `direction` the (m, 3) directions of the stroke at the nearest point. If an earlier segment
        of the same pass was nearer to a face, the face keeps its guide.
        """
        is_closest = distance <= self._least_distance[face]
        face = face[is_closest]
        self._least_distance[face] = distance[is_closest]
        frames = self._system.averages.x[face], self._system.averages.y[face]
        direction = normalize(direction[is_closest])
        target = to_representation(direction, *frames, self._system.degree)
        target *= (1.0 if self._brush.is_exact else SOFT_FIRMNESS) / np.abs(target)
        coverage = self._coverage[face]
        self._store(face, (1 - coverage) * self._base[face] + coverage * target)

    def _store(self, face: np.ndarray, guides: np.ndarray) -> None:
        guides[np.abs(guides) < LEAST_FIRMNESS] = 0
        self.guides[face] = guides
