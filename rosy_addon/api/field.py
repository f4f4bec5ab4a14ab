"""`Field`: an N-RoSy field on a surface; and fields from arrays and files."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import RosyError, RosyWarning
from ..field.analysis import angle_errors, dirichlet_energy, error_statistics
from ..field.array_field import SurfaceArrays, array_field
from ..field.convert import Conversion, convert
from ..field.directional_field import field_directions, tensor_field
from ..field.field_io import load_field, write_field
from ..field.rosy_field import RosyField, check_degree
from ..field.singularities import find_singularities
from ..field.singularity_changes import move_index
from ..field.validate import apply_nonfinite_policy, validated_directions, validated_field
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
        Of the angle in radians, weighted by area.
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


class Field:
    """An N-RoSy field on the faces of a surface.

    Make one with a generator, such as `smoothest`, or with `from_vectors`, `from_angles`,
    `from_directions`, `from_tensors`, `from_array` or `read_field`.

    Parameters
    ----------
    surface : Surface
        On whose faces the field is.
    rosy : rosyfields.field.rosy_field.RosyField
        The field as the other modules of the package use it.

    Attributes
    ----------
    surface : Surface
        On whose faces the field is.
    rosy : rosyfields.field.rosy_field.RosyField
        The field as the other modules of the package use it.

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

    def __init__(self, surface: Surface, rosy: RosyField) -> None:
        self.surface = surface
        self.rosy = rosy

    def __repr__(self) -> str:
        kind = f"{self.degree}-RoSy field" if self.is_rosy else f"field of {self.degree} directions"
        return f"<Field: {kind} on {self.surface!r}>"

    @property
    def degree(self) -> int:
        """N, the number of directions."""
        return self.rosy.degree

    @property
    def vectors(self) -> NDArray[np.float64]:
        """(F, 3): one member vector for each face; zero where the field is undefined."""
        return self.rosy.vectors

    @property
    def magnitude(self) -> NDArray[np.float64]:
        """(F,): the length of the members."""
        return self.rosy.magnitude

    @property
    def is_rosy(self) -> bool:
        """Whether the directions are rotationally symmetric, on all faces."""
        return self.rosy.direction_ratios is None

    @cached_property
    def directions(self) -> NDArray[np.float64]:
        """(F, N, 3): all directions, counter-clockwise about the normals."""
        return field_directions(self.surface.mesh, self.rosy)

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
        return Singularities(*find_singularities(self.surface.mesh, self.rosy))

    @cached_property
    def energy(self) -> float:
        """The Dirichlet energy of the directions; see `field.analysis.dirichlet_energy`."""
        return dirichlet_energy(self.surface.mesh, self.rosy)

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

        The two of a pair have opposite indices, and no other singularity changes. Far from the pairs, neither
        do directions. Pairs stay where the field would otherwise turn too fast for the size of the faces.

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

        On another singularity, its index is added to that one: opposite ones vanish. From a vertex that
        is not singular, a pair is made; of a part of an index, the rest stays.

        Parameters
        ----------
        source, target : int
            Vertices. -1 stands for none: the singularity comes or leaves over a border.
        index : int
            What is moved, in units of 1/N; 0 for the whole index of `source`.
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
        mesh = self.surface.mesh
        moved = move_index(mesh, self.rosy, source, target, index, reach * mesh.extent)
        return Field(self.surface, moved)

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
        angle = angle_errors(self.surface.mesh, self.rosy, other.rosy)
        return Difference(angle, **error_statistics(self.surface.mesh, angle)._asdict())

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
        write_field(path, self.rosy, self.surface.mesh)

    def _converted(self, conversion: Conversion) -> Field:
        return Field(self.surface, convert(self.surface.mesh, self.rosy, conversion))


def check_same_surface(surface: Surface, field: Field) -> None:
    """Raise an error if a field is on another surface."""
    if field.surface is not surface and field.surface.mesh is not surface.mesh:
        raise RosyError(
            f"{surface.name}: the field is on another surface, {field.surface.name}: make it on this one"
        )


def from_vectors(
    surface: Surface, vectors: ArrayLike, degree: int, *, nonfinite: str = "error"
) -> Field:
    """Make a field from one member vector for each face or vertex.

    Vectors slightly off the surface are rotated into it and keep their length. Values of vertices are
    averaged onto the faces as RoSys.

    Parameters
    ----------
    surface : Surface
    vectors : (F, 3) or (V, 3) array_like
        Zero where the field is undefined. If there are as many faces as vertices, they are of faces.
    degree : int
        N, from 1 to 12: 1 for a vector field, 2 for a line field, 4 for a cross field.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.

    Raises
    ------
    RosyError
        If their number fits neither faces nor vertices, a vector is not finite, or vectors do not lie
        on the surface.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> wind = rf.from_vectors(torus, torus.face_frames[0], degree=1)
    >>> wind.degree
    1
    """
    array = np.asarray(vectors, dtype=np.float64)
    source = f"{surface.name}: vectors"
    return Field(surface, validated_field(surface.mesh, array, degree, source, nonfinite))


def from_angles(
    surface: Surface, angles: ArrayLike, degree: int, *, magnitude: ArrayLike = 1.0
) -> Field:
    """Make a field from the angle of a member on each face.

    Parameters
    ----------
    surface : Surface
    angles : (F,) array_like
        Radians, counter-clockwise about the normal, from x of `Surface.face_frames`: the first edge
        of the face, as in ``igl.local_basis``.
    degree : int
        N, from 1 to 12.
    magnitude : (F,) array_like or float

    Raises
    ------
    RosyError
        If there is not one angle for each face, or one is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> field = rf.from_angles(torus, np.full(torus.face_count, np.pi / 8), degree=4)
    >>> bool(np.allclose(field.angles, np.pi / 8))
    True
    """
    degree = check_degree(degree)
    values = np.asarray(angles, dtype=np.float64)
    if values.shape != (surface.face_count,) or not np.isfinite(values).all():
        raise RosyError(
            f"{surface.name}: angles must be {surface.face_count:,} finite numbers, one for each "
            f"face, not an array of shape {values.shape}"
        )
    x, y = surface.face_frames
    vectors = np.cos(values)[:, None] * x + np.sin(values)[:, None] * y
    field = Field(surface, RosyField(degree, vectors))
    return field if np.all(np.asarray(magnitude) == 1.0) else field.with_magnitude(magnitude)


def from_representation(surface: Surface, representation: ArrayLike, degree: int) -> Field:
    """Make a field from a complex number r exp(i N t) on each face.

    Parameters
    ----------
    surface : Surface
    representation : (F,) array_like of complex
        The magnitude r, and N times the angle t of a member from x of `Surface.face_frames`.
    degree : int
        N, from 1 to 12.

    Raises
    ------
    RosyError
        If there is not one number for each face, or one is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import rosyfields as rf
    >>> square = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> rf.from_representation(square, [2j], degree=2).angles * 180 / np.pi
    array([45.])
    """
    z = np.asarray(representation, dtype=np.complex128)
    return from_angles(surface, np.angle(z) / check_degree(degree), degree, magnitude=np.abs(z))


def from_directions(surface: Surface, directions: ArrayLike, *, nonfinite: str = "error") -> Field:
    """Make a field from N directions for each face or vertex, which need not be a RoSy.

    Parameters
    ----------
    surface : Surface
    directions : (F, N, 3) or (V, N, 3) array_like
        In any order. Where one of them is zero, the field is undefined.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.

    Raises
    ------
    RosyError
        As `from_vectors`.

    Examples
    --------
    >>> import numpy as np
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> x, y = torus.face_frames
    >>> field = rf.from_directions(torus, np.stack([x, x + y, -x, -x - y], axis=1))
    >>> field.degree, field.is_rosy
    (4, False)
    """
    array = np.asarray(directions, dtype=np.float64)
    if array.ndim != 3 or array.shape[2] != 3:
        raise RosyError(
            f"{surface.name}: directions must have the shape (F, N, 3), not {array.shape}"
        )
    source = f"{surface.name}: directions"
    return Field(surface, validated_directions(surface.mesh, array, source, nonfinite))


def from_tensors(surface: Surface, tensors: ArrayLike, *, nonfinite: str = "error") -> Field:
    """Make a field of degree 4 from the eigenvectors of a symmetric tensor on each face.

    The tensors are projected to the faces. The major and the minor directions stay distinct.

    Parameters
    ----------
    surface : Surface
    tensors : (F, 3, 3) array_like
    nonfinite : {"error", "zero"}
        Raise an error if a tensor is not finite, or treat it as undefined.

    Raises
    ------
    RosyError
        If there is not one tensor for each face, or one is not finite.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> x, y = torus.face_frames
    >>> stress = 3 * x[:, :, None] * x[:, None] + y[:, :, None] * y[:, None]
    >>> rf.from_tensors(torus, stress).degree
    4
    """
    array = np.array(tensors, dtype=np.float64)
    if array.shape != (surface.face_count, 3, 3):
        raise RosyError(
            f"{surface.name}: tensors must have the shape ({surface.face_count}, 3, 3), not "
            f"{array.shape}"
        )
    apply_nonfinite_policy(array, f"{surface.name}: tensors", "face", nonfinite)
    return Field(surface, tensor_field(surface.mesh, array))


def from_array(
    surface: Surface,
    name: str | None = None,
    degree: int | None = None,
    *,
    nonfinite: str = "error",
) -> Field:
    """Make a field from an array of `Surface.vertex_data` or `Surface.face_data`.

    The count of numbers in each row says what they are:

    | numbers | meaning |
    | ------- | ------- |
    | 2 | on a mesh with constant z: a vector, z is 0 |
    | 3 | a vector: one member of the field |
    | 6 | a symmetric tensor, in VTK's order XX, YY, ZZ, XY, YZ, XZ |
    | 9 | a symmetric tensor, 3 x 3 |
    | 12, 15, ... 36 | all N directions, 3 numbers each |

    Vectors that are not tangent to the surface, such as velocities at the boundary of a volume, are
    replaced by their tangential components. Of tensors, the field consists of the two principal
    directions in each face. Values of vertices are averaged onto the faces.

    Parameters
    ----------
    surface : Surface
        From a file of a simulation, from the mesh of another library, or from a ``.ply`` file.
    name : str, optional
        Name of the array; "point:NAME" or "cell:NAME" if both vertices and faces have one. It can be
        left out if a single array of floating-point numbers can be a field. Normals do not count.
    degree : int, optional
        N, from 1 to 12; by default 1 for an array of vectors. Tensors have degree 4.
    nonfinite : {"error", "zero"}
        Raise an error if a number is not finite, or treat the vector or tensor as undefined.

    Raises
    ------
    RosyError
        If there is no such array, it holds scalars or tensors that are not symmetric, has another
        degree, or has numbers that are not finite.

    Examples
    --------
    >>> surface = rf.Surface("flow.vtu")  # doctest: +SKIP
    >>> velocity = rf.from_array(surface, "velocity")  # doctest: +SKIP
    >>> stress = rf.from_array(rf.Surface(pyvista.read("beam.vtu")), "stress")  # doctest: +SKIP
    """
    arrays = SurfaceArrays(surface.name, surface.mesh, surface.vertex_data, surface.face_data)
    return Field(surface, array_field(arrays, name, degree, nonfinite))


def read_field(
    path: str | os.PathLike[str],
    surface: Surface,
    degree: int | None = None,
    *,
    nonfinite: str = "error",
    mesh: str | os.PathLike[str] | None = None,
) -> Field:
    """Read a field from a file.

    Parameters
    ----------
    path : path-like
        ``.rosy``, ``.rawfield``, ``.obj`` (of fieldgen), ``.txt`` or ``.npy``.
    surface : Surface
    degree : int, optional
        The required degree; any if not given. Files that state none have 4.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    mesh : path-like, optional
        The mesh file that the field belongs to, if its faces are not those of `surface`. The field is
        then transferred by position.

    Warns
    -----
    RosyWarning
        If the field was transferred from another mesh.

    Raises
    ------
    RosyError
        If the file cannot be read, or does not fit the surface.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> rf.smoothest(torus, degree=6).save("torus.rosy")
    >>> rf.read_field("torus.rosy", torus).degree
    6
    """
    loaded = load_field(path, surface.mesh, degree, nonfinite, mesh=mesh)
    warn(loaded.note)
    return Field(surface, loaded.field)


def warn(note: str, stacklevel: int = 3) -> None:
    """Issue a `RosyWarning`, unless the note is empty. By default it names the caller's caller."""
    if note:
        warnings.warn(note, RosyWarning, stacklevel=stacklevel)
