"""`Field`: an N-RoSy field with its surface, for scripts and notebooks."""

from __future__ import annotations

import os
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RosyError
from .analysis import angle_errors, dirichlet_energy, error_statistics
from .convert import Conversion, convert
from .directional_field import field_directions
from .field_io import write_field
from .rosy_field import RosyField
from .singularities import find_singularities
from .singularity_changes import move_index
from .surface import Surface


class Singularities(NamedTuple):
    """The K singular vertices of a field.

    Attributes
    ----------
    vertex : (K,) int32 ndarray
        In ascending order.
    index : (K,) int32 ndarray
        In units of 1/N; never 0. On a closed surface they sum to N times the Euler characteristic.
    """

    vertex: NDArray[np.int32]
    index: NDArray[np.int32]  # type: ignore[assignment]  # hides tuple.index


@dataclass(frozen=True, eq=False)
class Difference:
    """The angle between two fields of the same degree.

    Attributes
    ----------
    angle : (F,) float64 ndarray
        From a member to the nearest member of the other field, in radians, 0 to pi/N. NaN where
        either field is undefined.
    mean, rms : float
        Mean and root mean square of the angle in radians, weighted by area.
    p95 : float
        The largest angle on 95 % of the area, radians.
    max : float
        Radians.
    worst_face : int
        The face of the largest angle; -1 if there is nothing to compare.
    compared : float
        Fraction of the faces on which both fields are defined.
    """

    angle: NDArray[np.float64]
    mean: float
    rms: float
    p95: float
    max: float
    worst_face: int
    compared: float


@dataclass(frozen=True, eq=False, repr=False)
class Field(RosyField):
    """An N-RoSy field on the faces of a surface.

    Make one with a generator, such as `smoothest`, or with `from_vectors`, `from_angles`,
    `from_directions`, `from_tensors`, `from_array` or `read_field`. Numeric functions take a `RosyField`
    and its surface; a `Field` is one that knows its surface.

    Attributes
    ----------
    degree : int
        N, the number of directions.
    vectors : (F, 3) float64 ndarray
        One member vector for each face; zero where the field is undefined.
    direction_ratios, family_count, source_directions
        See `RosyField`.
    surface : Surface
        On whose faces the field is.

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
        """Return a field with its surface."""
        return cls(
            field.degree,
            field.vectors,
            field.direction_ratios,
            field.family_count,
            field.source_directions,
            surface=surface,
        )

    def __repr__(self) -> str:
        kind = f"{self.degree}-RoSy field" if self.is_rosy else f"field of {self.degree} directions"
        return f"<Field: {kind} on {self.surface!r}>"

    @property
    def is_rosy(self) -> bool:
        """Whether the directions are rotationally symmetric, on all faces."""
        return self.direction_ratios is None

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """(F, N, 3): all directions, counter-clockwise about the normals."""
        return field_directions(self.surface, self)

    @cached_property
    def angles(self) -> NDArray[np.float64]:
        """(F,): angle of the stored member from x of `Surface.face_frames`, in radians, -pi to pi."""
        x, y = self.surface.face_frames
        vectors = self.vectors
        angles: NDArray[np.float64] = np.arctan2(
            (vectors * y).sum(axis=1), (vectors * x).sum(axis=1)
        )
        return angles

    @cached_property
    def representation(self) -> NDArray[np.complex128]:
        """(F,): r exp(i N t) for the magnitude r and the angle t of a member; see `angles`.

        It is the same for all members. `from_representation` makes a field of it.
        """
        z: NDArray[np.complex128] = self.magnitude * np.exp(1j * self.degree * self.angles)
        return z

    @cached_property
    def singularities(self) -> Singularities:
        """The singular vertices and their indices, in units of 1/N."""
        return Singularities(*find_singularities(self.surface, self))

    @cached_property
    def energy(self) -> float:
        """The Dirichlet energy of the directions; see `field.analysis.dirichlet_energy`."""
        return dirichlet_energy(self.surface, self)

    def to_degree(self, degree: int) -> Field:
        """Return the field with another degree, a multiple or a divisor of its own.

        Raises
        ------
        RosyError
            If it is neither, or the field is not a RoSy.
        """
        return self._converted(Conversion(degree=degree))

    def rotated(self, angle: float) -> Field:
        """Return the field rotated counter-clockwise about the normals, by an angle in radians."""
        return self._converted(Conversion(rotation=angle))

    def smoothed(self, reach: float) -> Field:
        """Return the field diffused over a distance, a fraction of the longest side of the mesh.

        Magnitudes decrease where directions vary, and singularities of opposite index merge.
        """
        return self._converted(Conversion(smoothing_length=reach))

    def without_pairs(self, reach: float) -> Field:
        """Return the field without pairs of singularities that are near to each other.

        The singularities of a pair have opposite indices. Other singularities and directions far from the pairs
        do not change. A pair stays if the field would turn too fast for the size of the faces without it.

        Parameters
        ----------
        reach : float
            Largest distance of a pair along edges, as a fraction of the longest side of the mesh.

        Raises
        ------
        RosyError
            If the field is not a RoSy.

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
        """Return the field with a singularity at another vertex; all others stay.

        If the target is singular, the indices are added: opposite ones cancel. If the source is not
        singular, a pair is created. If only a part of an index moves, the rest stays at the source.

        Parameters
        ----------
        source, target : int
            Vertices. -1 stands for none: the singularity enters or leaves over a border.
        index : int
            Index to move, in units of 1/N; 0 for the whole index of `source`.
        reach : float
            Distance over which directions change, as a fraction of the longest side of the mesh. They
            change at least as far as the singularity moves.

        Raises
        ------
        RosyError
            If the field is not a RoSy, a vertex can have no index or has none to move, or the field would
            turn too fast for the size of the faces.

        Examples
        --------
        >>> import rosyfields as rf
        >>> torus = rf.Surface("torus.obj")
        >>> field = rf.prescribed(torus, {10: 1, 200: -1}).with_moved_singularity(10, 12)
        >>> field.singularities.vertex.tolist()
        [12, 200]
        """
        distance = reach * self.surface.extent
        return Field.of(
            self.surface, move_index(self.surface, self, source, target, index, distance)
        )

    def with_magnitude(self, magnitude: str | ArrayLike) -> Field:
        """Return the field with other magnitudes.

        Parameters
        ----------
        magnitude : {"unit", "confidence", "curvature"} or (F,) array_like
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
        """Return the angle to another field of the same degree on the same surface.

        If the directions of one of them are not rotationally symmetric, it is the mean angle between the
        directions of their best matching, and may be larger than pi/N. Two smoothest fields of a closed
        surface may differ by a constant angle, which costs no energy.

        Raises
        ------
        RosyError
            If the degrees or the surfaces differ.
        """
        check_same_surface(self.surface, other)
        angle = angle_errors(self.surface, self, other)
        return Difference(angle, **error_statistics(self.surface, angle)._asdict())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the field to a file.

        Parameters
        ----------
        path : path-like
            ``.rosy``, ``.rawfield``, ``.obj`` (of fieldgen), ``.txt`` or ``.npy``; or ``.sings`` for
            the singularities alone.

        Raises
        ------
        RosyError
            If the format cannot hold the field, or the file cannot be written.
        """
        write_field(path, self, self.surface)

    def _converted(self, conversion: Conversion) -> Field:
        return Field.of(self.surface, convert(self.surface, self, conversion))


def check_same_surface(surface: Surface, field: Field) -> None:
    """Raise an error if a field is on another surface."""
    if field.surface is not surface:
        raise RosyError(
            f"{surface.name}: the field is on another surface, {field.surface.name}: make it on this one"
        )
