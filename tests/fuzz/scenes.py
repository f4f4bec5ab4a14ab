"""Categories of Blender files: scenes with faults, and animations with damaged frames."""

from __future__ import annotations

import shutil
from pathlib import Path

import bpy
import numpy as np
from numpy.random import Generator

from rosy_addon.cli.parser import main
from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import settings_of
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.scene.meshes import mesh_surface
from rosy_addon.ui.properties import ensure_registered

from .cases import Case, hash_file
from .damage import damaged
from .options import random_options
from .preset_files import setting_value
from .shapes import random_mesh

_NAMES = (
    "Body",
    "body",
    "a/b",
    "a:b",
    "-x",
    "CON",
    "é",
    "\u202ex",
    "a\tb",
    ".",
    "x" * 60,
    "#",
    " ",
)
_MODIFIERS = ("SUBSURF", "MIRROR", "ARRAY", "TRIANGULATE", "SOLIDIFY", "DECIMATE", "BEVEL", "MASK")


def scene_case(rng: Generator, folder: Path) -> Case:
    """A scene with odd objects, cameras, fields and settings, baked or drawn as strokes."""
    _new_file()
    scene = bpy.context.scene
    for _ in range(rng.integers(1, 4)):
        _add_object(rng)
    for _ in range(rng.choice([0, 1, 1, 1, 1, 1, 1, 2, 3])):
        _add_camera(rng)
    render = scene.render
    render.resolution_x, render.resolution_y = (int(size) for size in rng.integers(4, 100, 2))
    render.resolution_percentage = int(rng.choice([100, 100, 1, 150]))
    render.pixel_aspect_x = float(rng.choice([1, 1, 2]))
    render.use_border = bool(rng.random() < 0.1)
    if rng.random() < 0.3:
        bpy.ops.object.light_add(type=str(rng.choice(["POINT", "SUN", "SPOT", "AREA"])))
    _set_settings(rng, scene.rosy.look, settings_of(Look), 0.15)
    _set_settings(rng, scene.rosy.strokes, settings_of(StrokeStyle), 0.1)
    scene.rosy.relight = bool(rng.random() < 0.2)
    scene.rosy.placement = str(rng.choice(_enum_items(scene.rosy, "placement")))
    scene.rosy.image_format = str(rng.choice(_enum_items(scene.rosy, "image_format")))
    _save(folder / "scene.blend")
    if rng.random() < 0.1:
        _link_library(folder, missing=rng.random() < 0.7)
    if rng.random() < 0.05:
        (folder / "scene.blend").write_bytes(damaged(rng, b"no Blender file\n" * 20))
    return _scene_command(rng)


def _scene_command(rng: Generator) -> Case:
    """Return a random command for the file scene.blend."""
    command = "bake" if rng.random() < 0.7 else "strokes"
    leave_out = {
        *("degree", "generate", "axis", "reach", "sharp_angle"),
        "up",
        "view",
        "orthographic",
    }
    leave_out = leave_out if rng.random() < 0.95 else set()
    words = random_options(rng, command, rate=0.06, leave_out=leave_out)
    case = Case([command, "scene.blend", *words], outputs={"out/"})
    # Blender's threads that write .exr files do not exist in forks.
    case.own_process = command == "bake" and bpy.context.scene.rosy.image_format == "FLOAT"
    if rng.random() < 0.15:
        name = _NAMES[rng.integers(len(_NAMES))]
        case.arguments += [f"--camera={name}"] if rng.random() < 0.5 else ["--object", name]
    elif command == "bake" and rng.random() < 0.4:
        case.arguments += ["--all-cameras"]
    if rng.random() < 0.2:
        case.arguments += ["--frames", str(rng.choice(["1-2", "3", "1-5:3", "2-1", "-1", "x"]))]
    if command == "strokes":
        case.arguments += ["-o", "out-##.svg"]
        case.outputs = {"out-##.svg", *(f"out-{frame:02}.svg" for frame in range(-1, 6))}
        return case
    if rng.random() < 0.9:
        case.arguments += ["--out", "out"]
    if rng.random() < 0.2:
        case.arguments += ["--save"]
        case.outputs |= {"scene.blend", "scene.blend1"}
    return case


def scene_kill_case(rng: Generator, folder: Path) -> Case:
    """A bake, a saved file or an animation that is killed; the animation is then resumed."""
    case = animation_case(rng, folder, damage=False)
    case.own_process = True
    if rng.random() < 0.3:
        case.kill_when_writing = True
    else:
        case.kill_after = float(rng.uniform(0.3, 1.6))
    if rng.random() < 0.5 and case.expected:
        shutil.rmtree(folder / "out")
    else:  # new pictures for old ones
        case.arguments = ["bake", "scene.blend", "--out", "out", "--set", "seed=5", "--save"]
        case.outputs |= {"scene.blend", "scene.blend1"}
        case.expected = {}
    return case


def animation_case(rng: Generator, folder: Path, *, damage: bool = True) -> Case:
    """A finished animation, some of whose files are damaged, lost or exchanged; then a new run."""
    _new_file()
    scene = bpy.context.scene
    points, faces = random_mesh(rng, faults=0)
    obj = _add_mesh("Body", _centered(points), faces)
    _write_field(obj.data, np.random.default_rng(0), plain=True)
    for frame, angle in ((1, 0.0), (4, 1.0)):
        obj.rotation_euler.z = angle
        obj.keyframe_insert("rotation_euler", frame=frame)
    _add_camera(np.random.default_rng(1), plain=True).location.z = 2
    scene.render.resolution_x = scene.render.resolution_y = 40
    _save(folder / "scene.blend")
    case = Case(["bake", "scene.blend", "--frames", "1-4", "--out", "out"], outputs={"out/"})
    words = [*case.arguments[:-1], str(folder / "out")]
    words[1] = str(folder / "scene.blend")
    if main(words) != 0:
        return case  # nothing in view: the run says so
    files = sorted(path for path in (folder / "out").rglob("*") if path.is_file())
    case.expected = {str(path.relative_to(folder)): hash_file(path) for path in files}
    if not damage:
        return case
    for _ in range(rng.integers(1, 4)):
        path, other = (files[i] for i in rng.integers(len(files), size=2))
        if not (path.exists() and other.exists()):
            continue
        match rng.integers(4):
            case 0:
                path.unlink()
            case 1:
                path.write_bytes(damaged(rng, path.read_bytes()))
            case 2:
                path.write_bytes(other.read_bytes())
            case 3:
                path.write_bytes(b"")
    return case


def _new_file() -> None:
    ensure_registered()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ensure_registered()


def _save(path: Path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)


def _add_mesh(name: str, points: np.ndarray, faces: list) -> bpy.types.Object:
    faces = [face for face in faces if len(set(face)) == len(face)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces)
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    return obj


def _centered(points: np.ndarray) -> np.ndarray:
    """Return the points moved to the origin, and scaled to a size of 3."""
    size = np.ptp(points, axis=0).max()
    return 3 * (points - points.mean(axis=0)) / size if size > 0 else points


def _add_object(rng: Generator) -> None:
    """Add a mesh with a field, mostly; in odd places and states."""
    points, faces = random_mesh(rng, faults=int(rng.random() < 0.25))
    points = np.clip(points, -1e30, 1e30)
    if rng.random() < 0.9:
        points = _centered(points)
    obj = _add_mesh(_NAMES[rng.integers(len(_NAMES))], points, faces)
    if rng.random() < 0.9:
        _write_field(obj.data, rng)
    if rng.random() < 0.3:
        obj.data.polygons.foreach_set("use_smooth", np.ones(len(obj.data.polygons), bool))
    for kind in rng.choice(_MODIFIERS, rng.choice([0, 0, 0, 1, 2])):
        obj.modifiers.new(str(kind), str(kind))
    if rng.random() < 0.15:
        obj.scale = rng.choice([0.0, -1.0, 1.0, 2.0, 1e-6, 1e6], 3)
    if rng.random() < 0.15:
        obj.location = rng.normal(size=3) * 10.0 ** rng.uniform(-1, 7)
    obj.rotation_euler = rng.normal(size=3)
    if rng.random() < 0.1:
        obj.shape_key_add(name="Basis")
        obj.shape_key_add(name="Key").value = 1.0
    obj.hide_viewport, obj.hide_render = (bool(hidden) for hidden in rng.random(2) < 0.03)
    if rng.random() < 0.07:
        bpy.ops.mesh.primitive_plane_add()
        bpy.ops.object.convert(target="CURVE")


def _write_field(mesh: bpy.types.Mesh, rng: Generator, *, plain: bool = False) -> None:
    """Write an attribute: mostly tangent vectors on faces, otherwise anything unless `plain`."""
    if not mesh.polygons:
        return
    mesh.rosy.degree = int(rng.choice([1, 2, 3, 4, 4, 6, 7, 12]))
    kind, domain = "FLOAT_VECTOR", "FACE"
    if not plain and rng.random() < 0.1:
        kind = str(rng.choice(["FLOAT_VECTOR", "FLOAT", "INT", "FLOAT_COLOR", "FLOAT2", "BOOLEAN"]))
        domain = str(rng.choice(["FACE", "POINT", "CORNER", "EDGE"]))
    name = "rosy"
    if not plain and rng.random() < 0.03:
        name = mesh.rosy.attribute = ("", "position", "missing", "\x1b[31m")[rng.integers(4)]
    if name in ("", "position", "missing"):
        return
    attribute = mesh.attributes.new(name, kind, domain)
    if kind != "FLOAT_VECTOR":
        return
    if domain == "FACE":
        try:
            normal = mesh_surface(mesh).face_normal
        except ValueError:
            normal = np.tile([0.0, 0.0, 1.0], (len(attribute.data), 1))
        vectors = np.cross(normal, rng.normal(size=3))
    else:
        vectors = rng.normal(size=(len(attribute.data), 3))
    vectors[np.abs(vectors).max(axis=1) < 1e-6] = 0
    picked = rng.random(len(vectors)) < 0.2
    with np.errstate(all="ignore"):
        match 9 if plain else rng.integers(25):
            case 0:
                vectors[picked] = rng.choice([np.nan, np.inf])
            case 1:
                vectors *= 10.0 ** rng.uniform(-44, 38)
            case 2:
                vectors[picked] = 0
            case 3:
                vectors += rng.normal(size=vectors.shape)
        attribute.data.foreach_set("vector", vectors.astype(np.float32).ravel())


def _add_camera(rng: Generator, *, plain: bool = False) -> bpy.types.Object:
    """Add a camera that looks along y; mostly ordinary."""
    name = _NAMES[rng.integers(len(_NAMES))]
    data = bpy.data.cameras.new(name)
    camera = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(camera)
    camera.location = (0.0, -6.0, 0.0) if plain else rng.normal(size=3) * (1, 1, 1) + (0, -6, 0)
    camera.rotation_euler = (np.pi / 2, 0.0, 0.0)
    if plain or rng.random() < 0.9:
        bpy.context.scene.camera = camera
    if not plain and rng.random() < 0.25:
        data.type = str(rng.choice(["PERSP", "ORTHO", "PANO"], p=[0.5, 0.4, 0.1]))
        data.lens = float(rng.choice([1.0, 50.0, 5000.0]))
        data.ortho_scale = float(rng.choice([1e-6, 4.0, 1e6]))
        data.clip_start, data.clip_end = sorted(10.0 ** rng.uniform(-6, 5, 2))
        data.shift_x = float(rng.choice([0.0, 0.5, 10.0]))
        camera.scale = rng.choice([1.0, -1.0, 0.0], 3, p=[0.9, 0.05, 0.05])
    return camera


def _set_settings(rng: Generator, group: bpy.types.PropertyGroup, settings: dict, rate: float):
    """Set properties that belong to settings; Blender limits them to their ranges."""
    for setting in settings.values():
        if rng.random() < rate and hasattr(group, setting.name):
            value = setting_value(rng, setting)
            if isinstance(value, str) and value.startswith("#"):
                value = rng.random(len(getattr(group, setting.name))).tolist()
            setattr(group, setting.name, value)


def _enum_items(group: bpy.types.PropertyGroup, name: str) -> list[str]:
    return group.bl_rna.properties[name].enum_items.keys()


def _link_library(folder: Path, *, missing: bool) -> None:
    """Replace the scene by one that links its objects from a library."""
    library = folder / "library.blend"
    shutil.copy2(folder / "scene.blend", library)
    _new_file()
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 64
    with bpy.data.libraries.load(str(library), link=True) as (source, target):
        target.objects = source.objects
    for obj in target.objects:
        if obj is not None:
            bpy.context.scene.collection.objects.link(obj)
            if obj.type == "CAMERA":
                bpy.context.scene.camera = obj
    _save(folder / "scene.blend")
    if missing:
        library.unlink()
