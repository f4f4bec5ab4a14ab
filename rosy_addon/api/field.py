"""Make fields from arrays and files."""

import os
import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import RosyError, RosyWarning
from ..field.array_field import SurfaceArrays, array_field
from ..field.directional_field import tensor_field, with_opposites
from ..field.field import Field
from ..field.field_io import HALF_CROSS_NOTE, load_field
from ..field.mesh_arrays import OBJECT_READERS, SIMULATION_READERS
from ..field.rosy_field import RosyField, check_degree
from ..field.surface import Surface
from ..field.validate import (
    VectorPolicy,
    apply_nonfinite_policy,
    validated_directions,
    validated_field,
)
from ..field.vertex_frames import in_space

try:
    from ..external.simulation_files import SUFFIXES, read_object, read_simulation
except ImportError:  # the extension for Blender
    pass
else:
    SIMULATION_READERS.update(dict.fromkeys(SUFFIXES, read_simulation))
    OBJECT_READERS.update(dict.fromkeys(("extract_surface", "cells_dict"), read_object))


def from_vectors(
    surface: Surface,
    vectors: ArrayLike,
    degree: int,
    *,
    nonfinite: str = "error",
    off_surface: str = "error",
) -> Field:
    """Make a field from one member vector for each face or vertex.

    Vectors slightly off the surface are rotated into it and keep their length. Values of vertices are
    averaged onto the faces as RoSys (sets of N equivalent vectors).

    Parameters
    ----------
    surface : Surface
    vectors : (F, 3), (V, 3) or (V, 2) array_like
        Zero where the field is undefined. If there are as many faces as vertices, each vector belongs to a
        face. Rows of two numbers are x and y if all vertices have the same z. Otherwise they are vectors at
        the vertices in the frames of geometry-central, as potpourri3d returns them. A `RosyWarning` says so.
    degree : int
        N, from 1 to 12: 1 for a vector field, 2 for a line field, 4 for a cross field.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    off_surface : {"error", "project", "undefined"}
        What to do about vectors that are more than 5 degrees (at vertices, 20) off the surface: raise an
        error if more than 1 percent of the vectors are, always rotate them into the surface, or treat them
        as undefined.

    Raises
    ------
    RosyError
        If there is not one vector for each face or each vertex, a vector is not finite, or vectors do not lie
        on the surface.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> wind = rf.from_vectors(torus, torus.face_frames[0], degree=1)
    >>> wind.degree
    1
    """
    array, source = np.asarray(vectors, dtype=np.float64), f"{surface.name}: vectors"
    domain = None
    policy = VectorPolicy(nonfinite, off_surface).checked()
    if array.shape[1:] == (2,):
        array, domain, note = in_space(surface, array, source)
        warn(f"{source}: {note}")
    return Field.of(surface, validated_field(surface, array, degree, source, policy, domain))


def from_angles(
    surface: Surface, angles: ArrayLike, degree: int, *, magnitude: ArrayLike = 1.0
) -> Field:
    """Make a field from the angle of a member on each face.

    Parameters
    ----------
    surface : Surface
    angles : (F,) array_like
        Radians, counter-clockwise about the normal. The angle 0 is the x axis of `Surface.face_frames`,
        which is along the first edge of the face, as in ``igl.local_basis``.
    degree : int
        N, from 1 to 12.
    magnitude : (F,) array_like or float
        Length of the members.

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
    field = Field.of(surface, RosyField(degree, vectors))
    return field if np.all(np.asarray(magnitude) == 1.0) else field.with_magnitude(magnitude)


def from_representation(surface: Surface, representation: ArrayLike, degree: int) -> Field:
    """Make a field from a complex number r exp(i N t) on each face.

    Parameters
    ----------
    surface : Surface
    representation : (F,) array_like of complex
        The magnitude is r, the length of the members. The phase is N t, where t is the angle of a member to
        the x axis of `Surface.face_frames`.
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


def from_directions(
    surface: Surface,
    directions: ArrayLike,
    degree: int | None = None,
    *,
    nonfinite: str = "error",
    off_surface: str = "error",
) -> Field:
    """Make a field from N directions for each face or vertex. They need not be at equal angles.

    Parameters
    ----------
    surface : Surface
    directions : (F, N, 3) or (V, N, 3) array_like
        The N directions of a face or vertex may be in any order. If one of them is zero, the field is
        undefined there. For a cross, two directions are enough: one along each of its two lines.
    degree : int, optional
        N. By default the number of directions; two directions that are nowhere opposite are a cross, of
        degree 4, and a `RosyWarning` says so.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    off_surface : {"error", "project", "undefined"}
        What to do about directions off the surface: raise an error if they are many, always rotate them into
        the surface, or treat them as undefined; see `from_vectors`.

    Raises
    ------
    RosyError
        For the same reasons as `from_vectors`.

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
    source = f"{surface.name}: directions"
    if array.ndim != 3 or array.shape[2] != 3:
        raise RosyError(f"{source} must have the shape (F, N, 3), not {array.shape}")
    policy = VectorPolicy(nonfinite, off_surface).checked()
    given, array = array.shape[1], with_opposites(array, degree)
    if degree is None and array.shape[1] > given:
        warnings.warn(f"{source}: {HALF_CROSS_NOTE}", RosyWarning, stacklevel=2)
    elif degree not in (None, array.shape[1]):
        raise RosyError(f"{source} are {given} for each row, not {degree}")
    return Field.of(surface, validated_directions(surface, array, source, policy))


def from_tensors(surface: Surface, tensors: ArrayLike, *, nonfinite: str = "error") -> Field:
    """Make a field of degree 4 from the eigenvectors of a symmetric tensor on each face.

    The tensors are projected to the faces. The major and the minor directions are two families of lines.
    Their lengths are the absolute values of the two eigenvalues in the plane of the face. Where these
    eigenvalues are equal, the field is undefined.

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
    array, source = np.array(tensors, dtype=np.float64), f"{surface.name}: tensors"
    if array.shape != (surface.face_count, 3, 3):
        count = surface.face_count
        raise RosyError(f"{source} must have the shape ({count}, 3, 3), not {array.shape}")
    policy = VectorPolicy(nonfinite).checked()
    apply_nonfinite_policy(array, source, "face", policy.nonfinite)
    return Field.of(surface, tensor_field(surface, array))


def from_array(
    surface: Surface,
    name: str | None = None,
    degree: int | None = None,
    *,
    nonfinite: str = "error",
    off_surface: str = "error",
) -> Field:
    """Make a field from an array of `Surface.vertex_data` or `Surface.face_data`.

    The number of components in each row of the array determines what they mean:

    | components | meaning |
    | ---------- | ------- |
    | 2 | on a mesh with constant z: a vector, z is 0 |
    | 3 | a vector: one member of the field |
    | 6 | a symmetric tensor, in VTK's order XX, YY, ZZ, XY, YZ, XZ |
    | 9 | a symmetric tensor, 3 x 3 |
    | 12, 15, ... 36 | all N directions, 3 components each |

    Vectors that are not tangent to the surface, such as velocities at the boundary of a volume, are
    replaced by their tangential components. A tensor gives the field of the two principal directions in
    each face. Values of vertices are averaged onto the faces.

    Parameters
    ----------
    surface : Surface
        From a file of a simulation, from the mesh of another library, or from a ``.ply`` file. There, three
        properties such as ``wind_x``, ``wind_y`` and ``wind_z`` are the array of vectors "wind".
    name : str, optional
        Name of the array; not needed for files that `Field.save` wrote. If the vertices and the faces both
        have an array NAME, "point:NAME" is the array of the vertices, and "cell:NAME" the array of the faces.
        By default, the only array that can be a field is used. Integers and normals cannot be a field.
    degree : int, optional
        N, from 1 to 12; by default 1 for an array of vectors. Tensors have degree 4.
    nonfinite : {"error", "zero"}
        Raise an error if a number is not finite, or treat the vector or tensor as undefined.
    off_surface : {"error", "project", "undefined"}
        What to do about vectors off the surface, as in `from_vectors`. But if a row has one vector, "error"
        raises no error: if too many vectors are off the surface, all of them are replaced by their tangential
        components, and a `RosyWarning` says so.

    Raises
    ------
    RosyError
        If there is no such array, no name is given and several arrays can be a field, the array holds scalars
        or tensors that are not symmetric, its degree is not `degree`, or a number is not finite.

    Examples
    --------
    >>> surface = rf.Surface("flow.vtu")  # doctest: +SKIP
    >>> velocity = rf.from_array(surface, "velocity")  # doctest: +SKIP
    >>> stress = rf.from_array(rf.Surface(pyvista.read("beam.vtu")), "stress")  # doctest: +SKIP
    """
    arrays = SurfaceArrays(surface.name, surface, surface.vertex_data, surface.face_data)
    policy = VectorPolicy(nonfinite, off_surface).checked()
    return Field.of(surface, array_field(arrays, name, degree, policy))


def read_field(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    surface: Surface,
    degree: int | None = None,
    *,
    nonfinite: str = "error",
    off_surface: str = "error",
    mesh: str | os.PathLike[str] | None = None,
) -> Field:
    """Read a field from a file.

    Parameters
    ----------
    path : path-like, or sequence of path-like
        ``.rosy``, ``.rawfield``, ``.obj`` (of fieldgen), ``.txt``, ``.vec``, ``.csv``, ``.npy``, ``.npz``,
        ``.dmat``, ``.crossfield``, ``.ffield``, ``.vfield`` or ``.om``. Several files with one vector per row
        are the directions of one field, for example the two directions of a cross.
    surface : Surface
    degree : int, optional
        The required degree. By default, any degree is accepted. A file that states no degree has degree 4.
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    off_surface : {"error", "project", "undefined"}
        What to do about vectors off the surface: raise an error if they are many, always rotate them into the
        surface, or treat them as undefined; see `from_vectors`.
    mesh : path-like, optional
        The mesh file of the field, if it is another mesh than `surface`. The field is then transferred
        by position.

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
    policy = VectorPolicy(nonfinite, off_surface).checked()
    loaded = load_field(path, surface, degree, policy, mesh=mesh)
    warn(loaded.note)
    return Field.of(surface, loaded.field)


def warn(note: str, stacklevel: int = 3) -> None:
    """Issue a `RosyWarning` with a note, unless the note is empty.

    By default (`stacklevel` 3), the warning refers to the line that called the caller of this function.
    """
    if note:
        warnings.warn(note, RosyWarning, stacklevel=stacklevel)
