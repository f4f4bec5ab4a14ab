"""Peak memory of large pictures and meshes, relative to a limit, each in its own process."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from rosy_addon.compositor.compose import compose
from rosy_addon.projection.project import project

from . import cases
from .timing import Case, main

ROOT = Path(__file__).resolve().parents[1]

#: Allowed memory in gigabytes.
ALLOWED = 8.0

WIDE = 3840, 2160

#: Triangles, N, and settings of the look, by the name of the case.
CASES: dict[str, tuple[int, int, dict[str, object]]] = {
    "3840 x 2160, N = 4": (12_000, 4, {}),
    "3840 x 2160, N = 7, color noise": (12_000, 7, {"noise": "colour"}),
    "3840 x 2160, N = 4, 2 x 2 samples a pixel": (12_000, 4, {"supersampling": 2}),
    "3840 x 2160, N = 4, brute": (12_000, 4, {"method": "brute", "length": 4}),
    "10M triangles, 3840 x 2160, N = 4": (10_000_000, 4, {}),
}


def measure(runs: int) -> Iterator[Case]:
    """Measure each case once, because memory does not vary between runs."""
    for name in CASES:
        command = [sys.executable, "-m", "bench.memory", "--draw", name]
        completed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
        peak = float(completed.stdout.split()[-1])
        ratio = peak / ALLOWED
        case = Case(
            name=f"peak memory / {ALLOWED:g} GB, {name}",
            ratio=ratio,
            low=ratio,
            high=ratio,
            target=1.0,
            higher_is_better=False,
            amounts=(peak, ALLOWED),
            unit="GB",
        )
        print(case.line(), flush=True)
        yield case


def draw(name: str) -> float:
    """Draw a case, including its mesh, and return the peak memory of this process in gigabytes."""
    import resource

    triangles, degree, settings = CASES[name]
    look = replace(cases.LOOK, **settings)
    width, height = (size * look.supersampling for size in WIDE)
    gbuffer = project(
        [cases.instance(triangles, degree)], cases.camera(width, height), look.display
    )
    compose(gbuffer, look)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024) / 1e9


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--draw", choices=CASES)
    options, rest = parser.parse_known_args()
    if options.draw:
        print(draw(options.draw))
        sys.exit()
    if os.name == "nt":
        sys.exit(
            "memory: skipped, because this system does not report the peak memory of a process"
        )
    sys.exit(main(__doc__, measure, rest))
