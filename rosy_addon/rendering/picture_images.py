"""Convert pictures for images of Blender. Colors are extended past the silhouette of the surfaces."""

import numpy as np

from ..compositor.picture import Picture
from ..core.color import to_linear
from ..core.progress import progress, report
from ..image_io.image_data import ImageData, image_of_pixels
from .draw import bake_picture
from .view_input import ViewInput

#: Number of pixels by which colors are extended past the border of the covered area. The silhouette in a
#: render may differ slightly (other subdivision, filtering). There the render then still shows colors of the
#: picture.
BLEED_PIXELS = 4

#: Number of rows of pixels that are converted at once.
BLOCK_ROWS = 64

#: Label of the progress of the conversion.
STEP_LABEL = "converting the picture"

#: Color of pixels away from surfaces: the linear value of the sRGB gray 0.5.
NEUTRAL_GRAY = float(to_linear(np.array(0.5, dtype=np.float32)))

#: Fraction of the progress at which the conversion starts.
CONVERSION_START = 0.95


def draw_image(
    view: ViewInput, as_float: bool, keep_gbuffers: bool = True, workers: int = 0
) -> tuple[Picture, ImageData]:
    """Draw a picture with numpy, convert it to an image, and return both.

    Parameters
    ----------
    view : ViewInput
    as_float : bool
        Whether the image has linear values in single precision, instead of 8-bit sRGB.
    keep_gbuffers : bool
        Whether G-buffers are kept in the cache of this process.
    workers : int
        Number of processes that draw a large picture together. 0 means one per processor core.
    """
    with progress(0.0, CONVERSION_START):
        picture = bake_picture(view, keep_gbuffers, workers)
    with progress(CONVERSION_START, 1.0):
        return picture, picture_image(picture, as_float)


def picture_image(picture: Picture, as_float: bool) -> ImageData:
    """Convert a picture for an image of Blender, with colors extended past silhouettes; see `with_bleed`.

    Parameters
    ----------
    picture : Picture
        If it has thresholds of ink, `Picture.spread` is stored as the alpha of the image.
    as_float : bool
        Whether linear values in single precision are stored (for .exr), instead of 8-bit sRGB (.png).

    Returns
    -------
    ImageData
        The bytes of a PNG file, or an array of pixels if `as_float`.
    """
    with progress(0.0, 0.5):
        pixels = _bleed(picture.rgba)
    if picture.spread is not None:
        spread = picture.rgba.copy()
        spread[..., 0] = picture.spread
        with progress(0.5):
            spread = _bleed(spread)
        # Pixels far from surfaces get thresholds that show a medium tone.
        is_blank = spread[..., 3] == 0
        is_blank &= (pixels[..., :3] == NEUTRAL_GRAY).all(axis=2)
        pixels[..., 3] = spread[..., 0]
        pixels[is_blank] = (0.5, 0.5, 0.5, 1 / 3)
    with progress(0.5, 1.0, STEP_LABEL):
        return image_of_pixels(pixels, as_float, is_color=picture.spread is None)


def _bleed(rgba: np.ndarray) -> np.ndarray:
    """Return the result of `with_bleed` for a whole picture, computed a few rows at a time to save memory."""
    height = len(rgba)
    pixels = np.empty(rgba.shape, dtype=np.float32)
    for start in range(0, height, BLOCK_ROWS):
        report(start / height, STEP_LABEL)
        first = max(start - BLEED_PIXELS, 0)
        block = with_bleed(rgba[first : start + BLOCK_ROWS + BLEED_PIXELS])
        pixels[start : start + BLOCK_ROWS] = block[start - first :][:BLOCK_ROWS]
    return pixels


def with_bleed(rgba: np.ndarray) -> np.ndarray:
    """Extend the colors of a picture by `BLEED_PIXELS` pixels past the border of the covered area.

    Pixels farther outside become `NEUTRAL_GRAY`. Alpha is not changed: it is the coverage of the pixel.

    Parameters
    ----------
    rgba : (H, W, 4) float32 ndarray
        Linear RGBA, not premultiplied.

    Returns
    -------
    (H, W, 4) float32 ndarray
        The extended picture.
    """
    # Pad by one pixel, so that every pixel of the picture has eight neighbors.
    padded = np.pad(rgba, ((1, 1), (1, 1), (0, 0)))
    width = padded.shape[1]
    is_filled = padded[..., 3].ravel() > 0
    pixels = padded.reshape(-1, 4)
    pixels[~is_filled, :3] = NEUTRAL_GRAY
    is_inside = np.pad(np.ones(rgba.shape[:2], dtype=bool), 1).ravel()
    steps = (1, 0, -1)
    neighbor_offsets = [row * width + column for row in steps for column in steps if row or column]
    frontier = np.flatnonzero(is_filled)
    for _ in range(BLEED_PIXELS):
        is_adjacent = np.zeros_like(is_filled)
        for offset in neighbor_offsets:
            is_adjacent[frontier + offset] = True
        targets = np.flatnonzero(is_adjacent & ~is_filled & is_inside)
        total = np.zeros((len(targets), 3), dtype=np.float32)
        count = np.zeros((len(targets), 1), dtype=np.float32)
        for offset in neighbor_offsets:
            neighbor_filled = is_filled[targets + offset, None]
            total += pixels[targets + offset, :3] * neighbor_filled
            count += neighbor_filled
        pixels[targets, :3] = total / count
        is_filled[targets] = True
        frontier = targets
    return padded[1:-1, 1:-1].copy()
