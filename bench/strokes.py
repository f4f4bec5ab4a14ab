"""Measure how long it takes to trace strokes on 200,000 triangles, and to draw those a camera sees."""

import numpy as np
from harness.stroke_spacing import lateral_gaps
from harness.stroke_tracing import trace_strokes

from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.projection.camera import look_at, orthographic_camera
from rosy_addon.projection.gbuffer import MeshInstance

from . import cases
from .timing import Bench, main

DEGREE = 4

#: Spacing of strokes in world space.
SPACING = 0.0102

#: Maximum time of tracing in seconds.
MAX_SECONDS = 30.0


def measure(bench: Bench) -> None:
    """Time tracing relative to the smoothest field, and drawing without and with hidden strokes."""
    surface = cases.ball(200_000)
    instance = MeshInstance(surface, np.eye(4), smoothest_field(surface, DEGREE))
    strokes = trace_strokes(instance, SPACING)
    gaps = lateral_gaps(build_tangent_mesh(instance), strokes)
    print(
        f"{len(strokes)} strokes, {100 * gaps.evenness:.1f} % of gaps within 25 %, "
        f"none nearer than {gaps.nearest:.2f} spacings"
    )
    case = bench.compare(
        f"{len(strokes)} strokes / smoothest field, 200K triangles, N = {DEGREE}",
        lambda: trace_strokes(instance, SPACING),
        lambda: smoothest_field(surface, DEGREE),
        runs=3,
    )
    seconds = case["amounts"][0] / 1e3
    verdict = "yes" if seconds <= MAX_SECONDS else "NO"
    print(f"{seconds:.1f} s, at most {MAX_SECONDS:g}: {verdict}")
    camera = orthographic_camera(look_at((0, -4, 1), (0, 0, 0)), 800, 800, scale=2.4)

    def draw(hidden: bool) -> object:
        return draw_instances([instance], camera, StrokeStyle(spacing=5.0, hidden=hidden))

    bench.compare(
        "strokes without / with hidden ones, ball, 800 x 800, spacing 5",
        lambda: draw(False),
        lambda: draw(True),
        runs=3,
    )


if __name__ == "__main__":
    main(__doc__, measure)
