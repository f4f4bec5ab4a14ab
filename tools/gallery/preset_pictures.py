"""Draw the preview pictures of the presets that come with RoSy, which are part of the zip."""

from __future__ import annotations

from PIL import Image

from rosy_addon.compositor.look import Look, colors_magnitude
from rosy_addon.preset_files.preview import draw_preview
from rosy_addon.preset_files.store import preset_files, preview_path, read_preset

from .sheet import display

#: Numbers of palette colors: for pictures in tones of one hue, with colors for the magnitude, and with noise
#: of many hues. At the size of previews the palettes are not visible. They reduce the files to a quarter.
TONES, MAGNITUDE_COLORS, NOISE_COLORS = 16, 32, 64


def write() -> None:
    """Draw all pictures."""
    for path in preset_files().values():
        _small(read_preset(path).look).save(preview_path(path), optimize=True)


def _small(look: Look) -> Image.Image:
    shown = Image.fromarray(display(draw_preview(look)))
    size = TONES
    if colors_magnitude(look):
        size = MAGNITUDE_COLORS
    if look.hue == "noise":
        size = NOISE_COLORS
    return shown.quantize(size, Image.Quantize.MEDIANCUT, kmeans=4, dither=Image.Dither.NONE)
