"""The other job: read the scene, lay strokes along its fields, put them into the scene or a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from .bake import Source, camera_view, scene_depsgraph, undefined_of
from .compositor.shading import lights_of
from .errors import RosyError
from .files import check_writable
from .progress import Progress, Work, drain, part
from .reuse import KEPT
from .scene.bodies import Reading, read_scene
from .scene.cameras import picture_size, render_camera
from .scene.lights import read_lights
from .scene.strokes import manner_of, pen_of, put_strokes
from .strokes.draw import Drawn, Manner, drawing
from .strokes.svg import Pen, write_svg


@dataclass(frozen=True, eq=False)
class Sketch:
    """What came of drawing strokes.

    Attributes
    ----------
    camera : str
    drawn : Drawn
    thing : bpy.types.Object or None
        The object in the scene.
    path : Path or None
        The file.
    notes : tuple of str
        What the user should know.
    """

    camera: str
    drawn: Drawn
    thing: bpy.types.Object | None = None
    path: Path | None = None
    notes: tuple[str, ...] = ()


def sketching(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph | None = None,
    *,
    kind: str | None = None,
    path: Path | str | None = None,
    objects: Sequence[bpy.types.Object] | None = None,
    camera: Source | None = None,
    manner: Manner | None = None,
    pen: Pen | None = None,
    size: tuple[int, int] | None = None,
) -> Work[Sketch]:
    """Cover the objects of a scene with strokes along their fields.

    Nothing is changed in the scene until all strokes are there: closing the generator before
    leaves no trace.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph, optional
        That of the scene's view layer in the context, or else its first, if not given.
    kind : {"PENCIL", "CURVES", "SVG"}, optional
        What the strokes become. This and all that follows is as ``scene.rosy.strokes`` says if not
        given.
    path : Path or str, optional
        Of an SVG file; ``//`` is the folder of the .blend file.
    objects : sequence of bpy.types.Object, optional
        Whose fields are drawn; all that have one if not given. Everything else hides.
    camera : bpy.types.Object or Camera, optional
        From where; the camera that renders the scene if not given.
    manner : Manner, optional
    pen : Pen, optional
    size : (int, int), optional
        Of the picture in whose pixels lengths are counted; that of renders if not given.

    Yields
    ------
    Progress

    Returns
    -------
    Sketch

    Raises
    ------
    RosyError
        If there is nothing to draw or it cannot be drawn; see `read_scene`, `camera_of_object` and
        `strokes.draw.drawing`. If the file may not be written.
    """
    settings = scene.rosy.strokes
    kind = settings.kind if kind is None else kind
    manner = manner_of(settings) if manner is None else manner
    pen = pen_of(settings) if pen is None else pen
    if kind == "SVG":
        path = svg_path(settings.filepath if path is None else path)
    yield Progress(0.0, "reading the scene")
    depsgraph = scene_depsgraph(scene) if depsgraph is None else depsgraph
    source = render_camera(scene) if camera is None else camera
    view = camera_view(scene, depsgraph, source, picture_size(scene) if size is None else size)
    reading = read_scene(depsgraph, objects, undefined_of(scene), KEPT)
    lights = lights_of(manner, read_lights(depsgraph, view.view))
    framed = kind == "SVG"
    work = drawing(reading.bodies, view, manner, lights=lights, framed=framed)
    drawn = yield from part(work, 0.05, 0.95)
    KEPT.trim()
    yield Progress(0.97, "putting the strokes there")
    if kind == "SVG":
        write_svg(path, drawn.strokes, view, pen)
        return Sketch(view.name, drawn, path=path)
    thing = put_strokes(scene, kind, drawn, view, pen, _only_owner(reading))
    return Sketch(view.name, drawn, thing, notes=tuple(_notes(scene, thing, manner)))


def sketch(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None = None, **more) -> Sketch:
    """`sketching`, run to its end."""
    return drain(sketching(scene, depsgraph, **more))


def svg_path(path: Path | str) -> Path:
    """Where an SVG file goes, ``//`` being the folder of the .blend file.

    Raises
    ------
    RosyError
        If that is not saved yet, the name ends otherwise, or the file may not be written.
    """
    if str(path).startswith("//") and not bpy.data.filepath:
        raise RosyError(f"{path}: save the .blend file first, or choose a folder")
    path = Path(bpy.path.abspath(str(path)))
    if path.suffix.lower() != ".svg":
        raise RosyError(f"{path}: strokes are written to .svg files")
    check_writable(path)
    return path


def _only_owner(reading: Reading) -> bpy.types.Object | None:
    """The object that strokes are to move with: the one that is drawn on, if there is but one."""
    return reading.owners[0] if len(reading.owners) == 1 else None


def _notes(scene: bpy.types.Scene, thing: bpy.types.Object, manner: Manner) -> list[str]:
    told = any(layer.use_pass_z for layer in scene.view_layers)
    if not manner.hidden or thing.type == "CURVES" or told:
        return []
    return ["renders show Grease Pencil through surfaces, unless the view layer has the pass Z"]
