"""Draw the preview pictures of the presets that come with RoSy, which are part of the zip."""

from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.preset_files.preview import draw_preview
from rosy_addon.preset_files.store import preset_files, preview_path, read_preset

from .sheet import display

#: Numbers of palette colors: for pictures in tones of one hue, and by the setting `hue` for others. At the size
#: of previews the palettes are not visible. They reduce the files to a quarter.
TONES, COLORS = 16, {"magnitude": 32, "noise": 64}


def write() -> None:
    """Draw all pictures."""
    for path in preset_files().values():
        _small(read_preset(path).look).save(preview_path(path), optimize=True)


def _small(look: Look) -> Image.Image:
    shown = Image.fromarray(display(draw_preview(look)))
    size = COLORS.get(look.hue, TONES)
    return shown.quantize(size, Image.Quantize.MEDIANCUT, kmeans=4, dither=Image.Dither.NONE)
