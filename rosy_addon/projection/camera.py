"""A camera as two matrices and a frame of pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import RosyError

#: The longest side of a picture, in pixels.
MAX_SIZE = 16384


def check_size(width: int, height: int) -> tuple[int, int]:
    """Return the size of a picture as two ints.

    Raises
    ------
    RosyError
        If a side is not a whole number of pixels from 1 to `MAX_SIZE`.
    """
    for side in (width, height):
        if int(side) != side or not 1 <= side <= MAX_SIZE:
            raise RosyError(f"size {width}x{height}: a side must be from 1 to {MAX_SIZE} pixels")
    return int(width), int(height)


@dataclass(frozen=True, eq=False)
class Camera:
    """Where the eye is and how it sees.

    Camera space is Blender's: x right, y up, looking down -z, in Blender units. Pixels are counted
    from the lower left: pixel (column c, row r) has its centre at (c + 0.5, r + 0.5) and the flat
    index ``r * width + c``.

    Attributes
    ----------
    view : (4, 4) float64 ndarray
        World to camera space, rigid.
    projection : (4, 4) float64 ndarray
        Camera to clip space, OpenGL's convention: visible is -w <= x, y, z <= w. Perspective if
        ``projection[3, 2]`` is not 0, orthographic otherwise.
    width, height : int
        Size of the picture in pixels.
    name : str
        For messages and for naming what is baked.
    """

    view: np.ndarray
    projection: np.ndarray
    width: int
    height: int
    name: str = "camera"

    def __post_init__(self) -> None:
        check_size(self.width, self.height)

    @property
    def is_perspective(self) -> bool:
        """Whether rays meet in the eye."""
        return bool(self.projection[3, 2] != 0.0)
