"""The pictures of the presets that come with RoSy, which lie beside them and are in the zip."""

from __future__ import annotations

from PIL import Image

from rosy_addon.compositor.presets import picture_path, preset_files, read_preset
from rosy_addon.compositor.preview import draw_preview

from .sheet import display

#: Of a picture: enough for streaks, at a fifth of the size that every colour would need.
COLOURS = 128


def write() -> None:
    """Draw them all."""
    for path in preset_files().values():
        shown = Image.fromarray(display(draw_preview(read_preset(path).look)))
        few = shown.quantize(COLOURS, Image.Quantize.MEDIANCUT, kmeans=2, dither=Image.Dither.NONE)
        few.save(picture_path(path), optimize=True)
