"""Draw the pictures of docs/presets.md and docs/first-pictures.md, and write these pages.

`python -m tools.gallery.presets_page FOLDER` draws both pages. FOLDER/meshes has the mesh files of `FILES`,
which are not part of this repository. (`python -m tools.gallery preset-pictures` draws the previews of
presets in the zip.)
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import generate
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.field.up_axis import UP_AXIS_MATRIX
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.rendering.mesh_view import mesh_instance

from .page import IMAGES, ROOT
from .shapes import grid_surface, suzanne
from .sheet import Panel, display, save, sheet
from .solid import picture_on_paper

PRESETS_PAGE, FIRST_PAGE = ROOT / "docs" / "presets.md", ROOT / "docs" / "first-pictures.md"

#: Names of mesh files, by the title of the picture.
FILES = {
    "Stanford bunny": "stanford-bunny.obj",
    "Spot": "spot.obj",
    "Cheburashka": "cheburashka.off",
    "Piece of a vase": "vase.off",
}

#: Azimuth and elevation of each model of docs/presets.md, in degrees.
VIEWS = {"Suzanne": (-26.0, 8.0), "Spot": (-128.0, 12.0), "Bunny": (-18.0, 10.0)}

#: Sizes of the large picture of a preset and of its two small ones in pixels, and their margin as a fraction.
LARGE, SMALL, MARGIN = (820, 640), (410, 320), 0.04

#: Model of the large picture of a preset, if it is not Suzanne.
LARGE_ON = {
    "charcoal": "Bunny",
    "engraving": "Bunny",
    "pencil": "Spot",
    "print-300-dpi": "Spot",
    "woodcut": "Spot",
}

#: Numbers of palette colors of the .png files: for hatching (ink, paper and the edges between), and for
#: others.
HATCHING_COLORS, COLORS = 32, 192

#: Presets, size, view and margin of the pictures of docs/first-pictures.md, and number of pictures in a row.
FIRST_PRESETS = ("default", "cross-hatch", "engraving", "pencil")
SIDE, FIRST_VIEW, FIRST_MARGIN, COLUMNS = 262, (-32.0, 24.0), 0.006, 3


def write_pages(folder: Path) -> None:
    """Draw and write both pages, with the meshes of a folder."""
    files = {title: Surface(folder / "meshes" / name) for title, name in FILES.items()}
    _write_presets(files)
    _write_first_pictures(files)


def _write_presets(files: dict[str, Surface]) -> None:
    """Draw each preset large on one model and small on two others."""
    models = {
        "Suzanne": suzanne(),
        "Spot": files["Spot"],
        "Bunny": files["Stanford bunny"],
    }
    instances = {
        (name, kind): mesh_instance(surface, generate(surface, kind, 4))
        for name, surface in models.items()
        for kind in ("form", "curvature")
    }
    sections = []
    for key in preset_keys():
        preset = load_preset(key)
        kind = "form" if preset.look.hue != "magnitude" else "curvature"
        first = LARGE_ON.get(key, "Suzanne")
        names = [first, *(name for name in models if name != first)]
        drawn = [
            display(picture_on_paper(instances[name, kind], preset.look, VIEWS[name], size, MARGIN))
            for name, size in zip(names, (LARGE, SMALL, SMALL), strict=True)
        ]
        shown = np.concatenate([drawn[0], np.concatenate(drawn[1:], axis=1)])
        colors = HATCHING_COLORS if preset.look.ink != "soft" else COLORS
        picture = Image.fromarray(shown).quantize(
            colors, Image.Quantize.MEDIANCUT, kmeans=2, dither=Image.Dither.NONE
        )
        picture.save(IMAGES / f"preset-{key}.png", optimize=True)
        options = "" if kind == "form" else f'kind="{kind}"'
        sections += [
            f"## {preset.name}",
            f"{preset.description}.",
            f"![{preset.name} on {names[0]}, {names[1]} and {names[2]}](images/preset-{key}.png)",
            f"    bpy.ops.rosy.field_generate({options})\n"
            f'    bpy.ops.rosy.preset_apply(preset="{key}"); bpy.ops.rosy.bake()',
        ]
    _replace_sections(PRESETS_PAGE, sections)


def _write_first_pictures(files: dict[str, Surface]) -> None:
    """Draw the default field of sixteen meshes with some presets, antialiased."""
    models = _made_models()
    for title, surface in files.items():
        points = surface.vertices @ UP_AXIS_MATRIX[surface.up][:3, :3].T
        models.append((title, build_surface(points, surface.corner_vertex, surface.face_start)))
    instances = [mesh_instance(surface, generate(surface, "form", 4)) for _, surface in models]
    sections = []
    for key in FIRST_PRESETS:
        preset = load_preset(key)
        look = replace(preset.look, supersampling=max(preset.look.supersampling, 2))
        panels = []
        for (title, _), instance in zip(models, instances, strict=True):
            rgba = picture_on_paper(instance, look, FIRST_VIEW, (SIDE, SIDE), FIRST_MARGIN)
            panels.append(Panel(display(rgba), title))
        rows = [panels[start : start + COLUMNS] for start in range(0, len(panels), COLUMNS)]
        save(sheet(rows), IMAGES / f"first-{key}.png")
        sections += [
            f"## {preset.name}",
            f"![{preset.name} on sixteen meshes](images/first-{key}.png)",
            f"    rosyfields render mesh.obj -o mesh.png --preset {key} --size {SIDE}x{SIDE}",
        ]
    _replace_sections(FIRST_PAGE, sections)


def _replace_sections(page: Path, sections: list[str]) -> None:
    """Replace everything after the introduction of a page by sections."""
    introduction = page.read_text(encoding="utf-8").split("\n## ")[0].strip()
    page.write_text("\n\n".join([introduction, *sections]) + "\n", encoding="utf-8")


def _made_models() -> list[tuple[str, Surface]]:
    """Return titles and surfaces of meshes: those that Blender can add, and some derived from them."""
    import bpy

    from .in_blender import evaluated_surface

    add = bpy.ops.mesh
    primitives = {
        "Cube": add.primitive_cube_add,
        "Plane": add.primitive_plane_add,
        "UV sphere": add.primitive_uv_sphere_add,
        "Icosphere": add.primitive_ico_sphere_add,
        "Cylinder": add.primitive_cylinder_add,
        "Cone": add.primitive_cone_add,
        "Torus": add.primitive_torus_add,
    }
    rounded = evaluated_surface(add.primitive_cube_add, "BEVEL", width=0.25, segments=4)
    return [
        *((title, evaluated_surface(make)) for title, make in primitives.items()),
        ("Suzanne", suzanne(0)),
        ("Suzanne, subdivided", suzanne(3)),
        ("Suzanne with noise of 0.1 %", _with_noise(suzanne(3), 0.001)),
        ("Flange", _flange()),
        ("Rounded cube", rounded),
    ]


def _with_noise(surface: Surface, share: float) -> Surface:
    """Displace vertices randomly along their normals, relative to the diagonal of the bounding box."""
    normal = np.zeros_like(surface.vertices)
    np.add.at(normal, surface.corner_vertex, surface.corner_normal)
    amplitude = share * np.linalg.norm(np.ptp(surface.vertices, axis=0))
    noise = np.random.default_rng(0).standard_normal((len(normal), 1))
    points = surface.vertices + amplitude * noise * normalize(normal)
    return build_surface(points, surface.corner_vertex, surface.face_start)


def _flange(columns: int = 96) -> Surface:
    """Return a mechanical part with rotational symmetry: a disk with a bore, a hub and a fillet."""
    bend = np.linspace(0, np.pi / 2, 9)
    fillet = np.stack([0.75 - 0.2 * np.sin(bend), 0.45 - 0.2 * np.cos(bend)], axis=1)
    profile = np.concatenate(
        [[[0.3, 0.0], [1.0, 0.0], [1.0, 0.25]], fillet, [[0.55, 0.9], [0.3, 0.9]]]
    )
    angle = 2 * np.pi * np.arange(columns)[:, None] / columns
    radius, height = profile.T
    point = np.stack(
        np.broadcast_arrays(radius * np.cos(angle), radius * np.sin(angle), height), axis=-1
    )
    return grid_surface("mesh", point, (True, True), sharp_angle=0.6)


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
