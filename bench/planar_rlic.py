"""Measure how long a picture of a planar cross field takes, relative to four LIC images by `rlic`."""

from dataclasses import replace

import numpy as np
from harness.planar import compose_planar

from . import cases
from .timing import Bench, main, peer, use_cores

DEGREE = 4

#: Look with 41 samples per streamline.
LOOK = replace(cases.LOOK, length=20)


def measure(bench: Bench) -> None:
    """Time the picture from the angles of the field, and four `rlic` images, one per member, from noise."""
    rlic = peer("rlic")
    use_cores(1)
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

    for what, work in (
        ("picture", lambda: compose_planar(angle, DEGREE, LOOK)),
        ("images of the members", lambda: cases.compose_lic("sheets", DEGREE, LOOK)),
    ):
        name = f"{what} / four images of rlic, N = {DEGREE}, 41 samples"
        bench.compare(name, work, four_images, at_most=0.2)


if __name__ == "__main__":
    main(__doc__, measure)
