"""The pictures of docs/editing.md: a head whose field is combed, the film of it, and singularities."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from PIL import Image, ImageDraw
from scipy.spatial import cKDTree

from rosy_addon.compositor.look import Look
from rosy_addon.field.closest_point import closest_triangles
from rosy_addon.field.combing import BrushStroke, Combing, GuideBrush, start_combing
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.guided_system import guided_system
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.singularity_changes import move_index
from rosy_addon.field.surface import Surface
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.visible_vertices import project_vertices

from .fields_page import dotted_picture
from .page import ROOT
from .shapes import sphere, suzanne, torus
from .sheet import Panel, display, save, sheet
from .solid import compose_view, curve_through, points_on_surface, view

IMAGES = ROOT / "docs" / "images"

DEGREE, WIDE, FILM, SIDE = 2, 394, 320, 256
ANGLES, BALL_ANGLES, RING_ANGLES = (-26, 8), (-26, 30), (20, 40)

#: Strokes on Suzanne: start, middle and end of each, as fractions of the picture from the top left.
STROKES = (
    ((0.34, 0.37), (0.50, 0.26), (0.67, 0.17)),
    ((0.48, 0.36), (0.58, 0.285), (0.685, 0.35)),
    ((0.475, 0.38), (0.58, 0.485), (0.69, 0.39)),
    ((0.36, 0.45), (0.50, 0.54), (0.64, 0.59)),
    ((0.66, 0.62), (0.665, 0.75), (0.64, 0.88)),
)
INK, RADIUS = (214, 84, 20), 0.14

#: Singularities on a torus, as fractions of the picture from the top left, and their indices.
RING_PLACES = ((0.20, 0.58), (0.38, 0.68), (0.64, 0.66), (0.80, 0.55))
RING_INDEX = (1, -1, 1, -1)

OUT_OF_SIGHT_TEXTS = (
    ("Two in front", "Moved behind"),
    ("Two pairs", "Each moved onto its opposite"),
    ("Nine on the face and ears", "Moved behind the head"),
)

#: Distance of hidden singularities from what is seen, and from others, relative to the size.
HIDDEN_DEPTH, HIDDEN_DISTANCE = 0.12, 0.06

#: Pieces of each stroke in the film, and milliseconds a frame.
PIECES, MILLISECONDS = 5, 150


def write() -> None:
    """Draw and save all pictures."""
    head = suzanne()
    look = load_preset("engraving").look
    frames = list(_combed(head))
    first, last = frames[0][0], frames[-1][0]
    panels = [
        Panel(_picture(head, first, look, WIDE), "Smoothest"),
        Panel(_picture(head, last, look, WIDE), "Combed with five strokes"),
    ]
    save(sheet([panels]), IMAGES / "editing-comb.png")
    save(sheet(_out_of_sight()), IMAGES / "editing-singularities.png")
    pictures = [_with_strokes(_picture(head, field, look, FILM), lines) for field, lines in frames]
    film = [Image.fromarray(picture).quantize(16, dither=Image.Dither.NONE) for picture in pictures]
    film[0].save(
        IMAGES / "editing-comb.gif",
        save_all=True,
        append_images=film[1:],
        duration=[8 * MILLISECONDS, *[MILLISECONDS] * (len(film) - 2), 15 * MILLISECONDS],
        loop=0,
    )


def _out_of_sight() -> list[list[Panel]]:
    """Draw a sphere, a torus and a head before and after their singularities were moved."""
    ball, ring, head = sphere(), torus(), suzanne()
    camera = view(ring, RING_ANGLES, (SIDE, SIDE), 2)
    places = points_on_surface(ring, camera, np.array(RING_PLACES))
    vertex = cKDTree(ring.vertices).query(places)[1]
    settings = GeneratorSettings("prescribed", singularities=(vertex, np.array(RING_INDEX)))
    ring_field = generate(ring, settings, 4)
    merged = ring_field
    for source, target in vertex.reshape(-1, 2):
        merged = move_index(ring, merged, int(source), int(target), reach=ring.extent)
    ball_field, head_field = generate(ball, "smoothest", 4), generate(head, "smoothest", DEGREE)
    drawn = (
        (ball, BALL_ANGLES, ball_field, _moved_out_of_sight(ball, ball_field, BALL_ANGLES)),
        (ring, RING_ANGLES, ring_field, merged),
        (head, ANGLES, head_field, _moved_out_of_sight(head, head_field, ANGLES)),
    )
    look = load_preset("engraving").look
    before, after = [], []
    for (surface, angles, field, moved), texts in zip(drawn, OUT_OF_SIGHT_TEXTS, strict=True):
        for row, shown, text in ((before, field, texts[0]), (after, moved, texts[1])):
            row.append(Panel(dotted_picture(surface, shown, look, angles, SIDE), text))
    return [before, after]


def _moved_out_of_sight(
    surface: Surface, field: RosyField, angles: tuple[float, float]
) -> RosyField:
    """Move each singularity that is seen to a near place that is not seen."""
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
    """Yield the field and the strokes so far, piece by piece."""
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
            yield _field(combing), list(lines)
        combing.follow(stroke.finish())
        combing.settle()
        yield _field(combing), list(lines)
    yield _field(combing), []


def _field(combing: Combing) -> RosyField:
    return RosyField(DEGREE, combing.vectors)


def _picture(head: Surface, field: RosyField, look: Look, side: int) -> np.ndarray:
    camera = view(head, ANGLES, (side, side), look.supersampling)
    return display(compose_view(head, field, look, camera).rgba)


def _with_strokes(picture: np.ndarray, lines: list[np.ndarray]) -> np.ndarray:
    """Draw strokes, in fractions of the picture."""
    image = Image.fromarray(picture)
    pen = ImageDraw.Draw(image)
    for line in lines:
        if len(line) > 1:
            pen.line(
                [tuple(point) for point in (line * FILM).tolist()], fill=INK, width=4, joint="curve"
            )
    return np.asarray(image)
