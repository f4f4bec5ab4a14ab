"""Times of the shaders on this graphics card in milliseconds, next to those of the paper.

A frame is the work after the camera has moved: from triangles and fields on the card to the picture
on the card. Nothing is uploaded or read back, and a frame ends when the card is done. The card's own
time is that between its first and its last command, by its timer. It contains that of Python, which sends
the commands, only where the card waits for them. Needs numpy, moderngl and a driver with EGL, but neither
Blender nor a display.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rosy_addon.compositor.flow import NO_DRIFT, Drift, drift_at
from rosy_addon.compositor.look import Look
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.gpu.resources import DrawItem
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.job import run

from . import cases

SIZES = ("512x512", "1920x1080", "3840x2160")

DEGREES = (2, 3, 4, 6)

#: Milliseconds by degree in Table 1 of the paper: its decomposition, 512 x 512 pixels and 12K
#: triangles, on `PAPER_CARD`. Its objects are different, and it does not state how much of the frame
#: they cover; here it is 85 %.
PAPER_MILLISECONDS = {2: 17, 3: 46, 4: 32, 6: 46}
PAPER_CARD = "NVIDIA GeForce 8600 GTS"
PAPER_SIZE = (512, 512)

TRIANGLES = 12_000

#: Size and degree for the times of the stages, and the passes of each stage.
STAGES_SIZE, STAGES_DEGREE = (1920, 1080), 4
STAGES = {
    "G-buffer (visibility, resolve)": ("visibility", "resolve"),
    "covering (directions, angle_gradient)": ("directions", "angle_gradient"),
    "streamlines and light (lic)": ("lic",),
}

#: Settings of two looks whose times are compared, by the name of the option.
COMPARISONS: dict[str, dict[str, dict[str, Any]]] = {
    "flow": {"still": {}, "drifting": {"flow": 2.0}},
}

#: Degrees of these looks.
COMPARED_DEGREES = {"flow": (4,)}

#: Number of frames of a median, and the maximum of their total time in seconds.
FRAMES = 21
SECONDS = 6.0

#: Seconds of drawing before the timing (at least one frame), to compile shaders and raise clocks.
WARM_UP = 1.0

#: Rotation of the camera between frames, in radians.
AZIMUTH_STEP = 0.01


def open_device() -> Any:
    """Return a device; None if none can be opened, after printing the reason."""
    try:
        from harness.egl_device import EglDevice
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


def draw_texture(
    renderer: GpuRenderer,
    items: Sequence[DrawItem],
    camera: Any,
    look: Any,
    drift: Drift = NO_DRIFT,
) -> Any:
    """Draw a picture and leave it on the card."""
    return run(renderer.texture_steps(items, ViewInput((), camera, look, drift=drift)))


class QueriedDevice:
    """A device that records the card's own time for each pass."""

    def __init__(self, device: Any) -> None:
        self._device = device
        self._queries: list[tuple[str, Any]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def compute(self, shader: Any, *rest: Any) -> None:
        """As `Device.compute`."""
        self._queried(self._device.compute, shader, *rest)

    def draw(self, shader: Any, *rest: Any) -> None:
        """As `Device.draw`."""
        self._queried(self._device.draw, shader, *rest)

    def take_seconds(self) -> dict[str, float]:
        """Wait for the card. Return the time of the passes since the last call, by their names."""
        self._device.finish()
        seconds: dict[str, float] = {}
        for name, query in self._queries:
            seconds[name] = seconds.get(name, 0.0) + query.elapsed * 1e-9
        self._queries.clear()
        return seconds

    def _queried(self, work: Any, shader: Any, *rest: Any) -> None:
        query = self._device.context.query(time=True)
        with query:
            work(shader, *rest)
        self._queries.append((shader.name, query))


class Frames:
    """Repeated frames of one object at one size."""

    def __init__(
        self, device: Any, size: tuple[int, int], degree: int, look: Look = cases.LOOK
    ) -> None:
        self.device = device
        self.size = size
        self.look = look
        self.renderer = GpuRenderer(device)
        self.items: list[DrawItem] = self.renderer.upload(
            [cases.instance(TRIANGLES, degree)], "smooth"
        )
        self.frame_count = 0

    def draw(self) -> tuple[float, float]:
        """Draw the next frame. Return its time, and the card's own, in seconds."""
        camera = cases.camera(*self.size, azimuth=self.frame_count * AZIMUTH_STEP)
        drift = drift_at(self.look, self.frame_count)
        self.frame_count += 1
        timer = self.device.context.query(time=True)
        start = time.perf_counter()
        with timer:
            draw_texture(self.renderer, self.items, camera, self.look, drift)
        self.device.finish()
        return time.perf_counter() - start, timer.elapsed * 1e-9

    def warm_up(self) -> None:
        """Draw frames until all is prepared and the clocks have risen."""
        self.draw()
        start = time.perf_counter()
        while time.perf_counter() - start < WARM_UP:
            self.draw()

    def times(self, frames: int) -> np.ndarray:
        """Return the times of (F, 2) frames in milliseconds, as `draw`; fewer if they take long."""
        self.warm_up()
        seconds: list[tuple[float, float]] = []
        start = time.perf_counter()
        while len(seconds) < frames and (not seconds or time.perf_counter() - start < SECONDS):
            seconds.append(self.draw())
        return np.array(seconds) * 1e3


def measure_rows(
    device: Any, sizes: Sequence[tuple[int, int]], frames: int
) -> Iterator[dict[str, Any]]:
    """Yield the time for each size and degree."""
    for size in sizes:
        for degree in DEGREES:
            times, card_times = Frames(device, size, degree).times(frames).T
            yield {
                "width": size[0],
                "height": size[1],
                "degree": degree,
                "milliseconds": float(np.median(times)),
                "least": float(times.min()),
                "largest": float(times.max()),
                "card": float(card_times.min()),
                "frames": len(times),
                "paper": PAPER_MILLISECONDS[degree] if size == PAPER_SIZE else None,
            }


def measure_comparison(
    device: Any, comparison: str, sizes: Sequence[tuple[int, int]], frames: int
) -> Iterator[dict[str, Any]]:
    """Yield the times of two looks for each size and degree, with the camera moving."""
    for size in sizes:
        for degree in COMPARED_DEGREES[comparison]:
            row: dict[str, Any] = {"width": size[0], "height": size[1], "degree": degree}
            for name, settings in COMPARISONS[comparison].items():
                look = replace(cases.LOOK, **settings)
                times, card_times = Frames(device, size, degree, look).times(frames).T
                row[name], row[f"{name} card"] = float(np.median(times)), float(card_times.min())
            yield row


def measure_presets(
    device: Any, sizes: Sequence[tuple[int, int]], frames: int
) -> Iterator[dict[str, Any]]:
    """Yield the times of each preset with one sample in a pixel and with 2 x 2."""
    for size in sizes:
        for preset in preset_keys():
            row: dict[str, Any] = {"width": size[0], "height": size[1], "preset": preset}
            for samples in (1, 2):
                look = replace(load_preset(preset).look, supersampling=samples)
                times, card_times = Frames(device, size, STAGES_DEGREE, look).times(frames).T
                row[f"{samples}"] = float(np.median(times))
                row[f"{samples} card"] = float(card_times.min())
            yield row


def measure_stages(device: Any, frame_count: int) -> dict[str, float]:
    """Return the median of the card's own time for each stage in milliseconds."""
    queried = QueriedDevice(device)
    renderer = GpuRenderer(queried)
    items = renderer.upload([cases.instance(TRIANGLES, STAGES_DEGREE)], "smooth")
    camera = cases.camera(*STAGES_SIZE)
    stage_seconds = []
    start = time.perf_counter()
    while len(stage_seconds) <= frame_count and (
        len(stage_seconds) < 2 or time.perf_counter() - start < SECONDS
    ):
        draw_texture(renderer, items, camera, cases.LOOK)
        passes = queried.take_seconds()
        stage_seconds.append([sum(passes[name] for name in names) for names in STAGES.values()])
    medians = np.median(stage_seconds[1:], axis=0) * 1e3
    return dict(zip(STAGES, medians.tolist(), strict=True))


def format_row(row: dict[str, Any]) -> str:
    """Format a row for printing."""
    size = f"{row['width']} x {row['height']}"
    spread = f"({row['least']:.2f} to {row['largest']:.2f})"
    paper = "" if row["paper"] is None else f"{row['paper']}"
    times = f"{row['milliseconds']:9.2f}  {spread:22} {row['card']:9.2f}"
    text = f"{size:>11}  {row['degree']:>2}  {times} {paper:>5}"
    return text.rstrip()


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    summary, _, details = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(description=summary, epilog=details.strip())
    parser.add_argument("--sizes", nargs="+", type=_size, default=[_size(name) for name in SIZES])
    parser.add_argument(
        "--frames", type=int, default=FRAMES, help="number of frames per case (%(default)s)"
    )
    parser.add_argument(
        "--no-stages", action="store_true", help="time only whole frames, not stages"
    )
    for comparison, looks in COMPARISONS.items():
        parser.add_argument(
            f"--{comparison}",
            action="store_const",
            const=comparison,
            dest="comparison",
            help=f"time only {' and '.join(looks)} streaks",
        )
    parser.add_argument("--presets", action="store_true", help="time only the presets")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to a file")
    options = parser.parse_args(arguments)
    device = open_device()
    if device is None:
        return 1
    report: dict[str, Any] = {"renderer": device.name, "triangles": TRIANGLES, "rows": []}
    print(device.name)
    if options.presets:
        _print_presets(device, options, report)
    elif options.comparison:
        _print_comparison(device, options, report)
    else:
        _print_all(device, options, report)
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return 0


def _print_comparison(device: Any, options: argparse.Namespace, report: dict[str, Any]) -> None:
    """Time two looks, and print and store the rows."""
    first, second = COMPARISONS[options.comparison]
    print(f"N; milliseconds a frame and the card's own least, {first} and {second}")
    for row in measure_comparison(device, options.comparison, options.sizes, options.frames):
        report["rows"].append(row)
        size = f"{row['width']} x {row['height']}"
        times = "  ".join(
            f"{row[name]:9.2f} {row[f'{name} card']:9.2f}" for name in (first, second)
        )
        ratio = row[f"{second} card"] / row[f"{first} card"]
        print(f"{size:>11}  {row['degree']:>2}  {times}  ratio {ratio:.2f}", flush=True)


def _print_presets(device: Any, options: argparse.Namespace, report: dict[str, Any]) -> None:
    """Time the presets, and print and store the rows."""
    print("milliseconds a frame and the card's own least: one sample in a pixel, and 2 x 2")
    for row in measure_presets(device, options.sizes, options.frames):
        report["rows"].append(row)
        size = f"{row['width']} x {row['height']}"
        times = "  ".join(f"{row[key]:9.2f} {row[f'{key} card']:9.2f}" for key in ("1", "2"))
        print(f"{size:>11}  {row['preset']:16}  {times}", flush=True)


def _print_all(device: Any, options: argparse.Namespace, report: dict[str, Any]) -> None:
    """Time all degrees and the stages, and print and store the rows."""
    print(
        f"{TRIANGLES // 1000}K triangles, {2 * cases.LOOK.length + 1} samples; milliseconds a frame,"
    )
    print(
        f"the least and the largest, the card's own least, and the paper's on an {PAPER_CARD}",
        flush=True,
    )
    for row in measure_rows(device, options.sizes, options.frames):
        report["rows"].append(row)
        print(format_row(row), flush=True)
    if not options.no_stages:
        report["stages"] = measure_stages(device, options.frames)
        width, height = STAGES_SIZE
        print(f"the card's own of {width} x {height}, N = {STAGES_DEGREE}")
        for name, milliseconds in report["stages"].items():
            print(f"  {name:34} {milliseconds:9.2f}", flush=True)


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(side) for side in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not WIDTHxHEIGHT") from None
    return width, height


if __name__ == "__main__":
    sys.exit(main())
