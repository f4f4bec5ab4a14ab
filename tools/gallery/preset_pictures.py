"""The preview pictures of the shipped presets, which are part of the zip."""

from __future__ import annotations

import numpy as np
from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.presets.preview import draw_preview
from rosy_addon.presets.store import preset_files, preview_path, read_preset

from .sheet import display

#: Size of the palette of pictures with few hues, and step of the tones of others. Neither is
#: visible, and both reduce the files to a third.
COLORS, TONE = 64, 8


def write() -> None:
    """Draw all pictures."""
    for path in preset_files().values():
        _small(read_preset(path).look).save(preview_path(path), optimize=True)


def _small(look: Look) -> Image.Image:
    shown = display(draw_preview(look))
    if look.noise == "colour":
        return Image.fromarray(np.minimum(np.rint(shown / TONE) * TONE, 255).astype(np.uint8))
    method = Image.Quantize.MEDIANCUT
    return Image.fromarray(shown).quantize(COLORS, method, kmeans=2, dither=Image.Dither.NONE)
