"""The pictures of docs/fields.md: fields of each generator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from rosy_addon.compositor.look import Look
from rosy_addon.field.directional_field import field_from_directions, tensor_field
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, axis_field, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface, build_surface

from .page import ROOT
from .shapes import sphere, suzanne, torus
from .sheet import Panel, display, save, sheet
from .solid import compose_view, curve_through, points_on_surface, render_view, view

IMAGES = ROOT / "docs" / "images"

LOOK = Look(length=50, gain=2.8, supersampling=2)
SIDE, WIDE = 256, 394

#: Strokes on Suzanne: start, middle and end of each, as fractions of the picture from the top left.
STROKES = (
    ((0.33, 0.22), (0.50, 0.14), (0.66, 0.22)),
    ((0.30, 0.44), (0.42, 0.33), (0.52, 0.42)),
    ((0.58, 0.66), (0.67, 0.74), (0.76, 0.66)),
    ((0.74, 0.34), (0.82, 0.42), (0.78, 0.54)),
)
INK = (214, 84, 20)


def write() -> None:
    """Draw and save all pictures."""
    monkey, box = suzanne(), _box()
    smooth = [
        _panel(monkey, "smoothest", degree, (-26, 8), f"Smoothest, N = {degree}")
        for degree in (2, 4, 6)
    ]
    save(sheet([smooth]), IMAGES / "fields-smoothest.png")
    save(sheet(_form(monkey)), IMAGES / "fields-form.png")
    curved = [
        _panel(monkey, GeneratorSettings("curvature", reach=reach), 4, (-26, 8), text, WIDE)
        for reach, text in ((0.0, "Curvature of each face"), (0.05, "Curvature, reach 0.05"))
    ]
    save(sheet([curved]), IMAGES / "fields-curvature.png")
    along = [
        _panel(box, recipe, degree, (32, 28), text)
        for recipe, degree, text in (
            ("smoothest", 4, "Smoothest, N = 4"),
            ("features", 4, "Features, N = 4"),
            ("features", 2, "Features, N = 2"),
        )
    ]
    save(sheet([along]), IMAGES / "fields-features.png")
    save(sheet([_strokes(monkey)]), IMAGES / "fields-guided.png")
    save(sheet([_free()]), IMAGES / "fields-directions.png")
    save(sheet([_tensor()]), IMAGES / "fields-tensor.png")
    save(sheet([_singular(monkey)]), IMAGES / "fields-singularities.png")
    save(sheet([_prescribed()]), IMAGES / "fields-prescribed.png")


def _form(monkey: Surface) -> list[list[Panel]]:
    """Draw curvature of each face and form: of a noisy torus, Suzanne and a box."""
    ring = torus()
    size = np.linalg.norm(np.ptp(ring.vertices, axis=0))
    noise = 0.002 * size * np.random.default_rng(0).standard_normal(ring.vertices.shape)
    noisy = build_surface(ring.vertices + noise, ring.corner_vertex, ring.face_start)
    return [
        [
            _panel(surface, kind, 4, position, f"{text}, {kind_text}")
            for surface, position, text in (
                (noisy, (20, 40), "Noisy torus"),
                (monkey, (-26, 8), "Suzanne"),
                (_box(), (32, 28), "Box"),
            )
        ]
        for kind, kind_text in (("curvature", "curvature"), ("form", "form"))
    ]


def _strokes(monkey: Surface) -> list[Panel]:
    """Draw the smoothest field of Suzanne, and a field that follows strokes."""
    camera = view(monkey, (-26, 8), (WIDE, WIDE), LOOK.supersampling)
    curves = [curve_through(*ends) for ends in STROKES]
    strokes = [points_on_surface(monkey, camera, curve) for curve in curves]
    panels = [_panel(monkey, "smoothest", 2, (-26, 8), "Smoothest, N = 2", WIDE)]
    guided = _panel(
        monkey,
        GeneratorSettings("guided", strokes=strokes),
        2,
        (-26, 8),
        "Guided by four strokes",
        WIDE,
    )
    picture = Image.fromarray(guided.picture)
    pen = ImageDraw.Draw(picture)
    for stroke in curves:
        line = [tuple(point) for point in (stroke * WIDE).tolist()]
        pen.line(line, fill=(255, 255, 255), width=8, joint="curve")
        pen.line(line, fill=INK, width=4, joint="curve")
    return [*panels, Panel(np.asarray(picture), guided.label)]


def _free() -> list[Panel]:
    """Draw two pairs of directions on a sphere, at angles from 90 to 25 degrees."""
    ball = sphere()
    up = 1 - np.abs(ball.face_center[:, 2])
    half = np.radians(12.5 + (45 - 12.5) * np.clip(up, 0, 1))
    along = normalize(axis_field(ball, 1).vectors)
    across = np.cross(ball.face_normal, along)
    pair = [
        np.cos(half)[:, None] * along + sign * np.sin(half)[:, None] * across for sign in (1, -1)
    ]
    directions = np.stack([pair[0], pair[1], -pair[0], -pair[1]], axis=1)
    field = field_from_directions(ball, directions)
    panels = []
    for text, look in (
        ("Pairs at 25 to 90 degrees", LOOK),
        ("Each with its hue", LOOK.with_settings({"hue": "families"})),
    ):
        camera = view(ball, (20, 24), (WIDE, WIDE), look.supersampling)
        panels.append(Panel(display(compose_view(ball, field, look, camera).rgba), text))
    return panels


def _tensor() -> list[Panel]:
    """Draw the directions of tension and compression in a ring with a force at its side."""
    ring = torus()
    offset = ring.face_center - (1.2, -1.4, 0.6)
    distance = np.sqrt(dot(offset, offset))[:, None, None]
    outward = normalize(offset)
    tensors = outward[:, :, None] * outward[:, None, :] / distance - 0.35 * np.eye(3) * distance
    field = tensor_field(ring, tensors)
    panels = []
    for text, look in (
        ("Major and minor, one hue", LOOK),
        ("Orange: major, blue: minor", LOOK.with_settings({"hue": "families"})),
    ):
        camera = view(ring, (24, 44), (WIDE, 300), look.supersampling)
        panels.append(Panel(display(compose_view(ring, field, look, camera).rgba), text))
    return panels


def _singular(monkey: Surface) -> list[Panel]:
    """Draw the singularities of the smoothest fields."""
    fields = [(degree, generate(monkey, "smoothest", degree)) for degree in (2, 4)]
    return [
        _dotted_panel(monkey, field, WIDE, f"Singularities, N = {degree}")
        for degree, field in fields
    ]


def _prescribed() -> list[Panel]:
    """Draw a sphere whose singularities are placed: in a square in front, and out of sight."""
    ball = sphere()
    toward_eye = view(ball, (-26, 8), (SIDE, SIDE), 1).view[2, :3]
    across, up = view(ball, (-26, 8), (SIDE, SIDE), 1).view[:2, :3]
    angle = np.arange(8) * np.pi / 4 + 0.2
    ring = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * up
    panels = [_dotted_panel(ball, generate(ball, "smoothest", 4), SIDE, "Smoothest, N = 4")]
    for text, centers in (
        (
            "Two in front, six behind",
            toward_eye * np.where(angle < 1.7, 2, -2)[:, None],
        ),
        ("Out of sight", -2 * toward_eye),
    ):
        vertex = [int((ball.vertices @ point).argmax()) for point in normalize(ring + centers)]
        settings = GeneratorSettings("prescribed", singularities=(vertex, np.ones(8, dtype=int)))
        panels.append(_dotted_panel(ball, generate(ball, settings, 4), SIDE, text))
    return panels


def _dotted_panel(surface: Surface, field: RosyField, side: int, text: str) -> Panel:
    """Draw a field with dots at the visible singularities."""
    return Panel(dotted_picture(surface, field, LOOK, (-26, 8), side), text)


def dotted_picture(
    surface: Surface, field: RosyField, look: Look, angles: tuple[float, float], side: int
) -> np.ndarray:
    """Draw a field with dots at the visible singularities."""
    look = replace(look, singularity_dots="visible")
    return display(render_view(surface, field, look, angles, side))


def _box() -> Surface:
    """Return a leaning box, made by projecting a sphere to a cube."""
    ball = sphere()
    points = ball.vertices / np.abs(ball.vertices).max(axis=1)[:, None]
    points[:, 0] += 0.6 * points[:, 2]
    return build_surface(points, ball.corner_vertex, ball.face_start, name="box", sharp_angle=0.7)


def _panel(
    surface: Surface,
    recipe: GeneratorSettings | str,
    degree: int,
    angles: tuple[float, float],
    text: str,
    side: int = SIDE,
) -> Panel:
    field = generate(surface, recipe, degree)
    camera = view(surface, angles, (side, side), LOOK.supersampling)
    return Panel(display(compose_view(surface, field, LOOK, camera).rgba), text)
