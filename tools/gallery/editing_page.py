"""Draw the pictures of docs/editing.md: a combed head, a film of the combing, and moved singularities."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

from rosy_addon.field.closest_point import closest_triangles
from rosy_addon.field.combing import BrushStroke, GuideBrush, start_combing
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.guided_system import guided_system
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.singularity_changes import move_index
from rosy_addon.field.surface import Surface
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.visible_vertices import project_vertices
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.view_input import ViewInput

from .page import IMAGES
from .shapes import sphere, suzanne, torus
from .sheet import Panel, display, save, sheet
from .sheets import INK, with_line
from .solid import compose_view, curve_through, points_on_surface, view

DEGREE, WIDE, FILM, SIDE = 2, 394, 320, 256
ANGLES, BALL_ANGLES, RING_ANGLES = (-26, 8), (-26, 30), (20, 40)

#: Brush strokes on Suzanne: start, middle and end of each, as fractions of the picture from the top left.
STROKES = (
    ((0.34, 0.37), (0.50, 0.26), (0.67, 0.17)),
    ((0.48, 0.36), (0.58, 0.285), (0.685, 0.35)),
    ((0.475, 0.38), (0.58, 0.485), (0.69, 0.39)),
    ((0.36, 0.45), (0.50, 0.54), (0.64, 0.59)),
    ((0.66, 0.62), (0.665, 0.75), (0.64, 0.88)),
)

#: Radius of the brush in object space.
RADIUS = 0.14

#: Positions of singularities on a torus, as fractions of the picture from the top left, and their indices in
#: units of 1/4.
RING_PLACES = ((0.20, 0.58), (0.38, 0.68), (0.64, 0.66), (0.80, 0.55))
RING_INDEX = (1, -1, 1, -1)

OUT_OF_SIGHT_TEXTS = (
    ("Two in front", "Moved behind"),
    ("Two pairs", "Each moved onto its opposite"),
    ("Nine on the face and ears", "Moved behind the head"),
)

#: Least distances of hidden singularities from visible vertices and from other singularities, relative to
#: `Surface.extent`.
HIDDEN_DEPTH, HIDDEN_DISTANCE = 0.12, 0.06

#: Number of pieces in which each stroke is drawn in the film, and milliseconds per frame.
PIECES, MILLISECONDS = 5, 150


def write() -> None:
    """Draw and save all pictures."""
    head = suzanne()
    frames = list(_combed(head))
    panels = [
        Panel(_picture(head, frames[0][0], ANGLES, WIDE), "Smoothest"),
        Panel(_picture(head, frames[-1][0], ANGLES, WIDE), "Combed with five strokes"),
    ]
    save(sheet([panels]), IMAGES / "editing-comb.png")
    save(sheet(_out_of_sight()), IMAGES / "editing-singularities.png")
    film = []
    for field, lines in frames:
        picture = _picture(head, field, ANGLES, FILM)
        for line in lines:
            picture = with_line(picture, line, 4, INK) if len(line) > 1 else picture
        film.append(Image.fromarray(picture).quantize(16, dither=Image.Dither.NONE))
    durations = [8 * MILLISECONDS, *[MILLISECONDS] * (len(film) - 2), 15 * MILLISECONDS]
    options = {"save_all": True, "append_images": film[1:], "duration": durations, "loop": 0}
    film[0].save(IMAGES / "editing-comb.gif", **options)


def _picture(
    surface: Surface, field: RosyField, angles: tuple[float, float], side: int, **settings: object
) -> np.ndarray:
    """Draw a field with the preset *engraving*.

    With `settings`, marks such as singularities are drawn too.
    """
    look = load_preset("engraving").look
    instance = MeshInstance(surface, np.eye(4), field)
    if settings:
        view_input = ViewInput((instance,), view(surface, angles, (side, side), 1), look)
        return display(draw_picture(replace(view_input, look=replace(look, **settings))).rgba)
    camera = view(surface, angles, (side, side), look.supersampling)
    return display(compose_view(surface, field, look, camera).rgba)


def _out_of_sight() -> list[list[Panel]]:
    """Draw a sphere, a torus and a head before and after their singularities were moved."""
    ball, ring, head = sphere(), torus(), suzanne()
    ball_field, head_field = generate(ball, "smoothest", 4), generate(head, "smoothest", DEGREE)
    drawn = (
        (ball, BALL_ANGLES, ball_field, _moved_out_of_sight(ball, ball_field, BALL_ANGLES)),
        (ring, RING_ANGLES, *_two_pairs(ring)),
        (head, ANGLES, head_field, _moved_out_of_sight(head, head_field, ANGLES)),
    )
    rows: list[list[Panel]] = [[], []]
    for (surface, angles, *fields), texts in zip(drawn, OUT_OF_SIGHT_TEXTS, strict=True):
        for row, field, text in zip(rows, fields, texts, strict=True):
            picture = _picture(surface, field, angles, SIDE, singularity_dots="visible")
            row.append(Panel(picture, text))
    return rows


def _two_pairs(ring: Surface) -> tuple[RosyField, RosyField]:
    """Return a field with two pairs of opposite singularities, and the field after each pair was merged."""
    camera = view(ring, RING_ANGLES, (SIDE, SIDE), 2)
    places = points_on_surface(ring, camera, np.array(RING_PLACES))
    vertex = cKDTree(ring.vertices).query(places)[1]
    settings = GeneratorSettings("prescribed", singularities=(vertex, np.array(RING_INDEX)))
    field = merged = generate(ring, settings, 4)
    for source, target in vertex.reshape(-1, 2):
        merged = move_index(ring, merged, int(source), int(target), reach=ring.extent)
    return field, merged


def _moved_out_of_sight(
    surface: Surface, field: RosyField, angles: tuple[float, float]
) -> RosyField:
    """Move each visible singularity of a field to a near vertex that the camera does not see."""
    camera = view(surface, angles, (SIDE, SIDE), 2)
    points = surface.vertices
    instance = MeshInstance(surface, np.eye(4))
    is_seen = project_vertices([instance], camera, [np.arange(len(points))]).is_visible
    singular, _ = find_singularities(surface, field)
    depth = cKDTree(points[is_seen]).query(points)[0]
    hidden = np.flatnonzero(depth > HIDDEN_DEPTH * surface.extent)
    for source in singular[is_seen[singular]]:
        distance = cKDTree(points[singular]).query(points[hidden])[0]
        free = hidden[distance > HIDDEN_DISTANCE * surface.extent]
        target = free[np.linalg.norm(points[free] - points[source], axis=1).argmin()]
        field = move_index(surface, field, int(source), int(target))
        singular[singular == source] = target
    return field


def _combed(head: Surface) -> Iterator[tuple[RosyField, list[np.ndarray]]]:
    """Comb the field of the head. Yield the field and the strokes so far, after each piece of a stroke."""
    field = generate(head, "smoothest", DEGREE)
    yield field, []
    system = guided_system(head, DEGREE)
    no_guides = np.zeros((head.face_count, 3))
    combing = start_combing(system, field, no_guides, 0.1 * head.extent)
    lines: list[np.ndarray] = []
    for ends in STROKES:
        curve = curve_through(*ends)
        stroke = BrushStroke(
            system,
            combing.guides,
            GuideBrush(RADIUS),
            lambda places: head.triangle_face[closest_triangles(head, places)[0]],
        )
        lines.append(curve[:0])
        for piece in np.array_split(np.arange(len(curve)), PIECES):
            points = points_on_surface(head, view(head, ANGLES, (WIDE, WIDE), 2), curve[piece])
            combing.follow(stroke.extend(points, np.ones(len(points))))
            lines[-1] = curve[: piece[-1] + 1]
            yield RosyField(DEGREE, combing.vectors), list(lines)
        combing.follow(stroke.finish())
        combing.settle()
        yield RosyField(DEGREE, combing.vectors), list(lines)
    yield RosyField(DEGREE, combing.vectors), []
