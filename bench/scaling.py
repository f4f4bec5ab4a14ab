"""How time grows with the length of streamlines, the degree, the pixels and the triangles."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

from . import cases
from .timing import Case, compare, main

DEGREE = 4


def measure(runs: int) -> Iterator[Case]:
    """Time all cases."""
    for times in (2, 4, 8):
        long = replace(cases.LOOK, length=times * cases.LOOK.length)
        target = 1.6 if times == 8 else None
        yield compare(
            f"streamlines {times} times longer, LIC stage",
            lambda look=long: cases.compose_lic("sheets", DEGREE, look),
            lambda: cases.compose_lic("sheets", DEGREE),
            target=target,
            higher_is_better=False,
            runs=runs,
        )
        yield compare(
            f"streamlines {times} times longer, frame, 12K triangles",
            lambda look=long: cases.frame(12_000, DEGREE, look),
            lambda: cases.frame(12_000, DEGREE),
            target=target,
            higher_is_better=False,
            runs=runs,
        )
    for size in (256, 1024):
        yield compare(
            f"{size} x {size} / 512 x 512 pixels, frame, 12K triangles",
            lambda s=size: cases.frame(12_000, DEGREE, size=s),
            lambda: cases.frame(12_000, DEGREE),
            higher_is_better=False,
            runs=runs,
        )
    for triangles in (12_000, 200_000):
        yield compare(
            f"2 x 2 samples / one, 1080 x 1080 pixels, frame, {triangles // 1000}K triangles",
            lambda t=triangles: cases.frame(
                t, DEGREE, replace(cases.LOOK, supersampling=2), size=1080
            ),
            lambda t=triangles: cases.frame(t, DEGREE, size=1080),
            target=2.0,
            higher_is_better=False,
            runs=runs,
        )
    for degree in (1, 3, 6, 8, 12):
        yield compare(
            f"N = {degree} / N = 2, LIC stage",
            lambda d=degree: cases.compose_lic("sheets", d),
            lambda: cases.compose_lic("sheets", 2),
            higher_is_better=False,
            runs=runs,
        )
    for triangles in (200, 200_000, 2_000_000):
        yield compare(
            f"{triangles} / 12K triangles, frame",
            lambda t=triangles: cases.frame(t, DEGREE),
            lambda: cases.frame(12_000, DEGREE),
            target=1.34 if triangles == 200_000 else None,
            higher_is_better=False,
            runs=runs,
        )


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))
