"""Drawings in strokes as files and as curves, in one function each."""

from __future__ import annotations

from collections.abc import Sequence

from ..cache import BAKE_CACHE
from ..progress import progress
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.up_axis import UP_AXIS_BY_SUFFIX, UP_AXIS_MATRIX
from .pipeline import (
    LightSource,
    StrokeDrawing,
    StrokeGeometry,
    draw_instances,
    stroke_geometry,
)
from .polyline_files import polyline_file
from .style import StrokeStyle
from .svg import Pen, svg_text

#: Share of the time after which all strokes are drawn.
OUTPUT_START = 0.95

#: Label of what comes then.
OUTPUT_LABEL = "storing the strokes"


def drawing_file(
    suffix: str,
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    pen: Pen,
    lights: Sequence[LightSource],
) -> tuple[StrokeDrawing, bytes]:
    """Draw mesh instances in strokes, and return the drawing and the contents of its file.

    Parameters
    ----------
    suffix : str
        Of the file: .svg, or one of `polyline_file`.
    instances, camera, style, lights
        As for `draw_instances`.
    pen : Pen
    """
    is_svg = suffix == ".svg"
    drawing = _draw(instances, camera, style, lights, clip_to_frame=is_svg)
    with progress(OUTPUT_START, 1.0, OUTPUT_LABEL):
        if is_svg:
            return drawing, svg_text(drawing.strokes, camera, pen, drawing.marks).encode()
        matrix = UP_AXIS_MATRIX[UP_AXIS_BY_SUFFIX.get(suffix, "z")].T
        return drawing, polyline_file(suffix, drawing.strokes, camera, pen, matrix)


def drawing_curves(
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    pen: Pen,
    lights: Sequence[LightSource],
    follows: MeshInstance | None,
) -> tuple[StrokeDrawing, StrokeGeometry]:
    """Draw mesh instances in strokes, and return the drawing and its curves; see `stroke_geometry`."""
    drawing = _draw(instances, camera, style, lights, clip_to_frame=False)
    with progress(OUTPUT_START, 1.0, OUTPUT_LABEL):
        return drawing, stroke_geometry(drawing, camera, pen, follows)


def _draw(
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    lights: Sequence[LightSource],
    *,
    clip_to_frame: bool,
) -> StrokeDrawing:
    """Draw with the cache of bakes in the process that calls it."""
    with progress(0.0, OUTPUT_START):
        drawing = draw_instances(
            instances, camera, style, lights=lights, clip_to_frame=clip_to_frame, cache=BAKE_CACHE
        )
    BAKE_CACHE.evict_over_limit()
    return drawing
