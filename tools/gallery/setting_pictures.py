"""Draw pictures that show what each setting of a look does, for docs/looks.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.core.settings import settings_of
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import Camera, look_at, orbit_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_tone import SurfaceTone
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

from .shapes import evaluated_surface, plane, sphere, suzanne, torus
from .sheet import Panel, display, sheet

#: Side of a picture in pixels, and the number of pictures in a row.
SIDE, COLUMNS = 192, 4

#: Quality of the .webp files, which are lossy: in lossless formats, pictures of noise take much space.
WEBP_QUALITY = 60


class Scene(NamedTuple):
    """The scene of a picture: meshes with fields, camera and lights."""

    instances: tuple[MeshInstance, ...]
    camera: Camera
    lights: tuple[Light, ...]


@dataclass(frozen=True)
class Shown:
    """How a setting of a look is shown: one picture per value.

    Attributes
    ----------
    values : tuple
        Values of the setting. A value may also be a dict of several settings, with this setting first.
    scene : str
        Name of a function of this module that returns a `Scene`.
    preset : str
        The preset that all pictures begin with.
    settings : dict
        Changes of the preset in all pictures.
    """

    values: tuple[Any, ...]
    scene: str
    preset: str
    settings: dict[str, Any]


def shown(*values: Any, scene: str = "head", preset: str = "default", **settings: Any) -> Shown:
    """Return how a setting is shown. The parameters are the attributes of `Shown`."""
    return Shown(values, scene, preset, settings)


_ENGRAVED = {"scene": "head", "preset": "engraving"}
_PEN = {"scene": "ball", "preset": "pen-and-ink"}
_HATCHED = {"scene": "ball", "preset": "cross-hatch"}
_SHADED = {"light": "lamp", "shading": 0.9}
_SPARSE = {"density": 0.03, "length": 24, "line_width": 2.0}

#: How each setting of a look is shown, by its name.
SETTINGS: dict[str, Shown] = {
    "method": shown("sheets", "members", "brute", "ibfv", scene="vortices"),
    "weights": shown("cosine", "binary", "none", scene="vortices", method="members", gain=5.0),
    "view_plane": shown(True, False, scene="slope", method="members", gain=4.0),
    "display": shown("smooth", "flat", scene="coarse_ball"),
    "unit_size": shown(0.0, 0.005, 0.01, 0.02, scene="slope", line_width=2.0),
    "length": shown(10, 40, 160, scene="vortices"),
    "fade": shown("none", "ends", "tail", scene="wind", **_SPARSE),
    "arrows": shown(0.0, 24.0, 48.0, scene="wind"),
    "flow": shown(0.0, 1.0, scene="wind"),
    "line_width": shown(1.0, 1.5, 4.0, scene="vortices"),
    "line_distance": shown(2.5, 5.0, 10.0, **_ENGRAVED),
    "density": shown(0.02, 0.1, 0.5, scene="vortices"),
    "high_pass": shown(0.0, 16.0, 4.0, scene="vortices"),
    "detail": shown(0.0, 0.5, 0.9, preset="pen-and-ink"),
    "anchor": shown("picture", "surface", scene="ring", line_width=3.0),
    "hue": shown(
        *("one", "noise", "families", "magnitude", "values"),
        {"hue": "families", "ink": "hatch", **_SHADED},
        {"hue": "tone", "ink": "even", **_SHADED},
        scene="numbers",
        line_width=2.5,
        line_distance=5.0,
    ),
    "seed": shown(0, 1, scene="vortices"),
    "gain": shown(1.0, 2.5, 6.0, scene="vortices"),
    "guiding_angle": shown(0.0, 0.8, 1.57, **_ENGRAVED, layers=1),
    "crease_angle": shown(0.7, 1.2, 3.1416, scene="box", length=80, line_width=2.0),
    "magnitude_length": shown(False, True, scene="gusts", density=0.03, line_width=2.0),
    "color_range": shown((0.0, 0.0), (0.0, 0.5), (1.0, 0.0), scene="bumps", hue="magnitude"),
    "color_map": shown("viridis", "magma", "gray", scene="bumps", hue="magnitude"),
    "shading": shown(0.0, 0.7, 1.0),
    "light": shown("headlight", "lamp", "scene", scene="table", shading=0.9),
    "shadows": shown(False, True, scene="table", light="scene", shading=0.9),
    "tone": shown("light", "attribute", scene="painted", preset="cross-hatch"),
    "tone_lit": shown(False, True, scene="painted", preset="cross-hatch", tone="attribute"),
    "tone_levels": shown(
        (0.0, 1.0, 1.0), (0.2, 0.8, 1.0), (0.0, 1.0, 2.0), (1.0, 0.0, 1.0), **_PEN
    ),
    "ink": shown("soft", "hatch", "even", preset="engraving", length=40),
    "ink_color": shown("#08080d", "#8a2020", "#204890", **_ENGRAVED),
    "ink_color_light": shown("#b06a3c", "#3c8ab0", **_ENGRAVED, hue="tone"),
    "paper_color": shown("#ffffff", "#f0d9b0", "#f0d9b080", "#f0d9b000", **_ENGRAVED),
    "crispness": shown(0.0, 0.5, 1.0, **_HATCHED),
    "layers": shown(1, 2, 3, scene="ring_of_six", preset="cross-hatch"),
    "layering": shown(0.0, 0.3, 0.8, **_HATCHED),
    "breaks": shown(0.0, 0.5, 1.0, **_PEN, wobble=0.0, line_width=3.5),
    "overshoot": shown(
        0.0, 8.0, 20.0, scene="table", preset="pen-and-ink", light="scene", shadows=True
    ),
    "wobble": shown(0.0, 0.5, 1.0, **_PEN, breaks=0.0, line_width=3.5),
    "paper_grain": shown(0.0, 0.4, 1.0, scene="head", preset="pencil"),
    "outline": shown(0.0, 1.5, 4.0, preset="cross-hatch"),
    "singularity_dots": shown("visible", "visible_indices", "all", "all_indices", scene="ball"),
    "singularity_size": shown(5.0, 9.0, 18.0, scene="ball", singularity_dots="visible"),
    "supersampling": shown(1, 2, 4, scene="vortices", gain=4.0),
}


def setting_strip(name: str) -> Image.Image:
    """Return an image with a picture for each value of a setting, side by side in rows."""
    entry = SETTINGS[name]
    base = replace(load_preset(entry.preset).look, supersampling=2)
    panels = []
    for value in entry.values:
        changes = value if isinstance(value, dict) else {name: value}
        look = base.with_settings({**entry.settings, **changes})
        scene: Scene = globals()[entry.scene]()
        picture = draw_picture(ViewInput(scene.instances, scene.camera, look, scene.lights))
        panels.append(Panel(display(picture.rgba), value_label(name, value)))
    return sheet([panels[start : start + COLUMNS] for start in range(0, len(panels), COLUMNS)])


def value_label(name: str, value: Any) -> str:
    """Return a value of a setting as text, as it is written on the command line."""
    if isinstance(value, dict):
        return ", ".join(
            value_label(key, part) for key, part in value.items() if key in (name, "ink")
        )
    if isinstance(value, bool):
        return "on" if value else "off"
    parts = value if isinstance(value, tuple) else (value,)
    return ",".join(part if isinstance(part, str) else f"{part:g}" for part in parts)


def check_every_setting_is_shown() -> None:
    """Raise a `ValueError` if `SETTINGS` lacks a setting of looks, or has one that does not exist."""
    if different := set(settings_of(Look)) ^ set(SETTINGS):
        raise ValueError(f"settings and pictures differ: {', '.join(sorted(different))}")


# --- scenes ----------------------------------------------------------------------------------------


@cache
def vortices() -> Scene:
    """Return a cross field in the plane, with one positive and one negative singularity."""
    square = plane(96)
    p = square.face_center[:, 0] + 1j * square.face_center[:, 1]
    left, right = p + 0.35, p - 0.35
    z = left / np.abs(left) * (right / np.abs(right)).conj() * np.exp(0.6j)
    return _flat(RosyField(4, _in_plane(z ** (1 / 4))))


@cache
def wind() -> Scene:
    """Return a vector field in the plane, with a vortex and a saddle."""
    square = plane(96)
    p = square.face_center[:, 0] + 1j * square.face_center[:, 1]
    z = 1j * (p + 0.4) * (p - 0.6).conj()
    return _flat(RosyField(1, _in_plane(z / np.abs(z))))


@cache
def head() -> Scene:
    """Return Suzanne with a cross field of the generator *form*."""
    monkey = suzanne()
    return _framed(MeshInstance(monkey, np.eye(4), generate(monkey, "form", 4)))


@cache
def bumps() -> Scene:
    """Return Suzanne with the directions of curvature. The magnitude of this field varies."""
    monkey = suzanne()
    return _framed(MeshInstance(monkey, np.eye(4), curvature_field(monkey, 4)))


@cache
def numbers() -> Scene:
    """Return Suzanne with curvature directions in two families, and heights as values for the color map."""
    monkey = suzanne()
    field = replace(curvature_field(monkey, 4), family_count=2)
    height = monkey.vertices[monkey.corner_vertex, 2].astype(np.float32)
    return _framed(MeshInstance(monkey, np.eye(4), field, color_values=height))


@cache
def painted() -> Scene:
    """Return Suzanne with dark and light bands as surface tone."""
    (instance,) = head().instances
    height = instance.surface.vertices[instance.surface.corner_vertex, 2]
    tone = 0.55 + 0.4 * np.sin(9 * height)
    tone = SurfaceTone(tone.astype(np.float32)[:, None])
    return head()._replace(instances=(replace(instance, tone=tone),))


@cache
def coarse_ball() -> Scene:
    """Return a sphere of few faces."""
    ball = sphere(5)
    return _framed(MeshInstance(ball, np.eye(4), smoothest_field(ball, 4)))


@cache
def ring(degree: int = 4) -> Scene:
    """Return a torus that is seen from the side."""
    surface = torus()
    field = axis_field(surface, degree, (0.3, 0.1, 1.0))
    return _framed(MeshInstance(surface, np.eye(4), field), (-20, 24))


@cache
def ring_of_six() -> Scene:
    """Return a torus with a field of six directions."""
    return ring(6)


@cache
def ball() -> Scene:
    """Return a sphere with a smooth cross field."""
    surface = sphere()
    return _framed(MeshInstance(surface, np.eye(4), smoothest_field(surface, 4)))


@cache
def slope() -> Scene:
    """Return the plane of `vortices`, which recedes from the camera."""
    camera = perspective_camera(
        look_at((0.3, -1.5, 0.5), (0, -0.2, 0)), SIDE, SIDE, fov=np.radians(60)
    )
    return vortices()._replace(camera=camera)


@cache
def gusts() -> Scene:
    """Return a vector field in the plane whose magnitude rises from the left to the right."""
    (instance,) = wind().instances
    magnitude = (instance.surface.face_center[:, :1] + 1.1) / 2.1
    field = RosyField(1, instance.field.vectors * magnitude)
    return wind()._replace(instances=(replace(instance, field=field),))


@cache
def box() -> Scene:
    """Return a prism with seven sides. Its creases are not equally sharp."""
    import bpy

    surface = evaluated_surface(partial(bpy.ops.mesh.primitive_cylinder_add, vertices=7))
    return _framed(
        MeshInstance(surface, np.eye(4), axis_field(surface, 4, (1.0, 0.3, 0.8))), (-26, 30)
    )


@cache
def table() -> Scene:
    """Return a ball on a table, in the light of a sun."""
    ball, square = sphere(), plane(24)
    placed = np.diag([2.2, 2.2, 2.2, 1.0])
    placed[2, 3] = -1.0
    instances = (
        MeshInstance(ball, np.eye(4), smoothest_field(ball, 4)),
        MeshInstance(square, placed, axis_field(square, 4, (1.0, 0.25, 0.0))),
    )
    camera = perspective_camera(
        look_at((1.5, -6.0, 3.0), (0.2, 0, -0.3)), SIDE, SIDE, fov=np.radians(32)
    )
    return _lit(instances, camera)


def _in_plane(z: np.ndarray) -> np.ndarray:
    """Convert (F,) complex numbers to (F, 3) vectors in the plane z = 0."""
    return np.stack([z.real, z.imag, np.zeros(len(z))], axis=1)


def _flat(field: RosyField) -> Scene:
    """Return a scene with the square of `plane` and a field on it, seen from above."""
    camera = orbit_camera(
        np.array([[-1.0, -1, 0], [1, 1, 0]]), 0.0, 90.0, SIDE, SIDE, perspective=False
    )
    return _lit((MeshInstance(plane(96), np.eye(4), field),), camera)


def _framed(instance: MeshInstance, angles: tuple[float, float] = (-26, 8)) -> Scene:
    """Return a scene with a mesh that fills the picture."""
    camera = orbit_camera(instance.surface.vertices, *angles, SIDE, SIDE, margin=0.006)
    return _lit((instance,), camera)


def _lit(instances: Sequence[MeshInstance], camera: Camera) -> Scene:
    """Return a scene with some meshes, a camera and a sun."""
    toward = np.array([-0.55, -0.5, 0.75])
    sun = Light("sun", camera.view[:3, :3] @ (toward / np.linalg.norm(toward)), np.ones(3), 1.25)
    return Scene(tuple(instances), camera, (sun,))
