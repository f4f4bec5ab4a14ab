"""20,000 strokes on 200K faces: seconds, and over what the smoothest field itself takes there."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.projection.gbuffer import Body
from rosy_addon.strokes.evenness import side_gaps
from rosy_addon.strokes.ground import lay_ground
from rosy_addon.strokes.spread import Rules
from rosy_addon.strokes.trace import trace

from . import cases
from .timing import Case, compare, main

DEGREE = 4

#: Of hatching: lines of up to a dozen spacings, so near to each other that about 20,000 come.
SPACING, LONGEST = 0.0102, 12.0

#: Seconds that are allowed.
SECONDS = 30.0


def measure(runs: int) -> Iterator[Case]:
    """The ratio, beside it the milliseconds of both; what came of it goes to the error stream."""
    surface = cases.ball(200_000)
    body = Body(surface, np.eye(4), smoothest_field(surface, DEGREE))
    rules = Rules(longest=LONGEST)
    drawn = trace(body, SPACING, rules=rules)
    gaps = side_gaps(lay_ground(body), drawn)
    print(
        f"{len(drawn)} strokes, {100 * gaps.even():.1f} % of gaps within 25 %, "
        f"none nearer than {gaps.nearest.min():.2f} spacings",
        file=sys.stderr,
    )
    case = compare(
        f"{len(drawn)} strokes / smoothest field, 200K triangles, N = {DEGREE}",
        lambda: trace(body, SPACING, rules=rules),
        lambda: smoothest_field(surface, DEGREE),
        higher_is_better=False,
        runs=min(runs, 3),
    )
    seconds = case.amounts[0] / 1e3
    said = "yes" if seconds <= SECONDS else "NO"
    print(f"{seconds:.1f} s, at most {SECONDS:g}: {said}", file=sys.stderr)
    yield case


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))
