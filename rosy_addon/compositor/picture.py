"""`Picture`: the finished image of a field."""

import os
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..annotation.singularity_marks import SingularityMarks
from ..core.errors import RosyError
from ..core.file_io import write_bytes
from ..image_io.png import png_bytes, to_srgb_uint8


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """An image of a field. A notebook shows it, and `numpy.asarray` makes it an array.

    The array is (H, W, 4) uint8, sRGB with straight alpha, the top row first, as
    ``matplotlib.pyplot.imshow`` and ``PIL.Image.fromarray`` take it.

    Attributes
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear, not premultiplied, the bottom row first, as in Blender. Alpha is the fraction of the
        pixel in which a field is visible. If the paper is not opaque, alpha is multiplied by the opacity of
        ink and paper.
    spread : (H, W) float32 ndarray or None
        The fourth channel of `ink_thresholds.threshold_pixels`, if the picture has thresholds of ink in place
        of colors. The alpha of `rgba` is then the fraction of the pixel in which a field is visible. None for
        colors.
    color_range : (float, float) or None
        Values of the first and the last color of the color map. None if the look has no color map, or if
        fields of different degrees have different ranges.
    marks : SingularityMarks or None
        The singularities that are drawn over the picture as dots. None if dots are not drawn.
    line_count : int
        The largest number of lines (pairs of opposite directions of a field) through a point; 0 if the
        picture is from a graphics card.

    Examples
    --------
    >>> import numpy as np
    >>> import rosyfields as rf
    >>> picture = rf.render(rf.Surface("torus.obj"), size=(64, 48))
    >>> np.asarray(picture).shape
    (48, 64, 4)
    >>> picture.save("torus.png")
    """

    rgba: NDArray[np.float32]
    spread: NDArray[np.float32] | None = None
    color_range: tuple[float, float] | None = None
    marks: SingularityMarks | None = None
    line_count: int = 0

    def __repr__(self) -> str:
        return f"<Picture: {self.rgba.shape[1]} x {self.rgba.shape[0]} pixels>"

    def __array__(
        self, dtype: np.dtype[Any] | None = None, copy: bool | None = None
    ) -> NDArray[Any]:
        if copy is False:
            raise ValueError("a Picture has no array of display values that could be shared")
        array = to_srgb_uint8(self.rgba[::-1])
        return array if dtype is None else array.astype(dtype)

    def _repr_png_(self) -> bytes:
        return png_bytes(self.rgba)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an 8-bit ``.png`` file.

        Raises
        ------
        RosyError
            If the name does not end in ``.png``, or the file cannot be written.
        """
        check_png_path(path)
        write_bytes(path, png_bytes(self.rgba), follow_links=True)


def check_png_path(path: str | os.PathLike[str]) -> None:
    """Raise a `RosyError` if the name of a file does not end in ``.png``."""
    if Path(path).suffix.lower() != ".png":
        raise RosyError(f"{path}: the name of the file must end in .png")


def common_color_range(ranges: Collection[tuple[float, float]]) -> tuple[float, float] | None:
    """Return `Picture.color_range`: the range if fields of all degrees have the same one, else None.

    `ranges` are the ranges of the magnitudes of the fields of each degree.
    """
    return min(ranges) if len(set(ranges)) == 1 else None
