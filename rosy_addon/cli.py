"""The command line, the same in Blender and in plain Python.

``render``, ``strokes`` of mesh files, ``field``, ``info`` and ``presets`` need numpy alone; ``bake``, and
``strokes`` of .blend files, need a Blender, or its Python module.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .compositor.colour import LUMINANCE, luminance, to_linear
from .compositor.compose import compose
from .compositor.look import Look
from .compositor.png import read_png, write_png
from .compositor.presets import (
    FOLDER,
    find_preset,
    load_preset,
    own_folder,
    preset_files,
    preset_names,
    read_preset,
)
from .compositor.shading import lights_of
from .compositor.tone import Rendered
from .errors import RosyError
from .field.analysis import angle_errors, error_facts, field_energy
from .field.convert import Conversion, convert
from .field.fieldfile import READ, WRITTEN, load_field, write_field
from .field.formats.obj import read_uv
from .field.formats.ply import read_vertex_values
from .field.formats.sings import SINGULARITIES, read_sings
from .field.formats.strokes import read_strokes
from .field.generate import KINDS, MAGNITUDES, Recipe, generate
from .field.meshfile import read_mesh
from .field.rosy_field import RosyField, check_degree
from .field.singularities import euler_characteristic, singularities
from .field.surface import Surface, cut_note
from .files import check_writable
from .gpu.painter import DEVICES
from .jobs import frame_range, own_command, run_here, run_on_cluster
from .progress import Work
from .projection.camera import Camera, check_size, orbit_camera
from .projection.gbuffer import Body
from .projection.project import project
from .projection.tone import SurfaceTone
from .strokes.draw import Manner, draw
from .strokes.svg import Pen, write_svg
from .turntable import Encoder, check_film, has_ffmpeg, pictures, write_film

#: Exit statuses: done, something the user can put right, stopped by Ctrl-C.
DONE, WRONG, STOPPED = 0, 2, 130

#: Looking down a little from the front left, as portraits are taken.
DEFAULT_VIEW = (-25.0, 20.0)
DEFAULT_SIZE, DEFAULT_FILM_SIZE = (1024, 1024), (512, 512)

#: Options of `strokes` that are for mesh files, and for Blender files, alone, and what they are if
#: they are not given.
OF_MESHES = {
    **dict.fromkeys(("field", "degree", "generate", "strokes", "guides", "field_mesh", "up")),
    **dict.fromkeys(("uv", "undefined", "ortho"), False),
    "view": DEFAULT_VIEW,
}
OF_SCENES = dict.fromkeys(("object", "camera", "frames"))

#: What colours of vertices are called, as in Blender.
COLOUR = "Color"

#: What points up in files of each kind, as Blender's importers take it.
UP = {".obj": "y", ".off": "y", ".ply": "z", ".stl": "z"}

#: File to world space for each: a quarter turn about x stands what points along y upright.
UPRIGHT = {
    "y": np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]),
    "z": np.eye(4),
}


def main(argv: Sequence[str] | None = None, prog: str = "blender -b --command rosy") -> int:
    """Run a command.

    Parameters
    ----------
    argv : sequence of str, optional
        Without the name of the program; the process's own if not given.
    prog : str
        How the user started it, for the help.

    Returns
    -------
    int
        Exit status: 0 only when what was asked for was written.
    """
    arguments = sys.argv[1:] if argv is None else argv
    try:
        options = _parser(prog).parse_args(_with_signed_values(arguments))
        options.verb(options)
    except RosyError as error:
        print(f"rosy: {error}", file=sys.stderr)
        return WRONG
    except KeyboardInterrupt:
        print("rosy: stopped", file=sys.stderr)
        return STOPPED
    except SystemExit as end:  # argparse: 0 after its help, 2 for a wrong command line
        return DONE if end.code is None else int(end.code)
    return DONE


def render(options: argparse.Namespace) -> None:
    """Draw the field of a mesh file."""
    check_writable(options.output)
    look = _toned(
        options, _look(options, Look(supersampling=2))
    )  # for smooth edges: nothing draws over them later
    surface, field = _mesh_and_field(options)
    matrix = UPRIGHT[options.up or UP[options.mesh.suffix.lower()]]
    camera = _camera(options, surface.vertices @ matrix[:3, :3].T, look.supersampling)
    body = Body(surface, matrix, field, _surface_tone(options, surface))
    rendered = None
    if options.tone_picture is not None:
        shown = luminance(read_png(options.tone_picture))
        rendered = Rendered(shown, camera, str(options.tone_picture))
    picture = compose(project([body], camera, look.display), look, rendered=rendered)
    write_png(options.output, picture.rgba)


def turntable(options: argparse.Namespace) -> None:
    """Draw the field of a mesh file from all around, as a film."""
    check_writable(options.output)
    check_film(options.output)
    if options.pictures < 2 or not options.rate > 0:
        raise RosyError("a film has 2 pictures or more, and a rate above 0")
    encode = _encoder(options.output)
    look = _toned(options, _look(options, Look(supersampling=2)))
    surface, field = _mesh_and_field(options)
    matrix = UPRIGHT[options.up or UP[options.mesh.suffix.lower()]]
    body = Body(surface, matrix, field, _surface_tone(options, surface))
    size = check_size(*options.size)
    frames = pictures(body, look, options.pictures, size, options.view, not options.ortho)
    write_film(options.output, _counted(frames, options.pictures), options.rate, encode)


def strokes(options: argparse.Namespace) -> None:
    """Cover meshes with evenly spaced strokes along their fields, as lines in an .svg file."""
    if options.output.suffix.lower() != ".svg":
        raise RosyError(f"{options.output}: strokes are written to .svg files")
    check_writable(options.output)
    if options.mesh is None and "bpy" not in sys.modules:
        raise RosyError("there is nothing to draw: give a mesh file, or SCENE.blend")
    if options.mesh is None or options.mesh.suffix.lower() == ".blend":
        _check_not_given(options, OF_MESHES, "mesh files")
        _strokes_of_scene(options)
        return
    _check_not_given(options, OF_SCENES, ".blend files")
    manner, pen = _manner(options, Manner()), _pen(options, Pen())
    if manner.light == "scene":
        raise RosyError(f"{options.mesh}: has no lights: --light headlight or lamp")
    surface, field = _mesh_and_field(options)
    matrix = UPRIGHT[options.up or UP[options.mesh.suffix.lower()]]
    camera = _camera(options, surface.vertices @ matrix[:3, :3].T, 1)
    drawn = draw([Body(surface, matrix, field)], camera, manner, lights=lights_of(manner, ()))
    write_svg(options.output, drawn.strokes, camera, pen)


def _strokes_of_scene(options: argparse.Namespace) -> None:
    """Of a Blender file, by its own settings unless options say otherwise; at one frame or many."""
    frames = [None] if options.frames is None else list(frame_range(options.frames))
    if len(frames) > 1 and "#" not in options.output.name:
        raise RosyError(
            f"{options.output}: of several frames, # in the name are to stand for the number"
        )
    scene = _opened_scene("strokes", options.mesh)
    for frame in frames:
        if frame is None:
            _sketch(options, scene, options.output)
            continue
        scene.frame_set(frame)
        try:
            _sketch(options, scene, _numbered(options.output, frame))
        except RosyError as error:
            raise RosyError(f"frame {frame}: {error}") from None


def _numbered(path: Path, frame: int) -> Path:
    """With the number of a frame for rows of # in the name."""
    return path.with_name(re.sub("#+", lambda row: f"{frame:0{len(row[0])}d}", path.name))


def _sketch(options: argparse.Namespace, scene: Any, path: Path) -> None:
    """What the button does, with other settings where options are given."""
    import bpy

    from .scene.bodies import rosy_objects
    from .scene.cameras import frame_camera
    from .scene.strokes import manner_of, pen_of, wanted_objects
    from .sketch import sketch

    if options.camera is not None:
        camera = _camera_object(scene, options.camera)
    else:
        camera = None if options.frames is None else frame_camera(scene, scene.frame_current)
    settings, layer = scene.rosy.strokes, bpy.context.view_layer
    named = options.object is not None
    made = sketch(
        scene,
        kind="SVG",
        path=path.resolve(),
        objects=rosy_objects(layer, options.object) if named else wanted_objects(scene, layer),
        camera=camera,
        manner=_manner(options, manner_of(settings)),
        pen=_pen(options, pen_of(settings)),
        size=options.size,
    )
    print(f"{made.camera}: {made.path}", flush=True)


def _check_not_given(options: argparse.Namespace, defaults: dict[str, Any], others: str) -> None:
    """Refuse what is not for the kind of file that is drawn."""
    for name, default in defaults.items():
        if getattr(options, name) != default:
            option = "FIELD" if name == "field" else "--" + name.replace("_", "-")
            raise RosyError(f"{options.mesh or 'what is open'}: {option} is for {others}")


def _manner(options: argparse.Namespace, base: Manner) -> Manner:
    """How strokes are laid, by the options that are named as its fields."""
    given = vars(options)
    wished = {entry.name: given[entry.name] for entry in fields(Manner) if entry.name in given}
    if "spacing" in given or "distance" in given:
        wished["unit"] = "world" if "distance" in given else "pixels"
    return replace(base, **wished)


def _pen(options: argparse.Namespace, base: Pen) -> Pen:
    """How strokes are drawn."""
    given = vars(options)
    wished = {name: given[name] for name in ("width", "millimetres", "plotter") if name in given}
    if "colours" in given:
        wished |= {"colours": given["colours"].split(","), "outline": None}
    if given.get("plotter"):
        wished["paper"] = None
    elif "paper" in given:
        wished["paper"] = Pen.paper if given["paper"] else None
    return replace(base, **wished)


def _encoder(path: Path) -> Encoder | None:
    """Blender's, if a film needs one and there is no ffmpeg."""
    if path.suffix.lower() != ".mp4" or has_ffmpeg():
        return None
    try:
        from .scene.movie import encode
    except ImportError:
        raise RosyError(
            f"{path}: an .mp4 needs the program ffmpeg, or Blender; a .gif needs neither"
        ) from None
    return encode


def _counted(frames: Iterator[np.ndarray], count: int) -> Iterator[np.ndarray]:
    """The same, with a line said for each."""
    for number, frame in enumerate(frames, 1):
        print(f"picture {number} of {count}", flush=True)
        yield frame


def field(options: argparse.Namespace) -> None:
    """Make a field file, or convert one: its format, its degree, its directions, its lengths."""
    check_writable(options.output)
    surface, made = _mesh_and_field(options)
    turn = np.radians(options.turn)
    wished = Conversion(options.to_degree, turn, options.smooth, options.magnitude)
    made = convert(surface, made, wished)
    write_field(options.output, made, surface)


def info(options: argparse.Namespace) -> None:
    """Say what a mesh and its field are, and how far the field is from another."""
    surface, found = _mesh_and_field(options)
    vertex, index = singularities(surface, found)
    magnitude = found.magnitude
    facts = {
        "degree": found.degree,
        "vertices": len(surface.vertices),
        "faces": surface.face_count,
        "euler_characteristic": euler_characteristic(surface),
        "magnitude": [float(magnitude.min()), float(magnitude.max())],
        "undefined_faces": int(np.count_nonzero(magnitude == 0)),
        "is_rosy": found.deviations is None,
        "energy": field_energy(surface, found),
        "singularities": np.stack([vertex, index], axis=1).tolist(),
    }
    if options.against is not None:
        facts["against"] = _compared(options, surface, found, vertex, index)
    print(json.dumps(facts) if options.json else _in_words(facts))


def presets(options: argparse.Namespace) -> None:
    """Say which presets there are and what they are like, RoSy's and the user's own."""
    own, listed = _own_presets(), []
    for key, path in preset_files(own).items():
        try:
            found = read_preset(path)
        except RosyError as fault:
            _note(str(fault))
            continue
        words = {"preset": key, "name": found.name, "description": found.description}
        listed.append(words | {"own": path.parent == own})
    if options.json:
        print(json.dumps(listed))
        return
    width = max(len(each["preset"]) for each in listed)
    for each in listed:
        print(f"{each['preset']:{width}}  {each['description']}{'  (own)' * each['own']}")
    print(f"your own are in {own}")


def _own_presets() -> Path:
    """The folder of the user's own presets: Blender's, if this runs in one."""
    if "bpy" not in sys.modules:
        return own_folder()
    from .scene.folders import presets_folder

    return presets_folder()


def _compared(
    options: argparse.Namespace,
    surface: Surface,
    found: RosyField,
    vertex: np.ndarray,
    index: np.ndarray,
) -> dict[str, Any]:
    """How far a field is from one in a file; of a file of singularities, which of them differ."""
    if options.against.suffix.lower() not in SINGULARITIES:
        other = load_field(options.against, surface, found.degree).field
        return error_facts(surface, angle_errors(surface, found, other))
    degree, element, stored = read_sings(options.against)
    if degree != found.degree:
        raise RosyError(f"{options.against}: is of a field of degree {degree}, not {found.degree}")
    ours = set(zip(vertex.tolist(), index.tolist(), strict=True))
    theirs = set(zip(element.tolist(), stored.tolist(), strict=True))
    return {
        "same": len(ours & theirs),
        "only_here": sorted(map(list, ours - theirs)),
        "only_there": sorted(map(list, theirs - ours)),
    }


def bake(options: argparse.Namespace) -> None:
    """Draw the fields of a Blender file as its cameras see them, at one frame or at many."""
    _check_frames(options)
    if options.out is None and not options.save:
        raise RosyError("bake would keep nothing: give --out DIR for the pictures, --save, or both")
    if _is_spread(options):
        _spread(options)
        if not options.save:
            return
    scene = _opened_scene("bake", options.scene)
    import bpy

    from .bake import bake as bake_scene
    from .scene.apply import settings_of
    from .scene.bodies import rosy_objects
    from .scene.files import save_file
    from .scene.looks import look_of

    settings = settings_of(scene)
    if options.device is not None:
        settings = replace(settings, device=options.device)
    if options.out is not None:
        settings = replace(settings, folder=options.out.resolve())
    if options.frames is not None:
        _bake_frames(options, scene, settings)
        return
    baked = bake_scene(
        scene,
        objects=rosy_objects(bpy.context.view_layer, options.object),
        cameras=_cameras(scene, options),
        look=_look(options, look_of(scene.rosy)),
        size=options.size,
        settings=settings,
    )
    for note in dict.fromkeys(note for picture in baked for note in picture.notes):
        print(f"rosy: {note}", file=sys.stderr)
    for picture in baked:
        place = bpy.path.abspath(picture.image.filepath) if options.out else picture.image.name
        print(f"{picture.camera}: {place}")
    if options.save:
        print(save_file())


def _opened_scene(verb: str, path: Path | None) -> Any:
    """The scene of a Blender file, or of what is open."""
    try:
        import bpy
    except ImportError:
        raise RosyError(
            f"{verb} needs Blender: start it as `blender -b SCENE.blend --command rosy {verb}`, "
            "or install its Python module, bpy"
        ) from None
    from .scene.files import open_file
    from .ui.properties import ensure_registered

    ensure_registered()
    if path is not None:
        open_file(path)
    return bpy.context.scene


def _check_frames(options: argparse.Namespace) -> None:
    """Refuse what makes no sense together, before anything is opened."""
    if options.frames is None and _is_spread(options):
        raise RosyError("--jobs and --scheduler spread frames: give --frames A-B")
    if options.frames is not None and options.out is None:
        raise RosyError("--frames writes files: give --out DIR")
    if options.jobs < 1:
        raise RosyError(f"--jobs {options.jobs}: 1 or more is wanted")


def _is_spread(options: argparse.Namespace) -> bool:
    return options.jobs > 1 or options.scheduler is not None


def _spread(options: argparse.Namespace) -> None:
    """Have other processes, here or on a cluster, do the frames."""
    blender = sys.modules["bpy"].app.binary_path if "bpy" in sys.modules else ""
    scene = options.scene
    if scene is None:
        data = sys.modules["bpy"].data if "bpy" in sys.modules else None
        if data is None or not data.filepath or data.is_dirty:
            raise RosyError("--jobs and --scheduler work on a file: save it, or give SCENE.blend")
        scene = Path(data.filepath)
    if not scene.is_file():
        raise RosyError(f"{scene}: cannot be read: no such file")
    command = own_command(blender, scene.resolve()) + _same_for_others(options)
    frames = frame_range(options.frames)
    if options.scheduler is not None:
        said = run_on_cluster(command, frames, options.scheduler)
    else:
        said = run_here(command, frames, options.jobs)
    for line in said:
        if line.startswith("frame "):
            print(line, flush=True)


def _bake_frames(options: argparse.Namespace, scene: Any, settings: Any) -> None:
    """`bake --frames`, in this process."""
    import bpy

    from .animation import baking_animation
    from .scene.bodies import rosy_objects
    from .scene.files import save_file
    from .scene.looks import look_of

    frames = frame_range(options.frames)
    if _is_spread(options):
        # All are there: what is left is to have the materials play them.
        frames = sorted({frames[0], frames[-1]})
    changed = bool(options.preset or options.set)
    work = baking_animation(
        scene,
        frames,
        objects=rosy_objects(bpy.context.view_layer, options.object),
        cameras=_cameras(scene, options),
        look=_look(options, look_of(scene.rosy)) if changed else None,
        size=options.size,
        settings=settings,
        show=options.save,
    )
    made = _shown(work)
    for each in made:
        if each.kept:
            print(f"{len(each.kept)} frames of {each.camera} were there")
        print(f"{each.camera}: {each.strip.path}")
    if options.save:
        print(save_file())


def _shown(work: Work[Any]) -> Any:
    """Run work to its end, and say what it is at, a line for each frame."""
    last = ""
    while True:
        try:
            step = next(work)
        except StopIteration as done:
            return done.value
        if step.label != last and step.label.startswith("frame "):
            last = step.label
            print(f"{step.label} ({100 * step.fraction:.0f} %)", flush=True)


def _same_for_others(options: argparse.Namespace) -> list[str]:
    """The options of this command that other processes get as well."""
    words = ["--out", str(options.out.resolve())]
    if options.object:
        words += ["--object", *options.object]
    if options.camera is not None:
        words += ["--camera", options.camera]
    if options.all_cameras:
        words += ["--all-cameras"]
    if options.size is not None:
        words += ["--size", f"{options.size[0]}x{options.size[1]}"]
    if options.preset is not None:
        words += ["--preset", _preset_for_others(options.preset)]
    if options.device is not None:
        words += ["--device", options.device]
    for text in options.set:
        words += ["--set", text]
    return words


def _preset_for_others(preset: str) -> str:
    """RoSy's own by its name, for it may lie elsewhere there; another's by its path."""
    path = find_preset(preset, _own_presets())
    return path.stem if path.parent == FOLDER else str(path.resolve())


def _cameras(scene: Any, options: argparse.Namespace) -> list[Any] | None:
    """The chosen camera objects of a Blender scene; None for its own."""
    from .scene.cameras import scene_cameras

    if options.all_cameras:
        return scene_cameras(scene)
    return None if options.camera is None else [_camera_object(scene, options.camera)]


def _camera_object(scene: Any, name: str) -> Any:
    if name not in scene.objects:
        names = ", ".join(f"'{thing.name}'" for thing in scene.objects if thing.type == "CAMERA")
        raise RosyError(
            f"there is no camera '{name}' in scene '{scene.name}', only {names or 'none'}"
        )
    return scene.objects[name]


def _mesh_and_field(options: argparse.Namespace) -> tuple[Surface, RosyField]:
    if options.degree is not None:
        check_degree(options.degree)
    if options.field is not None and options.generate is not None:
        raise RosyError(f"give a field file, {options.field}, or --generate, not both")
    surface = read_mesh(options.mesh)
    if options.field is not None:
        undefined = "zero" if options.undefined else "error"
        loaded = load_field(
            options.field, surface, options.degree, undefined, mesh=options.field_mesh
        )
        _note(loaded.note)
        return surface, loaded.field
    _note(cut_note(surface))
    degree = 4 if options.degree is None else options.degree
    guided = options.strokes is not None or options.guides is not None
    usual = "guided" if guided else "curvature" if degree in (2, 4) else "axis"
    recipe = _recipe(options, surface, options.generate or usual, degree)
    return surface, generate(surface, recipe, degree)


def _recipe(options: argparse.Namespace, surface: Surface, kind: str, degree: int) -> Recipe:
    """What to generate, with all that the kind can use."""
    recipe = Recipe(kind, options.axis, options.reach, np.radians(options.sharp_angle))
    if options.strokes is not None:
        recipe = replace(recipe, strokes=read_strokes(options.strokes))
    if options.guides is not None:
        guides = load_field(options.guides, surface, degree).field
        recipe = replace(recipe, vectors=guides.vectors)
    if options.uv or kind == "uv":
        uv = read_uv(options.mesh) if options.mesh.suffix.lower() == ".obj" else None
        if uv is None:
            raise RosyError(f"{options.mesh}: has no UV map; those of .obj files are read")
        recipe = replace(recipe, uv=uv)
    return recipe


def _note(text: str) -> None:
    """Something that a user should know, if there is anything."""
    if text:
        print(f"rosy: {text}", file=sys.stderr)


def _look(options: argparse.Namespace, default: Look) -> Look:
    look = load_preset(options.preset, _own_presets()).look if options.preset else default
    return look.with_settings(dict(_setting(text) for text in options.set))


def _toned(options: argparse.Namespace, look: Look) -> Look:
    """The look with its tone from where the command line says."""
    given = [
        kind
        for kind in ("attribute", "image", "picture")
        if getattr(options, f"tone_{kind}", None) is not None
    ]
    if len(given) > 1:
        raise RosyError(f"give --tone-{given[0]} or --tone-{given[1]}, not both")
    return replace(look, tone=given[0]) if given else look


def _surface_tone(options: argparse.Namespace, surface: Surface) -> SurfaceTone | None:
    """The tone that the mesh is to have of its own, if it is to have any."""
    if options.tone_attribute is not None:
        values = _vertex_tone(options.mesh, options.tone_attribute)
        return SurfaceTone(values[surface.corner_vertex, None].astype(np.float32))
    if options.tone_image is not None:
        uv = read_uv(options.mesh) if options.mesh.suffix.lower() == ".obj" else None
        if uv is None:
            raise RosyError(f"{options.mesh}: has no UV map; those of .obj files are read")
        return SurfaceTone(uv.astype(np.float32), luminance(read_png(options.tone_image)))
    return None


def _vertex_tone(mesh: Path, name: str) -> np.ndarray:
    """(V,) a number for each vertex of a .ply file: a property, or the luminance of the colour."""
    if mesh.suffix.lower() != ".ply":
        raise RosyError(f"{mesh}: has no attributes; those of vertices of .ply files are read")
    values = read_vertex_values(mesh)
    rgb = [values.get(channel) for channel in ("red", "green", "blue")]
    if name == COLOUR and all(channel is not None for channel in rgb):
        return to_linear(np.stack(rgb, axis=1)) @ LUMINANCE
    if name not in values:
        there = ", ".join(f"'{key}'" for key in values) or "nothing but places"
        raise RosyError(f"{mesh}: vertices have no '{name}', only {there}")
    if not np.isfinite(values[name]).all():
        raise RosyError(f"{mesh}: vertices have values of '{name}' that are not finite")
    return values[name]


def _setting(text: str) -> tuple[str, Any]:
    """A name and a value of NAME=VALUE, the value of the kind that the setting has."""
    name, equals, value = text.partition("=")
    defaults = {entry.name: entry.default for entry in fields(Look)}
    if not equals:
        raise RosyError(f"--set {text}: NAME=VALUE is wanted")
    if name not in defaults:
        raise RosyError(f"--set {text}: a look has no setting '{name}', only {', '.join(defaults)}")
    default = defaults[name]
    if isinstance(default, str):
        return name, value
    if isinstance(default, bool):
        switch = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}
        return name, switch.get(value.lower(), value)
    try:
        return name, type(default)(value)
    except ValueError:
        wanted = "a whole number" if isinstance(default, int) else "a number"
        raise RosyError(f"--set {text}: {wanted} is wanted") from None


def _camera(options: argparse.Namespace, points: np.ndarray, supersampling: int) -> Camera:
    width, height = check_size(*(options.size or DEFAULT_SIZE))
    return orbit_camera(
        points,
        *options.view,
        width * supersampling,
        height * supersampling,
        perspective=not options.ortho,
    )


def _in_words(facts: dict[str, Any]) -> str:
    places = [
        f"  vertex {vertex}: {index:+d}/{facts['degree']}"
        for vertex, index in facts["singularities"]
    ]
    low, high = facts["magnitude"]
    return "\n".join(
        [
            f"degree {facts['degree']}",
            f"{facts['faces']} faces, {facts['vertices']} vertices, "
            f"Euler characteristic {facts['euler_characteristic']}",
            f"magnitude {low:.4g} to {high:.4g}, undefined on {facts['undefined_faces']} faces",
            f"energy {facts['energy']:.6g}",
            *([] if facts["is_rosy"] else ["directions at free angles, no RoSy"]),
            *_comparison_in_words(facts.get("against")),
            f"{len(places)} singularities",
            *places,
        ]
    )


def _comparison_in_words(against: dict[str, Any] | None) -> list[str]:
    if against is None:
        return []
    if "same" in against:
        differing = len(against["only_here"]), len(against["only_there"])
        return [
            f"singularities: {against['same']} are the same, {differing[0]} only here, "
            f"{differing[1]} only there"
        ]
    return [
        f"off by {against['mean']:.4g} degrees on average, rms {against['rms']:.4g}, at most "
        f"{against['max']:.4g}, on {100 * against['compared']:.4g} % of the faces"
    ]


def _parser(prog: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=prog, description="Draw N-way rotational symmetry fields on meshes."
    )
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    for add in (
        _add_bake,
        _add_render,
        _add_strokes,
        _add_turntable,
        _add_field,
        _add_info,
        _add_presets,
    ):
        add(verbs)
    return parser


def _add_bake(verbs: Any) -> None:
    verb = _verb(verbs, "bake", bake)
    verb.add_argument(
        "scene", nargs="?", type=Path, metavar="SCENE.blend", help="the open file if not given"
    )
    verb.add_argument(
        "--object", nargs="+", metavar="NAME", help="all that have a field if not given"
    )
    cameras = verb.add_mutually_exclusive_group()
    cameras.add_argument("--camera", metavar="NAME", help="the scene's own if not given")
    cameras.add_argument("--all-cameras", action="store_true")
    _add_look(verb)
    verb.add_argument("--size", type=_size, metavar="WxH", help="the scene's own if not given")
    verb.add_argument(
        "--out", type=Path, metavar="DIR", help="write the pictures there as .png files"
    )
    verb.add_argument(
        "--device",
        choices=list(DEVICES),
        help="what draws the pictures: the processor, the graphics card, or that if there is one; "
        "as the scene says if not given",
    )
    verb.add_argument("--save", action="store_true", help="save the Blender file")
    verb.add_argument(
        "--frames",
        metavar="A-B[:STEP]",
        help="a picture of each frame, as the camera that renders it sees it; those that are there "
        "and up to date stay",
    )
    spread = verb.add_mutually_exclusive_group()
    spread.add_argument(
        "--jobs", type=int, default=1, metavar="J", help="so many processes for the frames"
    )
    spread.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster whose workers do the frames"
    )


def _add_render(verbs: Any) -> None:
    verb = _verb(verbs, "render", render)
    _add_mesh(verb)
    verb.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.png")
    _add_view(verb, DEFAULT_SIZE)
    _add_look(verb)
    _add_tone(verb)
    verb.add_argument(
        "--tone-picture",
        type=Path,
        metavar="PICTURE.png",
        help="tone from a picture of the same mesh from the same view",
    )


def _add_tone(verb: argparse.ArgumentParser) -> None:
    verb.add_argument(
        "--tone-attribute",
        metavar="NAME",
        help=f"tone from a property of the vertices of a .ply file, or from their colour, '{COLOUR}'",
    )
    verb.add_argument(
        "--tone-image",
        type=Path,
        metavar="IMAGE.png",
        help="tone from an image on the UV map of an .obj file",
    )


def _add_strokes(verbs: Any) -> None:
    verb = _verb(verbs, "strokes", strokes)
    verb.description += " What is not said of a .blend file is as its scene says."
    _add_mesh(verb, or_scene=True)
    verb.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.svg")
    _add_view(verb, None)
    verb.add_argument("--object", nargs="+", metavar="NAME", help="of a .blend file, these alone")
    verb.add_argument("--camera", metavar="NAME", help="of a .blend file; its own if not given")
    verb.add_argument(
        "--frames",
        metavar="A-B[:STEP]",
        help="of a .blend file: a drawing of each, whose number # in the name OUT stand for",
    )
    _add_manner(verb)
    _add_pen(verb)


def _add_manner(verb: argparse.ArgumentParser) -> None:
    """Options named as the fields of `Manner`; those that are not given are not there."""
    add = partial(verb.add_argument, default=argparse.SUPPRESS)
    add(
        "--spacing",
        type=_number(0.5, 1e4),
        metavar="PX",
        help=f"pixels of the picture between strokes of a family ({Manner.spacing:g})",
    )
    add(
        "--distance",
        type=_number(1e-6, 1e6),
        metavar="UNITS",
        help="between strokes of a family in units of the mesh, instead of pixels",
    )
    add(
        "--tone",
        action=argparse.BooleanOptionalAction,
        help="nearer where a light leaves the surface darker, thinner and none where it is bright",
    )
    add(
        "--layering",
        type=_number(0.0, 1.0),
        metavar="AMOUNT",
        help="with --tone, how much darker it has to be for the next family to begin "
        f"({Manner.layering:g})",
    )
    add(
        "--light",
        choices=("headlight", "lamp", "scene"),
        help="the light of --tone: at the camera, a lamp over the left shoulder, or the lights of a "
        f".blend file ({Manner.light})",
    )
    add(
        "--curvature",
        type=_number(0.0, 1.0),
        metavar="AMOUNT",
        help="nearer where the surface bends more: 0 to 1",
    )
    add(
        "--taper",
        type=_number(0.0, 1e3),
        metavar="SPACINGS",
        help=f"over which strokes get thinner toward their ends ({Manner.taper:g})",
    )
    add(
        "--overshoot",
        type=_number(0.0, 1e3),
        metavar="PX",
        help="by which strokes run on, at most, where the surface or the shade ends or something is "
        "in front",
    )
    add(
        "--gaps",
        type=_number(0.0, 1.0),
        metavar="SPACINGS",
        help="that the lower of two strokes leaves where they cross",
    )
    switch = partial(add, action=argparse.BooleanOptionalAction)
    switch("--outline", help="silhouettes, creases and borders, as layers")
    switch("--hidden", help="draw what is hidden as well")
    switch("--cross-creases", help="let strokes go on over sharp edges")


def _add_pen(verb: argparse.ArgumentParser) -> None:
    """Options for the fields of `Pen`; those that are not given are not there."""
    add = partial(verb.add_argument, default=argparse.SUPPRESS)
    add(
        "--width",
        type=_number(0.01, 1e3),
        metavar="PX",
        help=f"of strokes ({Pen.width:g}; of a .blend file, the scene's)",
    )
    add(
        "--plotter",
        action=argparse.BooleanOptionalAction,
        help="lines of one width, in an order in which a pen travels little, without paper",
    )
    add(
        "--mm",
        dest="millimetres",
        type=_number(1.0, 1e5),
        metavar="WIDTH",
        help="width of the page in millimetres",
    )
    add("--colours", metavar="C,C,...", help="of the layers, as SVG names them (#000000)")
    add("--paper", action=argparse.BooleanOptionalAction, help="white behind the strokes")


def _add_view(verb: argparse.ArgumentParser, size: tuple[int, int] | None) -> None:
    verb.add_argument(
        "--view",
        type=_numbers(2, "AZ,EL"),
        default=DEFAULT_VIEW,
        metavar="AZ,EL",
        help="degrees: 0,0 looks from the front, 90,0 from the right, 0,90 from above",
    )
    verb.add_argument(
        "--up",
        choices=list(UPRIGHT),
        help="the file's upward axis; y for .obj and .off if not given",
    )
    verb.add_argument("--size", type=_size, default=size, metavar="WxH")
    verb.add_argument("--ortho", action="store_true", help="without perspective")


def _add_turntable(verbs: Any) -> None:
    verb = _verb(verbs, "turntable", turntable)
    _add_mesh(verb)
    verb.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.mp4|OUT.gif")
    verb.add_argument(
        "--pictures", type=int, default=72, metavar="N", help="of a full turn (%(default)d)"
    )
    verb.add_argument(
        "--rate", type=float, default=24.0, metavar="N", help="pictures a second (%(default)g)"
    )
    _add_view(verb, DEFAULT_FILM_SIZE)
    _add_look(verb)
    _add_tone(verb)


def _add_field(verbs: Any) -> None:
    verb = _verb(verbs, "field", field)
    _add_mesh(verb)
    verb.add_argument(
        "-o", "--output", required=True, type=Path, metavar="OUT", help=", ".join(WRITTEN)
    )
    verb.add_argument(
        "--to-degree", type=int, metavar="N", help="a multiple or a divisor of the field's degree"
    )
    verb.add_argument(
        "--turn", type=_number(-360.0, 360.0), default=0.0, metavar="DEGREES", help="all directions"
    )
    verb.add_argument(
        "--smooth",
        type=_number(0.0, 10.0),
        default=0.0,
        metavar="SHARE",
        help="let the field diffuse over this share of the size of the mesh",
    )
    verb.add_argument("--magnitude", choices=list(MAGNITUDES), help="give the field other lengths")


def _add_info(verbs: Any) -> None:
    verb = _verb(verbs, "info", info)
    _add_mesh(verb)
    verb.add_argument("--json", action="store_true", help="as one object")
    verb.add_argument(
        "--against",
        type=Path,
        metavar="FILE",
        help="another field, for the angle between the two, or singularities (.sings)",
    )


def _add_presets(verbs: Any) -> None:
    verb = _verb(verbs, "presets", presets)
    verb.add_argument("--json", action="store_true", help="as a list of objects")


def _verb(verbs: Any, name: str, function: Callable) -> argparse.ArgumentParser:
    text = function.__doc__.splitlines()[0]
    verb = verbs.add_parser(name, help=text, description=text)
    verb.set_defaults(verb=function)
    return verb


def _add_mesh(verb: argparse.ArgumentParser, *, or_scene: bool = False) -> None:
    if or_scene:
        kinds = ".obj, .off, .ply, .stl or .blend; in Blender the open file if not given"
        verb.add_argument("mesh", nargs="?", type=Path, metavar="MESH|SCENE.blend", help=kinds)
    else:
        verb.add_argument("mesh", type=Path, metavar="MESH", help=".obj, .off, .ply or .stl")
    verb.add_argument("field", type=Path, nargs="?", metavar="FIELD", help=", ".join(READ))
    verb.add_argument(
        "--degree", type=int, metavar="N", help="1 to 12; 4, or the file's, if not given"
    )
    verb.add_argument(
        "--generate",
        choices=list(KINDS),
        help="make a field instead of reading one; curvature for degree 2 and 4, else axis, if not given",
    )
    verb.add_argument("--axis", type=_numbers(3, "X,Y,Z"), default=(0.0, 0.0, 1.0), metavar="X,Y,Z")
    verb.add_argument(
        "--reach",
        type=_number(0.0, 10.0),
        default=0.0,
        metavar="SHARE",
        help="of the size of the mesh: how far curvature reaches into parts that are hardly curved, "
        "or over what distance guides are smoothed, which are met exactly at 0",
    )
    verb.add_argument(
        "--sharp-angle",
        type=_number(0.0, 180.0),
        default=30.0,
        metavar="DEGREES",
        help="by which the surface bends at a sharp edge, for --generate features (%(default)g)",
    )
    verb.add_argument(
        "--strokes",
        type=Path,
        metavar="FILE",
        help="lines drawn on the mesh that a guided field follows: rows x y z, with an empty line "
        "between one and the next",
    )
    verb.add_argument(
        "--guides",
        type=Path,
        metavar="FIELD",
        help="a field that a guided one follows where it is not zero",
    )
    verb.add_argument(
        "--uv", action="store_true", help="let a guided field follow the UV map of an .obj file"
    )
    verb.add_argument(
        "--field-mesh",
        type=Path,
        metavar="MESH",
        help="whose faces the field file counts, if they are others: it follows by position",
    )
    verb.add_argument(
        "--undefined", action="store_true", help="take NaN and infinite vectors for undefined"
    )


def _add_look(verb: argparse.ArgumentParser) -> None:
    verb.add_argument(
        "--preset",
        metavar="NAME",
        help=f"{', '.join(preset_names())}, one of your own, or a .json file; see `presets`",
    )
    verb.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"one setting of the look, after the preset: {', '.join(f.name for f in fields(Look))}",
    )


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 640x480")
    return int(match[1]), int(match[2])


def _numbers(count: int, form: str) -> Callable[[str], tuple[float, ...]]:
    def convert(text: str) -> tuple[float, ...]:
        try:
            values = tuple(map(float, text.split(",")))
        except ValueError:
            values = ()
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"{text!r} is not {form}")
        return values

    return convert


def _number(low: float, high: float) -> Callable[[str], float]:
    def convert(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number from {low:g} to {high:g}")
        return value

    return convert


def _with_signed_values(arguments: Sequence[str]) -> list[str]:
    """`--view -30,20` as `--view=-30,20`: argparse takes the first for an option without a value."""
    joined: list[str] = []
    for argument in arguments:
        if (
            joined
            and joined[-1] in ("--view", "--axis", "--frames")
            and re.match(r"-[\d.]", argument)
        ):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
