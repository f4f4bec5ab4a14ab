"""`strokes`: draw evenly spaced lines along a field, as an SVG document or as polylines in space."""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compositor.look_units import pixel_look
from ..compositor.shading import lights_of
from ..core.file_io import write_bytes
from ..field.field import Field
from ..field.surface import Surface
from ..line_drawing.from_look import strokes_of_look
from ..line_drawing.pipeline import StrokeDrawing, draw_instances
from ..line_drawing.polyline_files import check_drawing_suffix, polyline_file
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen, svg_text
from ..projection.camera import Camera, check_size, orbit_camera
from .pictures import DEFAULT_SIZE, DEFAULT_VIEW, preset_look, upright_instance


class Drawing:
    """Strokes along a field. A notebook shows them.

    Parameters
    ----------
    strokes : rosyfields.line_drawing.pipeline.StrokeDrawing
        The strokes in world space.
    camera : rosyfields.projection.camera.Camera
        Camera of the picture.
    pen : rosyfields.line_drawing.svg.Pen
        Width and colors of the strokes.
    up : {"y", "z"}
        The axis of the mesh that points up.

    Examples
    --------
    >>> import rosyfields as rf
    >>> drawing = rf.strokes(rf.Surface("torus.obj"), size=(100, 100), spacing=12)
    >>> drawing.save("torus.svg")
    >>> drawing.save("torus-lines.ply")
    >>> drawing.polylines[0].shape[1]
    3
    """

    def __init__(self, strokes: StrokeDrawing, camera: Camera, pen: Pen, up: str = "z") -> None:
        self._strokes = strokes.strokes
        self._marks = strokes.marks
        self._camera = camera
        self._pen = pen
        self._up = up

    def __repr__(self) -> str:
        return f"<Drawing: {len(self):,} strokes>"

    def __len__(self) -> int:
        return len(self._strokes)

    @cached_property
    def svg(self) -> str:
        """SVG document of the drawing, with a layer for each family of lines."""
        return svg_text(self._strokes, self._camera, self._pen, self._marks)

    def _repr_svg_(self) -> str:
        return self.svg

    @cached_property
    def polylines(self) -> list[NDArray[np.float64]]:
        """(n, 3) points of each stroke in world space, where z points up."""
        return np.split(self._strokes.points, self._strokes.start[1:-1])

    @property
    def family_names(self) -> list[str]:
        """Name of the family of each stroke: a direction of the field, or a kind of outline."""
        return [self._strokes.names[family] for family in self._strokes.family]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file: the picture as ``.svg``, or the strokes as polylines in space.

        The points of polylines are in the coordinates of the mesh. They have normals, widths in units of
        the mesh, and families.
        A ``.csv`` file has a row for each point, an ``.obj`` file a line element for each stroke, and a
        ``.ply`` file vertices and edges.

        Raises
        ------
        RosyError
            If the name has another extension, or the file cannot be written.
        """
        suffix = check_drawing_suffix(path)
        if suffix == ".svg":
            contents = self.svg.encode()
        else:
            contents = polyline_file(suffix, self._strokes, self._camera, self._pen, self._up)
        write_bytes(path, contents, follow_links=True)


def strokes(
    surface: Surface,
    field: Field | None = None,
    *,
    view: tuple[float, float] = DEFAULT_VIEW,
    size: tuple[int, int] = DEFAULT_SIZE,
    orthographic: bool = False,
    preset: str | os.PathLike[str] | None = None,
    width: float | None = None,
    colors: Sequence[str] | None = None,
    paper: str | None = "",
    millimeters: float | None = None,
    plotter: bool = False,
    **style: Any,
) -> Drawing:
    """Draw evenly spaced strokes along a field.

    Hidden strokes are left out, unless the setting `hidden` is on.

    Parameters
    ----------
    surface : Surface
    field : Field, optional
        By default a field of degree 4 along the form of the surface; see `form`.
    view : (float, float)
        Azimuth and elevation of the camera in degrees: (0, 0) is from the front, (0, 90) from above.
    size : (int, int)
        Width and height of the picture in pixels. All lengths in pixels, such as the setting `spacing`, refer
        to it.
    orthographic : bool
        Orthographic projection instead of perspective.
    preset : str or path-like, optional
        Name of a preset of the look, or a ``.json`` file. It sets the spacing, widths, light, outline, ends,
        colors and marks of the strokes, except those that other arguments set.
    width : float, optional
        Full width of a stroke in pixels; by default 1.2.
    colors : sequence of str, optional
        SVG colors, used for the families of strokes in turn, such as ``"#204060"`` or ``"navy"``; by default
        black.
    paper : str or None
        Color of the background, by default white. With None, there is no background.
    millimeters : float, optional
        Width of the page in millimeters; by default the page is in pixels.
    plotter : bool
        Draw strokes of constant width, in an order that keeps the travel of the pen short.
    **style
        Settings of `line_drawing.style.StrokeStyle`: ``spacing=6, light="lamp", outline=1.5``.
        `spacing` is in pixels; `distance` is the spacing in units of the mesh.

    Returns
    -------
    Drawing

    Raises
    ------
    RosyError
        If a setting is invalid, the field is on another surface, no stroke is visible, or there
        is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> square = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> drawing = rf.strokes(square, view=(0, 90), size=(100, 100), spacing=20)
    >>> drawing.svg.startswith("<?xml") and len(drawing) > 4
    True
    """
    stroke_style, pen = StrokeStyle().with_settings(style), Pen(millimeters=millimeters)
    instance = upright_instance(surface, field)
    points, frame = instance.face_points(), (*view, *check_size(*size))
    camera = orbit_camera(points, *frame, perspective=not orthographic)
    if preset is not None:
        look = pixel_look(preset_look(preset), camera, [instance])
        stroke_style, pen = strokes_of_look(look, StrokeStyle(), pen)
        stroke_style = stroke_style.with_settings(style)
    paper = pen.paper if paper == "" else paper
    pen = replace(
        pen,
        width=pen.width if width is None else width,
        colors=pen.colors if colors is None else tuple(colors),
        paper=None if plotter else paper,
        plotter=plotter,
    )
    drawing = draw_instances([instance], camera, stroke_style, lights=lights_of(stroke_style, ()))
    return Drawing(drawing, camera, pen, surface.up)
