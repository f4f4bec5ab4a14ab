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

#: Number of frames in each timing.
TOGETHER = 10

#: Number of frames of 640 x 480 pixels that the processes share.
FRAMES = 80


def measure(runs: int) -> Iterator[Case]:
    """Time animations with unchanged parts, which are reused, and with several processes."""
    try:
        import bpy
    except ImportError:
        print("animation: skipped, because bpy is not installed", file=sys.stderr)
        return
    from rosy_addon.animation import bake_animation
    from rosy_addon.bake import bake
    from rosy_addon.cache import BAKE_CACHE
    from rosy_addon.scene.pictures import OutputSettings

    with tempfile.TemporaryDirectory() as folder:
        settings = OutputSettings(folder=Path(folder))
        for name, animate in (
            ("static mesh, moving camera", _move_camera),
            ("static camera, deforming mesh", _deform),
        ):
            scene = _scene(bpy, animate)
            number = itertools.count(1)

            # The first frame costs as much as a bake.
            def frames(scene=scene, number=number) -> None:
                some = [next(number) for _ in range(TOGETHER)]
                bake_animation(scene, some, look=cases.LOOK, settings=settings, show=False)

            def singles(scene=scene, number=number) -> None:
                for _ in range(TOGETHER):
                    scene.frame_set(next(number))
                    BAKE_CACHE.clear()
                    bake(scene, look=cases.LOOK, settings=settings)

            frames()
            yield compare(
                f"{TOGETHER} frames / as many single bakes, {name}",
                frames,
                singles,
                target=0.7,
                higher_is_better=False,
                runs=runs,
            )
        scene = _scene(bpy, _deform)
        scene.render.resolution_x, scene.render.resolution_y = 640, 480
        path = Path(folder) / "scene.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        fresh = itertools.count()

        def processes(count: int) -> None:
            out = Path(folder) / f"frames{next(fresh)}"
            command = [sys.executable, "-m", "rosy_addon", "bake", str(path), "--out", str(out)]
            command += ["--frames", f"1-{FRAMES}", "--jobs", str(count)]
            subprocess.run(command, check=True, capture_output=True)

        yield compare(
            f"one process / two, {FRAMES} frames, start and all",
            lambda: processes(1),
            lambda: processes(2),
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
    for frame, x in ((1, -0.4), (500, 0.4)):
        scene.camera.location.x = x
        scene.camera.keyframe_insert("location", frame=frame)


def _deform(scene) -> None:
    thing = scene.objects["Ball"]
    thing.shape_key_add(name="Basis")
    key = thing.shape_key_add(name="Wide")
    points = np.empty(3 * len(key.data))
    key.data.foreach_get("co", points)
    points[::3] *= 1.2
    key.data.foreach_set("co", points)
    for frame, value in ((1, 0.0), (500, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)


if __name__ == "__main__":
    sys.exit(main(__doc__, measure))
