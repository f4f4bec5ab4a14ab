"""The main job over a range of frames: read, project, compose, write; what is there already stays.

A frame's picture is a file in a folder, beside it a note of what it was drawn from: a digest of the
look, the camera, every mesh and field, and the lights. A frame is there when its file is whole and
the note says the same; so work that was broken off goes on where it stopped, and a change draws
again only what it touches. Both are written aside and renamed, and the same inputs give the same
bytes, so that two processes may work on one folder and at worst do a frame twice.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass

import bpy

from .bake import Source, camera_view, scene_depsgraph, undefined_of
from .compositor.look import Look
from .compositor.shading import Light
from .compositor.tone import Rendered
from .errors import RosyError
from .files import read_bytes, write_bytes
from .gpu.painter import find_card, painting
from .progress import Progress, Work, drain, part
from .projection.camera import Camera
from .reuse import Kept, digest
from .scene.apply import Settings, Strip, apply_strip, check_appliable, settings_of
from .scene.bodies import Reading, prepared, read_scene, rosy_objects
from .scene.cameras import frame_camera
from .scene.images import check_folder, frame_path, write_frame
from .scene.lights import read_lights
from .scene.looks import look_of
from .scene.tones import read_rendered, tone_wish

#: How the note of a frame ends; it begins as the picture's name.
NOTE = ".rosy.txt"

#: What a note says first. Changes of how pictures are drawn change it, too.
FORMAT = "rosy frame 1"


@dataclass(frozen=True)
class Frames:
    """What came of a range of frames from one camera.

    Attributes
    ----------
    camera : str
        Its name; that of the scene if the camera may change from frame to frame.
    drawn, kept : tuple of int
        Frames that were drawn now, and that were there already.
    strip : Strip
    """

    camera: str
    drawn: tuple[int, ...]
    kept: tuple[int, ...]
    strip: Strip


def baking_animation(
    scene: bpy.types.Scene,
    frames: Sequence[int],
    *,
    cameras: Sequence[Source] | None = None,
    objects: Sequence[bpy.types.Object] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: Settings | None = None,
    show: bool = True,
) -> Work[list[Frames]]:
    """Draw the fields of a scene at some frames, and have materials play the pictures back.

    Parameters
    ----------
    scene : bpy.types.Scene
        At the frame it is at, in the end.
    frames : sequence of int
    cameras : sequence of bpy.types.Object, optional
        One sequence of pictures each. If not given, the camera that renders each frame, as markers
        may say.
    objects, look, size : optional
        As for `bake`; settings of a look may be animated if it is the scene's.
    settings : Settings, optional
        As ``scene.rosy`` says if not given; with a folder.
    show : bool
        Whether the objects get a material that plays the pictures back.

    Yields
    ------
    Progress
        With the time that is left.

    Raises
    ------
    RosyError
        As `bake`, with the frame; if there is no folder; or a picture cannot be written.
    """
    settings = settings_of(scene) if settings is None else settings
    if settings.folder is None:
        raise RosyError("frames are saved to a folder: choose Output > Store: In a Folder")
    check_folder(settings.folder)
    frames = list(frames)
    before = scene.frame_current, scene.frame_subframe
    drawn: dict[str, list[int]] = {}
    kept: dict[str, list[int]] = {}
    views: dict[str, Camera] = {}
    began, spent = time.monotonic(), 0
    reading = None
    # What a frame has not used, none of the next ones will: its memory is theirs.
    held, known = ExitStack(), Kept()
    try:
        depsgraph = scene_depsgraph(scene)
        drawn_ones = rosy_objects(depsgraph.view_layer) if objects is None else list(objects)
        if show:
            check_appliable(drawn_ones, settings)
        held.enter_context(prepared(depsgraph, drawn_ones, undefined_of(scene), known))
        for number, frame in enumerate(frames):
            start, stop = number / len(frames), (number + 1) / len(frames)
            label = f"frame {frame}{_time_left(began, spent, len(frames) - number)}"
            yield Progress(start, label)
            scene.frame_set(frame)
            try:
                steps = _frame(scene, frame, cameras, objects, look, size, settings, known)
                reading, results = yield from part(steps, start, stop, label)
            except RosyError as error:
                raise RosyError(f"frame {frame}: {error}") from None
            for name, (view, was_there) in results.items():
                (kept if was_there else drawn).setdefault(name, []).append(frame)
                views[name] = view
            # Frames that were there take no time to speak of.
            spent += not all(was_there for _, was_there in results.values())
            if not spent:
                began = time.monotonic()
        made = []
        for name, view in views.items():
            path = frame_path(settings.folder, name, frames[0], settings.as_float)
            strip = Strip(name, path, frames[0], frames[-1], view.width, view.height)
            if show:
                apply_strip(scene, reading, strip, view, settings)
            mine = tuple(drawn.get(name, ())), tuple(kept.get(name, ()))
            made.append(Frames(name, *mine, strip))
        return made
    finally:
        held.close()
        scene.frame_set(before[0], subframe=before[1])


def bake_animation(scene: bpy.types.Scene, frames: Sequence[int], **more) -> list[Frames]:
    """`baking_animation`, run to its end."""
    return drain(baking_animation(scene, frames, **more))


def _frame(
    scene: bpy.types.Scene,
    frame: int,
    cameras: Sequence[Source] | None,
    objects: Sequence[bpy.types.Object] | None,
    look: Look | None,
    size: tuple[int, int] | None,
    settings: Settings,
    kept: Kept,
) -> Work[tuple[Reading, dict]]:
    """Draw one frame from all cameras; by the names of the sequences their views, and whether the
    picture was there."""
    look = look_of(scene.rosy) if look is None else look
    card = kept.find_or_make(
        ("card", settings.device), lambda: (find_card(settings.device, look),)
    )[0]
    depsgraph = scene_depsgraph(scene)
    sources = [frame_camera(scene, frame)] if cameras is None else list(cameras)
    wish = tone_wish(scene, look)
    reading = read_scene(depsgraph, objects, undefined_of(scene), kept, wish)
    rendered = None
    if look.tone == "picture":
        rendered = read_rendered(scene, depsgraph, frame_camera(scene, frame), look)
    results = {}
    for number, source in enumerate(sources):
        start, stop = number / len(sources), (number + 1) / len(sources)
        view = camera_view(scene, depsgraph, source, size)
        name = scene.name if cameras is None else view.name
        lights = read_lights(depsgraph, view.view)
        path = frame_path(settings.folder, name, frame, settings.as_float)
        note = path.with_name(path.name + NOTE)
        drawn_from = _inputs(
            reading, look, view, lights, settings, rendered, by_card=card is not None
        )
        inputs = f"{FORMAT}\n{drawn_from.hex()}\n".encode()
        was_there = path.is_file() and note.is_file() and read_bytes(note) == inputs
        if not was_there:
            fine = view.scaled(look.supersampling)
            work = painting(card, reading.bodies, fine, look, lights, rendered=rendered)
            picture = yield from part(work, start, stop)
            note.unlink(missing_ok=True)
            write_frame(path, picture, settings.as_float)
            write_bytes(note, inputs)
        results[name] = view, was_there
    kept.forget_unused()
    return reading, results


def _inputs(
    reading: Reading,
    look: Look,
    view: Camera,
    lights: Sequence[Light],
    settings: Settings,
    rendered: Rendered | None,
    *,
    by_card: bool,
) -> bytes:
    """A digest of all that a picture is drawn from."""
    parts: list = [look, view.view, view.projection, view.width, view.height, settings.as_float]
    if by_card:
        parts.append("by the graphics card")
    if look.light == "scene":
        for light in lights:
            parts += vars(light).values()
    if rendered is not None:
        parts += [rendered.luminance, rendered.camera.view, rendered.camera.projection]
    for body in reading.bodies:
        surface, field = body.surface, body.field
        parts += [body.matrix, surface.vertices, surface.triangles, surface.corner_vertex]
        if field is not None:
            parts += [surface.corner_normal, surface.corner_fan, surface.rest]
            parts += [field.degree, field.vectors, field.deviations, field.families]
        if body.tone is not None:
            parts += [body.tone.values, body.tone.image]
    return digest(*parts)


def _time_left(began: float, spent: int, left: int) -> str:
    """How long the rest will take, in words; nothing until it can be told."""
    if not spent:
        return ""
    seconds = (time.monotonic() - began) / spent * left
    if seconds < 90:
        return f", {seconds:.0f} s left"
    minutes = seconds / 60
    return f", {minutes:.0f} min left" if minutes < 90 else f", {minutes / 60:.1f} h left"
