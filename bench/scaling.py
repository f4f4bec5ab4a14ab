"""Measure how time grows with streamline length, degree, and numbers of pixels, samples and triangles."""

from dataclasses import replace

from . import cases
from .timing import Bench, main

DEGREE, TRIANGLES = 4, 12_000


def measure(bench: Bench) -> None:
    """Time all cases."""

    def frame(look=cases.LOOK, triangles=TRIANGLES, size=cases.SIZE) -> object:
        return cases.frame(triangles, DEGREE, look, size)

    for times in (2, 4, 8):
        long = replace(cases.LOOK, length=times * cases.LOOK.length)
        target = 1.6 if times == 8 else None
        bench.compare(
            f"streamlines {times} times longer, LIC stage",
            lambda look=long: cases.compose_lic("sheets", DEGREE, look),
            lambda: cases.compose_lic("sheets", DEGREE),
            at_most=target,
        )
        name = f"streamlines {times} times longer, frame, 12K triangles"
        bench.compare(name, lambda look=long: frame(look), frame, at_most=target)
    for size in (256, 1024):
        name = f"{size} x {size} / 512 x 512 pixels, frame, 12K triangles"
        bench.compare(name, lambda s=size: frame(size=s), frame)
    sampled = replace(cases.LOOK, supersampling=2)
    for triangles in (TRIANGLES, 200_000):
        bench.compare(
            f"2 x 2 samples / one, 1080 x 1080 pixels, frame, {triangles // 1000}K triangles",
            lambda t=triangles: frame(sampled, t, 1080),
            lambda t=triangles: frame(triangles=t, size=1080),
            at_most=2.0,
        )
    for degree in (1, 3, 6, 8, 12):
        bench.compare(
            f"N = {degree} / N = 2, LIC stage",
            lambda d=degree: cases.compose_lic("sheets", d),
            lambda: cases.compose_lic("sheets", 2),
        )
    for triangles, target in ((200, None), (200_000, 1.34), (2_000_000, None)):
        name = f"{triangles} / 12K triangles, frame"
        bench.compare(name, lambda t=triangles: frame(triangles=t), frame, at_most=target)


if __name__ == "__main__":
    main(__doc__, measure)
