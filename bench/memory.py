"""Peak memory of pictures and meshes, each in its own process: relative to a limit, and to the bound.

The bound is compared with the resident memory that a picture takes beyond what the process holds
when the drawing begins, up to the writing of the file.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rosy_addon.image_io.png import write_png
from rosy_addon.preset_files.store import load_preset
from rosy_addon.rendering.draw import draw_picture, picture_groups, picture_memory
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.pool import POOL

from . import cases
from .timing import Case, main

ROOT = Path(__file__).resolve().parents[1]

#: Allowed memory in gigabytes.
ALLOWED = 8.0

WIDE = 3840, 2160

#: Triangles, N, and settings of the look, by the name of the case.
CASES: dict[str, tuple[int, int, dict[str, object]]] = {
    "3840 x 2160, N = 4": (12_000, 4, {}),
    "3840 x 2160, N = 7, color noise": (12_000, 7, {"hue": "noise"}),
    "3840 x 2160, N = 4, 2 x 2 samples a pixel": (12_000, 4, {"supersampling": 2}),
    "3840 x 2160, N = 4, brute": (12_000, 4, {"method": "brute", "length": 4}),
    "10M triangles, 3840 x 2160, N = 4": (10_000_000, 4, {}),
}

#: Presets, each of which is drawn with 1920 x 1080 pixels, and with 512 x 512.
PRESETS = (
    *("default", "plaid", "magnitude-map", "paper", "charcoal", "pencil", "pen-and-ink"),
    *("cross-hatch", "white-on-black", "woodcut", "print-300-dpi", "engraving"),
)

#: Preset, triangles, N, size, other settings of the look and number of processes, of the pictures whose
#: bound is compared with what they take.
ESTIMATED: dict[str, tuple[str, int, int, tuple[int, int], dict[str, object], int]] = {
    **{
        f"{width} x {height}, {preset}": (preset, 12_000, 4, (width, height), {}, 1)
        for preset in PRESETS
        for width, height in ((512, 512), (1920, 1080))
    },
    "512 x 512, 300K triangles": ("default", 300_000, 4, (512, 512), {}, 1),
    "1024 x 1024, 1K triangles": ("default", 1000, 4, (1024, 1024), {}, 1),
    "1024 x 1024, 300K triangles": ("default", 300_000, 4, (1024, 1024), {}, 1),
    "512 x 512, 3M triangles": ("default", 3_000_000, 4, (512, 512), {}, 1),
    "1024 x 1024, N = 1": ("default", 12_000, 1, (1024, 1024), {}, 1),
    "1024 x 1024, N = 2": ("default", 12_000, 2, (1024, 1024), {}, 1),
    "1024 x 1024, N = 6": ("default", 12_000, 6, (1024, 1024), {}, 1),
    "1024 x 1024, N = 7": ("default", 12_000, 7, (1024, 1024), {}, 1),
    "1024 x 1024, brute": ("default", 12_000, 4, (1024, 1024), {"method": "brute", "length": 2}, 1),
    "1024 x 1024, ibfv": ("default", 12_000, 4, (1024, 1024), {"method": "ibfv", "length": 4}, 1),
    "1024 x 1024, drifting streaks": ("default", 12_000, 4, (1024, 1024), {"flow": 1.0}, 1),
    "1024 x 1024, 2 x 2 samples": ("default", 12_000, 4, (1024, 1024), {"supersampling": 2}, 1),
    "1024 x 1024, hatching of other streaks, 2 x 2 samples": (
        "pen-and-ink", 12_000, 4, (1024, 1024), {"method": "members", "length": 2}, 1,
    ),
    "3840 x 2160": ("default", 12_000, 4, WIDE, {}, 1),
    "3840 x 2160, two processes": ("default", 12_000, 4, WIDE, {}, 2),
    "3840 x 2160, pen-and-ink": ("pen-and-ink", 12_000, 4, WIDE, {}, 1),
    "3840 x 2160, plaid": ("plaid", 12_000, 4, WIDE, {}, 1),
    "3840 x 2160, paper": ("paper", 12_000, 4, WIDE, {}, 1),
}  # fmt: skip


def measure(runs: int) -> Iterator[Case]:
    """Measure each case once, because memory does not vary between runs."""
    for name in CASES:
        (peak,) = _run("--draw", name)
        yield _case(f"peak memory / {ALLOWED:g} GB, {name}", (peak, ALLOWED), "GB", 1.0)
    for name in ESTIMATED if Path("/proc/self/clear_refs").exists() else ():
        estimate, peak = _run("--estimate", name)
        yield _case(f"bound / taken memory, {name}", (1000 * estimate, 1000 * peak), "MB", None)


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
    """Return the memory of a case on Linux, in gigabytes: the bound, and what all processes take."""
    preset, triangles, degree, size, settings, processes = ESTIMATED[name]
    look = replace(load_preset(preset).look, **settings)
    view = ViewInput((cases.instance(triangles, degree),), cases.camera(*size), look)
    # Memory that is free in the heap since the mesh was made counts neither as held nor as taken.
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")  # resets the peak
    held = _resident_bytes("VmRSS")
    bound = picture_memory(view, picture_groups(view, processes), processes)
    rgba = draw_picture(view, workers=processes).rgba
    others = sum(_resident_bytes("VmHWM", helper.pid) for helper in POOL.helpers)
    with TemporaryDirectory() as folder:
        write_png(Path(folder) / "picture.png", rgba)
    return bound / 1e9, (_resident_bytes("VmHWM") - held + others) / 1e9


def _resident_bytes(kind: str, process: int | str = "self") -> int:
    """Return the resident memory of a process on Linux: now ("VmRSS") or its peak ("VmHWM")."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
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
