"""Overlays over the picture of a 3D view: dots at singularities, their labels, arrowheads, messages."""

import textwrap
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from functools import partial

import blf
import gpu
import numpy as np
from bpy.types import Area, Context, Region
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

from ..annotation import arrow_marks, singularity_marks
from ..annotation.arrow_marks import ArrowMarks
from ..annotation.draw_marks import head_outline
from ..annotation.index_labels import MAX_LABELS, place_indices
from ..annotation.singularity_settings import shows_hidden_singularities, shows_indices
from ..compositor.look import Look
from ..core.cache import Cache
from ..core.color import from_hex
from ..core.errors import as_sentence
from ..field.singularities import find_singularities
from ..gpu.preparation import Preparation
from ..projection.gbuffer import MeshInstance, with_field
from ..projection.visible_vertices import is_cut_away
from ..rendering.marks import view_arrows
from ..rendering.view_input import ViewInput
from ..worker.job import Call

#: Number of sides of the polygon that approximates a disc.
DISC_SEGMENTS = 20

#: Surfaces in front of a point do not hide it within this distance, as a fraction of the view distance.
NEAR_SURFACE = 1e-3

#: Height of labels, in diameters of a dot of index 1 / N.
LABEL_SIZE = 4 / 3

#: Seconds that finding the singularities takes for each triangle of a mesh.
SINGULARITY_SECONDS = 1.2e-6

#: Arrowheads are moved toward the eye, so that surfaces do not hide them. `NEARNESS` is this offset, and
#: `OUTLINE_DISTANCE` how much smaller it is for their outlines, in lengths of an arrowhead. `SLOPE` is an
#: additional offset for slanted surfaces, as a multiple of the distance on screen of an arrowhead from its
#: point on the surface.
NEARNESS, OUTLINE_DISTANCE, SLOPE = 1.5, 0.5, 2.5

#: Largest number of triangles of a view for which the hidden points of arrowheads are found exactly. In views
#: with more triangles, hidden arrowheads leave gaps.
MAX_EXACT_TRIANGLES = 200_000

#: Points of the arc around a corner of an outline.
ARC_POINTS = 4


def _facing_triangles(
    context: Context, points: np.ndarray, offset: np.ndarray, nearness: np.ndarray
) -> np.ndarray:
    """Return the (K M, 3) float32 corners of triangles at K points, facing the eye, in world space.

    Parameters
    ----------
    context : bpy.types.Context
        Context of the region that is drawn.
    points : (K, 3) ndarray
        World space.
    offset : (K, M, 2) ndarray
        M corners of triangles at each point, in pixels from the point, parallel to the view plane.
    nearness : (K,) ndarray
        Distance in pixels by which the triangles are moved toward the eye. This does not move them on screen.
    """
    view, window = context.region_data, context.region
    view_to_world = np.array(view.view_matrix.inverted())
    right, up, back, eye = view_to_world[:3].T
    depth, toward_eye = np.ones(len(points)), np.broadcast_to(back, points.shape)
    if view.is_perspective:
        depth = (eye - points) @ back
        toward_eye = (eye - points) / depth[:, None]
    pixel = depth * (2 / (view.window_matrix[0][0] * window.width))
    step = offset @ np.stack([right, up]) + (nearness[:, None] * toward_eye)[:, None]
    return (points[:, None] + pixel[:, None, None] * step).reshape(-1, 3).astype(np.float32)


def _fan(outline: np.ndarray) -> np.ndarray:
    """Return the (3 n, 2) corners of the triangles between the origin and the n edges of a closed outline."""
    ends = outline, np.roll(outline, -1, axis=0)
    return np.stack([np.zeros_like(outline), *ends], axis=1).reshape(-1, 2)


def _unit_vectors(first: float, last: float, count: int = ARC_POINTS) -> np.ndarray:
    """Return (count, 2) unit vectors, at equal steps from the first to the last angle, in radians."""
    angles = np.linspace(first, last, count)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _draw_triangles(parts: Sequence[tuple[np.ndarray, str]], *, shows_hidden: bool = False) -> None:
    """Draw triangles in a view. Surfaces in front of them hide them.

    Parameters
    ----------
    parts : sequence of ((n, 3) ndarray, str)
        Corners of triangles in world space, and their color. Later parts cover earlier ones.
    shows_hidden : bool
        Whether the triangles are also drawn over the surfaces that hide them, with less opacity.
    """
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    gpu.state.blend_set("ALPHA")
    hidden = ("NONE", singularity_marks.HIDDEN_OPACITY)
    for depth_test, opacity in (*[hidden] * shows_hidden, ("LESS_EQUAL", 1.0)):
        gpu.state.depth_test_set(depth_test)
        for vertices, code in parts:
            if len(vertices):  # Blender cannot make a batch without vertices
                shader.uniform_float("color", (*from_hex(code).tolist(), opacity))
                batch_for_shader(shader, "TRIS", {"pos": vertices}).draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


@dataclass(frozen=True, eq=False)
class SingularityDots:
    """The singularities of an object.

    Attributes
    ----------
    points : (K, 3) ndarray
        Positions in world space.
    index : (K,) int ndarray
        Indices of the singularities, in units of 1 / N.
    degree : int
        N.
    """

    points: np.ndarray
    index: np.ndarray
    degree: int


@dataclass(eq=False)
class ViewOverlay:
    """The marks and messages over the picture of a region of a live view.

    Attributes
    ----------
    problem : str or None
        Why the view shows no picture, or a picture by another LIC method than the look has.
    lines : list of str
        Rows of text in the view, as they were drawn last.
    labeled : (list of SingularityDots, float) or None
        The dots that have labels, and the diameter in pixels of the dot of a singularity of index 1 / N. None
        if no dots have labels.
    arrowheads : (hashable, ArrowMarks) or None
        A key of everything that the arrowheads depend on, and the arrowheads.
    """

    problem: str | None = None
    lines: list[str] = field(default_factory=list)
    labeled: tuple[list[SingularityDots], float] | None = None
    arrowheads: tuple[Hashable, ArrowMarks] | None = None


def look_up_singularities(
    instance: MeshInstance, cache: Cache
) -> tuple[np.ndarray, np.ndarray] | Preparation:
    """Look up the singularities of an instance with a field, or return a `Preparation` that finds them.

    They are (K,) vertices and their (K,) indices in units of 1 / N; see `field.find_singularities`. They are
    found on the rest shape, so all deformations of a mesh have the same ones.
    """
    surface = instance.surface
    key = "singularities", surface.rest_shape_key, instance.field
    found = cache.get(key)
    if found is not None:
        return found
    arguments = surface.in_rest_shape(), instance.field
    call = Call(find_singularities, arguments, label="finding singularities")
    return Preparation(call, SINGULARITY_SECONDS * len(surface.triangles), partial(cache.put, key))


def draw_dots(
    context: Context, objects: Sequence[SingularityDots], size: float, *, shows_hidden: bool = False
) -> None:
    """Draw dots in a view. Surfaces in front of dots hide them.

    Parameters
    ----------
    context : bpy.types.Context
    objects : sequence of SingularityDots
    size : float
        Diameter of the dot of a singularity of index 1 / N, in pixels.
    shows_hidden : bool
        Whether hidden dots are drawn as well, with less opacity.
    """
    outline = singularity_marks.OUTLINE * size
    disc = _fan(_unit_vectors(0.0, 2 * np.pi, DISC_SEGMENTS + 1)[:-1])
    parts = []
    for dots in objects:
        radii = singularity_marks.dot_diameters(dots.index, size) / 2
        for sign, code in singularity_marks.COLOR_BY_SIGN.items():
            chosen = np.sign(dots.index) == sign
            points, radius = dots.points[chosen], radii[chosen]
            # The outline first, slightly behind the dot.
            for part_radius, nearness, color in (
                (radius + outline, 2 * radius, singularity_marks.OUTLINE_COLOR),
                (radius, 3 * radius, code),
            ):
                offset = part_radius[:, None, None] * disc
                parts.append((_facing_triangles(context, points, offset, nearness), color))
    _draw_triangles(parts, shows_hidden=shows_hidden)


def draw_singularities(
    context: Context, view_input: ViewInput, look: Look, overlay: ViewOverlay, cache: Cache
) -> None:
    """Draw the dots of a view, and store in its overlay those that get labels.

    Singularities that have not been computed yet are left out.
    """
    dots = []
    for instance in with_field(view_input.instances):
        if isinstance(look_up_singularities(instance, cache), Preparation):
            continue
        vertex, index = singularity_marks.shown_singularities(instance, look, cache)
        points = instance.world_points()[vertex]
        kept = ~is_cut_away(points, view_input.clip_planes)
        dots.append(SingularityDots(points[kept], index[kept], instance.field.degree))
    draw_dots(context, dots, look.singularity_size, shows_hidden=shows_hidden_singularities(look))
    if shows_indices(look):
        overlay.labeled = dots, look.singularity_size


def draw_labels(context: Context, objects: Sequence[SingularityDots], size: float) -> None:
    """Draw the index of each visible dot beside the dot, where there is room for it.

    Parameters
    ----------
    context : bpy.types.Context
    objects : sequence of SingularityDots
        Objects with more than `MAX_LABELS` dots get no labels.
    size : float
        Diameter of the dot of a singularity of index 1 / N, in pixels.
    """
    font_id = 0
    blf.size(font_id, LABEL_SIZE * size)
    blf.color(font_id, 1.0, 1.0, 1.0, 1.0)
    blf.enable(font_id, blf.SHADOW)
    blf.shadow(font_id, 5, 0.0, 0.0, 0.0, 1.0)
    labels = []
    for dots in objects:
        if len(dots.index) > MAX_LABELS:
            continue
        for point, index in zip(dots.points, dots.index.tolist(), strict=True):
            place = location_3d_to_region_2d(context.region, context.region_data, Vector(point))
            if place is not None and not is_occluded(context, point):
                labels.append((place, index, dots.degree))
    columns = map(np.array, zip(*labels, strict=True)) if labels else np.empty((3, 0))
    frame = context.region.width, context.region.height
    label_size = partial(blf.dimensions, font_id)
    for text, left, bottom in place_indices(*columns, size, label_size, frame):
        blf.position(font_id, left, bottom, 0)
        blf.draw(font_id, text)
    blf.disable(font_id, blf.SHADOW)


def is_occluded(context: Context, point: np.ndarray) -> bool:
    """Return whether a surface is between a point in world space and the camera.

    Surfaces very close to the point do not count, so that the point may lie on one; see `NEAR_SURFACE`.
    """
    point = Vector(point)
    view_to_world = context.region_data.view_matrix.inverted()
    view_direction = view_to_world.col[2].xyz
    if context.region_data.is_perspective:
        view_direction = view_to_world.translation - point
    view_direction.normalize()
    start = point + NEAR_SURFACE * context.region_data.view_distance * view_direction
    return context.scene.ray_cast(context.view_layer.depsgraph, start, view_direction)[0]


def draw_view_arrowheads(
    context: Context, view: ViewInput, key: Hashable, overlay: ViewOverlay, cache: Cache
) -> None:
    """Draw arrowheads over the lines of a view. Surfaces in front of arrowheads hide them.

    The arrowheads are kept in `overlay`, and are placed again only if `key`, the key of the view, changes.
    """
    if overlay.arrowheads is None or overlay.arrowheads[0] != key:
        triangles = sum(len(instance.surface.triangles) for instance in view.instances)
        is_exact = triangles <= MAX_EXACT_TRIANGLES
        overlay.arrowheads = key, view_arrows(view, cache, is_exact=is_exact)
    marks = overlay.arrowheads[1]
    parts = [
        (_arrowheads(context, marks, grown, nearness * marks.size), code)
        for grown, code, nearness in (
            (marks.outline, arrow_marks.OUTLINE_COLOR, NEARNESS - OUTLINE_DISTANCE),
            (0.0, arrow_marks.FILL_COLOR, NEARNESS),
        )
    ]
    _draw_triangles(parts)


def _arrowheads(context: Context, marks: ArrowMarks, grown: float, nearness: float) -> np.ndarray:
    """Return the (n, 3) float32 corners, in world space, of triangles of arrowheads that face the camera.

    The outline of each arrowhead is moved outward by `grown` pixels, and the arrowhead is moved toward the
    camera by `nearness` pixels.
    """
    corners = _fan(_grown_outline(head_outline(marks.size), grown))
    forward, left = marks.direction, marks.direction[:, ::-1] * (-1, 1)
    step = marks.position - marks.place
    offset = step[:, None] + (corners[:, :1] * forward[:, None] + corners[:, 1:] * left[:, None])
    return _facing_triangles(context, marks.anchor, offset, nearness + SLOPE * np.hypot(*step.T))


def _grown_outline(outline: np.ndarray, grown: float) -> np.ndarray:
    """Return the (n, 2) corners, in pixels, of the outline of an arrowhead with a margin around it.

    The margin is `grown` pixels wide and has round corners. `outline` is the result of `head_outline`.
    """
    tip, barb, notch = outline
    # The sides run counter-clockwise from the tip, so their right sides are outside.
    side, back = (np.arctan2(-way[0], way[1]) % (2 * np.pi) for way in (barb - tip, notch - barb))
    half = [tip + grown * _unit_vectors(0.0, side), barb + grown * _unit_vectors(side, back)]
    half = np.concatenate([*half, [notch + (grown / np.cos(back), 0.0)]])
    return np.concatenate([half, (half * (1, -1))[-2:0:-1]])


#: Color of messages: RGBA, display values.
_COLOR = 1.0, 0.6, 0.2, 1.0

#: In pixels at a user interface scale of 1: font size, line height, and distances from the lower left corner.
_FONT_SIZE, _LINE_HEIGHT, _LEFT, _BOTTOM = 12, 18, 16, 64

#: Smallest number of characters in a row of text, however narrow the view is.
_MIN_CHARACTERS = 20


def draw_messages(messages: Sequence[str], context: Context) -> None:
    """Draw messages in the lower left corner of the context's region, the first one lowest.

    Lines are wrapped to the width of the region that the sidebar does not cover.
    """
    if not messages:
        return
    ui_scale = context.preferences.system.ui_scale
    blf.size(0, _FONT_SIZE * ui_scale)
    blf.color(0, *_COLOR)
    width = _uncovered_width(context.area, context.region) - 2 * _LEFT * ui_scale
    character_width = blf.dimensions(0, "abcdefghijklmnopqrst")[0] / 20
    max_characters = max(int(width / character_width), _MIN_CHARACTERS)
    rows = [
        row
        for message in messages
        for row in reversed(textwrap.wrap(f"RoSy: {as_sentence(message)}", max_characters))
    ]
    for index, row in enumerate(rows):
        blf.position(0, _LEFT * ui_scale, (_BOTTOM + _LINE_HEIGHT * index) * ui_scale, 0)
        blf.draw(0, row)


def _uncovered_width(area: Area, region: Region) -> int:
    """Return the width, in pixels, of the part of a region that no sidebar overlaps."""
    sidebars = (
        other.x - region.x
        for other in area.regions
        if other.type == "UI" and other.alignment == "RIGHT" and other.width > 1
    )
    return min(region.width, *(left for left in sidebars if left > 0), region.width)
