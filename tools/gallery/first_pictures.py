"""Write docs/first-pictures.md: default fields of sixteen meshes, with four presets.

`python -m tools.gallery.first_pictures FOLDER` draws and writes it. The folder contains the meshes of
`FILES`, which are not part of this repository.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.field.up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX
from rosy_addon.preset_files.store import load_preset

from .looks_page import IMAGES
from .page import ROOT
from .presets_page import on_paper
from .shapes import evaluated_surface, suzanne
from .sheet import Panel, display, save, sheet
from .solid import compose_view, view

PAGE = ROOT / "docs" / "first-pictures.md"

#: Size of a picture in pixels, and pictures in a row.
SIDE, COLUMNS = 262, 3

#: Presets of the sheets.
PRESETS = ("default", "cross-hatch", "engraving", "pencil")

#: Azimuth and elevation of the views in degrees.
VIEW = (-32.0, 24.0)

#: Mesh files in the folder, by title.
FILES = {
    "Stanford bunny": "stanford-bunny.obj",
    "Spot": "spot.obj",
    "Cheburashka": "cheburashka.off",
    "Piece of a vase": "vase.off",
}


def write(folder: Path) -> None:
    """Draw and write the page, with the meshes of a folder."""
    models = [(title, surface) for title, surface in _models(folder / "meshes")]
    fields = [generate(surface, "form", 4) for _, surface in models]
    pieces = [
        "# First pictures",
        "Here is what the default field, *Form* with degree 4, and the presets give without any "
        "choice: on the meshes that Blender can add, on scans and characters, and on a mechanical "
        "part. The light is that of the preset. "
        "`python -m tools.gallery.first_pictures FOLDER` draws this page, given a folder with "
        f"{', '.join(f'`meshes/{name}`' for name in FILES.values())}.",
    ]
    for name in PRESETS:
        path = IMAGES / f"first-{name}.png"
        save(sheet(_rows(name, models, fields)), path)
        preset = load_preset(name)
        pieces += [
            f"## {preset.name}",
            f"![{preset.name} on sixteen meshes](images/{path.name})",
            f"    rosyfields render mesh.obj -o mesh.png --preset {name} --size {SIDE}x{SIDE}",
        ]
    PAGE.write_text("\n\n".join(pieces) + "\n", encoding="utf-8")


def _rows(
    name: str, models: list[tuple[str, Surface]], fields: list[RosyField]
) -> list[list[Panel]]:
    """Draw all models with a preset, antialiased."""
    look = load_preset(name).look
    look = replace(look, supersampling=max(look.supersampling, 2))
    panels = []
    for (title, surface), field in zip(models, fields, strict=True):
        camera = view(surface, VIEW, (SIDE, SIDE), look.supersampling)
        picture = compose_view(surface, field, look, camera).rgba
        panels.append(Panel(display(on_paper(picture, look)), title))
    return [panels[start : start + COLUMNS] for start in range(0, len(panels), COLUMNS)]


def _models(meshes: Path) -> list[tuple[str, Surface]]:
    """Return the meshes with their titles."""
    import bpy

    add = bpy.ops.mesh
    primitives: dict[str, Callable[[], object]] = {
        "Cube": add.primitive_cube_add,
        "Plane": add.primitive_plane_add,
        "UV sphere": add.primitive_uv_sphere_add,
        "Icosphere": add.primitive_ico_sphere_add,
        "Cylinder": add.primitive_cylinder_add,
        "Cone": add.primitive_cone_add,
        "Torus": add.primitive_torus_add,
    }
    models = [(title, evaluated_surface(make)) for title, make in primitives.items()]
    monkey = suzanne(0), suzanne(3)
    models += [
        ("Suzanne", monkey[0]),
        ("Suzanne, subdivided", monkey[1]),
        ("Suzanne with noise of 0.1 %", _with_noise(monkey[1], 0.001)),
        ("Flange", _flange()),
        (
            "Rounded cube",
            evaluated_surface(add.primitive_cube_add, "BEVEL", width=0.25, segments=4),
        ),
    ]
    for title, name in FILES.items():
        surface = Surface(meshes / name)
        matrix = UP_AXIS_MATRIX[UP_AXIS_BY_SUFFIX[Path(name).suffix]]
        vertices = surface.vertices @ matrix[:3, :3].T
        models.append((title, build_surface(vertices, surface.corner_vertex, surface.face_start)))
    return models


def _with_noise(surface: Surface, share: float) -> Surface:
    """Displace the vertices along their normals by a share of the diagonal of the bounding box."""
    normal = np.zeros_like(surface.vertices)
    np.add.at(normal, surface.corner_vertex, surface.corner_normal)
    amplitude = share * np.linalg.norm(np.ptp(surface.vertices, axis=0))
    noise = np.random.default_rng(0).standard_normal((len(normal), 1))
    return build_surface(
        surface.vertices + amplitude * noise * normalize(normal),
        surface.corner_vertex,
        surface.face_start,
    )


def _flange(columns: int = 96) -> Surface:
    """Return a turned part: a disk with a bore and a hub, with a fillet between them."""
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
    rows = len(profile)
    i, j = np.divmod(np.arange(columns * rows), rows)
    following, above = (i + 1) % columns * rows, (j + 1) % rows
    faces = np.stack([i * rows + j, following + j, following + above, i * rows + above], axis=1)
    start = np.arange(0, faces.size + 1, 4)
    return build_surface(point.reshape(-1, 3), faces.ravel(), start, sharp_angle=0.6)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
