"""The pictures of docs/hatching.md, whose text is written by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.generate import axis_field
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.field.surface import Surface
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.ambient_occlusion import ambient_occlusion
from rosy_addon.projection.camera import look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.surface_tone import SurfaceTone

from .figure_11 import smoothed_a_little
from .looks_page import IMAGES
from .shapes import plane, sphere, suzanne
from .sheet import Panel, display, save, sheet
from .solid import compose_view, view

#: Sizes of pictures in pixels, for two and three in a row.
SIDE, THIRD = 384, 256

#: Side of a picture of which a part is shown, and the upper left corner of that part.
LARGE, CORNER = 720, (290, 150)

#: Pictures of hand-drawn lines and inks: labels, presets and changed settings.
EVEN = {"breaks": 0.0, "wobble": 0.0}
HAND = {
    "pen and ink, even": ("pen-and-ink", EVEN),
    "breaks 1": ("pen-and-ink", EVEN | {"breaks": 1.0}),
    "wobble 1": ("pen-and-ink", EVEN | {"wobble": 1.0}),
    "pencil, paper_grain 0.6": ("pencil", {"paper_grain": 0.6}),
}
INKS = {
    "hue families, of black ink": ("cross-hatch", {"hue": "families", "layering": 0.15}),
    "hue families, of light ink": ("white-on-black", {"hue": "families"}),
    "hue tone, from blue to ochre": (
        "engraving",
        {"hue": "tone", "ink_color": "#141a3c", "ink_color_light": "#b0703c"},
    ),
    "hue tone, of charcoal": (
        "charcoal",
        {"hue": "tone", "ink_color": "#14213c", "ink_color_light": "#d2603c"},
    ),
}

#: Camera distances for lines in pixels and in Blender units.
DISTANCES = (3.6, 7.2, 14.4)


def write() -> None:
    """Draw and save the pictures."""
    monkey = suzanne()
    field = smoothed_a_little(monkey, curvature_field(monkey, 4))
    look = load_preset("cross-hatch").look
    camera = view(monkey, (-26, 8), (THIRD, THIRD), look.supersampling)
    layered = []
    for layers in (1, 2, 3):
        shown = compose_view(
            monkey, smoothest_field(monkey, 6), replace(look, layers=layers), camera
        )
        layered.append(Panel(display(shown.rgba), f"layers {layers}, N = 6"))
    save(sheet([layered]), IMAGES / "hatching-layers.png")
    guided = []
    for degrees in (0, 45, 90):
        turned = replace(look, guiding_angle=float(np.radians(degrees)), layers=1)
        shown = compose_view(monkey, field, turned, camera)
        guided.append(Panel(display(shown.rgba), f"guiding angle {degrees} degrees"))
    save(sheet([guided]), IMAGES / "hatching-guide.png")
    for name, panels in {"hatching-hand": HAND, "hatching-inks": INKS}.items():
        shown = [
            Panel(_detail(monkey, field, replace(load_preset(preset).look, **settings)), label)
            for label, (preset, settings) in panels.items()
        ]
        save(sheet([shown[start : start + 2] for start in (0, 2)]), IMAGES / f"{name}.png")
    bare = _on_a_table(monkey, field)
    save(sheet(_tones(bare)), IMAGES / "hatching-tone.png")
    save(sheet([_ends(bare)]), IMAGES / "hatching-ends.png")
    save(sheet(_outlines(bare, monkey, field)), IMAGES / "hatching-outline.png")
    save(sheet(_units(monkey, field)), IMAGES / "hatching-units.png")


def _on_a_table(monkey: Surface, field: RosyField) -> list[MeshInstance]:
    """Return Suzanne and a ball on a table."""
    ball, table = sphere(), plane(24)
    fields = field, smoothest_field(ball, 4), axis_field(table, 4, (1.0, 0.25, 0.0))
    surfaces, matrices = (
        (monkey, ball, table),
        (_placement(0, 0, 0.985), _placement(1.55, -0.75, 0.5, 0.5), _placement(0, 0, 0, 7.0)),
    )
    return [MeshInstance(*entry) for entry in zip(surfaces, matrices, fields, strict=True)]


def _ends(instances: list[MeshInstance]) -> list[Panel]:
    """Draw lines that end at a shadow, and lines that overshoot it."""
    look = replace(load_preset("cross-hatch").look, light="scene", shadows=True, shading=0.9)
    return [
        _tone_panel(instances, replace(look, overshoot=length), f"overshoot {length:g}")
        for length in (0.0, 14.0)
    ]


def _outlines(
    instances: list[MeshInstance], monkey: Surface, field: RosyField
) -> list[list[Panel]]:
    """Draw Suzanne without and with an outline, and outlines in other inks."""
    look = replace(load_preset("cross-hatch").look, light="scene", shadows=True, shading=0.9)
    others = {
        "white-on-black": {"outline": 2.0, "hue": "families"},
        "engraving": {"outline": 2.0},
    }
    return [
        [
            _tone_panel(instances, replace(look, outline=width), f"outline {width:g}")
            for width in (0.0, 1.6)
        ],
        [
            Panel(
                _detail(monkey, field, replace(load_preset(name).look, **settings)),
                f"{name}, outline 2",
            )
            for name, settings in others.items()
        ],
    ]


def _units(monkey: Surface, field: RosyField) -> list[list[Panel]]:
    """Draw lines in pixels and in Blender units from several distances."""
    rows = []
    for unit_size in (0.0, 0.008):
        look = replace(load_preset("engraving").look, unit_size=unit_size)
        row = []
        for distance in DISTANCES:
            side = THIRD * look.supersampling
            view_matrix = look_at((-0.35 * distance, -0.9 * distance, 0.25 * distance), (0, 0, 0))
            camera = perspective_camera(view_matrix, side, side, fov=np.radians(24))
            shown = compose(project([MeshInstance(monkey, np.eye(4), field)], camera), look)
            row.append(Panel(display(shown.rgba), f"unit_size: {unit_size:g}"))
        rows.append(row)
    return rows


def _tones(bare: list[MeshInstance]) -> list[list[Panel]]:
    """Draw the sources of tone one after the other."""
    occluded = [
        replace(instance, tone=SurfaceTone(ambient_occlusion(bare, number)[:, None]))
        for number, instance in enumerate(bare)
    ]
    mapped = [replace(instance, tone=_banded(instance.surface)) for instance in bare]
    mapped[2] = bare[2]
    look = replace(load_preset("cross-hatch").look, light="scene", shadows=True, shading=0.9)
    return [
        [
            _tone_panel(bare, look, "light: scene, shadows"),
            _tone_panel(occluded, replace(look, tone="attribute"), "tone: attribute, of occlusion"),
        ],
        [
            _tone_panel(
                occluded,
                replace(look, tone="attribute", tone_lit=True, tone_levels=(0.0, 1.0, 1.3)),
                "the same, lit",
            ),
            _tone_panel(mapped, replace(look, tone="image", tone_lit=True), "tone: image, lit"),
        ],
    ]


def _tone_panel(instances: list[MeshInstance], look: Look, label: str) -> Panel:
    side = look.supersampling * SIDE
    camera = perspective_camera(
        look_at((1.9, -6.0, 3.3), (0.45, -0.2, 0.75)), side, side, fov=np.radians(29)
    )
    toward = np.array([-0.55, -0.5, 0.75])
    sun = Light("sun", camera.view[:3, :3] @ (toward / np.linalg.norm(toward)), np.ones(3), 1.25)
    return Panel(display(compose(project(instances, camera), look, [sun]).rgba), label)


def _banded(surface: Surface) -> SurfaceTone:
    """Return a tone of dark and light bands, mapped to a surface from bottom to top."""
    rows = np.arange(512)[:, None] / 512
    image = np.where(rows * 6 % 1 < 0.5, 0.45, 0.95) + np.zeros(512)
    x, _, z = surface.vertices[surface.corner_vertex].T
    uv = np.stack([x / 3 + 0.5, z / 2.4 + 0.5 + 0.04 * np.sin(5 * x)], axis=1)
    return SurfaceTone(uv.astype(np.float32), image.astype(np.float32))


def _placement(x: float, y: float, z: float, scale: float = 1.0) -> np.ndarray:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def _detail(surface: Surface, field: RosyField, look: Look) -> np.ndarray:
    """Return a part of a large picture, which shows single lines."""
    camera = view(surface, (-26, 8), (LARGE, LARGE), look.supersampling)
    shown = display(compose_view(surface, field, look, camera).rgba)
    left, top = CORNER
    return shown[top : top + SIDE, left : left + SIDE]
