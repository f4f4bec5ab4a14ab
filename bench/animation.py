"""Measure how long the command line takes for an animation with one process, relative to two processes."""

import itertools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from . import cases
from .timing import Bench, main, peer

#: Number of triangles of the ball, and number of frames of 640 x 480 pixels.
TRIANGLES, FRAMES = 50_000, 80


def measure(bench: Bench) -> None:
    """Time the whole command, with its start, for frames of a ball that changes its shape."""
    peer("bpy")
    import bpy

    scene = cases.ball_scene(TRIANGLES)
    _deform(scene.objects["Ball"])
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.location, scene.camera.rotation_euler = (0.0, -3.4, 0.0), (np.pi / 2, 0.0, 0.0)
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    numbers = itertools.count()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))

        def bake_frames(processes: int) -> None:
            command = [sys.executable, "-m", "rosy_addon", "bake", str(path)]
            command += ["--out", f"{folder}/frames{next(numbers)}"]
            command += ["--frames", f"1-{FRAMES}", "--jobs", str(processes)]
            subprocess.run(command, check=True, capture_output=True)

        bench.compare(
            f"one process / two, {FRAMES} frames, start and all",
            lambda: bake_frames(1),
            lambda: bake_frames(2),
            at_least=1.8,
            runs=3,
        )


def _deform(obj) -> None:
    """Animate an object with a shape key that widens it."""
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Wide")
    points = np.empty(3 * len(key.data))
    key.data.foreach_get("co", points)
    points[::3] *= 1.2
    key.data.foreach_set("co", points)
    for frame, value in ((1, 0.0), (500, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


if __name__ == "__main__":
    main(__doc__, measure)
