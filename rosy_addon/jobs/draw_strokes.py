"""The job of strokes: draw strokes along the fields of a scene, and store them as an object or a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from ..compositor.look_units import pixel_look
from ..compositor.shading import lights_of
from ..core.cache import BAKE_CACHE
from ..core.errors import RosyError
from ..core.file_io import check_writable, write_bytes
from ..line_drawing.drawing_outputs import StrokeInput, drawing_curves, drawing_file
from ..line_drawing.from_look import strokes_of_look
from ..line_drawing.pipeline import StrokeDrawing
from ..line_drawing.polyline_files import check_drawing_suffix
from ..line_drawing.style import StrokeStyle
from ..line_drawing.svg import Pen
from ..projection.gbuffer import MeshInstance
from ..scene.cameras import CameraSource, render_camera, render_size, resolve_camera
from ..scene.files import absolute_path
from ..scene.look_inputs import ReadRequest, nonfinite_policy
from ..scene.look_properties import own_presets, read_look
from ..scene.read_view import lights_for, scene_depsgraph
from ..scene.scene_reader import SceneData, read_scene
from ..scene.stroke_objects import read_pen, read_stroke_style, store_strokes
from ..worker.job import Call, Step, Steps, job


@dataclass(frozen=True, eq=False)
class StrokeResult:
    """The strokes that were drawn, and the object or file that has them.

    Attributes
    ----------
    camera : str
        Name of the camera.
    drawing : StrokeDrawing
    obj : bpy.types.Object or None
        The object with the strokes. None if they were written to a file.
    path : Path or None
        The file with the strokes. None if they were stored in an object.
    notes : tuple of str
        Warnings for the user.
    """

    camera: str
    drawing: StrokeDrawing
    obj: bpy.types.Object | None = None
    path: Path | None = None
    notes: tuple[str, ...] = ()


@job
def draw_strokes(
    scene: bpy.types.Scene,
    *,
    kind: str | None = None,
    path: Path | str | None = None,
    objects: Sequence[bpy.types.Object] | None = None,
    camera: CameraSource | None = None,
    collection: bpy.types.Collection | None = None,
    style: StrokeStyle | None = None,
    pen: Pen | None = None,
    adjust: Callable[[StrokeStyle, Pen], tuple[StrokeStyle, Pen]] | None = None,
    size: tuple[int, int] | None = None,
    follow_links: bool = True,
) -> Steps[StrokeResult]:
    """Cover the objects of a scene with strokes along their fields.

    The scene is changed only after all strokes are drawn. If the job is cancelled before, the scene is
    unchanged.

    Parameters
    ----------
    scene : bpy.types.Scene
    kind : {"PENCIL", "CURVES", "FILE"}, optional
        Grease Pencil object, curves object or file. By default ``scene.rosy.strokes.kind``.
    path : Path or str, optional
        Path of the file, only for the kind "FILE". An .svg file is a picture. A .ply, .obj or .csv file has
        polylines in world space (`polyline_file`); in an .obj file y points up, as in Blender's exports.
        ``//`` stands for the folder of the .blend file. By default ``scene.rosy.strokes.filepath``.
    objects : sequence of bpy.types.Object, optional
        Objects whose fields are drawn. By default all visible objects with a field. All other objects only
        hide what is behind them.
    camera : bpy.types.Object or Camera, optional
        The camera that sees the strokes. By default the active camera of the scene.
    collection : bpy.types.Collection, optional
        The collection to which a new object is added. By default the collection of the scene.
    style : StrokeStyle, optional
        How strokes are placed. By default ``scene.rosy.strokes`` sets this. If its property `from_look` is on,
        the look of the scene replaces some of these settings; see `strokes_of_look`.
    pen : Pen, optional
        Width and colors of strokes. By default as for `style`.
    adjust : callable, optional
        Function that takes the style and the pen that the scene and its look set, and returns the ones to use.
    size : (int, int), optional
        Width and height in pixels of the picture to which lengths in pixels refer. By default the render
        resolution of the scene.
    follow_links : bool
        If `path` is a symbolic link, whether its target is replaced instead of the link. A link at the path
        that is set in the scene is always replaced itself, as the .blend file may be from somebody else.

    Returns
    -------
    StrokeResult

    Raises
    ------
    RosyError
        If there is nothing to draw, the strokes cannot be drawn (see `read_scene`, `resolve_camera` and
        `draw_instances`), or the file cannot be written.
    """
    settings = scene.rosy.strokes
    kind = settings.kind if kind is None else kind
    if kind == "FILE":
        follow_links = follow_links and path is not None
        path = absolute_path(str(settings.filepath if path is None else path))
        suffix = check_drawing_suffix(path)
        check_writable(path, follow_links=follow_links)
    depsgraph = scene_depsgraph(scene)
    source = render_camera(scene) if camera is None else camera
    view = resolve_camera(scene, depsgraph, source, render_size(scene) if size is None else size)
    scene_data = read_scene(depsgraph, objects, ReadRequest(nonfinite_policy(scene)), BAKE_CACHE)
    BAKE_CACHE.evict_over_limit()
    look = read_look(scene.rosy) if settings.from_look else None
    notes = [*scene_data.warnings]
    if look is not None and style is None:
        if look.tone != "light":
            notes.append("strokes follow the light, not the tone of the look")
        if any(own_presets(scene, scene_data.objects)):
            notes.append("strokes follow the look of the scene, not those of objects")
    is_following = kind == "CURVES" and settings.follow
    followed = _followed_instance(scene_data) if is_following else None
    made = read_stroke_style(settings), read_pen(settings)
    if look is not None:
        made = strokes_of_look(pixel_look(look, view, scene_data.instances), *made)
    made = made if adjust is None else adjust(*made)
    style, pen = (given or default for given, default in zip((style, pen), made, strict=True))
    lights = lights_for(scene, depsgraph, style, scene_data.instances)
    lights = lights_of(style, [light.transformed(view.view) for light in lights])
    inputs = StrokeInput(scene_data.instances, view, style, pen, lights)
    if kind == "FILE":
        drawing, contents = yield Call(drawing_file, (suffix, inputs))
        write_bytes(path, contents, follow_links=follow_links)
        return StrokeResult(view.name, drawing, path=path, notes=tuple(notes))
    drawing, curves = yield Call(drawing_curves, (inputs, followed), 0.0, 0.97)
    yield Step(0.97, "storing the strokes")
    # The strokes move with the drawn object, if there is only one.
    parent = scene_data.objects[0] if len(scene_data.objects) == 1 else None
    vertex_count = 0 if followed is None else len(followed.surface.vertices)
    output = curves, view.name, parent, collection, vertex_count
    obj, edited = store_strokes(scene, kind, *output)
    notes += _notes(scene, obj, style)
    if edited is not None:
        notes.append(f"'{edited.name}' was edited and stays: the new strokes are '{obj.name}'")
    return StrokeResult(view.name, drawing, obj, notes=tuple(notes))


def _followed_instance(scene_data: SceneData) -> MeshInstance:
    """Return the only mesh instance with a field. When it deforms, the strokes will deform with it.

    Raises
    ------
    RosyError
        If there are several such instances.
    """
    instances = [instance for instance in scene_data.instances if instance.field is not None]
    if len(instances) > 1:
        raise RosyError(
            "strokes can follow the surface of one object only: select one, and switch on Selected Only"
        )
    return instances[0]


def _notes(scene: bpy.types.Scene, obj: bpy.types.Object, style: StrokeStyle) -> list[str]:
    """Return warnings for the user about the object with the strokes."""
    has_depth_pass = any(layer.use_pass_z for layer in scene.view_layers)
    if not style.hidden or obj.type == "CURVES" or has_depth_pass:
        return []
    return [
        "renders will show these strokes through surfaces: enable the Depth pass of the view layer "
        "(Z before Blender 5.0)"
    ]
