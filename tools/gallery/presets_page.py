"""Write docs/presets.md: each preset large on one model and small on two others.

`python -m tools.gallery.presets_page FOLDER` draws and writes it. The folder contains
`meshes/spot.obj` and `meshes/stanford-bunny.obj`, which are not part of this repository.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look, uses_magnitude
from rosy_addon.core.color import from_hex, to_linear
from rosy_addon.field.generate import generate
from rosy_addon.field.surface import Surface
from rosy_addon.field.up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX
from rosy_addon.preset_files.store import Preset, load_preset, preset_keys
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

from .looks_page import IMAGES
from .page import ROOT
from .shapes import suzanne
from .sheet import display

PAGE = ROOT / "docs" / "presets.md"

#: Sizes of the large picture and of the two small ones in pixels.
LARGE, SMALL = (820, 640), (410, 320)

#: Empty margin at each border, as a fraction of the frame.
MARGIN = 0.04

#: Palette sizes of the .png files: of hatching (ink, paper and the edges between) and of others.
HATCHING_COLORS, COLORS = 32, 192


@dataclass(frozen=True)
class Model:
    """A mesh with its fields, and the view of it.

    Attributes
    ----------
    name : str
    instance : MeshInstance
        With the default field, for presets that do not show the magnitude.
    with_magnitude : MeshInstance
        With the curvature of each face.
    view : (float, float)
        Azimuth and elevation in degrees.
    """

    name: str
    instance: MeshInstance
    with_magnitude: MeshInstance
    view: tuple[float, float]


#: Mesh files in the folder, with their views, by the name of the model.
FILES = {"Spot": ("spot.obj", (-128.0, 12.0)), "Bunny": ("stanford-bunny.obj", (-18.0, 10.0))}

#: Models of the large pictures, for presets with another model than Suzanne.
LARGE_ON = {
    "charcoal": "Bunny",
    "engraving": "Bunny",
    "pencil": "Spot",
    "print-300-dpi": "Spot",
    "woodcut": "Spot",
}


def write(folder: Path) -> None:
    """Draw and write the page, with the meshes of a folder."""
    models = _load_models(folder / "meshes")
    pieces = [
        "# Presets",
        "Here you can compare all presets that come with RoSy, on Suzanne (subdivided three "
        "times), on [Spot](https://www.cs.cmu.edu/~kmcrane/Projects/ModelRepository/) and on the "
        "Stanford bunny. All pictures use the default field, *Form* with degree 4, and the light of "
        "the preset, unless the lines below the picture say otherwise. These two lines make the "
        "picture from a selected mesh in a new scene. Use them in Blender's Python console or in a "
        "script. In the panel, use *Make Field*, *Look* and *Bake*. The view transform *Standard* "
        "shows ink and paper as they were drawn.",
        "With a mesh file and without Blender:",
        "    rosyfields render bunny.obj -o bunny.png --preset engraving --size 1600x1200",
        "Lengths are in pixels of the finished picture. A picture of twice the size shows twice as "
        "many lines, not broader ones. `python -m tools.gallery.presets_page FOLDER` draws this "
        "page, given a folder with `meshes/spot.obj` and `meshes/stanford-bunny.obj`.",
    ]
    for name in preset_keys():
        pieces.append(_section(name, load_preset(name), models))
    PAGE.write_text("\n\n".join(pieces) + "\n", encoding="utf-8")


def _load_models(meshes: Path) -> dict[str, Model]:
    models = {"Suzanne": _model("Suzanne", suzanne(), np.eye(4), (-26.0, 8.0))}
    for name, (file, view) in FILES.items():
        path = meshes / file
        models[name] = _model(
            name, Surface(path), UP_AXIS_MATRIX[UP_AXIS_BY_SUFFIX[path.suffix]], view
        )
    return models


def _model(name: str, surface: Surface, matrix: np.ndarray, view: tuple[float, float]) -> Model:
    along_form, curvature = (
        MeshInstance(surface, matrix, generate(surface, kind, 4)) for kind in ("form", "curvature")
    )
    return Model(name, along_form, curvature, view)


def _section(name: str, preset: Preset, models: dict[str, Model]) -> str:
    first = models[LARGE_ON.get(name, "Suzanne")]
    others = [model for model in models.values() if model is not first]
    look = preset.look
    small = np.concatenate([_draw(model, look, SMALL) for model in others], axis=1)
    sheet = Image.fromarray(np.concatenate([_draw(first, look, LARGE), small]))
    path = IMAGES / f"preset-{name}.png"
    colors = HATCHING_COLORS if look.ink != "soft" else COLORS
    sheet.quantize(colors, Image.Quantize.MEDIANCUT, kmeans=2, dither=Image.Dither.NONE).save(
        path, optimize=True
    )
    kind = 'kind="curvature"' if uses_magnitude(look) else ""
    return "\n\n".join(
        [
            f"## {preset.name}",
            f"{preset.description}.",
            f"![{preset.name} on {first.name}, {others[0].name} and {others[1].name}]"
            f"(images/{path.name})",
            f"    bpy.ops.rosy.field_generate({kind})\n"
            f'    bpy.ops.rosy.preset_apply(preset="{name}"); bpy.ops.rosy.bake()',
        ]
    )


def _draw(model: Model, look: Look, size: tuple[int, int]) -> np.ndarray:
    """Return a picture of a model on the paper of a look, (H, W, 3) uint8."""
    instance = model.with_magnitude if uses_magnitude(look) else model.instance
    points = instance.surface.vertices @ instance.matrix[:3, :3].T + instance.matrix[:3, 3]
    width, height = (look.supersampling * side for side in size)
    camera = orbit_camera(points, *model.view, width, height, margin=MARGIN)
    rgba = compose(project([instance], camera, look.display), look).rgba
    return display(on_paper(rgba, look))


def on_paper(rgba: np.ndarray, look: Look) -> np.ndarray:
    """Return an (H, W, 4) picture with the paper of its look as background, if it has paper."""
    if look.ink == "soft":
        return rgba
    alpha = rgba[..., 3:]
    color = rgba[..., :3] * alpha + to_linear(from_hex(look.paper_color)) * (1 - alpha)
    return np.concatenate([color, np.ones_like(alpha)], axis=-1)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
