"""Films: draw the fields of a series from one camera, as a video."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compositor.flow import drift_at
from ..compositor.look import Look, magnitude_range, uses_magnitude
from ..core.cache import Cache
from ..core.errors import RosyError, counted
from ..field.carry import vectors_on_rest_shape
from ..field.field import Field
from ..field.frames import normalize
from ..field.interpolation import interpolate_fields
from ..field.polygon_arrays import face_area_vectors
from ..field.representation import face_representation
from ..field.rosy_field import RosyField
from ..field.surface import Surface, have_same_polygons
from ..projection.camera import check_size, framing_points, orbit_camera
from ..rendering.draw import draw_picture
from ..rendering.mesh_view import mesh_instance
from ..rendering.turntable import Encoder, turntable
from ..rendering.view_input import ViewInput
from .field import warn
from .pictures import DEFAULT_VIDEO_SIZE, DEFAULT_VIEW, default_encoder, picture_look

#: Limit for steady streaks of a s / w: a is the mean angle (radians) by which the field turns from picture to
#: picture, s is the half length of streaks, and w is the line width. Up to this limit, the correlation of
#: neighboring pictures is above 0.9.
STEADY_TURN = 0.2

#: Largest number of pictures between two fields.
MAX_BETWEEN = 1000


def film(
    fields: Sequence[Field],
    path: str | os.PathLike[str],
    *,
    between: int | None = 0,
    loop: bool = False,
    rate: float = 24.0,
    view: tuple[float, float] = DEFAULT_VIEW,
    size: tuple[int, int] = DEFAULT_VIDEO_SIZE,
    orthographic: bool = False,
    preset: str | os.PathLike[str] | None = None,
    workers: int = 0,
    encode: Encoder | None = None,
    on_picture: Callable[[int], None] | None = None,
    **settings: Any,
) -> Path:
    """Draw a field that changes with time as a video, seen from one camera.

    With the setting `flow`, streaks drift along the field while it changes. If the mesh moves and keeps its
    polygons, the noise of the look moves with it, unless the setting `anchor` is given.

    Parameters
    ----------
    fields : sequence of Field
        Two or more fields of the same degree. They may all be on one surface, or each on its own. Each item
        is requested twice: first to determine the camera and the range of magnitudes, then to be drawn. At
        most two fields are kept, so the items may be read from files on request.
    path : path-like
        A ``.gif``, or an ``.mp4`` if there is an encoder.
    between : int or None
        Number of pictures between two fields. In these the fields and the vertices are interpolated, so the
        surfaces must have the same polygons. None chooses a number that keeps streaks steady: they flicker
        if the field turns by more than about half a degree from picture to picture.
    loop : bool
        Add pictures from the last field back to the first one, so that the video can be played as a loop.
    rate : float
        Pictures per second.
    view : (float, float)
        Azimuth and elevation of the camera in degrees: (0, 0) is from the front, (0, 90) from above.
    size : (int, int)
        Width and height in pixels.
    orthographic : bool
        Orthographic projection instead of perspective.
    preset : str or path-like, optional
        Name of a preset of the look, or a ``.json`` file; see `list_presets`.
    workers : int
        Number of processes that draw a large picture together. 0 means one for each processor core.
    encode : function, optional
        Function that encodes an ``.mp4`` file; see `turntable`. By default ffmpeg, if it is installed.
    on_picture : function, optional
        Function that is called before each picture is drawn, with its number, from 1.
    **settings
        Settings of the look, after the preset: ``length=120, seed=3``; see `render`.

    Returns
    -------
    Path
        The file. It is written after the last picture.

    Warns
    -----
    RosyWarning
        If the field turns too fast for steady streaks. The warning says which value of `between` keeps them
        steady.

    Raises
    ------
    RosyError
        If there is only one field, fields have different degrees, pictures between fields are requested but
        the surfaces have different polygons, or for the same reasons as `turntable`.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> fields = [rf.smoothest(torus).rotated(0.01 * step) for step in range(2)]
    >>> rf.film(fields, "film.gif", between=1, size=(32, 32)).name
    'film.gif'
    """
    path = Path(path)
    encode = default_encoder(path, encode)
    if not rate > 0:
        raise RosyError(f"{path}: a film needs a rate above 0")
    look = picture_look(str(path), preset, settings)
    framing = (*view, *check_size(*size))
    timing, keeps_anchor = (between, loop), "anchor" in settings
    series = Film(fields, look, framing, not orthographic, *timing, keeps_anchor, str(path))
    draw = partial(draw_picture, cache=Cache(), keep_gbuffers=False, workers=workers)
    result = turntable(draw, series.views(), series.picture_count, path, rate, encode, on_picture)
    warn(series.advice)
    return result


class _Survey(NamedTuple):
    """Properties of all fields of a film, which are needed before the first picture.

    Attributes
    ----------
    points : (n, 3) float64 ndarray
        Points in world space that the camera frames.
    largest_magnitude : float
        Largest length of a member in all fields.
    turn : float
        Largest mean angle between neighboring fields, in radians.
    keeps_polygons : bool
        Whether all fields have the polygons of the first one.
    rest_vertices : (V, 3) float64 ndarray or None
        Vertices of the first surface if the mesh moves, but keeps its polygons.
    """

    points: NDArray[np.float64]
    largest_magnitude: float
    turn: float
    keeps_polygons: bool
    rest_vertices: NDArray[np.float64] | None


@dataclass(eq=False)
class Film:
    """The pictures of a film, as inputs of the renderer. They have one camera, whose frame contains all meshes.

    Parameters
    ----------
    fields : sequence of Field
        Two or more fields of the same degree, in order of time. Each item is requested twice.
    look : Look
        Look of the first picture. If it shows magnitudes and sets no range of colors, the range covers all
        fields.
    framing : (float, float, int, int)
        Azimuth and elevation of the camera in degrees (see `orbit_camera`), and width and height of the
        picture in pixels.
    perspective : bool
        Whether the projection is perspective. If not, it is orthographic.
    between : int or None
        Number of pictures between two fields. None chooses a number that keeps streaks steady, or 0 if the
        polygons change.
    loop : bool
        Whether pictures lead from the last field back to the first one.
    keeps_anchor : bool
        Whether the setting `anchor` of the look is used even if the mesh moves.
    name : str
        Name of the film, with which error messages begin.

    Raises
    ------
    RosyError
        If there is one field only.
    """

    fields: Sequence[Field]
    look: Look
    framing: tuple[float, float, int, int]
    perspective: bool = True
    between: int | None = 0
    loop: bool = False
    keeps_anchor: bool = False
    name: str = "film"

    def __post_init__(self) -> None:
        if len(self.fields) < 2:
            raise RosyError(f"{self.name}: a film needs 2 fields or more")
        name, count = self.name, self.between
        if count is not None and not 0 <= count <= MAX_BETWEEN:
            raise RosyError(f"{name}: between must be from 0 to {MAX_BETWEEN}, not {count}")

    @property
    def picture_count(self) -> int:
        """Number of pictures. It may depend on how fast the fields turn, which needs a pass over all fields."""
        intervals = len(self.fields) - (not self.loop)
        return intervals * (self._between + 1) + (not self.loop)

    @property
    def _between(self) -> int:
        """Number of pictures between two fields."""
        if self.between is not None:
            return self.between
        survey = self._survey
        return _steady_between(survey.turn, self.look) if survey.keeps_polygons else 0

    @property
    def advice(self) -> str:
        """A warning if streaks flicker because there are too few pictures between two fields; else empty."""
        turn, between = self._survey.turn, self._between
        needed = _steady_between(turn, self.look)
        if needed <= between:
            return ""
        return (
            f"the field turns by up to {np.degrees(turn / (between + 1)):.1f} degrees from picture to "
            f"picture, by which streaks flicker: {needed} pictures between two fields keep them steady, "
            "and so do shorter streaks"
        )

    def views(self) -> Iterator[ViewInput]:
        """Yield the renderer's input for each picture.

        Raises
        ------
        RosyError
            For the same reasons as `film`. All fields are checked before the first view.
        """
        survey, look = self._survey, self.look
        if uses_magnitude(look) and magnitude_range(look) is None:
            look = replace(look, color_range=(0.0, survey.largest_magnitude))
        rest = survey.rest_vertices
        if rest is not None and not self.keeps_anchor:
            look = replace(look, anchor="surface")
        rest = rest if look.anchor == "surface" else None
        camera = orbit_camera(survey.points, *self.framing, perspective=self.perspective)
        loop_frames = self.picture_count if self.loop else 0
        for number, (surface, field) in enumerate(self._moments()):
            if rest is not None:
                vectors = vectors_on_rest_shape(surface, rest, field.vectors)
                field = replace(field, vectors=vectors, source_directions=None)
                surface = surface.with_parts(rest_vertices=rest)
            instance, drift = mesh_instance(surface, field), drift_at(look, number, loop_frames)
            yield ViewInput((instance,), camera, look, drift=drift)

    def _moments(self) -> Iterator[tuple[Surface, RosyField]]:
        """Yield the mesh and the field of each picture, interpolated between two fields if needed."""
        count, stop = len(self.fields), self._between + 1
        previous = self.fields[0]
        for number in range(1, count + self.loop):
            field = self.fields[number % count]
            start = previous.surface, previous
            yield start
            for index in range(1, stop):
                share, end = index / stop, (field.surface, field)
                mesh = _mesh_between(start[0], end[0], share)
                yield mesh, interpolate_fields(start, end, share, mesh)
            previous = field
        if not self.loop:
            yield previous.surface, previous

    @cached_property
    def _survey(self) -> _Survey:
        """Properties of all fields, computed once."""
        points, largest, turn = np.zeros((0, 3)), 0.0, 0.0
        first = previous = self.fields[0]
        keeps_polygons, moves = True, False
        for number in range(len(self.fields)):
            field = previous if number == 0 else self.fields[number]
            has_same = self._check(number, field, previous)
            keeps_polygons &= has_same
            mesh = field.surface
            if keeps_polygons and mesh is not first.surface:
                moves |= not np.array_equal(mesh.vertices, first.surface.vertices)
            if has_same:
                turn = max(turn, _mean_turn(previous, field))
            largest = max(largest, float(field.magnitude.max()))
            if number == 0 or mesh is not previous.surface:
                points = np.concatenate([points, mesh_instance(mesh, field).face_points()])
                points = framing_points(points, *self.framing, perspective=self.perspective)
            previous = field
        if self.loop and self._check(0, first, previous):
            turn = max(turn, _mean_turn(previous, first))
        rest = first.surface.vertices if keeps_polygons and moves else None
        return _Survey(points, largest, turn, keeps_polygons, rest)

    def _check(self, number: int, field: Field, previous: Field) -> bool:
        """Return whether a field has the polygons of the previous field.

        `number` is the position of the field in the series, from 0, for messages.

        Raises
        ------
        RosyError
            If the degrees differ, or the polygons differ although fields are to be interpolated.
        """
        name = f"{field.surface.name}: field {number + 1} of {len(self.fields)}"
        degree, mesh, other = field.degree, field.surface, previous.surface
        if degree != previous.degree:
            raise RosyError(f"{name} has degree {degree}, but the one before it {previous.degree}")
        has_same = mesh is other or have_same_polygons(mesh, other)
        if self.between and not has_same:
            counts = f"{counted(mesh.face_count, 'face')} after {other.face_count:,}"
            raise RosyError(
                f"{name} has other polygons than the one before it ({counts}): there can be no pictures between them"
            )
        return has_same


def _mesh_between(first: Surface, second: Surface, share: float) -> Surface:
    """Interpolate the vertices of two meshes with the same polygons: `share` 0 gives the first, 1 the second.

    The result has the triangulation and the vertex fans of the first mesh.
    """
    if first is second:
        return first
    vertices = (1 - share) * first.vertices + share * second.vertices
    normal = normalize((1 - share) * first.corner_normal + share * second.corner_normal)
    return first.with_parts(vertices=vertices, corner_normal=normal)


def _mean_turn(first: Field, second: Field) -> float:
    """Return the mean angle in radians between two fields on the same polygons, weighted by area."""
    mesh = second.surface
    z, other = (face_representation(field.surface, field) for field in (first, second))
    vectors = face_area_vectors(mesh.vertices, mesh.corner_vertex, mesh.face_start)
    weight = np.linalg.norm(vectors, axis=1) * ((z != 0) & (other != 0))
    angle = np.abs(np.angle(z * other.conj())) / first.degree
    return float((weight * angle).sum() / max(weight.sum(), 1e-300))


def _steady_between(turn: float, look: Look) -> int:
    """Return how many pictures between two fields keep streaks steady; `turn` is their angle in radians."""
    if look.unit == "scene":
        return 0
    steady = STEADY_TURN * look.line_width / look.length
    return min(max(int(np.ceil(turn / steady - 1e-9)) - 1, 0), MAX_BETWEEN)
