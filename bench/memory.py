"""Peak memory of pictures and meshes, each in its own process: relative to a limit, and estimated.

Estimates are compared with the resident memory that a picture takes beyond what the process holds
when the drawing begins, up to the writing of the file.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rosy_addon.image_io.png import write_png
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.picture_memory import picture_memory, view_coverage
from rosy_addon.rendering.view_input import ViewInput

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

#: Settings of lines on the surface.
HATCHED = {"ink": "hatch", "supersampling": 2, "anchor": "surface", "detail": 0.5}

#: Triangles, N, size, enlargement of the ball in the frame, and settings of the look, of the
#: pictures whose estimates are compared with what they take.
ESTIMATED: dict[str, tuple[int, int, tuple[int, int], float, dict[str, object]]] = {
    "256 x 256": (12_000, 4, (256, 256), 1, {}),
    "512 x 512, 500 triangles": (500, 4, (512, 512), 1, {}),
    "1024 x 1024, 300K triangles": (300_000, 4, (1024, 1024), 1, {}),
    "512 x 512, 3M triangles": (3_000_000, 4, (512, 512), 1, {}),
    "1024 x 1024, 2 x 2 samples a pixel": (12_000, 4, (1024, 1024), 1, {"supersampling": 2}),
    "1024 x 1024, 300K triangles, 3 x 3 samples a pixel": (
        300_000, 4, (1024, 1024), 1, {"supersampling": 3},
    ),
    "2048 x 2048, 3M triangles, 2 x 2 samples a pixel": (
        3_000_000, 4, (2048, 2048), 1, {"supersampling": 2},
    ),
    "1024 x 1024, hatching, 2 x 2 samples a pixel": (
        12_000, 4, (1024, 1024), 1, {"ink": "hatch", "supersampling": 2},
    ),
    "2048 x 2048, pen and ink, 2 x 2 samples a pixel": (
        12_000, 4, (2048, 2048), 1, {**HATCHED, "outline": 1.3, "breaks": 0.7, "overshoot": 8.0},
    ),
    "1400 x 1400, pencil, 2 x 2 samples a pixel": (
        12_000, 4, (1400, 1400), 1, {**HATCHED, "breaks": 0.4, "wobble": 0.5, "paper_grain": 0.4},
    ),
    "2048 x 2048": (12_000, 4, (2048, 2048), 1, {}),
    "2048 x 2048, the picture is filled": (12_000, 4, (2048, 2048), 4, {}),
    "2048 x 2048, 2 x 2 samples a pixel": (12_000, 4, (2048, 2048), 1, {"supersampling": 2}),
    "4096 x 4096": (12_000, 4, (4096, 4096), 1, {}),
    "4096 x 4096, a small ball": (12_000, 4, (4096, 4096), 0.3, {}),
    "6000 x 6000": (12_000, 4, (6000, 6000), 1, {}),
    "6000 x 6000, a small ball": (12_000, 4, (6000, 6000), 0.2, {}),
    "1400 x 1400, N = 2": (12_000, 2, (1400, 1400), 1, {}),
    "2800 x 2800, N = 7": (12_000, 7, (2800, 2800), 1, {}),
    "1400 x 1400, color noise": (12_000, 4, (1400, 1400), 1, {"noise": "colour"}),
    "1400 x 1400, members, N = 7": (12_000, 7, (1400, 1400), 1, {"method": "members"}),
    "2800 x 2800, members": (12_000, 4, (2800, 2800), 1, {"method": "members"}),
    "1400 x 1400, brute, N = 2": (12_000, 2, (1400, 1400), 1, {"method": "brute"}),
    "2800 x 2800, brute": (12_000, 4, (2800, 2800), 1, {"method": "brute"}),
    "2800 x 2800, hatching": (12_000, 4, (2800, 2800), 1, {"ink": "hatch"}),
    "1400 x 1400, hatching with overshoot": (
        12_000, 4, (1400, 1400), 1, {"ink": "hatch", "overshoot": 5.0},
    ),
    "2800 x 2800, noise on the surface": (12_000, 4, (2800, 2800), 1, {"anchor": "surface"}),
    "1400 x 1400, noise on the surface, Blender units": (
        12_000, 4, (1400, 1400), 1, {"anchor": "surface", "unit": "world"},
    ),
    "1400 x 1400, shadows": (12_000, 4, (1400, 1400), 1, {"light": "lamp", "shadows": True}),
    "1400 x 1400, magnitude": (12_000, 4, (1400, 1400), 1, {"magnitude": "both"}),
}  # fmt: skip


def measure(runs: int) -> Iterator[Case]:
    """Measure each case once, because memory does not vary between runs."""
    for name in CASES:
        (peak,) = _run("--draw", name)
        yield _case(f"peak memory / {ALLOWED:g} GB, {name}", (peak, ALLOWED), "GB", 1.0)
    for name in ESTIMATED if Path("/proc/self/clear_refs").exists() else ():
        estimate, peak = _run("--estimate", name)
        yield _case(f"estimated / taken memory, {name}", (1000 * estimate, 1000 * peak), "MB", None)


def _case(name: str, amounts: tuple[float, float], unit: str, target: float | None) -> Case:
    """Return the case of the ratio of two amounts, and print its line."""
    ratio = amounts[0] / amounts[1]
    case = Case(
        name=name,
        ratio=ratio,
        low=ratio,
        high=ratio,
        target=target,
        higher_is_better=False,
        amounts=amounts,
        unit=unit,
    )
    print(case.line(), flush=True)
    return case


def _run(*options: str) -> list[float]:
    """Return the numbers that this module prints in another process."""
    command = [sys.executable, "-m", "bench.memory", *options]
    completed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return [float(word) for word in completed.stdout.split()]


def estimate_and_draw(name: str) -> tuple[float, float]:
    """Return the memory that a case takes, in gigabytes: estimated, and as measured on Linux."""
    triangles, degree, size, zoom, settings = ESTIMATED[name]
    camera = cases.camera(*size)
    projection = camera.projection.copy()
    projection[:2] *= zoom
    # Short streamlines take as much memory as long ones with the slow methods.
    look = replace(cases.LOOK, length=2 if settings.get("method") else 40, **settings)
    view = ViewInput(
        (cases.instance(triangles, degree),), replace(camera, projection=projection), look
    )
    estimate = picture_memory(view, view_coverage(view))
    Path("/proc/self/clear_refs").write_text("5")  # resets the peak
    held = _resident_bytes("VmRSS")
    rgba = draw_picture(view).rgba
    with TemporaryDirectory() as folder:
        write_png(Path(folder) / "picture.png", rgba)
    return estimate / 1e9, (_resident_bytes("VmHWM") - held) / 1e9


def _resident_bytes(kind: str) -> int:
    """Return the resident memory of this process on Linux: now ("VmRSS") or its peak ("VmHWM")."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(kind))


def draw(name: str) -> float:
    """Draw a case, including its mesh, and return the peak memory of this process in gigabytes."""
    import resource

    triangles, degree, settings = CASES[name]
    look = replace(cases.LOOK, **settings)
    view = ViewInput((cases.instance(triangles, degree),), cases.camera(*WIDE), look)
    (draw_picture(view))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024) / 1e9


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--draw", choices=CASES)
    parser.add_argument("--estimate", choices=ESTIMATED)
    options, rest = parser.parse_known_args()
    if options.estimate:
        print(*estimate_and_draw(options.estimate))
        sys.exit()
    if options.draw:
        print(draw(options.draw))
        sys.exit()
    if os.name == "nt":
        sys.exit(
            "memory: skipped, because this system does not report the peak memory of a process"
        )
    sys.exit(main(__doc__, measure, rest))
