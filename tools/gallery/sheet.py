"""Compose sheets of labeled pictures, and draw on pictures. Pictures are scaled only by whole factors."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

from rosy_addon.core.color import to_display

#: Largest width of a sheet that a page shows unscaled, in pixels.
MAX_WIDTH = 820

GAP, LABEL_SIZE, LINE = 16, 13, 18
INK, PAPER = (40, 40, 40), (255, 255, 255)


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture, (H, W, 3) uint8 with rows from the top, and its label."""

    picture: np.ndarray
    label: str = ""


def font(size: int = LABEL_SIZE) -> ImageFont.FreeTypeFont:
    """Return the font of the labels. It comes with matplotlib."""
    return ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size)


def display(rgba: np.ndarray) -> np.ndarray:
    """Composite an (H, W, 4) `Picture.rgba` over white, and return (H, W, 3) uint8 with rows from the top."""
    alpha = rgba[..., 3:]
    shown = to_display(rgba[..., :3] * alpha + (1 - alpha))
    return np.rint(shown[::-1] * 255).astype(np.uint8)


def gray(tone: np.ndarray) -> np.ndarray:
    """Convert (H, W) or (H, W, K) display values, bottom row first, to (H, W, 3) uint8, top row first."""
    tone = tone[..., None] if tone.ndim == 2 else tone
    shown = np.rint(np.clip(tone[::-1], 0, 1) * 255).astype(np.uint8)
    return np.repeat(shown, 3 // shown.shape[2], axis=2)


def magnified(picture: np.ndarray, factor: int) -> np.ndarray:
    """Enlarge a picture by a whole factor."""
    height, width = picture.shape[:2]
    large = (width * factor, height * factor)
    return np.asarray(Image.fromarray(picture).resize(large, Image.Resampling.BICUBIC))


def outlined(
    picture: np.ndarray, box: tuple[int, int, int, int], color: tuple[int, int, int]
) -> np.ndarray:
    """Draw a rectangle (left, top, right, bottom) on a picture."""
    image = Image.fromarray(picture)
    left, top, right, bottom = box
    outline = (left - 2, top - 2, right + 1, bottom + 1)
    ImageDraw.Draw(image).rectangle(outline, outline=color, width=2)
    return np.array(image)


def inset(
    picture: np.ndarray, small: np.ndarray, left: int, top: int, color: tuple[int, int, int]
) -> np.ndarray:
    """Put a small framed picture into a picture."""
    picture = picture.copy()
    height, width = small.shape[:2]
    picture[top : top + height, left : left + width] = small
    return outlined(picture, (left, top, left + width, top + height), color)


def dotted(picture: np.ndarray, x: float, y: float, color: tuple[int, int, int]) -> np.ndarray:
    """Draw a dot on a picture, at (x, y) in pixels from the upper left."""
    size = 4
    disc = Image.new("L", (2 * size + 3,) * 2)
    disc = disc.resize((disc.width * 8,) * 2)
    ImageDraw.Draw(disc).ellipse((8, 8, disc.width - 9, disc.height - 9), fill=255)
    disc = disc.resize((2 * size + 3,) * 2, Image.Resampling.BOX)
    image = Image.fromarray(picture)
    corner = (round(x) - size - 1, round(y) - size - 1)
    image.paste(Image.new("RGB", disc.size, color), corner, disc)
    return np.array(image)


def sheet(rows: Sequence[Sequence[Panel]]) -> Image.Image:
    """Compose rows of panels with their labels as one image.

    Raises
    ------
    ValueError
        If a row is wider than `MAX_WIDTH`.
    """
    images, top = [], 0
    sheet_width = 0
    for row in rows:
        left = 0
        height = max(panel.picture.shape[0] for panel in row)
        lines = 1
        for panel in row:
            width = panel.picture.shape[1]
            text = _wrapped(panel.label, width)
            lines = max(lines, len(text))
            images.append((panel.picture, text, left, top, top + height + 4))
            left += width + GAP
        sheet_width = max(sheet_width, left - GAP)
        top += height + 4 + lines * LINE + GAP
    if sheet_width > MAX_WIDTH:
        raise ValueError(f"a row of panels is {sheet_width} pixels wide, {MAX_WIDTH} at most")
    image = Image.new("RGB", (sheet_width, top - GAP + 4), PAPER)
    pen = ImageDraw.Draw(image)
    for picture, text, left, upper, below in images:
        image.paste(Image.fromarray(picture), (left, upper))
        for index, line in enumerate(text):
            pen.text((left, below + index * LINE), line, INK, font())
    return image


def _wrapped(text: str, width: int) -> list[str]:
    """Wrap text into lines no wider than a picture."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font().getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines or [""]


def save(image: Image.Image, path: Path) -> None:
    """Write a .png file: gray if the image has no color, otherwise with a palette of 256 colors."""
    pixels = np.asarray(image)
    if (pixels == pixels[..., :1]).all():
        image = image.convert("L")
    else:
        image = image.quantize(256, Image.Quantize.MEDIANCUT, kmeans=2, dither=Image.Dither.NONE)
    image.save(path, optimize=True)


def chart(figure, width: int, height: int) -> np.ndarray:
    """Render a matplotlib figure as (height, width, 3) uint8."""
    figure.set_size_inches(width / 100, height / 100)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=100, format="png", metadata={"Software": None})
    return np.asarray(Image.open(buffer).convert("RGB"))
