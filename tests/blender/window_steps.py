"""Running test steps in a window, one after the other, while Blender handles its events.

Every step is a generator. Whenever it yields, Blender continues, and a timer resumes the step. The
results are written to the file of ROSY_RESULTS, as {step: [error or "", seconds]}.
"""

import importlib
import json
import math
import os
import subprocess
import sys
import time
import traceback
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
from conftest import add_camera, add_suzanne
from extension import preferences, rosy
from mathutils import Euler, Vector

SHOTS = Path(os.environ["ROSY_SHOTS"])
RESULTS = Path(os.environ["ROSY_RESULTS"])
TIMEOUT_SECONDS = 40.0

#: Colors of a picture for the documentation: interfaces have few, and the file is a third of the size.
PICTURE_COLORS = 128

#: Seconds for which Blender waits for events in each turn of its loop, unless events are simulated.
LOOP_PAUSE = 0.005

#: Names of the only steps to run; all if there is none.
ONLY = os.environ.get("ROSY_STEPS", "").split(",")

#: Whether to take pictures for the documentation, which needs further steps: `run.py --many`.
MANY = bool(os.environ.get("ROSY_MANY"))


def run_module(name):
    """Run the functions of a module whose names start with test_, in their order, and end Blender.

    They run as soon as there is a window, and their results are written. If `ONLY` has names, other steps
    are left out.
    """
    functions = vars(importlib.import_module(name)).items()
    steps = {key[5:]: step for key, step in functions if key.startswith("test_")}
    if any(ONLY):
        steps = {key: step for key, step in steps.items() if key in ONLY}
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.show_statusbar_stats = False
    bpy.context.preferences.view.smooth_view = 0
    preferences().live_first_field = False
    if "--enable-event-simulate" in sys.argv:
        bpy.app.timers.register(_rest, persistent=True)
    bpy.app.timers.register(_resume(_run_all(steps)), first_interval=1.0, persistent=True)


def _rest():
    """Wait in each turn of Blender's loop, which otherwise takes a core while events are simulated."""
    time.sleep(LOOP_PAUSE)
    return 0.0


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


def _run_all(steps):
    results = {}
    for name, step in steps.items():
        start, error = time.monotonic(), ""
        try:
            yield from step()
        except Exception:
            error = traceback.format_exc()
        results[name.replace("_", " ")] = error, round(time.monotonic() - start, 1)
        RESULTS.write_text(json.dumps(results))
    results["the end"] = "", 0.0
    RESULTS.write_text(json.dumps(results))


def view():
    """Return the window, its 3D view, and the main region and the sidebar of the view."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    regions = {region.type: region for region in area.regions}
    return window, area, regions["WINDOW"], regions["UI"]


def status():
    """Return the module that knows how far the running job has come."""
    return rosy("rosy_addon.ui.job_status")


def open_tab():
    """Open RoSy's tab of the sidebar. Blender knows it once the sidebar has been drawn."""
    view()[1].spaces.active.show_region_ui = True
    for _ in range(3):
        yield 0.3
        view()[3].active_panel_category = "RoSy"
        view()[1].tag_redraw()
    yield 0.3


def fresh_scene(size=(320, 240)):
    """Create a scene with Suzanne, a light and a camera, and open RoSy's tab of the sidebar."""
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    view()[1].spaces.active.shading.type = "SOLID"
    yield from open_tab()
    with in_view():
        bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.2))
        scene.camera = add_camera("Camera", (0.0, -4.5, 1.0), (math.radians(78), 0.0, 0.0))
        add_suzanne(2)
        bpy.ops.ed.undo_push(message="fresh scene")


def turn_view(angles, distance, sidebar):
    """Turn the 3D view to Euler angles, and move it to the left of the sidebar."""
    region_3d, rotation = view()[1].spaces.active.region_3d, Euler(angles).to_quaternion()
    region_3d.view_rotation = rotation
    region_3d.view_location = rotation @ Vector((sidebar, 0.0, 0.0))
    region_3d.view_distance = distance


def scene_with_field(size=(320, 240)):
    """Create a scene with Suzanne, her field and a camera."""
    yield from fresh_scene(size)
    call_in_view(bpy.ops.rosy.field_generate, "EXEC_DEFAULT", True, kind="curvature", degree=4)


def start_long_bake():
    """Start a bake as its button does, one that no other has prepared, and wait until it has made progress."""
    look = bpy.context.scene.rosy.look
    look.method, look.seed = "brute", look.seed + 1
    assert call_in_view(bpy.ops.rosy.bake, "INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield from wait_until(lambda: status().current is None or status().current.fraction > 0.1)
    assert status().current is not None, "the bake ended before it could be interrupted"


def press(key):
    """Press and release a key over the window that has opened last, such as a file browser."""
    window = bpy.context.window_manager.windows[-1]
    for value in ("PRESS", "RELEASE"):
        window.event_simulate(type=key, value=value, x=window.width // 3, y=window.height // 2)


def in_view():
    """Return a context in which operators find the 3D view."""
    window, area, region, _ = view()
    return bpy.context.temp_override(window=window, area=area, region=region)


def call_in_view(operator, *arguments, **settings):
    """Call an operator in the 3D view, and return its result."""
    with in_view():
        return operator(*arguments, **settings)


def wait_until(condition, seconds=TIMEOUT_SECONDS):
    """Yield until a condition holds."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError("timed out")
        yield


@contextmanager
def redraws(record=None):
    """Return a list that gets an entry whenever a 3D view was drawn; `record` is called then, too."""
    drawn = []

    def note():
        drawn.append(True)
        if record is not None:
            record()

    space = bpy.types.SpaceView3D
    handler = space.draw_handler_add(note, (), "WINDOW", "POST_PIXEL")
    try:
        yield drawn
    finally:
        space.draw_handler_remove(handler, "WINDOW")


def redraw_view():
    """Yield until the 3D view has been drawn once more, so that its matrices are those of its settings."""
    with redraws() as drawn:
        view()[1].tag_redraw()
        yield from wait_until(lambda: drawn)


def capture(name, region):
    """Return the (h, w, 3) float32 display values of a region on the screen, rows from the bottom.

    The whole screen is saved as NAME.png. It is read from the X server, because Blender's own
    screenshot is black on software OpenGL.
    """
    path = SHOTS / f"{name}.png"
    subprocess.run(["import", "-window", "root", str(path)], check=True, timeout=20)
    command = ["convert", str(path), "-depth", "8", "ppm:-"]
    output = subprocess.run(command, check=True, timeout=20, capture_output=True).stdout
    _, size, _, values = output.split(b"\n", 3)
    width, height = map(int, size.split())
    screen = np.frombuffer(values, dtype=np.uint8).reshape(height, width, 3)[::-1]
    part = screen[region.y : region.y + region.height, region.x : region.x + region.width]
    return part.astype(np.float32) / 255


def save_part(screenshot, name, x, y, width, height, colors=PICTURE_COLORS):
    """Save a part of the screenshot of `capture` as NAME.png, for the documentation.

    `x` and `y` are pixels from the lower left of the window and of the screen. The number of colors is
    not reduced if it is None.
    """
    crop = f"{width}x{height}+{x}+{y}"
    options = ["-gravity", "SouthWest", "-crop", crop, "+repage"]
    if colors is not None:
        options += ["-strip", "+dither", "-colors", str(colors)]
    command = ["convert", SHOTS / f"{screenshot}.png", *options, SHOTS / f"{name}.png"]
    subprocess.run(command, check=True, timeout=20)
