"""Time per frame of an animation relative to a single bake, and of two processes to one."""

from __future__ import annotations

import itertools
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from . import cases
from .timing import Bench, main, peer

TRIANGLES = 50_000

#: Number of frames that each timing draws.
FRAMES_PER_TIMING = 10

#: Number of frames of 640 x 480 pixels that the processes share.
SHARED_FRAMES = 80


def measure(bench: Bench) -> None:
    """Time animations with unchanged parts, which are reused, and with several processes."""
    peer("bpy")
    with tempfile.TemporaryDirectory() as folder:
        for name, animate in (
            ("static mesh, moving camera", _move_camera),
            ("static camera, deforming mesh", _deform),
        ):
            _compare_with_bakes(bench, name, _scene(animate), Path(folder))
        _compare_processes(bench, Path(folder))


def _compare_with_bakes(bench: Bench, name: str, scene, folder: Path) -> None:
    """Time frames of an animation and as many single bakes."""
    from rosy_addon.core.cache import BAKE_CACHE
    from rosy_addon.jobs.animation import bake_animation
    from rosy_addon.jobs.bake import bake
    from rosy_addon.scene.pictures import OutputSettings

    settings = OutputSettings(folder=folder)
    numbers = itertools.count(1)

    def bake_frames() -> None:
        batch = [next(numbers) for _ in range(FRAMES_PER_TIMING)]
        bake_animation(scene, batch, look=cases.LOOK, settings=settings, show=False)

    def bake_singly() -> None:
        for _ in range(FRAMES_PER_TIMING):
            scene.frame_set(next(numbers))
            BAKE_CACHE.clear()
            bake(scene, look=cases.LOOK, settings=settings)

    bake_frames()  # the first frame costs as much as a bake
    name = f"{FRAMES_PER_TIMING} frames / as many single bakes, {name}"
    bench.compare(name, bake_frames, bake_singly, at_most=0.7)


def _compare_processes(bench: Bench, folder: Path) -> None:
    """Time an animation of the command line with one process and with two."""
    import bpy

    scene = _scene(_deform)
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    path = folder / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    numbers = itertools.count()

    def run_processes(count: int) -> None:
        command = [sys.executable, "-m", "rosy_addon", "bake", str(path)]
        command += ["--out", str(folder / f"frames{next(numbers)}")]
        command += ["--frames", f"1-{SHARED_FRAMES}", "--jobs", str(count)]
        subprocess.run(command, check=True, capture_output=True)

    bench.compare(
        f"one process / two, {SHARED_FRAMES} frames, start and all",
        lambda: run_processes(1),
        lambda: run_processes(2),
        at_least=1.8,
        runs=3,
    )


def _scene(animate) -> object:
    """Open a scene with the ball and a camera, 512 x 512 pixels."""
    import bpy

    scene = cases.ball_scene(TRIANGLES)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.location, camera.rotation_euler = (0.0, -3.4, 0.0), (np.pi / 2, 0.0, 0.0)
    scene.render.resolution_x = scene.render.resolution_y = 512
    animate(scene)
    return scene


def _move_camera(scene) -> None:
    """Animate the location of the camera."""
    for frame, x in ((1, -0.4), (500, 0.4)):
        scene.camera.location.x = x
        scene.camera.keyframe_insert("location", frame=frame)


def _deform(scene) -> None:
    """Animate the ball with a shape key that widens it."""
    obj = scene.objects["Ball"]
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
