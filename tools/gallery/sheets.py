"""Draw the sheets of pictures and the films that `pictures.toml` describes."""

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.core.cache import Cache
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import Camera, look_at, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.projection.surface_tone import SurfaceTone
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.turntable import draw_next, turntable, turntable_views
from rosy_addon.rendering.view_input import ViewInput

from . import shapes, table_scene
from .page import ROOT
from .sheet import Panel, display, save, sheet
from .solid import MADE_FIELDS, TONES, VALUES, curve_through, points_on_surface, view

PAGES: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("pictures.toml").read_text(encoding="utf-8")
)

INK, PAPER = (214, 84, 20), (255, 255, 255)


def write_page(page: str) -> None:
    """Draw and save the sheets and films that `pictures.toml` lists for a page of the documentation."""
    table = PAGES[page]
    for name, spec in table.get("films", {}).items():
        _write_film(table | spec, ROOT / f"{table['prefix']}{name}.gif")
    for name, options in table.get("sheets", {}).items():
        rows = [[draw_panel(table, options, panel) for panel in row] for row in options["rows"]]
        save(sheet(rows), ROOT / f"{table['prefix']}{name}.png")


def _write_film(spec: dict[str, Any], path: Path) -> None:
    """Draw and save a film.

    If the look has flow, streaks move in front of a still camera; else the camera orbits.
    """
    look = Look().with_settings(spec["look"])
    surface = _surface(spec["mesh"])
    instance = MeshInstance(surface, np.eye(4), _field(surface, spec))
    is_still, count = look.flow != 0, spec["count"]
    size, angles = tuple(spec["size"]), tuple(spec["view"])
    views = turntable_views(instance, look, count, size, angles, still=is_still)
    draw = partial(draw_next, cache=Cache()) if is_still else draw_picture
    turntable(draw, views, count, path, spec["rate"])


def draw_panel(*specs: dict[str, Any]) -> Panel:
    """Draw a picture that tables of `pictures.toml` describe, and return it as a panel.

    Keys of later tables replace those of earlier ones.
    """
    spec = {key: value for part in specs for key, value in part.items()}
    view_input = described(*specs)
    look, camera = view_input.look, view_input.camera
    if spec.get("finished"):
        rgba = draw_picture(view_input).rgba
    else:
        gbuffer = project(view_input.instances, camera.scaled(look.supersampling), look.display)
        rgba = compose(gbuffer, look, view_input.lights).rgba
    picture = display(rgba)
    if "crop" in spec:
        left, top, width, height = spec["crop"]
        enlarged = np.ones((spec.get("enlarge", 1),) * 2 + (1,), np.uint8)
        picture = np.kron(picture[top : top + height, left : left + width], enlarged)
    for stroke in spec.get("strokes", ()):
        picture = with_line(picture, curve_through(*stroke), 8, PAPER)
        picture = with_line(picture, curve_through(*stroke), 4, INK)
    return Panel(picture, spec.get("label", ""))


def described(*specs: dict[str, Any]) -> ViewInput:
    """Return the meshes, the camera, the look and the lights that tables of `pictures.toml` describe."""
    spec = {key: value for part in specs for key, value in part.items()}
    look = load_preset(spec["preset"]).look if "preset" in spec else Look()
    for part in specs:
        look = look.with_settings(part.get("look", {}))
    if spec.get("turn"):
        look = replace(look, guiding_angle=float(np.radians(spec["turn"])))
    if spec["mesh"] == "table":
        instances = table_scene.instances(spec.get("tone", ""))
    else:
        instances = [_instance(spec)]
    camera = _camera(spec, instances[0].surface)
    lights = (_sun(camera, spec["sun"]),) if "sun" in spec else ()
    return ViewInput(tuple(instances), camera, look, lights)


def _instance(spec: dict[str, Any]) -> MeshInstance:
    """Return the mesh that a table describes, with its field, and its numbers and tone if it has any."""
    surface = _surface(spec["mesh"])
    field = _field(surface, spec)
    if "families" in spec:
        field = replace(field, family_count=spec["families"])
    values, tone = (
        made[spec[key]](surface).astype(np.float32) if key in spec else None
        for key, made in (("values", VALUES), ("tone", TONES))
    )
    tone = None if tone is None else SurfaceTone(tone[:, None])
    return MeshInstance(surface, np.eye(4), field, color_values=values, tone=tone)


@lru_cache
def _surface(text: str) -> Surface:
    """Return the mesh of a function of `shapes`: its name, and its arguments (whole numbers) if there are any."""
    name, *arguments = text.split()
    return getattr(shapes, name)(*map(int, arguments))


def _field(surface: Surface, spec: dict[str, Any]) -> RosyField:
    """Return the field that a table describes: one of `MADE_FIELDS`, or the field of a generator."""
    kind, degree = spec["field"].split()
    if kind in MADE_FIELDS:
        return MADE_FIELDS[kind](surface, int(degree))
    options: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in spec.get("options", {}).items()
    }
    if "strokes" in spec:
        camera = _camera(spec, surface).scaled(2)
        curves = [curve_through(*stroke) for stroke in spec["strokes"]]
        options["strokes"] = [points_on_surface(surface, camera, curve) for curve in curves]
    return generate(surface, GeneratorSettings(kind, **options), int(degree))


def _camera(spec: dict[str, Any], surface: Surface) -> Camera:
    if "eye" not in spec:
        is_perspective = spec.get("perspective", True)
        return view(surface, tuple(spec["view"]), tuple(spec["size"]), 1, is_perspective)
    matrix = look_at(spec["eye"], spec.get("target", (0, 0, 0)))
    return perspective_camera(matrix, *spec["size"], fov=np.radians(spec["angle"]))


def _sun(camera: Camera, direction: Sequence[float]) -> Light:
    toward = camera.view[:3, :3] @ (direction / np.linalg.norm(direction))
    return Light("sun", toward, np.ones(3), 1.25)


def with_line(
    picture: np.ndarray, line: np.ndarray, width: int, color: tuple[int, int, int]
) -> np.ndarray:
    """Draw a polyline on a square picture. Its points are fractions of the picture from the top left."""
    image = Image.fromarray(picture)
    points = [tuple(point) for point in (line * len(picture)).tolist()]
    ImageDraw.Draw(image).line(points, fill=color, width=width, joint="curve")
    return np.asarray(image)
