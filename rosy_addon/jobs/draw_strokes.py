"""Draw strokes along the fields of a scene, and store them as an object or a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..compositor.shading import lights_of
from ..core.cache import BAKE_CACHE
from ..core.errors import RosyError
from ..core.file_io import check_writable, write_bytes
from ..line_drawing.drawing_outputs import drawing_curves, drawing_file
from ..line_drawing.pipeline import StrokeDrawing
from ..line_drawing.polyline_files import check_drawing_suffix
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from ..projection.gbuffer import MeshInstance
from ..scene.cameras import CameraSource, render_camera, render_size, resolve_camera
from ..scene.look_inputs import ReadRequest, nonfinite_policy
from ..scene.read_view import read_lights, scene_depsgraph
from ..scene.scene_reader import SceneData, read_scene
from ..scene.stroke_objects import read_pen, read_stroke_style, store_strokes
from ..worker.job import Call, Step, Steps, job


@dataclass(frozen=True, eq=False)
class StrokeResult:
    """The result of drawing strokes.

    Attributes
    ----------
    camera : str
        Name of the camera.
    drawing : StrokeDrawing
    obj : bpy.types.Object or None
        The object with the strokes, or None for a file.
    path : Path or None
        The file, or None for an object.
    notes : tuple of str
        Warnings to the user.
    """

    camera: str
    drawing: StrokeDrawing
    obj: bpy.types.Object | None = None
    path: Path | None = None
    notes: tuple[str, ...] = ()


@job
def draw_strokes(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    kind: str | None = None,
    path: Path | str | None = None,
    objects: Sequence[bpy.types.Object] | None = None,
    camera: CameraSource | None = None,
    collection: bpy.types.Collection | None = None,
    style: StrokeStyle | None = None,
    pen: Pen | None = None,
    size: tuple[int, int] | None = None,
) -> Steps[StrokeResult]:
    """Cover the objects of a scene with strokes along their fields.

    The scene is changed when all are drawn. A job that is cancelled leaves it unchanged.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph, optional
        By default `scene_depsgraph`.
    kind : {"PENCIL", "CURVES", "FILE"}, optional
        Grease Pencil object, curves object or file. By default ``scene.rosy.strokes.kind``.
    path : Path or str, optional
        Path of the file: .svg for a picture; .ply, .obj or .csv for polylines in world space, see
        `polyline_file`. In an .obj file, y points up, as Blender exports it. ``//`` is the folder of
        the .blend file. By default ``scene.rosy.strokes.filepath``.
    objects : sequence of bpy.types.Object, optional
        Objects with fields to draw; by default all that have one. Other objects only occlude.
    camera : bpy.types.Object or Camera, optional
        By default the camera of renders.
    collection : bpy.types.Collection, optional
        The collection of a new object. By default that of the scene.
    style : StrokeStyle, optional
        By default the settings of the scene.
    pen : Pen, optional
        By default the settings of the scene.
    size : (int, int), optional
        Resolution of the picture that lengths in pixels refer to. By default that of renders.

    Returns
    -------
    StrokeResult

    Raises
    ------
    RosyError
        If there is nothing to draw, or it cannot be drawn; see `read_scene`, `resolve_camera` and
        `draw_instances`. Also if the file cannot be written.
    """
    settings = scene.rosy.strokes
    kind = settings.kind if kind is None else kind
    style = read_stroke_style(settings) if style is None else style
    pen = read_pen(settings) if pen is None else pen
    suffix = ""
    if kind == "FILE":
        path = drawing_path(settings.filepath if path is None else path)
        suffix = check_drawing_suffix(path)
    depsgraph = scene_depsgraph(scene) if depsgraph is None else depsgraph
    source = render_camera(scene) if camera is None else camera
    view = resolve_camera(scene, depsgraph, source, render_size(scene) if size is None else size)
    scene_data = read_scene(depsgraph, objects, ReadRequest(nonfinite_policy(scene)), BAKE_CACHE)
    BAKE_CACHE.evict_over_limit()
    followed = None
    if kind == "CURVES" and settings.follow:
        followed = _followed_instance(scene_data)
    lights = lights_of(style, read_lights(depsgraph, view.view))
    inputs = scene_data.instances, view, style, pen, lights
    if kind == "FILE":
        drawing, contents = yield Call(drawing_file, (suffix, *inputs))
        write_bytes(path, contents)
        return StrokeResult(view.name, drawing, path=path, notes=scene_data.warnings)
    drawing, curves = yield Call(drawing_curves, (*inputs, followed), 0.0, 0.97)
    yield Step(0.97, "storing the strokes")
    # The strokes move with the drawn object, if there is only one.
    parent = scene_data.objects[0] if len(scene_data.objects) == 1 else None
    obj = store_strokes(
        scene,
        kind,
        curves,
        view.name,
        parent,
        collection,
        0 if followed is None else len(followed.surface.vertices),
    )
    return StrokeResult(
        view.name, drawing, obj, notes=(*scene_data.warnings, *_notes(scene, obj, style))
    )


def drawing_path(path: Path | str) -> Path:
    """Return the absolute path of a file of strokes. ``//`` is the folder of the .blend file.

    Raises
    ------
    RosyError
        If the path starts with ``//`` and the .blend file is not saved, if there is no such kind of
        file, or if the file cannot be written.
    """
    if str(path).startswith("//") and not bpy.data.filepath:
        raise RosyError(f"{path}: save the .blend file first, or choose an absolute path")
    path = Path(bpy.path.abspath(str(path)))
    check_drawing_suffix(path)
    check_writable(path)
    return path


def _followed_instance(scene_data: SceneData) -> MeshInstance:
    """Return the instance whose surface the strokes follow.

    Raises
    ------
    RosyError
        If there are several.
    """
    instances = [instance for instance in scene_data.instances if instance.field is not None]
    if len(instances) > 1:
        raise RosyError(
            "strokes can follow the surface of one object only: select one, and switch on Selected Only"
        )
    return instances[0]


def _notes(scene: bpy.types.Scene, obj: bpy.types.Object, style: StrokeStyle) -> list[str]:
    """Return warnings to the user about the new object."""
    has_depth_pass = any(layer.use_pass_z for layer in scene.view_layers)
    if not style.hidden or obj.type == "CURVES" or has_depth_pass:
        return []
    return [
        "renders will show these strokes through surfaces: enable the Depth pass of the view layer "
        "(Z before Blender 5.0)"
    ]
