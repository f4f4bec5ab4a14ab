"""What an N-RoSy field is: one member vector a face, and its degree.

And what a field of N directions is that are free: a RoSy and by how much they deviate from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import RosyError

#: Degrees that can be drawn. Past 6 or so directions get hard to tell apart (the paper's Figure 10).
MAX_DEGREE = 12


def check_degree(degree: int) -> int:
    """Return `degree` as an int.

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

    The N member vectors of a face are the rotations of the stored one by 2 pi k / N about the
    face normal, so which of them is stored makes no difference.

    Attributes
    ----------
    degree : int
        N, from 1 to `MAX_DEGREE`.
    vectors : (F, 3) float64 ndarray
        One member vector a face, in the space of the surface (object space). Its length is the
        magnitude rho; a zero vector says that the field is undefined on that face.
    deviations : (F, N) complex128 ndarray or None
        Of directions that are not a RoSy: direction k is member k, counter-clockwise from the
        stored one, turned by the phase and as many times as long as the modulus. None of a RoSy.
    families : int
        How many lines are told apart by the stored member: 1 if it could be any of them, or as many
        as there are, as of a tensor's 2, the major and the minor.
    given : (F, N, 3) float64 ndarray or None
        The directions as they came, in their order, if the field was made of such: for those who
        write them again.

    See Also
    --------
    rosy_addon.field.directions : Where fields of free directions are made.
    """

    degree: int
    vectors: np.ndarray
    deviations: np.ndarray | None = None
    families: int = 1
    given: np.ndarray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "degree", check_degree(self.degree))
        vectors = np.ascontiguousarray(self.vectors, dtype=np.float64)
        if vectors.ndim != 2 or vectors.shape[1] != 3:
            raise RosyError(f"a field holds one vector a face, (F, 3), not {vectors.shape}")
        object.__setattr__(self, "vectors", vectors)
        if self.deviations is None:
            return
        deviations = np.ascontiguousarray(self.deviations, dtype=np.complex128)
        if deviations.shape != (len(vectors), self.degree):
            raise RosyError(f"deviations are (F, N) numbers, not {deviations.shape}")
        object.__setattr__(self, "deviations", deviations)

    @property
    def magnitude(self) -> np.ndarray:
        """(F,) float64: rho, the common length of the members."""
        return np.linalg.norm(self.vectors, axis=1)
