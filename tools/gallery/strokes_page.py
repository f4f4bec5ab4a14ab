"""Draw the pictures of docs/strokes.md."""

import numpy as np
from PIL import Image, ImageDraw

from rosy_addon.compositor.shading import lights_of
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.stroke_set import Strokes
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.visibility import project_to_pixels
from rosy_addon.projection.camera import Camera, orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance

from .page import IMAGES
from .shapes import suzanne
from .sheet import Panel, save, sheet

#: Side of a picture in pixels, and subpixels along each side of a pixel.
SIDE, SUPERSAMPLING = 402, 4

#: Width of the strokes in pixels.
WIDTH = 1.3

#: Styles of the strokes on Suzanne, by the label of the picture.
STYLES = {
    "evenly spaced, with an outline": StrokeStyle(spacing=6, outline=1.0),
    "by tone, of a lamp": StrokeStyle(spacing=4, outline=1.0, light="lamp"),
}


def write() -> None:
    """Draw and save the pictures."""
    surface = suzanne()
    instance = MeshInstance(
        surface, np.eye(4), generate(surface, GeneratorSettings("curvature", reach=0.1), 4)
    )
    camera = orbit_camera(surface.vertices, -26.0, 8.0, SIDE, SIDE, margin=0.03)
    panels = []
    for label, style in STYLES.items():
        strokes = draw_instances([instance], camera, style, lights=lights_of(style, ())).strokes
        panels.append(Panel(rasterize(strokes, camera), label))
    save(sheet([panels]), IMAGES / "strokes.png")


def rasterize(strokes: Strokes, camera: Camera) -> np.ndarray:
    """Draw strokes with a round black pen on white. Return (H, W, 3) uint8 with rows from the top."""
    pixels, _ = project_to_pixels(strokes.points, camera)
    pixels[:, 1] = camera.height - pixels[:, 1]
    pixels *= SUPERSAMPLING
    paper = Image.new("L", (camera.width * SUPERSAMPLING, camera.height * SUPERSAMPLING), 255)
    pen = ImageDraw.Draw(paper)
    radius = strokes.width * (WIDTH * SUPERSAMPLING / 2)
    for start, stop in zip(strokes.start[:-1].tolist(), strokes.start[1:].tolist(), strict=True):
        for point in range(start, stop):
            x, y, r = *pixels[point], radius[point]
            pen.ellipse((x - r, y - r, x + r, y + r), fill=0)
            if point > start:
                ends = [tuple(pixels[point - 1]), (x, y)]
                pen.line(ends, fill=0, width=max(round(r + radius[point - 1]), 1))
    small = paper.resize((camera.width, camera.height), Image.Resampling.BOX)
    return np.repeat(np.asarray(small)[..., None], 3, axis=2)
