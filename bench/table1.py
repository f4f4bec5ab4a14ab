"""Measure Table 1 of the paper: the method "sheets" relative to "members" and "brute", by degree."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from . import cases
from .timing import Bench, main

#: Target ratios by degree: for the LIC stage, and for frames of a small and a large mesh (by triangles).
LIC = {2: 4.0, 3: 8.0, 4: 12.0, 6: 16.0}
FRAMES = {12_000: {2: 2.5, 3: 5.0, 4: 7.0, 6: 10.0}, 200_000: {2: 2.0, 3: 4.0, 4: 6.0, 6: 8.0}}
BRUTE, MEMBERS = (replace(cases.LOOK, method=method) for method in ("brute", "members"))


def measure(bench: Bench, quick: bool) -> None:
    """Time all rows. If `quick`, only rows in which the camera has moved are timed, without a first run."""
    for degree, target in LIC.items():
        bench.compare(
            f"brute / sheets, LIC stage, N = {degree}",
            lambda d=degree: cases.compose_lic("brute", d),
            lambda d=degree: cases.compose_lic("sheets", d),
            at_least=target,
            cold=quick,
        )
    _frames(bench, "frame", cases.frame, quick)
    if quick:
        return
    _frames(bench, "first frame of a mesh", cases.first_frame)
    for triangles in FRAMES:
        bench.compare(
            f"members / sheets, frame, {triangles // 1000}K triangles, N = 4",
            lambda t=triangles: cases.frame(t, 4, MEMBERS),
            lambda t=triangles: cases.frame(t, 4),
            at_least=4.0,
        )


def _frames(bench: Bench, name: str, frame: Callable[..., np.ndarray], cold: bool = False) -> None:
    """Time a small and a large mesh at every degree."""
    for triangles, targets in FRAMES.items():
        for degree, target in targets.items():
            bench.compare(
                f"brute / sheets, {name}, {triangles // 1000}K triangles, N = {degree}",
                lambda t=triangles, d=degree: frame(t, d, BRUTE),
                lambda t=triangles, d=degree: frame(t, d),
                at_least=target,
                cold=cold,
            )


if __name__ == "__main__":
    main(__doc__, measure, quick={"action": "store_true"})
