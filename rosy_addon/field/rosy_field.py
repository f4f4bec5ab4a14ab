"""The N-RoSy field of a surface: its degree and one member vector for each face.

A field of N directions that are not rotationally symmetric is stored as a RoSy field and the ratios
of its directions to the members.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core.errors import RosyError

#: Largest degree N that is supported. The directions of a field are hard to distinguish above about
#: 6 (Figure 10 of the paper).
MAX_DEGREE = 12


def check_degree(degree: int) -> int:
    """Return `degree` as an int, after checking its range.

    Raises
    ------
    RosyError
        If it is not a whole number from 1 to `MAX_DEGREE`.
    """
    if isinstance(degree, bool) or int(degree) != degree or not 1 <= degree <= MAX_DEGREE:
        raise RosyError(f"degree {degree} is not a whole number from 1 to {MAX_DEGREE}")
    return int(degree)


@dataclass(frozen=True, eq=False)
class RosyField:
    """An N-RoSy field on the faces of a surface.

    The N member vectors of a face are the rotations of the stored one by 2 pi k / N about the face
    normal. For a RoSy it makes no difference which member is stored.

    Attributes
    ----------
    degree : int
        N, from 1 to `MAX_DEGREE`.
    vectors : (F, 3) float64 ndarray
        One member vector for each face, in object space. Its length is the magnitude rho. The field
        is undefined on faces with a zero vector.
    direction_ratios : (F, N) complex128 ndarray or None
        None for a RoSy. Otherwise direction k is member k (counted counter-clockwise from the
        stored one) rotated by the phase of ratio k and scaled by its modulus.
    family_count : int
        Number of line families that the stored member distinguishes: 1 if it may be on any line,
        otherwise the number of lines. A tensor field has 2: the major and the minor directions.
    source_directions : (F, N, 3) float64 ndarray or None
        The input directions in their original order, if the field was made from directions: those
        of faces with values that are not finite are zero, all others unmodified. Writers use them
        to reproduce the input.

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
        """(F,) float64: rho, the common length of the members."""
        return np.linalg.norm(self.vectors, axis=1)

    def check_rosy(self, name: str) -> None:
        """Raise an error, which names the mesh, if the directions are not a RoSy."""
        if self.direction_ratios is not None:
            raise RosyError(
                f"{name}: only RoSy fields can be changed, but the directions of this field are not a RoSy"
            )
