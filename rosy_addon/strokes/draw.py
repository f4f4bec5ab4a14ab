"""The whole of a drawing: strokes on several bodies, as dense as is asked for, seen by a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import reduce
from typing import Any

import numpy as np

from ..errors import RosyError
from ..field.frames import dot
from ..progress import Progress, Work, drain, part
from ..projection.camera import Camera
from ..projection.gbuffer import Body
from .crossings import with_gaps
from .density import (
    Lamp,
    at_points,
    by_curvature,
    by_tone,
    foreshortened,
    lit,
    pixel_spacing,
    weighed_by_tone,
)
from .ends import meeting
from .families import label_families
from .ground import lay_ground
from .outline import KINDS, outline
from .overshoot import loose_at_edges, overshot
from .seen import in_frame, on_screen, pixel_size, seen
from .strokes import COLUMNS, Strokes
from .svg import Pen, simplified
from .trace import tracing

#: Width of tapered strokes at their very ends.
LEAST_WIDTH = 0.15

#: Share of the distance of a body at which its spacings are least, if no vertex is in the frame.
NEAREST = 0.1

#: Pixels by which thinned strokes may miss the points that are left out, and how many pixels the
#: full width counts for there.
TOLERANCE, WIDTH_COUNTS = 0.08, 2.0

#: Steepness up to which lines are lifted farther off the surface.
STEEPEST = 12.0


def _setting(default: Any, text: str, **rules: Any) -> Any:
    return field(default=default, metadata={"text": text, **rules})


@dataclass(frozen=True)
class Manner:
    """How strokes are laid: what the panel shows, and what the command line takes.

    Each field's metadata says its range or options and what it does, in words a user meets.
    """

    unit: str = _setting(
        "pixels",
        "What the spacing is counted in",
        options={
            "pixels": "Pixels of the picture",
            "world": "Blender units, on the surface",
        },
    )
    spacing: float = _setting(
        8.0, "Pixels from one stroke of a family to the next", low=0.5, high=1e4, unit="pixels"
    )
    distance: float = _setting(
        0.1,
        "Blender units from one stroke of a family to the next",
        low=1e-6,
        high=1e6,
        unit="length",
    )
    tone: bool = _setting(
        False,
        "Bring strokes nearer to each other where the light is weak, and lift the pen where it is "
        "strong",
    )
    layering: float = _setting(
        0.3,
        "With tone: how much darker it has to be for each next family to begin",
        low=0.0,
        high=1.0,
    )
    light: str = _setting(
        "headlight",
        "Where that light comes from",
        options={
            "headlight": "The eye",
            "lamp": "A lamp over the left shoulder",
            "scene": "The lights of the scene",
        },
    )
    curvature: float = _setting(
        0.0, "Bring strokes nearer to each other where the surface bends more", low=0.0, high=1.0
    )
    gaps: float = _setting(
        0.0, "Gap in the lower of two strokes where they cross, in spacings", low=0.0, high=1.0
    )
    taper: float = _setting(
        0.8,
        "Over how many spacings strokes get thinner toward their ends, but where two meet head on",
        low=0.0,
        high=1e3,
    )
    overshoot: float = _setting(
        0.0,
        "Up to how many pixels strokes run on where the surface or the shade ends, or something "
        "is in front",
        low=0.0,
        high=1e3,
        unit="pixels",
    )
    outline: bool = _setting(False, "Draw silhouettes, creases and borders, too")
    hidden: bool = _setting(False, "Keep what the camera does not see")
    cross_creases: bool = _setting(False, "Let strokes go on over sharp edges")

    def __post_init__(self) -> None:
        for entry in fields(self):
            value, rules = getattr(self, entry.name), entry.metadata
            if "options" in rules and value not in rules["options"]:
                known = ", ".join(rules["options"])
                raise RosyError(f"{entry.name} of strokes: {value!r} is none of {known}")
            if "low" in rules and not rules["low"] <= value <= rules["high"]:
                raise RosyError(
                    f"{entry.name} of strokes: {value:g} is not from {rules['low']:g} to "
                    f"{rules['high']:g}"
                )


@dataclass(frozen=True, eq=False)
class Drawn:
    """Strokes of several bodies.

    Attributes
    ----------
    strokes : Strokes
        Families of all bodies by their names; the kinds of outline come last.
    body : (S,) int32 ndarray
        Of which body each stroke is, counted among all that were given.
    hidden : bool
        Whether those that the camera does not see are among them.
    """

    strokes: Strokes
    body: np.ndarray
    hidden: bool = False


def draw(bodies: Sequence[Body], camera: Camera, manner: Manner | None = None, **more) -> Drawn:
    """`drawing`, run to its end."""
    return drain(drawing(bodies, camera, manner, **more))


def drawing(
    bodies: Sequence[Body],
    camera: Camera,
    manner: Manner | None = None,
    *,
    lights: Sequence[Lamp] = (),
    framed: bool = True,
) -> Work[Drawn]:
    """Cover bodies with strokes, and leave out what a camera does not see.

    Parameters
    ----------
    bodies : sequence of Body
        Those with a field are drawn on; all of them hide.
    camera : Camera
        Which also says how long a pixel is.
    manner : Manner, optional
    lights : sequence of Lamp
        For the tone, in the space of the camera; the eye is the light if there are none.
    framed : bool
        Whether strokes end at the frame although hidden ones are kept.

    Yields
    ------
    Progress

    Returns
    -------
    Drawn

    Raises
    ------
    RosyError
        If there is no field, a spacing is impossible, or there is nothing to be seen.
    """
    manner = manner or Manner()
    owners = [number for number, body in enumerate(bodies) if body.field is not None]
    if not owners:
        raise RosyError("there is no field to draw strokes along")
    if framed or not manner.hidden:
        owners = [number for number in owners if _is_in_view(bodies[number], camera)]
    parts = []
    for place, number in enumerate(owners):
        start, stop = (0.05 + 0.8 * done / len(owners) for done in (place, place + 1))
        work = _on_body(bodies[number], camera, manner, lights)
        parts.append((yield from part(work, start, stop)))
    if not parts:
        raise RosyError(f"camera '{camera.name}' sees none of the strokes")
    strokes = reduce(Strokes.joined, parts)
    if not len(strokes):
        raise RosyError("there is no room for a stroke: ask for a narrower spacing")
    if framed or not manner.hidden:
        yield Progress(0.85, "finding what is seen")
        strokes = seen(strokes, bodies, camera, hide=not manner.hidden)
    if manner.overshoot:
        strokes = _run_on(strokes, bodies, camera, manner, framed)
    if not len(strokes):
        raise RosyError(f"camera '{camera.name}' sees none of the strokes")
    counts = [len(one.names) for one in parts]
    body = np.repeat(np.array(owners, dtype=np.int32), counts)[strokes.family]
    return Drawn(_by_name(strokes), body, manner.hidden)


def _on_body(body: Body, camera: Camera, manner: Manner, lights: Sequence[Lamp]) -> Work[Strokes]:
    """Strokes, and the outline, hidden or not."""
    spacing = _spacing(body, camera, manner)
    tone = lit(body, camera, lights) if manner.tone else None
    if tone is not None:
        spacing = by_tone(spacing, tone)
    if manner.curvature:
        spacing = by_curvature(body.surface, spacing, manner.curvature)
    strokes = yield from tracing(body, spacing, cross_creases=manner.cross_creases)
    strokes = label_families(strokes, lay_ground(body), camera.view[0, :3])
    if manner.overshoot:
        strokes = loose_at_edges(strokes, lay_ground(body, cross_creases=manner.cross_creases))
    if tone is not None:
        here = at_points(strokes, body.surface, tone)
        strokes = weighed_by_tone(strokes, here, manner.layering)
    if manner.gaps:
        strokes = with_gaps(strokes, manner.gaps, weave=True)
    if manner.taper:
        at = ~meeting(strokes)
        if manner.overshoot:
            # Those that are to run on get thinner there.
            at &= ~strokes.is_loose
        strokes = strokes.tapered(manner.taper, LEAST_WIDTH, at)
    if manner.outline:
        strokes = Strokes.joined(strokes, outline(body, camera))
    return strokes


def _run_on(
    strokes: Strokes, bodies: Sequence[Body], camera: Camera, manner: Manner, framed: bool
) -> Strokes:
    """Loose ends run on, up to the frame."""
    over = None if manner.hidden else bodies
    strokes = overshot(strokes, camera, manner.overshoot, over)
    if framed or not manner.hidden:
        inside = in_frame(on_screen(strokes.points, camera)[0], camera)
        strokes = strokes.runs(inside, loose=False)
    return strokes.tapered(manner.taper, LEAST_WIDTH, strokes.is_loose)


def _spacing(body: Body, camera: Camera, manner: Manner) -> np.ndarray:
    """(V,) world space. Out of the frame it does not get smaller than it is within.

    Else what is beside the eye, or behind it, would be covered with strokes without end.
    """
    if manner.unit == "world":
        return np.full(len(body.surface.vertices), manner.distance)
    spacing = foreshortened(body, camera, pixel_spacing(body, camera, manner.spacing))
    points = body.world_points()
    pixels, _ = on_screen(points, camera)
    inside = in_frame(pixels, camera)
    if not camera.is_perspective:
        return spacing
    if inside.any():
        return np.maximum(spacing, spacing[inside].min())
    far = float(np.linalg.norm(points - camera.eye, axis=1).mean()) / camera.pixels_per_unit
    share = NEAREST if _is_in_view(body, camera) else 1.0
    return np.maximum(spacing, manner.spacing * share * far)


def _is_in_view(body: Body, camera: Camera) -> bool:
    """False only if all of a body is beyond one of the sides of what a camera sees."""
    points = body.world_points()
    matrix = camera.projection @ camera.view
    clip = points @ matrix[:, :3].T + matrix[:, 3]
    beyond = np.abs(clip[:, :2]) > clip[:, 3:]
    sides = np.concatenate([beyond & (clip[:, :2] > 0), beyond & (clip[:, :2] < 0)], axis=1)
    return not (sides.all(axis=0).any() or (clip[:, 2] < -clip[:, 3]).all())


def _by_name(strokes: Strokes) -> Strokes:
    """Families of one name made one, with the kinds of outline at the end."""
    names = sorted(set(strokes.names), key=lambda name: (name in KINDS, strokes.names.index(name)))
    number = np.array([names.index(name) for name in strokes.names], dtype=np.int32)
    return replace(strokes, family=number[strokes.family], names=tuple(names))


@dataclass(frozen=True, eq=False)
class Lines:
    """Strokes as lines in space that have a width.

    Attributes
    ----------
    strokes : Strokes
        With those points alone that are needed.
    body : (S,) int32 ndarray
        As in `Drawn`.
    points : (n, 3) float64 ndarray
        Where they are to be, world space.
    radius : (n,) float64 ndarray
        World space.
    colours : list of str
        Of the families.
    """

    strokes: Strokes
    body: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    colours: list[str]


def as_lines(drawn: Drawn, camera: Camera, pen: Pen) -> Lines:
    """Strokes as they are drawn with a pen whose width is in pixels of a camera."""
    strokes = thinned(drawn.strokes, camera)
    # Strokes that go on behind the silhouette have no side of their own to come forward on.
    points = (raised if drawn.hidden else lifted)(strokes, camera, pen.width)
    radius = pen.width / 2 * pixel_size(points, camera) * strokes.width
    return Lines(strokes, drawn.body, points, radius, pen.inks(strokes.names))


def thinned(strokes: Strokes, camera: Camera) -> Strokes:
    """Without the points that make no difference: less than `TOLERANCE` pixels.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
        That says how long a pixel is.
    """
    pixel = pixel_size(strokes.points, camera)
    least = np.minimum.reduceat(pixel, strokes.start[:-1])
    least = np.maximum(least, 1e-3 * pixel.max())[strokes.stroke]
    shape = np.column_stack([strokes.points / least[:, None], WIDTH_COUNTS * strokes.width])
    kept = simplified(shape, strokes.start, TOLERANCE)
    return replace(
        strokes,
        start=np.concatenate([[0], np.cumsum(np.add.reduceat(kept, strokes.start[:-1]))]),
        **{name: getattr(strokes, name)[kept] for name in COLUMNS},
    )


def raised(strokes: Strokes, camera: Camera, width: float) -> np.ndarray:
    """(n, 3) float64: the points moved off the surface along its normals, by a width in pixels."""
    return strokes.points + width * pixel_size(strokes.points, camera)[:, None] * strokes.normal


def lifted(strokes: Strokes, camera: Camera, width: float) -> np.ndarray:
    """(n, 3) float64: the points moved toward a camera that sees them.

    In the picture they stay where they are. Ribbons of that width that face the camera are then in
    front of the surface: the more slanted it is, the farther they have to come, and yet they are
    hardly higher above it.

    Parameters
    ----------
    strokes : Strokes
    camera : Camera
    width : float
        In pixels' lengths at a point's depth.
    """
    toward = camera.toward(strokes.points)
    facing = np.abs(dot(strokes.normal, toward))
    steepness = np.sqrt(np.maximum(1 - facing**2, 0)) / np.maximum(facing, 1 / STEEPEST)
    length = width * (1 + steepness) * pixel_size(strokes.points, camera)
    return strokes.points + length[:, None] * toward
