"""Table 1 of the paper: the method sheets relative to members and brute force, by degree."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from . import cases
from .timing import Case, compare, main

#: Target ratios by degree: of the LIC stage, and of frames of a small and of a large mesh.
LIC = {2: 4.0, 3: 8.0, 4: 12.0, 6: 16.0}
FRAMES = {
    12_000: {2: 2.5, 3: 5.0, 4: 7.0, 6: 10.0},
    200_000: {2: 2.0, 3: 4.0, 4: 6.0, 6: 8.0},
}
MEMBERS = 4.0

BRUTE = replace(cases.LOOK, method="brute")


def measure(runs: int) -> Iterator[Case]:
    """Time all rows."""
    yield from quick(runs)
    yield from _frames("first frame of a mesh", cases.first_frame, runs)
    for triangles in FRAMES:
        yield compare(
            f"members / sheets, frame, {_thousands(triangles)}, N = 4",
            lambda t=triangles: cases.frame(t, 4, replace(cases.LOOK, method="members")),
            lambda t=triangles: cases.frame(t, 4),
            target=MEMBERS,
            runs=runs,
        )


def quick(runs: int, cold: bool = False) -> Iterator[Case]:
    """Time only the rows of the table, in which the camera has moved since the last frame."""
    for degree, target in LIC.items():
        yield compare(
            f"brute / sheets, LIC stage, N = {degree}",
            lambda d=degree: cases.compose_lic("brute", d),
            lambda d=degree: cases.compose_lic("sheets", d),
            target=target,
            runs=runs,
            cold=cold,
        )
    yield from _frames("frame", cases.frame, runs, cold)


def _frames(
    name: str, frame: Callable[..., np.ndarray], runs: int, cold: bool = False
) -> Iterator[Case]:
    """Time a small and a large mesh at every degree."""
    for triangles, targets in FRAMES.items():
        for degree, target in targets.items():
            yield compare(
                f"brute / sheets, {name}, {_thousands(triangles)}, N = {degree}",
                lambda t=triangles, d=degree: frame(t, d, BRUTE),
                lambda t=triangles, d=degree: frame(t, d),
                target=target,
                runs=runs,
                cold=cold,
            )


def _thousands(triangles: int) -> str:
    return f"{triangles // 1000}K triangles"


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))
