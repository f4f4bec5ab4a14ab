"""Commands that start other processes, and their files."""

import os
import subprocess
import sys
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.random import Generator

from rosy_addon import api
from rosy_addon.extras.blender import BLENDER_VARIABLE

from .meshes import torus

#: Script that writes a .blend file with a camera and a turning mesh with a field.
SCENE_SCRIPT = """
import bpy
import numpy as np
bpy.ops.wm.read_homefile(use_empty=True)
scene = bpy.context.scene
scene.render.resolution_x = scene.render.resolution_y = 300
camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
camera.location, camera.rotation_euler = (0.0, -5.0, 0.0), (np.pi / 2, 0.0, 0.0)
scene.collection.objects.link(camera)
scene.camera = camera
bpy.ops.mesh.primitive_monkey_add()
monkey = bpy.context.object
normals = np.array([polygon.normal for polygon in monkey.data.polygons])
field = monkey.data.attributes.new("rosy", "FLOAT_VECTOR", "FACE")
field.data.foreach_set("vector", np.cross(normals, (0.3, 0.2, 1.0)).ravel())
for frame, angle in ((1, 0.0), (90, 3.0)):
    monkey.rotation_euler.z = angle
    monkey.keyframe_insert("rotation_euler", frame=frame)
bpy.ops.wm.save_as_mainfile(filepath={path!r})
"""

#: Arguments of the commands, their outputs, and the seconds that they take on one core. A word with a star
#: stands for several files.
COMMANDS: list[tuple[str, str, float]] = [
    ("render mesh.obj --size 1400x1400 --workers 3 --set supersampling=2", "out.png", 7.0),
    ("render mesh.obj a.rosy --size 900x900 --workers 2 --set ink=hatch", "out.png", 4.0),
    ("turntable mesh.obj --pictures 9 --size 500x500 --workers 2", "out.gif", 6.0),
    ("turntable mesh.obj --pictures 9 --size 500x500 --workers 2", "out.mp4", 6.0),
    ("film mesh.obj a.rosy b.rosy c.rosy --between 3 --size 400x400", "out.mp4", 5.0),
    ("film mesh.obj a.rosy b.rosy c.rosy --between 3 --size 400x400", "out.gif", 5.0),
    ("strokes mesh.obj --size 900x900", "out.svg", 4.0),
    ("field mesh.obj --generate smoothest", "out.rosy", 3.0),
    ("texture mesh.obj --size 1024", "out.png", 5.0),
]

#: Commands for .blend files. They need Blender's Python module, or a Blender that ROSY_BLENDER names.
BLENDER_COMMANDS: list[tuple[str, str, float]] = [
    ("bake scene.blend --frames 1-90 --jobs 3 --out out", "out/", 15.0),
    ("bake scene.blend --frames 1-90 --out out", "out/", 8.0),
    ("strokes scene.blend --size 800x800", "out.svg", 5.0),
]


def write_command(rng: Generator, folder: Path) -> tuple[list[str], set[str], float]:
    """Write the files of a random command. Return its arguments and outputs, and the seconds that it takes."""
    has_blender = find_spec("bpy") is not None or BLENDER_VARIABLE in os.environ
    if has_blender and rng.random() < 0.5:
        text, output, seconds = BLENDER_COMMANDS[rng.integers(len(BLENDER_COMMANDS))]
        (folder / "scene.blend").write_bytes(scene_bytes())
    else:
        text, output, seconds = COMMANDS[rng.integers(len(COMMANDS))]
        _write_torus(rng, folder)
    arguments = text.split()
    if not output.endswith("/"):
        arguments += ["-o", output]
        (folder / output).write_bytes(b"the previous contents")
    return arguments, {output}, seconds


@cache
def scene_bytes() -> bytes:
    """Return the contents of the .blend file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.blend"
        script = SCENE_SCRIPT.format(path=str(path))
        command = [sys.executable, "-c", script]
        if BLENDER_VARIABLE in os.environ:
            command = [os.environ[BLENDER_VARIABLE], "-b", "--python-expr", script]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return path.read_bytes()


def _write_torus(rng: Generator, folder: Path) -> None:
    """Write a torus as mesh.obj, with a UV map, and three fields on it."""
    points, faces = torus(80, 40)
    uv = np.stack(np.divmod(np.arange(len(points)), 40), axis=1) / (80, 40)
    lines = ["v {} {} {}".format(*point) for point in points.tolist()]
    lines += ["vt {} {}".format(*pair) for pair in uv.tolist()]
    lines += ["f " + " ".join(f"{v + 1}/{v + 1}" for v in face) for face in faces]
    (folder / "mesh.obj").write_text("\n".join(lines) + "\n")
    surface = api.Surface(points, faces)
    for name in "abc":
        field = api.along_axis(surface, rng.normal(size=3), degree=4)
        field.save(folder / f"{name}.rosy")
