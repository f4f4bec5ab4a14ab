"""`RosyField`: the degree N of an N-RoSy field and one vector for each face.

On each face, an N-RoSy (N-way rotational symmetry) has N *members*: vectors that are rotations of each
other by 2 pi / N. Storing one of them is enough. A field of N directions that are not rotationally
symmetric is stored as a RoSy field and the ratios of its directions to the members.
"""

from dataclasses import dataclass

import numpy as np

from ..core.errors import RosyError

#: Largest degree N that is supported. Above a degree of about 6, the directions of a field are hard to
#: distinguish in pictures.
MAX_DEGREE = 12


def check_degree(degree: int) -> int:
    """Return `degree` as an int, after checking its range.

    Raises
    ------
    RosyError
        If the degree is not a whole number from 1 to `MAX_DEGREE`.
    """
    if isinstance(degree, bool) or int(degree) != degree or not 1 <= degree <= MAX_DEGREE:
        raise RosyError(f"degree {degree} is not a whole number from 1 to {MAX_DEGREE}")
    return int(degree)


@dataclass(frozen=True, eq=False)
class RosyField:
    """An N-way rotational symmetry (N-RoSy) field on F faces.

    One vector is stored for each face. The N *members* of the face are the rotations of this vector by
    2 pi k / N about the face normal. For a RoSy it makes no difference which member is stored.

    Attributes
    ----------
    degree : int
        N, from 1 to `MAX_DEGREE`.
    vectors : (F, 3) float64 ndarray
        One member vector for each face, in object space. Its length is the magnitude rho. The field
        is undefined on faces with a zero vector.
    direction_ratios : (F, N) complex128 ndarray or None
        None for a RoSy. Otherwise the field has directions that deviate from the members: direction k is
        member k, rotated by the phase of ratio k and scaled by its modulus. Members are counted
        counter-clockwise from the stored one.
    family_count : int
        1 if the stored member may be any of the members. Otherwise its direction is in the same family on
        all faces, and this is the number of families. A tensor field has 2: the major and the minor
        directions. (Two opposite directions are in the same family.)
    source_directions : (F, N, 3) float64 ndarray or None
        The input directions in their original order, if the field was made from directions. They are
        unmodified, except that they are zero on faces with values that are not finite. They are written
        to files instead of recomputed directions.

    See Also
    --------
    rosy_addon.field.directional_field : Make fields from N directions.
    """

    degree: int
    vectors: np.ndarray
    direction_ratios: np.ndarray | None = None
    family_count: int = 1
    source_directions: np.ndarray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "degree", check_degree(self.degree))
        vectors = np.ascontiguousarray(self.vectors, dtype=np.float64)
        if vectors.ndim != 2 or vectors.shape[1] != 3:
            raise RosyError(f"a field needs one vector per face, (F, 3), not {vectors.shape}")
        object.__setattr__(self, "vectors", vectors)
        if self.direction_ratios is None:
            return
        direction_ratios = np.ascontiguousarray(self.direction_ratios, dtype=np.complex128)
        if direction_ratios.shape != (len(vectors), self.degree):
            raise RosyError(
                f"direction ratios must have the shape (F, N), not {direction_ratios.shape}"
            )
        object.__setattr__(self, "direction_ratios", direction_ratios)

    @property
    def magnitude(self) -> np.ndarray:
        """(F,) float64: rho, the common length of the members of each face."""
        return np.linalg.norm(self.vectors, axis=1)

    def check_rosy(self, name: str) -> None:
        """Raise a `RosyError` if the directions are not a RoSy; `name` is the mesh name for the message."""
        if self.direction_ratios is not None:
            raise RosyError(
                f"{name}: only RoSy fields can be changed, but the directions of this field are not a RoSy"
            )
