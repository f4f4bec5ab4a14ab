"""Draw the pictures of docs/listing, for the page of the extension on Blender's Extensions platform."""

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from rosy_addon.compositor.look import Look
from rosy_addon.core.color import from_hex
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.generate import generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.projection.gbuffer import MeshInstance

from .page import ROOT
from .shapes import sphere, suzanne, torus, triple_torus
from .sheet import display, font
from .solid import (
    around_field,
    even_curvature,
    harmonic_field,
    icosahedron_axes,
    picture_on_paper,
    ring_curvature,
)

FOLDER = ROOT / "docs" / "listing"

#: Size of the pictures. The platform shows the featured picture at 16:9, and asks for at least this size.
SIZE = (1920, 1080)

#: Vertical bands of the featured picture, from the left: preset, color behind the model, and position of the
#: right edge at half the height of the picture, as a fraction of its width.
BANDS = (
    ("engraving", "#f6efdf", 0.39),
    ("plaid", "#b4c3c9", 0.58),
    ("white-on-black", "#0c0c10", 1.1),
)
#: Azimuth and elevation of the featured picture in degrees. They are chosen so that each eye is in another
#: band.
VIEW = (-14.0, 4.0)
#: Slope of the edges between bands: pixels to the right per pixel upward.
SLANT = 0.22

#: Settings in pixels that are enlarged, and the factor, so that lines are visible when the picture is shown
#: small.
LENGTHS = ("length", "line_width", "line_distance", "high_pass", "outline", "overshoot")
ENLARGED = 1.6

#: Looks of the picture of fields: gray streaks, and colored streaks that look woven.
STREAKS = Look(length=80, line_width=2.6, gain=2.8, shading=0.85, supersampling=2)
WEAVE = STREAKS.with_settings({"hue": "noise", "line_width": 4.0, "gain": 3.0})

#: Font size of the captions in pixels, and their color.
CAPTION, INK = 34, (40, 40, 40)


def write() -> None:
    """Draw and save the pictures."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    monkey = suzanne()
    form = generate(monkey, "form", 4)
    _save(_featured(monkey, form), "featured", 256)
    _save(_presets(monkey, form), "presets", 128)
    _save(_fields(monkey), "fields", 96)


def _featured(monkey: Surface, form: RosyField) -> Image.Image:
    """Draw Suzanne in three presets, one in each band of the picture."""
    canvas = Image.new("RGB", SIZE)
    left = -1.0
    for name, background, right in BANDS:
        look = load_preset(name).look
        settings = {key: getattr(look, key) * ENLARGED for key in LENGTHS}
        settings["length"] = round(settings["length"])
        look = look.with_settings({**settings, "supersampling": 2})
        shown = _draw(monkey, form, look, VIEW, SIZE, 0.03, background)
        canvas.paste(Image.fromarray(shown), (0, 0), _band(left, right))
        left = right
    return canvas


def _band(left: float, right: float) -> Image.Image:
    """Return the mask of a slanted band, with antialiased edges."""
    width, height = SIZE
    across, down = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    position = across + (down - height / 2) * SLANT
    cover = np.clip(position - left * width + 0.5, 0, 1)
    # The next band covers the right edge.
    cover *= position < right * width + 1
    return Image.fromarray(np.rint(cover * 255).astype(np.uint8))


def _presets(monkey: Surface, form: RosyField) -> Image.Image:
    """Draw Suzanne in every preset, with the names of the presets."""
    curved = curvature_field(monkey, 4)
    shots = []
    for name in preset_keys():
        preset = load_preset(name)
        look = preset.look.with_settings({"supersampling": 2})
        field = form if look.hue != "magnitude" else curved
        paper = look.paper_color if look.ink != "soft" else "#ffffff"
        shots.append((monkey, field, look, (-26.0, 6.0), preset.name, paper))
    return _labeled(shots, 4, CAPTION * 3 // 4, CAPTION + 14, 0.04)


def _fields(monkey: Surface) -> Image.Image:
    """Draw fields of several degrees from 1 to 6 on several shapes, labeled with the degrees."""
    rings, ring, ball = triple_torus(), torus(), sphere(64)
    icosahedral = harmonic_field(ball, 6, icosahedron_axes())
    shots = (
        (monkey, generate(monkey, "smoothest", 1), STREAKS, (-26.0, 6.0), "1: vectors"),
        (monkey, generate(monkey, "smoothest", 2), STREAKS, (-26.0, 6.0), "2: lines"),
        (monkey, even_curvature(monkey, 4), STREAKS, (-26.0, 6.0), "4: crosses"),
        (rings, ring_curvature(rings), WEAVE, (14.0, 52.0), "4, with colored noise"),
        (ball, icosahedral, STREAKS, (20.0, 20.0), "6"),
        (ring, around_field(ring, 6), WEAVE, (20.0, 42.0), "6, with colored noise"),
    )
    named = [(*shot, f"N = {text}", "#ffffff") for *shot, text in shots]
    return _labeled(named, 3, CAPTION, CAPTION + 26, 0.02)


def _labeled(
    shots: Sequence[tuple], columns: int, font_size: int, caption: int, margin: float
) -> Image.Image:
    """Draw labeled pictures in a grid.

    A shot has surface, field, look, angles, label and background color.
    """
    width, height = SIZE[0] // columns, SIZE[1] // -(-len(shots) // columns)
    canvas = Image.new("RGB", SIZE, (255, 255, 255))
    pen = ImageDraw.Draw(canvas)
    for index, (*shot, text, background) in enumerate(shots):
        shown = _draw(*shot, (width, height - caption), margin, background)
        left, top = index % columns * width, index // columns * height
        canvas.paste(Image.fromarray(shown), (left, top))
        middle = (left + width / 2, top + height - caption / 2)
        pen.text(middle, text, INK, font(font_size), anchor="mm")
    return canvas


def _draw(
    surface: Surface,
    field: RosyField,
    look: Look,
    angles: tuple[float, float],
    size: tuple[int, int],
    margin: float,
    background: str,
) -> np.ndarray:
    """Draw a field on a plain background. Return (H, W, 3) uint8 with rows from the top."""
    instance = MeshInstance(surface, np.eye(4), field)
    rgba = picture_on_paper(instance, look, angles, size, margin)
    color = np.rint(np.asarray(from_hex(background)) * 255)
    alpha = rgba[::-1, :, 3:]
    opaque = display(np.concatenate([rgba[..., :3], np.ones_like(rgba[..., 3:])], axis=-1))
    return np.rint(opaque * alpha + color * (1 - alpha)).astype(np.uint8)


def _save(image: Image.Image, name: str, colors: int) -> None:
    """Write a .png file with a palette of `colors` colors."""
    image = image.quantize(colors, Image.Quantize.MEDIANCUT, kmeans=2, dither=Image.Dither.NONE)
    image.save(FOLDER / f"{name}.png", optimize=True)
