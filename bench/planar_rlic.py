"""Time of a planar cross field relative to the four images of `rlic` that it replaces."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from harness.planar import compose_planar

from . import cases
from .timing import Case, compare, main, use_one_core

DEGREE = 4

#: Look with 41 samples per streamline.
LOOK = replace(cases.LOOK, length=20)


def measure(runs: int) -> Iterator[Case]:
    """Time the picture from angles, and the images of the members from noise."""
    try:
        import rlic
    except ImportError:
        print("planar images of rlic: skipped, because rlic is not installed", file=sys.stderr)
        return
    use_one_core()
    field, noise = cases.plane(DEGREE)
    angle = (np.angle(field.representation) / DEGREE).reshape(cases.SIZE, cases.SIZE)
    texture = np.ascontiguousarray(noise.reshape(angle.shape))
    kernel = np.full(2 * LOOK.length + 1, 1 / (2 * LOOK.length + 1), dtype=np.float32)
    members = [
        (np.cos(rotated).astype(np.float32), np.sin(rotated).astype(np.float32))
        for rotated in (angle + 2 * np.pi * index / DEGREE for index in range(DEGREE))
    ]

    def four_images() -> None:
        for u, v in members:
            rlic.convolve(texture, u, v, kernel=kernel)

    ours = {
        "picture": lambda: compose_planar(angle, DEGREE, LOOK),
        "images of the members": lambda: cases.compose_lic("sheets", DEGREE, LOOK),
    }
    for what, work in ours.items():
        yield compare(
            f"{what} / four images of rlic, N = {DEGREE}, 41 samples",
            work,
            four_images,
            target=0.2,
            higher_is_better=False,
            runs=runs,
        )


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))
