"""The page of presets: each one large on one model and small on two others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image

from rosy_addon.cli import UP, UPRIGHT
from rosy_addon.compositor.colour import from_hex, to_linear
from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.presets import Preset, load_preset, preset_names
from rosy_addon.field.generate import Recipe, generate
from rosy_addon.field.meshfile import read_mesh
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import Body
from rosy_addon.projection.project import project

from .looks_page import IMAGES
from .page import ROOT
from .shapes import suzanne
from .sheet import display

PAGE = ROOT / "docs" / "presets.md"

#: Where the meshes of others are, which are not passed on with this program.
MESHES = ROOT.parent / "shared" / "data" / "meshes"

#: Of the large picture and of the two small ones, pixels.
LARGE, SMALL = (820, 640), (410, 320)

#: Of the frame, free at each border.
MARGIN = 0.04

#: How far curvature reaches into what is hardly curved.
REACH = 0.1

#: Of a file: hatching is ink, paper and the edges between.
INKS, COLOURS = 32, 192


@dataclass(frozen=True)
class Model:
    """What is drawn, and from where.

    Attributes
    ----------
    name : str
    body : Body
        With the field that presets of ink show.
    raw : Body
        With the magnitudes that curvature gives.
    view : (float, float)
        Azimuth and elevation in degrees.
    """

    name: str
    body: Body
    raw: Body
    view: tuple[float, float]


#: Files of `MESHES`, by what they show, and from where.
FILES = {"Spot": ("spot.obj", (-128.0, 12.0)), "Bunny": ("stanford-bunny.obj", (-18.0, 10.0))}

#: Presets that are shown large on something else than Suzanne.
LARGE_ON = {
    "charcoal": "Bunny",
    "engraving": "Bunny",
    "pencil": "Spot",
    "print-300-dpi": "Spot",
    "woodcut": "Spot",
}


def write() -> None:
    """Draw and write the page; without the meshes of others there is none."""
    missing = [MESHES / file for file, _ in FILES.values() if not (MESHES / file).exists()]
    if missing:
        print(f"presets-page: left as it is, since there is no {missing[0]}")
        return
    models = _models()
    pieces = [
        "# Presets",
        "Every look that comes with RoSy, on Suzanne (three times subdivided), on [Spot](https://www."
        "cs.cmu.edu/~kmcrane/Projects/ModelRepository/) and on the Stanford bunny: the same field, "
        f"curvature with a reach of {REACH:g}, and the lamp that the preset brings. The two lines "
        "below each picture go from a selected mesh in a new scene to it, in Blender's Python console "
        "or a script; in the panel they are *Make Field*, *Look > Presets* and *Bake*. The view "
        "transform *Standard* shows ink and paper as they were drawn. With a mesh file and no Blender:",
        "    python -m rosy_addon render bunny.obj -o bunny.png --generate curvature --reach "
        f"{REACH:g} --preset engraving --size 1600x1200",
        "Lengths are in pixels of the finished picture: pictures of twice the size show twice as "
        "many lines, not broader ones. `python -m tools.gallery presets-page` draws this page.",
    ]
    for name in preset_names():
        pieces.append(_section(name, load_preset(name), models))
    PAGE.write_text("\n\n".join(pieces) + "\n", encoding="utf-8")


def _models() -> dict[str, Model]:
    models = {"Suzanne": _model("Suzanne", suzanne(), np.eye(4), (-26.0, 8.0))}
    for name, (file, view) in FILES.items():
        path = MESHES / file
        models[name] = _model(name, read_mesh(path), UPRIGHT[UP[path.suffix]], view)
    return models


def _model(name: str, surface: Surface, matrix: np.ndarray, view: tuple[float, float]) -> Model:
    smooth, raw = (
        Body(surface, matrix, generate(surface, Recipe("curvature", reach=reach), 4))
        for reach in (REACH, 0.0)
    )
    return Model(name, smooth, raw, view)


def _section(name: str, preset: Preset, models: dict[str, Model]) -> str:
    first = models[LARGE_ON.get(name, "Suzanne")]
    others = [model for model in models.values() if model is not first]
    look = preset.look
    small = np.concatenate([_drawn(model, look, SMALL) for model in others], axis=1)
    sheet = Image.fromarray(np.concatenate([_drawn(first, look, LARGE), small]))
    path = IMAGES / f"preset-{name}.png"
    colours = INKS if look.ink == "hatch" else COLOURS
    sheet.quantize(colours, Image.Quantize.MEDIANCUT, kmeans=2, dither=Image.Dither.NONE).save(
        path, optimize=True
    )
    reach = 0.0 if look.magnitude != "none" else REACH
    return "\n\n".join(
        [
            f"## {preset.name}",
            f"{preset.description}.",
            f"![{preset.name} on {first.name}, {others[0].name} and {others[1].name}]"
            f"(images/{path.name})",
            f'    bpy.ops.rosy.field_generate(kind="curvature", reach={reach:g})\n'
            f'    bpy.ops.rosy.preset_apply(preset="{name}"); bpy.ops.rosy.bake()',
        ]
    )


def _drawn(model: Model, look: Look, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8 of a model on the paper of a look."""
    body = model.body if look.magnitude == "none" else model.raw
    points = body.surface.vertices @ body.matrix[:3, :3].T + body.matrix[:3, 3]
    width, height = (look.supersampling * side for side in size)
    camera = orbit_camera(points, *model.view, width, height, margin=MARGIN)
    rgba = compose(project([body], camera, look.display), look).rgba
    return display(on_paper(rgba, look))


def on_paper(rgba: np.ndarray, look: Look) -> np.ndarray:
    """A (H, W, 4) picture whose background is the paper of its look, if it has one."""
    if look.ink != "hatch":
        return rgba
    alpha = rgba[..., 3:]
    colour = rgba[..., :3] * alpha + to_linear(from_hex(look.paper_colour)) * (1 - alpha)
    return np.concatenate([colour, np.ones_like(alpha)], axis=-1)
