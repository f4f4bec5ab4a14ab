"""Times of the shaders on this graphics card in milliseconds, next to those of the paper.

A frame is the work after the camera has moved: from triangles and fields on the card to the picture
on the card. Nothing is uploaded or read back, and a frame ends when the card is done. Needs numpy,
moderngl and a driver with EGL, but neither Blender nor a display.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.gpu.resources import DrawItem
from rosy_addon.progress import run_to_completion
from rosy_addon.render.view_input import ViewInput

from . import cases

SIZES = ("512x512", "1920x1080", "3840x2160")

DEGREES = (2, 3, 4, 6)

#: Table 1 of the paper: its decomposition, 512 x 512 pixels and 12K triangles, on this card. Its
#: objects are different, and it does not state their coverage of the frame; here it is 85 %.
PAPER = {2: 17, 3: 46, 4: 32, 6: 46}
PAPERS_CARD = "NVIDIA GeForce 8600 GTS"
PAPERS_SIZE = (512, 512)

TRIANGLES = 12_000

#: Degree for the times of the stages.
STAGES_SIZE, STAGES_DEGREE = (1920, 1080), 4
STAGES = {
    "G-buffer (visibility, resolve)": ("visibility", "resolve"),
    "covering (directions, angle_gradient)": ("directions", "angle_gradient"),
    "streamlines and light (lic)": ("lic",),
}

#: Number of frames of a median, and the maximum of their total time in seconds.
FRAMES = 21
SECONDS = 6.0

#: Seconds of drawing before the timing (at least one frame), to compile shaders and raise clocks.
WARM_UP = 0.3

#: Rotation of the camera between frames, in radians.
ON = 0.01


def device() -> Any:
    """Return the device; None if there is none, after printing the reason."""
    try:
        from .egl import EglDevice
    except ImportError:
        print("shaders: skipped, because moderngl is not installed", file=sys.stderr)
        return None
    try:
        return EglDevice()
    except Exception as error:
        # moderngl raises bare exceptions.
        reason = " ".join(str(error).split())
        print(
            f"shaders: skipped, because there is no OpenGL 4.3 with EGL ({reason})", file=sys.stderr
        )
        return None


def draw_texture(card: GpuRenderer, items: Sequence[DrawItem], camera: Any, look: Any) -> Any:
    """Draw a picture and leave it on the card."""
    return run_to_completion(card.render_texture_task(items, ViewInput((), camera, look)))


class Frames:
    """Repeated frames of one object at one size."""

    def __init__(self, drawn_by: Any, size: tuple[int, int], degree: int) -> None:
        self.device = drawn_by
        self.size = size
        self.card = GpuRenderer(drawn_by)
        self.placed: list[DrawItem] = self.card.upload(
            [cases.instance(TRIANGLES, degree)], "smooth"
        )
        self.drawn = 0

    def draw(self) -> float:
        """Draw the next frame and return its time in seconds."""
        camera = cases.camera(*self.size, azimuth=self.drawn * ON)
        self.drawn += 1
        start = time.perf_counter()
        draw_texture(self.card, self.placed, camera, cases.LOOK)
        self.device.finish()
        return time.perf_counter() - start

    def warm_up(self) -> None:
        """Draw frames until the clocks have risen."""
        start = time.perf_counter()
        self.draw()
        while time.perf_counter() - start < WARM_UP:
            self.draw()

    def times(self, frames: int) -> np.ndarray:
        """Return the times of frames in milliseconds; fewer frames if they take long."""
        self.warm_up()
        found: list[float] = []
        while len(found) < frames and sum(found) < SECONDS:
            found.append(self.draw())
        return np.array(found) * 1e3


class Staged:
    """A device that waits after each pass and records its time."""

    def __init__(self, device: Any) -> None:
        self._device = device
        self.seconds: dict[str, float] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def compute(self, shader: Any, *rest: Any) -> None:
        """As `Device.compute`."""
        self._timed(self._device.compute, shader, *rest)

    def draw(self, shader: Any, *rest: Any) -> None:
        """As `Device.render`."""
        self._timed(self._device.draw, shader, *rest)

    def _timed(self, work: Any, shader: Any, *rest: Any) -> None:
        self._device.finish()
        start = time.perf_counter()
        work(shader, *rest)
        self._device.finish()
        took = time.perf_counter() - start
        self.seconds[shader.name] = self.seconds.get(shader.name, 0.0) + took


def rows(drawn_by: Any, sizes: Sequence[tuple[int, int]], frames: int) -> Iterator[dict[str, Any]]:
    """Yield the time for each size and degree."""
    for size in sizes:
        for degree in DEGREES:
            times = Frames(drawn_by, size, degree).times(frames)
            yield {
                "width": size[0],
                "height": size[1],
                "degree": degree,
                "milliseconds": float(np.median(times)),
                "least": float(times.min()),
                "largest": float(times.max()),
                "frames": len(times),
                "paper": PAPER[degree] if size == PAPERS_SIZE else None,
            }


def stages(drawn_by: Any, frames: int) -> dict[str, float]:
    """Return the median time of each stage in milliseconds, with a wait after each pass."""
    staged = Staged(drawn_by)
    again = Frames(staged, STAGES_SIZE, STAGES_DEGREE)
    again.warm_up()
    found = []
    start = time.perf_counter()
    while len(found) < frames and (not found or time.perf_counter() - start < SECONDS):
        staged.seconds.clear()
        again.draw()
        found.append([sum(staged.seconds[name] for name in names) for names in STAGES.values()])
    return dict(zip(STAGES, (np.median(found, axis=0) * 1e3).tolist(), strict=True))


def line(row: dict[str, Any]) -> str:
    """Format a row for printing."""
    size = f"{row['width']} x {row['height']}"
    spread = f"({row['least']:.2f} to {row['largest']:.2f})"
    paper = "" if row["paper"] is None else f"{row['paper']}"
    text = f"{size:>11}  {row['degree']:>2}  {row['milliseconds']:9.2f}  {spread:22} {paper:>5}"
    return text.rstrip()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    about, _, more = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(description=about, epilog=more.strip())
    parser.add_argument("--sizes", nargs="+", type=_size, default=[_size(name) for name in SIZES])
    parser.add_argument(
        "--frames", type=int, default=FRAMES, help="number of frames per case (%(default)s)"
    )
    parser.add_argument(
        "--no-stages", action="store_true", help="time only whole frames, not stages"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to a file")
    chosen = parser.parse_args(arguments)
    drawn_by = device()
    if drawn_by is None:
        return 1
    found: dict[str, Any] = {"renderer": drawn_by.name, "triangles": TRIANGLES, "rows": []}
    print(drawn_by.name)
    print(
        f"{TRIANGLES // 1000}K triangles, {2 * cases.LOOK.length + 1} samples; milliseconds a frame,"
    )
    print(f"the least and the largest, and the paper's on an {PAPERS_CARD}", flush=True)
    for row in rows(drawn_by, chosen.sizes, chosen.frames):
        found["rows"].append(row)
        print(line(row), flush=True)
    if not chosen.no_stages:
        found["stages"] = stages(drawn_by, chosen.frames)
        width, height = STAGES_SIZE
        print(f"of {width} x {height}, N = {STAGES_DEGREE}, waiting after each pass")
        for name, amount in found["stages"].items():
            print(f"  {name:34} {amount:9.2f}", flush=True)
    if chosen.json:
        chosen.json.parent.mkdir(parents=True, exist_ok=True)
        chosen.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(side) for side in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not WIDTHxHEIGHT") from None
    return width, height


if __name__ == "__main__":
    sys.exit(main())
