"""Measure how long the shaders take on this graphics card, in milliseconds, next to the times in the paper.

A frame is the work after the camera has moved: from triangles and fields on the card to the picture on the
card. Nothing is uploaded or read back, and a frame ends when the card is done. The time of the card itself
runs from its first to its last command, measured by its own timer. Python sends the commands; its time only
counts while the card waits for them. This script needs numpy, moderngl and a driver with EGL, but neither
Blender nor a display.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.gpu.renderer import GpuRenderer
from rosy_addon.gpu.resources import DrawItem
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.rendering.view_input import ViewInput
from rosy_addon.worker.job import run

from . import cases
from .timing import peer, write_json

SIZES = ("512x512", "1920x1080", "3840x2160")

#: Milliseconds per frame by degree in Table 1 of the paper (Palacios and Zhang 2011), for its member
#: decomposition with 512 x 512 pixels and 12K triangles on `PAPER_CARD`. The paper draws other objects, and
#: does not state how much of the picture they cover. Here the ball covers 85 %.
PAPER_MILLISECONDS = {2: 17, 3: 46, 4: 32, 6: 46}
PAPER_CARD = "NVIDIA GeForce 8600 GTS"

TRIANGLES, DEGREE = 12_000, 4

#: Number of frames of which the median is taken, and maximum of their total time in seconds.
FRAMES, SECONDS = 21, 6.0

#: Seconds of drawing before the timing (at least one frame), so that shaders are compiled and clocks are up.
WARM_UP = 1.0

#: Rotation of the camera between frames, in radians.
AZIMUTH_STEP = 0.01


def open_device() -> Any:
    """Return a device to draw on. If none can be opened, end the program with a message."""
    peer("moderngl")
    from harness.egl_device import EglDevice

    try:
        return EglDevice()
    except Exception as error:  # moderngl raises bare exceptions
        sys.exit(
            f"skipped, because there is no OpenGL 4.3 with EGL: {' '.join(str(error).split())}"
        )


def draw_texture(renderer: GpuRenderer, items: Sequence[DrawItem], camera: Any, look: Any) -> Any:
    """Draw a picture without reading it back, and return its texture."""
    return run(renderer.texture_steps(items, ViewInput((), camera, look)))


def frame_times(
    device: Any, size: tuple[int, int], degree: int, look: Look, frames: int
) -> np.ndarray:
    """Return (F, 2) milliseconds per frame: in total, and of the card itself.

    F is `frames`, or less if the frames take long in total.
    """
    renderer = GpuRenderer(device)
    items = renderer.upload([cases.instance(TRIANGLES, degree)], "smooth")
    azimuths = iter(np.arange(10_000) * AZIMUTH_STEP)

    def draw() -> tuple[float, float]:
        camera = cases.camera(*size, azimuth=next(azimuths))
        timer = device.context.query(time=True)
        start = time.perf_counter()
        with timer:
            draw_texture(renderer, items, camera, look)
        device.finish()
        return time.perf_counter() - start, timer.elapsed * 1e-9

    draw()
    start = time.perf_counter()
    while time.perf_counter() - start < WARM_UP:
        draw()
    seconds: list[tuple[float, float]] = []
    start = time.perf_counter()
    while len(seconds) < frames and (not seconds or time.perf_counter() - start < SECONDS):
        seconds.append(draw())
    return np.array(seconds) * 1e3


def looks(options: argparse.Namespace) -> Iterator[tuple[str, int, Look]]:
    """Yield name, degree and look of each row of the table for one picture size."""
    if options.presets:
        for preset in preset_keys():
            for samples in (1, 2):
                look = replace(load_preset(preset).look, supersampling=samples)
                yield f"{preset}, {samples} x {samples} samples", DEGREE, look
    else:
        for degree, paper in PAPER_MILLISECONDS.items():
            yield f"N = {degree} (the paper: {paper} at 512 x 512)", degree, cases.LOOK


def main() -> None:
    """Run the command line."""
    summary, _, details = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(description=summary, epilog=details.strip())
    parser.add_argument("--sizes", nargs="+", default=SIZES, help="WIDTHxHEIGHT ...")
    parser.add_argument("--frames", type=int, default=FRAMES, help="frames a row (%(default)s)")
    parser.add_argument("--presets", action="store_true", help="time the presets instead")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to a file")
    options = parser.parse_args()
    device = open_device()
    rows = []
    print(f"{device.name}; the paper's card is a {PAPER_CARD}")
    print(f"{TRIANGLES // 1000}K triangles, {2 * cases.LOOK.length + 1} samples a streamline")
    print("milliseconds a frame: median, least, largest; least of the card itself", flush=True)
    for size in options.sizes:
        width, height = map(int, size.split("x"))
        for name, degree, look in looks(options):
            times, card = frame_times(device, (width, height), degree, look, options.frames).T
            row = {"width": width, "height": height, "name": name, "frames": len(times)}
            row |= {"milliseconds": float(np.median(times)), "least": float(times.min())}
            rows.append(row | {"largest": float(times.max()), "card": float(card.min())})
            numbers = (rows[-1][key] for key in ("milliseconds", "least", "largest", "card"))
            print(f"{size:>10}  {name:44}", *(f"{n:8.2f}" for n in numbers), flush=True)
    if options.json:
        report = {"renderer": device.name, "triangles": TRIANGLES, "rows": rows}
        write_json(options.json, report)


if __name__ == "__main__":
    main()
