"""Time per frame of an animation relative to a single bake, and of two processes to one."""

from __future__ import annotations

import itertools
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import cases
from .again import ball_scene
from .timing import Case, compare, main

TRIANGLES = 50_000

#: Number of frames that each timing draws.
FRAMES_PER_TIMING = 10

#: Number of frames of 640 x 480 pixels that the processes share.
SHARED_FRAMES = 80


def measure(runs: int) -> Iterator[Case]:
    """Time animations with unchanged parts, which are reused, and with several processes."""
    try:
        import bpy
    except ImportError:
        print("animation: skipped, because bpy is not installed", file=sys.stderr)
        return
    from rosy_addon.core.cache import BAKE_CACHE
    from rosy_addon.jobs.animation import bake_animation
    from rosy_addon.jobs.bake import bake
    from rosy_addon.scene.pictures import OutputSettings

    with tempfile.TemporaryDirectory() as folder:
        settings = OutputSettings(folder=Path(folder))
        for name, animate in (
            ("static mesh, moving camera", _move_camera),
            ("static camera, deforming mesh", _deform),
        ):
            scene = _scene(bpy, animate)
            frame_numbers = itertools.count(1)

            # The first frame costs as much as a bake.
            def bake_frames(scene=scene, frame_numbers=frame_numbers) -> None:
                batch = [next(frame_numbers) for _ in range(FRAMES_PER_TIMING)]
                bake_animation(scene, batch, look=cases.LOOK, settings=settings, show=False)

            def bake_singly(scene=scene, frame_numbers=frame_numbers) -> None:
                for _ in range(FRAMES_PER_TIMING):
                    scene.frame_set(next(frame_numbers))
                    BAKE_CACHE.clear()
                    bake(scene, look=cases.LOOK, settings=settings)

            bake_frames()
            yield compare(
                f"{FRAMES_PER_TIMING} frames / as many single bakes, {name}",
                bake_frames,
                bake_singly,
                target=0.7,
                higher_is_better=False,
                runs=runs,
            )
        scene = _scene(bpy, _deform)
        scene.render.resolution_x, scene.render.resolution_y = 640, 480
        path = Path(folder) / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        folder_numbers = itertools.count()

        def run_processes(count: int) -> None:
            out = Path(folder) / f"frames{next(folder_numbers)}"
            command = [sys.executable, "-m", "rosy_addon", "bake", str(path), "--out", str(out)]
            command += ["--frames", f"1-{SHARED_FRAMES}", "--jobs", str(count)]
            subprocess.run(command, check=True, capture_output=True)

        yield compare(
            f"one process / two, {SHARED_FRAMES} frames, start and all",
            lambda: run_processes(1),
            lambda: run_processes(2),
            target=1.8,
            higher_is_better=True,
            runs=min(runs, 3),
        )


def _scene(bpy, animate) -> object:
    """Open a scene with the ball and a camera, 512 x 512 pixels."""
    scene = ball_scene(bpy, TRIANGLES)
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
    sys.exit(main(__doc__, measure))
