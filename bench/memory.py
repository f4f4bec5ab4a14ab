"""Measure the peak memory of pictures, each in its own process: relative to a limit, and to the estimate.

`picture_memory` estimates the memory of a picture before it is drawn. The estimate is compared with the
resident memory that is taken from the beginning of the drawing up to the writing of the file, beyond what the
process held before.
"""

import ctypes
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from rosy_addon.image_io.png import write_png
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.rendering.draw import draw_picture, picture_groups, picture_memory
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.pool import POOL

from . import cases
from .timing import Bench, main, peer

ROOT = Path(__file__).resolve().parents[1]

#: Limit of the peak memory of `CASES`, in gigabytes.
ALLOWED = 8.0

#: Pictures whose peak memory is compared with the limit: number of triangles, degree N, and settings of the
#: look.
CASES: dict[str, tuple[int, int, dict[str, object]]] = {
    "3840 x 2160, N = 4": (12_000, 4, {}),
    "3840 x 2160, N = 7, color noise": (12_000, 7, {"hue": "noise"}),
    "3840 x 2160, N = 4, 2 x 2 samples a pixel": (12_000, 4, {"supersampling": 2}),
    "3840 x 2160, N = 4, brute": (12_000, 4, {"method": "brute", "length": 4}),
    "10M triangles, 3840 x 2160, N = 4": (10_000_000, 4, {}),
}

#: Pictures whose memory is compared with its estimate: preset, degree N, thousands of triangles, and other
#: settings. The names begin with the size.
ESTIMATED: dict[str, tuple[str, int, int, dict[str, object]]] = {
    **{
        f"{size}, {preset}": (preset, 4, 12, {})
        for preset in preset_keys()
        for size in ("512 x 512", "1920 x 1080")
    },
    "512 x 512, 300K triangles": ("default", 4, 300, {}),
    "512 x 512, 3M triangles": ("default", 4, 3000, {}),
    "1024 x 1024, 1K triangles": ("default", 4, 1, {}),
    "1024 x 1024, 300K triangles": ("default", 4, 300, {}),
    **{f"1024 x 1024, N = {n}": ("default", n, 12, {}) for n in (1, 2, 6, 7)},
    "1024 x 1024, brute": ("default", 4, 12, {"method": "brute", "length": 2}),
    "1024 x 1024, ibfv": ("default", 4, 12, {"method": "ibfv", "length": 4}),
    "1024 x 1024, drifting streaks": ("default", 4, 12, {"flow": 1.0}),
    "1024 x 1024, 2 x 2 samples": ("default", 4, 12, {"supersampling": 2}),
    "1024 x 1024, hatching of other streaks, 2 x 2 samples": (
        *("pen-and-ink", 4, 12),
        {"method": "members", "length": 2},
    ),
    "3840 x 2160, two processes": ("default", 4, 12, {}),
    **{
        f"3840 x 2160, {preset}": (preset, 4, 12, {})
        for preset in ("default", "pen-and-ink", "plaid", "paper")
    },
}


def measure(bench: Bench) -> None:
    """Measure each case once, because memory does not vary between runs."""
    peer("resource")  # exists on systems that tell the peak memory of a process
    for name in CASES:
        (peak,) = _run("--draw", name)
        amounts = peak, ALLOWED
        bench.add(f"peak memory / {ALLOWED:g} GB, {name}", peak / ALLOWED, amounts, "GB", at_most=1)
    for name in ESTIMATED if Path("/proc/self/clear_refs").exists() else ():
        bound, taken = _run("--estimate", name)
        amounts = 1000 * bound, 1000 * taken
        bench.add(f"bound / taken memory, {name}", bound / taken, amounts, "MB")


def _run(*options: str) -> list[float]:
    """Run this module in another process, and return the numbers that it prints."""
    command = [sys.executable, "-m", "bench.memory", *options]
    completed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
    return [float(word) for word in completed.stdout.split()]


def estimate_and_draw(name: str) -> tuple[float, float]:
    """Return the memory of a case of `ESTIMATED` on Linux, in gigabytes: the estimate, and what is taken."""
    preset, degree, thousands, settings = ESTIMATED[name]
    width, height = (int(side) for side in name.split(",")[0].split(" x "))
    workers = 2 if "two processes" in name else 1
    look = replace(load_preset(preset).look, **settings)
    ball = cases.instance(1000 * thousands, degree)
    view = ViewInput((ball,), cases.camera(width, height), look)
    # Free memory in the heap, left over from making the mesh, goes back to the system, so it is not counted.
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")  # resets the peak
    held = _resident_bytes("VmRSS")
    bound = picture_memory(view, picture_groups(view, workers), workers)
    rgba = draw_picture(view, workers=workers).rgba
    others = sum(_resident_bytes("VmHWM", helper.pid) for helper in POOL.helpers)
    with TemporaryDirectory() as folder:
        write_png(Path(folder) / "picture.png", rgba)
    return bound / 1e9, (_resident_bytes("VmHWM") - held + others) / 1e9


def _resident_bytes(kind: str, process: int | str = "self") -> int:
    """Return the resident memory of a process on Linux: now ("VmRSS") or its peak ("VmHWM")."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(kind))


def draw(name: str) -> float:
    """Make the mesh of a case of `CASES` and draw it. Return the peak memory of this process in gigabytes."""
    triangles, degree, settings = CASES[name]
    look = replace(cases.LOOK, **settings)
    draw_picture(ViewInput((cases.instance(triangles, degree),), cases.camera(3840, 2160), look))
    resource = peer("resource")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak * (1 if sys.platform == "darwin" else 1024) / 1e9


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["--estimate", name]:
            print(*estimate_and_draw(name))
        case ["--draw", name]:
            print(draw(name))
        case _:
            main(__doc__, measure)
