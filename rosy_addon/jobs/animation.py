"""The job of animations: read, draw and write each frame that is not up to date.

The picture of a frame is a file in a folder. A sidecar file next to it holds two hashes. One is a hash of
everything that the picture was drawn from (look, camera, meshes, fields and lights). The other is a hash of
the bytes of the picture. A frame is up to date if both still match. So an interrupted job continues where it
stopped, only frames that a change affects are drawn again, and damaged pictures are replaced. Both files are
written under a temporary name and then renamed, and equal inputs give equal bytes. So several processes may
write to one folder; at worst they draw a frame twice.
"""

import math
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bpy.types import Object, Scene

from ..compositor.look import Look, has_flow
from ..core import file_io
from ..core.cache import Cache, content_hash
from ..core.errors import RosyError
from ..gpu.select import image_steps, select_device
from ..projection.camera import Camera
from ..rendering.marks import sequence_key
from ..rendering.view_input import ViewInput
from ..scene import pictures
from ..scene.blender_images import frame_path, write_images
from ..scene.cameras import CameraSource, frame_camera
from ..scene.files import picture_stem
from ..scene.keys import update_camera_planes
from ..scene.look_properties import read_look
from ..scene.picture_state import PictureState, SceneState
from ..scene.read_view import read_views, scene_depsgraph
from ..scene.scene_reader import SceneData
from ..scene.visible_objects import drawn_objects
from ..worker.job import Call, Step, Steps, job, part, shares

#: Suffix of a sidecar file, after the name of the picture.
SIDECAR_SUFFIX = ".rosy.txt"

#: First line of a sidecar file. It changes when pictures are drawn differently.
SIDECAR_HEADER = "rosy frame 2"


@dataclass(frozen=True)
class SequenceResult:
    """The image sequence of one camera, and what was drawn of it.

    Attributes
    ----------
    camera : str
        Name of the camera. If the camera may change from frame to frame, the name of the scene.
    rendered, skipped : tuple of int
        Frames that were drawn, and frames that were up to date and kept.
    path : Path
        File of the first frame.
    warnings : tuple of str
        Messages for the user.
    """

    camera: str
    rendered: tuple[int, ...]
    skipped: tuple[int, ...]
    path: Path
    warnings: tuple[str, ...] = ()


@job
def bake_animation(
    scene: Scene,
    frames: Sequence[int],
    *,
    cameras: Sequence[CameraSource] | None = None,
    objects: Sequence[Object] | None = None,
    look: Look | None = None,
    size: tuple[int, int] | None = None,
    settings: pictures.OutputSettings | None = None,
    show: bool = True,
    workers: int = 0,
) -> Steps[list[SequenceResult]]:
    """Draw the fields of a scene at several frames, and show the image sequences on the objects.

    Parameters
    ----------
    scene : bpy.types.Scene
        Its current frame and camera are restored at the end.
    frames : sequence of int
        Numbers of the frames.
    cameras : sequence of bpy.types.Object, optional
        One image sequence is drawn from each of these cameras. By default one sequence is drawn, each frame
        from the camera that renders it, which timeline markers may change.
    objects : sequence of bpy.types.Object, optional
        Objects whose fields are drawn. By default all visible objects with a field.
    look : Look, optional
        Settings of the drawing. By default the look of the scene, which may be animated.
    size : (int, int), optional
        Width and height in pixels. By default the render resolution of the scene, scaled as in `bake`.
    settings : OutputSettings, optional
        How the pictures are stored and applied, with a folder. By default the settings of the scene.
    show : bool
        Whether the objects get a material that plays the sequence.
    workers : int
        Number of processes that draw a large picture together. 0 means one per processor core.

    Yields
    ------
    Call or Step
        The parts of the job. Their label has the frame number and the remaining time.

    Returns
    -------
    list of SequenceResult
        One result per image sequence.

    Raises
    ------
    RosyError
        For the reasons of `bake` (the message then begins with the frame number), if there is no folder, or
        if a picture cannot be written.
    """
    settings = pictures.read_output_settings(scene) if settings is None else settings
    if settings.folder is None:
        raise RosyError("frames need a folder: choose Output > Store > In a Folder")
    file_io.check_folder(settings.folder)
    file_io.remove_leftovers(settings.folder)
    frames = list(frames)
    if show:
        targets = drawn_objects(scene_depsgraph(scene)) if objects is None else list(objects)
        pictures.check_targets(targets, settings)
    cache = Cache()  # meshes and fields; `_frame_steps` removes those that a frame has not used
    start_time, rendered_count = time.monotonic(), 0
    sequences: dict[str, list[_Frame]] = {}
    scene_data, warnings = None, {}
    with _restored_frame(scene):
        for index, frame in enumerate(frames):
            start, stop = index / len(frames), (index + 1) / len(frames)
            label = f"frame {frame}{_time_left(start_time, rendered_count, len(frames) - index)}"
            yield Step(start, label)
            scene.frame_set(frame)
            try:
                steps = _frame_steps(scene, cameras, objects, look, size, settings, cache, workers)
                scene_data, drawn = yield from part(steps, start, stop, label)
            except RosyError as error:
                raise RosyError(f"frame {frame}: {error}") from None
            warnings |= dict.fromkeys(scene_data.warnings)
            for one in drawn:
                sequences.setdefault(one.name, []).append(one)
            # Frames that are up to date take almost no time, so the estimate leaves them out.
            rendered_count += not all(one.up_to_date for one in drawn)
            if not rendered_count:
                start_time = time.monotonic()
        results = [_sequence_result(drawn, tuple(warnings)) for drawn in sequences.values()]
        if show and scene_data is not None:
            last_look = read_look(scene.rosy) if look is None else look
            key = yield Call(sequence_key, (scene_data.instances, last_look), 1.0)
            sources = [None] * len(results) if cameras is None else cameras
            for result, drawn, source in zip(results, sequences.values(), sources, strict=True):
                states = {one.frame: one.state for one in drawn}
                inputs = result.path, drawn[-1].camera, settings, source, states, last_look, key
                pictures.apply_sequence(scene, scene_data, result.camera, *inputs)
            update_camera_planes(scene)
        return results


@contextmanager
def _restored_frame(scene: Scene) -> Iterator[None]:
    """Context manager: at the end, restore the current frame and the active camera of a scene."""
    frame, camera = scene.frame_current + scene.frame_subframe, scene.camera
    try:
        yield
    finally:
        # `frame_set` takes subframes from 0 to 1 only, so a frame before 0 is rounded down.
        whole_frame = math.floor(frame)
        scene.frame_set(whole_frame, subframe=frame - whole_frame)
        scene.camera = camera


@dataclass(frozen=True, eq=False)
class _Frame:
    """The picture of one frame of an image sequence.

    Attributes
    ----------
    name : str
        Name of the sequence.
    frame : int
    path : Path
        The file.
    camera : Camera
    up_to_date : bool
        Whether the picture was up to date, so that it was not drawn.
    state : PictureState
        The state of the scene from which it is drawn.
    """

    name: str
    frame: int
    path: Path
    camera: Camera
    up_to_date: bool
    state: PictureState


def _sequence_result(drawn: Sequence[_Frame], warnings: tuple[str, ...]) -> SequenceResult:
    """Return the result of an image sequence, given its frames."""
    rendered, skipped = (
        tuple(one.frame for one in drawn if one.up_to_date == up_to_date)
        for up_to_date in (False, True)
    )
    return SequenceResult(drawn[0].name, rendered, skipped, drawn[0].path, warnings)


def _frame_steps(
    scene: Scene,
    cameras: Sequence[CameraSource] | None,
    objects: Sequence[Object] | None,
    look: Look | None,
    size: tuple[int, int] | None,
    settings: pictures.OutputSettings,
    cache: Cache,
    workers: int,
) -> Steps[tuple[SceneData, list[_Frame]]]:
    """Draw the current frame of a scene from all cameras, as part of a job.

    Return the data of the scene, and one `_Frame` for each camera. If `cameras` is None, the only camera is the
    one that renders the frame. `cache` has the meshes and fields of earlier frames. The other parameters are as
    in `bake_animation`.
    """
    frame, look = scene.frame_current, read_look(scene.rosy) if look is None else look
    # The look may be animated, and not every device can draw every method, so the device is chosen per frame.
    device = select_device(settings.device, look)
    sources = [frame_camera(scene, frame)] if cameras is None else list(cameras)
    depsgraph = scene_depsgraph(scene)
    views, scene_data = read_views(
        scene, depsgraph, sources, look, objects=objects, size=size, cache=cache
    )
    cache.evict_unused()
    device = "cpu" if views[0].looks else device
    scene_state = SceneState(scene, depsgraph, scene_data.mesh_states)
    states = [scene_state.picture_state(scene, depsgraph, source, True) for source in sources]
    drawn = []
    for (view, state), start, stop in shares(zip(views, states, strict=True)):
        name, kind = (scene.name, "scene") if cameras is None else (view.camera.name, "camera")
        path = frame_path(settings.folder / picture_stem(name, kind), frame, settings.as_float)
        sidecar = path.with_name(path.name + SIDECAR_SUFFIX)
        input_hash = _input_hash(view, device, settings)
        up_to_date = (
            path.is_file()
            and sidecar.is_file()
            and _own_bytes(sidecar) == _sidecar_text(input_hash, path)
        )
        if not up_to_date:
            for output in (path, sidecar):
                if os.path.lexists(output):
                    file_io.check_writable(output)
            # The G-buffer is kept if streaks drift, as it may be the same in the next frame.
            steps = image_steps(
                view, device, settings.as_float, keep_gbuffers=has_flow(look), workers=workers
            )
            _, image_data = yield from part(steps, start, stop)
            sidecar.unlink(missing_ok=True)
            write_images({path: image_data})
            file_io.write_bytes(sidecar, _sidecar_text(input_hash, path))
        state = replace(state, device=device)
        drawn.append(_Frame(name, frame, path, view.camera, up_to_date, state))
    return scene_data, drawn


def _sidecar_text(input_hash: bytes, path: Path) -> bytes:
    """Return the contents of the sidecar file of the picture at `path`."""
    picture_hash = content_hash(np.frombuffer(_own_bytes(path), dtype=np.uint8))
    return f"{SIDECAR_HEADER}\n{input_hash.hex()}\n{picture_hash.hex()}\n".encode()


def _own_bytes(path: Path) -> bytes:
    """Return the contents of a picture or a sidecar file.

    `file_io.read_bytes` would record the file as an input, and RoSy could then not replace it.
    """
    with file_io.system_errors(path, "cannot be read"):
        return path.read_bytes()


def _input_hash(view: ViewInput, device: str, settings: pictures.OutputSettings) -> bytes:
    """Return a hash of everything that a picture is drawn from."""
    camera, reference = view.camera, view.reference
    parts: list = [view.look, *view.looks, *view.drift, camera.view, camera.projection]
    parts += [camera.width, camera.height, settings.as_float]
    if device == "gpu":
        parts.append("by the graphics card")
    if view.look.light == "scene":
        for light in view.lights:
            parts += vars(light).values()
    if reference is not None:
        parts += [reference.luminance, reference.camera.view, reference.camera.projection]
    for instance in view.instances:
        surface, field = instance.surface, instance.field
        parts += [instance.matrix, surface.vertices, surface.triangles, surface.corner_vertex]
        if field is not None:
            parts += [surface.corner_normal, surface.corner_fan, surface.rest_vertices]
            parts += [field.degree, field.vectors, field.direction_ratios, field.family_count]
        if instance.tone is not None:
            parts += [instance.tone.values, instance.tone.image]
        if instance.color_values is not None:
            parts += ["numbers", instance.color_values]
    return content_hash(*parts)


def _time_left(start_time: float, rendered_count: int, remaining_count: int) -> str:
    """Return the estimated remaining time as text; empty if no frame has been drawn yet.

    `start_time` is the value of `time.monotonic` when the first frame began to be drawn.
    """
    if not rendered_count:
        return ""
    seconds = (time.monotonic() - start_time) / rendered_count * remaining_count
    if seconds < 90:
        return f", {seconds:.0f} s left"
    minutes = seconds / 60
    return f", {minutes:.0f} min left" if minutes < 90 else f", {minutes / 60:.1f} h left"
