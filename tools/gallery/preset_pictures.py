"""The preview pictures of the shipped presets, which are part of the zip."""

from __future__ import annotations

import numpy as np
from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.presets.preview import draw_preview
from rosy_addon.presets.store import preset_files, preview_path, read_preset

from .sheet import display

#: Of a picture of few hues; and between tones of a channel, where many hues blend. Neither is to
#: be seen, and both make the files a third as large.
COLORS, TONE = 64, 8


def write() -> None:
    """Draw them all."""
    for path in preset_files().values():
        _small(read_preset(path).look).save(preview_path(path), optimize=True)


def _small(look: Look) -> Image.Image:
    shown = display(draw_preview(look))
    if look.noise == "colour":
        return Image.fromarray(np.minimum(np.rint(shown / TONE) * TONE, 255).astype(np.uint8))
    few = Image.Quantize.MEDIANCUT
    return Image.fromarray(shown).quantize(COLORS, few, kmeans=2, dither=Image.Dither.NONE)
