"""Pictures put on objects, remembered, and taken away again.

Of each camera there is one image and one material. An object shows a picture by a modifier at the
end of its stack, whose node group belongs to that object alone; mesh, material slots and everything
else of the user's stay as they are. What RoSy makes carries the custom property ``rosy_made``, and
``scene.rosy.bakes`` remembers what each picture was drawn from.

The picture belongs to the shape at the time of the bake: it stays on an object that is moved, and
slides over one that deforms.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import bpy
import numpy as np

from ..compositor.look import Look
from ..compositor.picture import Picture
from ..errors import RosyError
from ..projection.camera import Camera
from .attributes import attribute_name, field_degree
from .bodies import MADE, Reading, is_rosy_modifier
from .capabilities import is_editable
from .images import check_folder, load_strip, new_image
from .looks import look_of
from .nodes import material_of_group, new_group, new_material, play

MODIFIER = "RoSy"

#: View transforms that show a picture as it was drawn.
FAITHFUL = ("Standard", "Raw")

#: Seconds for which the state of a mesh is taken to be what it was.
PATIENCE = 1.0


@dataclass(frozen=True)
class Settings:
    """How a picture gets into the scene.

    Attributes
    ----------
    window : bool
        Placed by window coordinates rather than by the baked projection.
    emission, diffuse : float
    as_float : bool
        Float values rather than 8 bit sRGB.
    folder : Path or None
        Where to save images; None packs them.
    device : {"cpu", "gpu", "auto"}
        What draws the pictures.
    """

    window: bool = False
    emission: float = 1.0
    diffuse: float = 0.0
    as_float: bool = False
    folder: Path | None = None
    device: str = "cpu"


@dataclass(frozen=True, eq=False)
class Baked:
    """What a bake from one camera made.

    Attributes
    ----------
    camera : str
    image : bpy.types.Image
    material : bpy.types.Material
    objects : tuple of bpy.types.Object
    picture : Picture
    notes : tuple of str
        What the user should know.
    """

    camera: str
    image: bpy.types.Image
    material: bpy.types.Material
    objects: tuple[bpy.types.Object, ...]
    picture: Picture
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Bake:
    """A picture that is in the scene.

    Attributes
    ----------
    camera : str
        Name of the camera, or ``3D View``.
    width, height : int
        Pixels.
    image : bpy.types.Image
    stale : str
        Why the picture is out of date, empty if it is not.
    shown : bool
        Whether any object shows it; others are kept, to be shown instead.
    frames : str
        Of a sequence, from which to which; empty for one picture.
    """

    camera: str
    width: int
    height: int
    image: bpy.types.Image
    stale: str
    shown: bool
    frames: str = ""


@dataclass(frozen=True)
class Removed:
    """How many things were taken away.

    Attributes
    ----------
    objects, images, materials, groups : int
        Objects freed of their modifier, and datablocks deleted.
    """

    objects: int = 0
    images: int = 0
    materials: int = 0
    groups: int = 0


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture, and what it was drawn from.

    Attributes
    ----------
    picture : Picture
    camera : Camera
    camera_object : bpy.types.Object or None
        None for a view.
    """

    picture: Picture
    camera: Camera
    camera_object: bpy.types.Object | None = None


def settings_of(scene: bpy.types.Scene) -> Settings:
    """How the scene wants its pictures.

    Raises
    ------
    RosyError
        If they are to be saved beside a .blend file that has not been saved.
    """
    chosen = scene.rosy
    folder = folder_of(scene) if chosen.store == "SAVED" else None
    return Settings(
        window=chosen.placement == "WINDOW",
        emission=chosen.emission,
        diffuse=chosen.diffuse,
        as_float=chosen.image_format == "FLOAT",
        folder=folder,
        device=chosen.device.lower(),
    )


def folder_of(scene: bpy.types.Scene) -> Path:
    """Where the scene's pictures are saved.

    Raises
    ------
    RosyError
        If that is beside a .blend file that has not been saved.
    """
    directory = scene.rosy.directory
    if directory.startswith("//") and not bpy.data.filepath:
        raise RosyError(f"{directory}: save the .blend file first, or choose a folder")
    return Path(bpy.path.abspath(directory))


def check_appliable(objects: Iterable[bpy.types.Object], settings: Settings) -> None:
    """Find out before long work whether pictures can be put on objects.

    Raises
    ------
    RosyError
        If an object is linked from a library without an override, or the folder for images cannot
        be written.
    """
    for thing in objects:
        if not is_editable(thing):
            library = thing.library.filepath if thing.library else "its library"
            raise RosyError(
                f"object '{thing.name}' is linked from {library} and cannot get a modifier: make a "
                "library override of it, or make it local"
            )
    if settings.folder is not None:
        check_folder(settings.folder)


def apply_picture(
    scene: bpy.types.Scene,
    reading: Reading,
    shot: Shot,
    settings: Settings | None = None,
) -> Baked:
    """Put a picture on the objects it shows, in place of an older one from the same camera.

    The old one goes only when all of the new one is there, and an error leaves things as they were.

    Parameters
    ----------
    scene : bpy.types.Scene
    reading : Reading
        What the picture was drawn from.
    shot : Shot
    settings : Settings, optional
        The scene's own if not given.

    Raises
    ------
    RosyError
        See `check_appliable`.
    """
    settings = settings_of(scene) if settings is None else settings
    owners = list(dict.fromkeys(reading.owners))
    check_appliable(owners, settings)
    name = shot.camera.name
    matrices = _object_matrices(reading, shot.camera)
    with all_or_nothing() as made:
        image = new_image(
            f"RoSy {name}", shot.picture, as_float=settings.as_float, folder=settings.folder
        )
        made.append(image)
        material = new_material(
            f"RoSy {name}",
            image,
            shot.camera.projection @ shot.camera.view,
            window=settings.window,
            emission=settings.emission,
            diffuse=settings.diffuse,
        )
        made.append(material)
        groups = []
        for thing in owners:
            groups.append(new_group(f"RoSy {thing.name}", material, matrices[thing]))
            made.append(groups[-1])
    for thing, group in zip(owners, groups, strict=True):
        _show(thing, group)
    _remember(scene, shot, image, material, matrices)
    return Baked(name, image, material, tuple(owners), shot.picture, tuple(_notes(scene)))


@contextmanager
def all_or_nothing() -> Iterator[list[bpy.types.ID]]:
    """A list for datablocks that are made: marked as RoSy's in the end, or deleted on an error."""
    made: list[bpy.types.ID] = []
    try:
        yield made
        for datablock in made:
            datablock[MADE] = True
    except BaseException:
        for datablock in reversed(made):
            delete_made(datablock)
        raise


@dataclass(frozen=True)
class Strip:
    """A sequence of pictures on disk.

    Attributes
    ----------
    name : str
        Of the camera, or of the scene if that changes.
    path : Path
        Of the first frame.
    first, last : int
        Frames.
    width, height : int
        Pixels.
    """

    name: str
    path: Path
    first: int
    last: int
    width: int
    height: int


def apply_strip(
    scene: bpy.types.Scene, reading: Reading, strip: Strip, camera: Camera, settings: Settings
) -> None:
    """Have the objects of a scene play a sequence of pictures, in place of an older one.

    The pictures fill the frame of the camera that renders, each at its own frame: any machine that
    has the files shows them, with or without RoSy.
    """
    with all_or_nothing() as made:
        image = load_strip(strip.path, settings.as_float)
        made.append(image)
        image.name = f"RoSy {strip.name}"
        material = new_material(
            image.name,
            image,
            camera.projection @ camera.view,
            window=True,
            emission=settings.emission,
            diffuse=settings.diffuse,
        )
        made.append(material)
        play(material, strip.first, strip.last)
        owners = list(dict.fromkeys(reading.owners))
        groups = [new_group(f"RoSy {thing.name}", material, None) for thing in owners]
        made += groups
    for thing, group in zip(owners, groups, strict=True):
        _show(thing, group)
    record = _record_of(scene, strip.name, image, material)
    record.width, record.height = strip.width, strip.height
    record.frames = f"{strip.first} to {strip.last}"
    record.look, record.camera_state = _look_state(look_of(scene.rosy)), ""
    record.objects.clear()
    for thing in owners:
        entry = record.objects.add()
        entry.name = thing.name


def use_bake(scene: bpy.types.Scene, camera: str) -> None:
    """Have the objects show the picture that was baked from a camera.

    Parameters
    ----------
    scene : bpy.types.Scene
    camera : str
        One of the names in `bakes`.

    Raises
    ------
    RosyError
        If there is no such picture.
    """
    record = scene.rosy.bakes.get(camera)
    if record is None:
        names = ", ".join(f"'{known.name}'" for known in scene.rosy.bakes) or "none"
        raise RosyError(f"nothing is baked from camera '{camera}'; there are {names}")
    for entry in record.objects:
        thing = scene.objects.get(entry.name) or bpy.data.objects.get(entry.name)
        if thing is None or not is_editable(thing):
            continue
        matrix = np.array(entry.matrix).reshape(4, 4)
        group = new_group(f"RoSy {thing.name}", record.material, matrix if matrix.any() else None)
        group[MADE] = True
        _show(thing, group)


def remove(scene: bpy.types.Scene, objects: Sequence[bpy.types.Object] | None = None) -> Removed:
    """Take away what RoSy put into a scene. Fields stay, and so do files of saved pictures.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : sequence of bpy.types.Object, optional
        Take the pictures off these alone; images and materials go with their last object.
    """
    records = scene.rosy.bakes
    named = {entry.name for record in records for entry in record.objects}
    shown = [
        thing
        for thing in bpy.data.objects
        if (thing.name in named or thing.name in scene.objects)
        and any(map(is_rosy_modifier, thing.modifiers))
    ]
    chosen = shown if objects is None else [thing for thing in objects if thing in shown]
    groups = 0
    for thing in chosen:
        groups += _take_off(thing)
    for record in records:
        for index in reversed(range(len(record.objects))):
            if record.objects[index].name in {thing.name for thing in chosen}:
                record.objects.remove(index)
    images = materials = 0
    for index in reversed(range(len(records))):
        if objects is None or not records[index].objects:
            image, material = records[index].image, records[index].material
            records.remove(index)
            materials += delete_made(material)
            images += delete_made(image)
    return Removed(len(chosen), images, materials, groups)


def bakes(scene: bpy.types.Scene) -> list[Bake]:
    """The pictures in a scene, in the order of their cameras' names, and whether they still hold.

    Quick enough to be asked whenever a panel is drawn: meshes are looked at once a second.
    """
    found = []
    for record in scene.rosy.bakes:
        if record.image is None:
            continue
        stale, shown = _why_stale(scene, record), _is_shown(record)
        size = record.width, record.height
        found.append(Bake(record.name, *size, record.image, stale, shown, record.frames))
    return sorted(found, key=lambda bake: bake.camera)


def _is_shown(record: bpy.types.PropertyGroup) -> bool:
    things = (bpy.data.objects.get(entry.name) for entry in record.objects)
    groups = (
        modifier.node_group
        for thing in things
        if thing is not None
        for modifier in thing.modifiers
        if is_rosy_modifier(modifier)
    )
    return any(material_of_group(group) == record.material for group in groups)


def _object_matrices(reading: Reading, camera: Camera) -> dict[bpy.types.Object, np.ndarray | None]:
    """Object to clip space for each object; None for those seen in several places."""
    matrices: dict[bpy.types.Object, np.ndarray | None] = {}
    for body, owner in zip(reading.bodies, reading.owners, strict=False):
        seen = owner in matrices
        matrices[owner] = None if seen else camera.projection @ camera.view @ body.matrix
    return matrices


def _show(thing: bpy.types.Object, group: bpy.types.NodeTree) -> None:
    """Put a node group at the end of an object's modifiers, in place of RoSy's last one."""
    own = [modifier for modifier in thing.modifiers if is_rosy_modifier(modifier)]
    modifier = own[0] if own else thing.modifiers.new(MODIFIER, "NODES")
    modifier.show_expanded = False
    old, modifier.node_group = modifier.node_group, group
    for extra in own[1:]:
        thing.modifiers.remove(extra)
    last = len(thing.modifiers) - 1
    thing.modifiers.move(thing.modifiers.find(modifier.name), last)
    if old is not None and old != group and not old.users:
        bpy.data.node_groups.remove(old)
    group.name = f"RoSy {thing.name}"


def _take_off(thing: bpy.types.Object) -> int:
    """Remove RoSy's modifiers from an object; how many node groups went with them."""
    own = [modifier for modifier in thing.modifiers if is_rosy_modifier(modifier)]
    groups = {modifier.node_group for modifier in own}
    for modifier in own:
        thing.modifiers.remove(modifier)
    return sum(delete_made(group) for group in groups if not group.users)


def delete_made(datablock: bpy.types.ID | None) -> int:
    """Delete a datablock that RoSy made; 1 if it was one."""
    if datablock is None or not datablock.get(MADE, True):
        return 0
    bpy.data.batch_remove([datablock])
    return 1


def _remember(
    scene: bpy.types.Scene,
    shot: Shot,
    image: bpy.types.Image,
    material: bpy.types.Material,
    matrices: dict[bpy.types.Object, np.ndarray | None],
) -> None:
    """Record a picture, and replace the older one from the same camera."""
    record = _record_of(scene, shot.camera.name, image, material)
    record.frames = ""
    record.height, record.width = shot.picture.rgba.shape[:2]
    record.look = _look_state(look_of(scene.rosy))
    record.camera_state = (
        _camera_state(scene, shot.camera_object) if shot.camera_object is not None else ""
    )
    record.objects.clear()
    for thing, matrix in matrices.items():
        entry = record.objects.add()
        entry.name = thing.name
        entry.matrix = (np.zeros(16) if matrix is None else matrix.ravel()).tolist()
        entry.state = _object_state(thing, fresh=True)


def _record_of(
    scene: bpy.types.Scene, name: str, image: bpy.types.Image, material: bpy.types.Material
) -> bpy.types.PropertyGroup:
    """The record of a picture's name, with a new image and material in place of older ones."""
    record = scene.rosy.bakes.get(name)
    if record is None:
        record = scene.rosy.bakes.add()
        record.name = name
    old = (record.material, record.image)
    record.image, record.material = image, material
    for before, after in zip(old, (material, image), strict=True):
        if before is not None:
            before.user_remap(after)
            delete_made(before)
            after.name = f"RoSy {name}"
    return record


def _notes(scene: bpy.types.Scene) -> list[str]:
    transform = scene.view_settings.view_transform
    if transform in FAITHFUL:
        return []
    return [f"the view transform {transform} greys the lines; Standard shows them as drawn"]


# --- is it still what would be drawn? ---------------------------------------------------------


def _why_stale(scene: bpy.types.Scene, record: bpy.types.PropertyGroup) -> str:
    if record.frames:
        return ""  # the notes beside the frames know
    if record.look != _look_state(look_of(scene.rosy)):
        return "the look was changed"
    if record.camera_state:
        camera = scene.objects.get(record.name)
        if camera is None or camera.type != "CAMERA":
            return f"camera '{record.name}' is gone"
        if record.camera_state != _camera_state(scene, camera):
            return f"camera '{record.name}' was changed"
    for entry in record.objects:
        thing = bpy.data.objects.get(entry.name)
        if thing is None:
            return f"object '{entry.name}' is gone"
        place, shape = entry.state.split(" ")
        now_place, now_shape = _object_state(thing).split(" ")
        if place != now_place:
            return f"'{entry.name}' was moved"
        if shape != now_shape:
            return f"the mesh or field of '{entry.name}' was changed"
    return ""


def _look_state(look: Look) -> str:
    return json.dumps(asdict(look))


def _camera_state(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """All that decides what a camera sees, as text."""
    data, render = camera.data, scene.render
    lens = [
        round(value, 5) if isinstance(value, float) else value
        for value in (getattr(data, name) for name in _LENS)
    ]
    aspect = (render.resolution_x * render.pixel_aspect_x) / (
        render.resolution_y * render.pixel_aspect_y
    )
    return json.dumps([_rounded(camera.matrix_world), lens, round(aspect, 5)])


_LENS = (
    "type",
    "lens",
    "sensor_fit",
    "sensor_width",
    "sensor_height",
    "ortho_scale",
    "shift_x",
    "shift_y",
    "clip_start",
    "clip_end",
)


def _rounded(matrix: Iterable[Iterable[float]]) -> list[float]:
    return [round(value, 5) + 0.0 for row in matrix for value in row]


def _object_state(thing: bpy.types.Object, fresh: bool = False) -> str:
    """Digests of an object's place and of its mesh with the field, two words."""
    place = zlib.crc32(json.dumps(_rounded(thing.matrix_world)).encode())
    return f"{place:08x} {_mesh_state(thing.data, fresh)}"


def _mesh_state(mesh: bpy.types.Mesh, fresh: bool = False) -> str:
    key = mesh.as_pointer()
    now = time.monotonic()
    if not fresh and key in _seen_states and now - _seen_states[key][0] < PATIENCE:
        return _seen_states[key][1]
    name = attribute_name(mesh)
    digest = zlib.crc32(f"{name} {field_degree(mesh)}".encode())
    if not mesh.is_editmode:
        for source in (mesh.attributes.get("position"), mesh.attributes.get(name)):
            digest = zlib.crc32(_bytes(source), digest)
    state = f"{digest:08x}" if not mesh.is_editmode else "editing"
    if len(_seen_states) > 256:
        _seen_states.clear()
    _seen_states[key] = (now, state)
    return state


def _bytes(attribute: bpy.types.Attribute | None) -> bytes:
    if attribute is None or attribute.data_type not in ("FLOAT_VECTOR", "FLOAT"):
        return b""
    vector = attribute.data_type == "FLOAT_VECTOR"
    values = np.empty(len(attribute.data) * (3 if vector else 1), dtype=np.float32)
    attribute.data.foreach_get("vector" if vector else "value", values)
    return values.tobytes()


_seen_states: dict[int, tuple[float, str]] = {}
