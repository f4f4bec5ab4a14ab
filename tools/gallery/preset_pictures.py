"""The preview pictures of the shipped presets, which are part of the zip."""

from __future__ import annotations

from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.presets.preview import draw_preview
from rosy_addon.presets.store import preset_files, preview_path, read_preset

from .sheet import display

#: Sizes of the palettes of pictures with few hues, and with noise of many. They are not visible
#: at the size of previews, and reduce the files to a third.
TONES, COLORS = 32, 96


def write() -> None:
    """Draw all pictures."""
    for path in preset_files().values():
        _small(read_preset(path).look).save(preview_path(path), optimize=True)


def _small(look: Look) -> Image.Image:
    shown = Image.fromarray(display(draw_preview(look)))
    size = COLORS if look.noise == "colour" else TONES
    return shown.quantize(size, Image.Quantize.MEDIANCUT, kmeans=4, dither=Image.Dither.NONE)
