"""Steps in a window, one after the other, while Blender goes on with its own affairs.

Every step is a generator that yields while Blender is to go on; a timer resumes it. What each step
found is written to the file ROSY_RESULTS names, as {step: "" or what went wrong}.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

SHOTS = Path(os.environ["ROSY_SHOTS"])
RESULTS = Path(os.environ["ROSY_RESULTS"])
PATIENCE = 40.0


def watch(*steps):
    """Do steps as soon as there is a window, write what came of them and end Blender."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.show_statusbar_stats = False
    bpy.app.timers.register(_resume(_all(steps)), first_interval=1.0, persistent=True)


def _resume(work):
    def tick():
        try:
            pause = next(work)
        except StopIteration:
            failed = any(error for error, _ in json.loads(RESULTS.read_text()).values())
            sys.stdout.flush()
            os._exit(1 if failed else 0)
        return 0.05 if pause is None else pause

    return tick


def _all(steps):
    results = {}
    for step in steps:
        start, error = time.monotonic(), ""
        try:
            yield from step()
        except Exception:
            error = traceback.format_exc()
        results[step.__name__.replace("_", " ")] = error, round(time.monotonic() - start, 1)
        RESULTS.write_text(json.dumps(results))
    results["the end"] = "", 0.0
    RESULTS.write_text(json.dumps(results))


def rosy(name):
    """A module of the extension."""
    return sys.modules[f"bl_ext.user_default.rosy.{name}"]


def view():
    """The window, the 3D view in it and its main region and sidebar."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    regions = {region.type: region for region in area.regions}
    return window, area, regions["WINDOW"], regions["UI"]


def in_view():
    """A context in which operators find the 3D view."""
    window, area, region, _ = view()
    return bpy.context.temp_override(window=window, area=area, region=region)


def until(condition):
    late = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > late:
            raise AssertionError("waited in vain")
        yield


def captured(name, region):
    """(h, w, 3) float32 display values of a region as it is on the screen, rows from the bottom.

    The whole screen is kept as NAME.png. Blender's own screenshot is black on software OpenGL; the
    X server knows better.
    """
    path = SHOTS / f"{name}.png"
    subprocess.run(["import", "-window", "root", str(path)], check=True, timeout=20)
    words = ["convert", str(path), "-depth", "8", "-format", "%w %h", "-write", "info:-", "rgb:-"]
    said = subprocess.run(words, check=True, timeout=20, capture_output=True).stdout
    size = said.split(b" ", 1)
    width = int(size[0])
    raw = np.frombuffer(said, dtype=np.uint8)
    height = len(raw) // (3 * width)
    seen = raw[len(raw) - 3 * width * height :].reshape(height, width, 3)[::-1]
    part = seen[region.y : region.y + region.height, region.x : region.x + region.width]
    return part.astype(np.float32) / 255
