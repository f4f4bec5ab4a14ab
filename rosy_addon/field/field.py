"""`Field`: an N-RoSy (N-way rotational symmetry) field with its surface, for scripts and notebooks."""

from __future__ import annotations

import os
from dataclasses import KW_ONLY, dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RosyError
from .analysis import Difference as Difference
from .analysis import angle_errors, dirichlet_energy, error_statistics
from .convert import Conversion, convert
from .directional_field import field_directions
from .field_io import write_field
from .representation import face_representation, to_representation
from .rosy_field import RosyField
from .singularities import find_singularities
from .singularity_changes import cluster_singularities, move_index
from .surface import Surface, is_same_surface


class Singularities(NamedTuple):
    """The K singular vertices of a field, and their indices.

    Attributes
    ----------
    vertex : (K,) int32 ndarray
        Numbers of the vertices, in ascending order.
    index : (K,) int32 ndarray
        Singularity index of each vertex in units of 1/N; never 0. On a closed surface, the sum of all
        indices is N times the Euler characteristic.
    """

    vertex: NDArray[np.int32]
    index: NDArray[np.int32]  # type: ignore[assignment]  # hides tuple.index


@dataclass(frozen=True, eq=False, repr=False)
class Field(RosyField):
    """An N-way rotational symmetry (N-RoSy) field on the F faces of a surface.

    It has N vectors, its *members*, on each face: rotations of each other by 2 pi / N about the normal.
    Make a field with a generator, such as `smoothest`, or with `from_vectors`, `from_angles`,
    `from_directions`, `from_tensors`, `from_array` or `read_field`. A `Field` is a `RosyField` that also
    holds its surface, so that methods need no surface as an argument.

    Attributes
    ----------
    degree : int
        N, the number of directions.
    vectors : (F, 3) float64 ndarray
        One member vector for each face, in object space; zero where the field is undefined.
    direction_ratios : (F, N) complex128 ndarray or None
        None if the directions are the members. Otherwise direction k is member k, rotated by the phase of
        ratio k and scaled by its modulus.
    family_count : int
        Number of families of directions that are told apart, such as 2 for the major and minor directions of
        a tensor; 1 if the stored member may be any of the members.
    source_directions : (F, N, 3) float64 ndarray or None
        The input directions in their order, if the field was made from directions.
    surface : Surface
        The surface on which the field is defined.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> field = rf.smoothest(torus)
    >>> int(field.singularities.index.sum()) == field.degree * torus.euler_characteristic
    True
    >>> round(field.difference(field.rotated(0.2)).mean, 6)
    0.2
    >>> field.to_degree(2)
    <Field: 2-RoSy field on <Surface 'torus.obj': 288 faces, 288 vertices>>
    """

    _: KW_ONLY
    surface: Surface

    @classmethod
    def of(cls, surface: Surface, field: RosyField) -> Field:
        """Return a `Field` with the values of a `RosyField` and this surface."""
        values = {each.name: getattr(field, each.name) for each in fields(RosyField)}
        return cls(**values, surface=surface)

    def __repr__(self) -> str:
        kind = f"{self.degree}-RoSy field" if self.is_rosy else f"field of {self.degree} directions"
        return f"<Field: {kind} on {self.surface!r}>"

    @property
    def is_rosy(self) -> bool:
        """Whether the directions are rotationally symmetric on all faces."""
        return self.direction_ratios is None

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """(F, N, 3): all N directions of each face in object space, counter-clockwise about the normal."""
        return field_directions(self.surface, self)

    @cached_property
    def angles(self) -> NDArray[np.float64]:
        """(F,): counter-clockwise angle from x of `Surface.face_frames` to `vectors`, -pi to pi radians."""
        return np.angle(to_representation(self.vectors, *self.surface.face_frames, 1))

    @cached_property
    def representation(self) -> NDArray[np.complex128]:
        """(F,): the representation r exp(i N t) for member vectors of length r and angle t (see `angles`).

        All N members of a face give the same value. `from_representation` makes a field from it.
        """
        return face_representation(self.surface, self)

    @cached_property
    def singularities(self) -> Singularities:
        """The singular vertices of the field, and their indices in units of 1/N."""
        return Singularities(*find_singularities(self.surface, self))

    @cached_property
    def energy(self) -> float:
        """The Dirichlet energy of the directions, without unit; see `field.analysis.dirichlet_energy`."""
        return dirichlet_energy(self.surface, self)

    def to_degree(self, degree: int) -> Field:
        """Return the field converted to another degree, which is a multiple or a divisor of its own degree.

        Raises
        ------
        RosyError
            If `degree` is neither a multiple nor a divisor, or if the directions of the field are not
            rotationally symmetric.
        """
        return self._converted(Conversion(degree=degree))

    def rotated(self, angle: float) -> Field:
        """Return the field rotated counter-clockwise about the normals, by an angle in radians."""
        return self._converted(Conversion(rotation=angle))

    def smoothed(self, reach: float) -> Field:
        """Return the field diffused over a distance.

        Magnitudes decrease where directions vary, and singularities of opposite index cancel.

        Parameters
        ----------
        reach : float
            The distance, as a fraction of the longest side of the bounding box of the mesh.
        """
        return self._converted(Conversion(smoothing_length=reach))

    def clusters(self, reach: float) -> Singularities:
        """Return the singularities, with each cluster of nearby singularities replaced by a single one.

        It lies at the vertex of the cluster that is nearest to their mean position, and its index is the sum
        of their indices. A cluster with the sum 0 is left out. So the sum of all indices does not change.

        Parameters
        ----------
        reach : float
            Largest distance from a singularity to the next one of its cluster, along edges, as a fraction of
            the longest side of the bounding box of the mesh.

        Examples
        --------
        >>> import rosyfields as rf
        >>> bunny = rf.Surface("bunny.obj")  # doctest: +SKIP
        >>> rf.form(bunny).clusters(0.02)  # doctest: +SKIP
        """
        surface, found = self.surface, self.singularities
        return Singularities(*cluster_singularities(surface, *found, reach * surface.extent))

    def without_pairs(self, reach: float) -> Field:
        """Return the field without singularities that are near to each other and whose indices sum to 0.

        These are pairs with opposite indices, and then clusters of the others. Other singularities, and
        directions far from the removed ones, do not change. A group is kept if the faces near it are too
        large to remove it: the field would then turn by pi / N or more from one face to the next.

        Parameters
        ----------
        reach : float
            Largest distance from a singularity to the next one of its group, along edges, as a fraction of
            the longest side of the bounding box of the mesh.

        Raises
        ------
        RosyError
            If the directions of the field are not rotationally symmetric.

        Examples
        --------
        >>> import rosyfields as rf
        >>> torus = rf.Surface("torus.obj")
        >>> field = rf.curvature(torus).without_pairs(0.05)
        """
        return self._converted(Conversion(pair_distance=reach))

    def with_moved_singularity(
        self, source: int, target: int, index: int = 0, *, reach: float = 0.1
    ) -> Field:
        """Return the field with a singularity moved to another vertex; all other singularities stay.

        If the target is already singular, the moved index is added to its index: opposite indices cancel.
        If the source is not singular, a pair with indices `-index` and `index` is created. If only a part
        of the index of the source moves, the rest of it stays there.

        Parameters
        ----------
        source, target : int
            Vertices. A `source` of -1 means that the singularity enters the surface over its border, and a
            `target` of -1 that it leaves over the border.
        index : int
            Index to move, in units of 1/N; 0 for the whole index of `source`.
        reach : float
            Distance over which directions change, as a fraction of the longest side of the bounding box
            of the mesh. They change at least as far as the singularity moves.

        Raises
        ------
        RosyError
            If the directions of the field are not rotationally symmetric, if one of the vertices cannot be
            singular (such as a border vertex), if `source` has no index to move, or if the faces are too
            large: the field would turn by pi / N or more from one face to the next.

        Examples
        --------
        >>> import rosyfields as rf
        >>> torus = rf.Surface("torus.obj")
        >>> field = rf.prescribed(torus, {10: 1, 200: -1}).with_moved_singularity(10, 12)
        >>> field.singularities.vertex.tolist()
        [12, 200]
        """
        surface, distance = self.surface, reach * self.surface.extent
        return Field.of(surface, move_index(surface, self, source, target, index, distance))

    def with_magnitude(self, magnitude: str | ArrayLike) -> Field:
        """Return the field with the same directions and other magnitudes.

        Parameters
        ----------
        magnitude : {"unit", "confidence", "curvature"} or (F,) array_like
            The magnitudes, or how to compute them: 1; how well the principal directions are defined, from 0
            to 1; or the larger absolute principal curvature, in 1 / unit of length of the mesh.
        """
        if not isinstance(magnitude, str):
            values = np.asarray(magnitude, dtype=np.float64)
            shape = np.broadcast_shapes(values.shape, (self.surface.face_count,))
            if shape != (self.surface.face_count,) or not (values >= 0).all():
                raise RosyError(
                    f"{self.surface.name}: magnitudes must be {self.surface.face_count:,} numbers "
                    "that are not negative"
                )
            magnitude = values
        return self._converted(Conversion(magnitude=magnitude))

    def difference(self, other: Field) -> Difference:
        """Return the angle to another field of the same degree on the same surface, and statistics of it.

        If the directions of either field are not rotationally symmetric, the directions of the two fields are
        matched on each face, in their order around the normal. There are N such matchings. The angle is then
        the least mean angle between matched directions, and it may be larger than pi/N. Two smoothest fields
        of a closed surface may differ by a constant angle: such a rotation does not change the energy.

        Raises
        ------
        RosyError
            If the degrees or the surfaces differ.
        """
        check_same_surface(self.surface, other)
        return error_statistics(self.surface, angle_errors(self.surface, self, other))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the field to a file.

        Parameters
        ----------
        path : path-like
            The suffix selects the format: ``.rosy``, ``.rawfield``, ``.obj`` (in the format of the program
            fieldgen), ``.txt`` or ``.npy``; ``.vtp``, ``.vtu``, ``.ply`` or ``.npz`` for the mesh with the
            directions, magnitudes and singularities; or ``.sings`` for the singularities alone.

        Warns
        -----
        RosyWarning
            If directions in an ``.obj`` file, which has one for each vertex, are off.

        Raises
        ------
        RosyError
            If the format cannot hold the field, or the file cannot be written.
        """
        write_field(path, self, self.surface)

    def _converted(self, conversion: Conversion) -> Field:
        return Field.of(self.surface, convert(self.surface, self, conversion))


def check_same_surface(surface: Surface, field: Field) -> None:
    """Raise a `RosyError` if the surface of a field has other vertices or faces than this `Surface`."""
    if not is_same_surface(field.surface, surface):
        raise RosyError(
            f"{surface.name}: the field is on another surface, {field.surface.name}: make it on this one"
        )
