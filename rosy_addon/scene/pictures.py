"""Baked pictures in a scene: apply them to objects, list them and remove them.

There is one image and one material for each camera. An object shows a picture through a modifier
at the end of its stack, with a node group of its own. The user's mesh, material slots and modifiers
are not changed. Datablocks that RoSy creates have the custom property ``rosy_made``. The records in
``scene.rosy.bakes`` store what each picture was drawn from.

A picture is projected onto the shape at the time of the bake. It moves with an object that is
transformed, and slides over one that deforms.
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
from .blender_images import check_folder, load_sequence, new_image
from .compat import is_editable
from .field_attributes import attribute_name, field_degree
from .look_properties import read_look
from .picture_nodes import material_of_group, new_group, new_material, set_sequence_frames
from .scene_reader import OWNED_TAG, SceneData, is_rosy_modifier

#: Name of the modifier that shows a picture.
MODIFIER_NAME = "RoSy"

#: View transforms that do not change the colors of a picture.
NEUTRAL_VIEW_TRANSFORMS = ("Standard", "Raw")

#: Seconds for which the cached state of a mesh is used before it is computed again.
STATE_TTL_SECONDS = 1.0


@dataclass(frozen=True)
class OutputSettings:
    """How pictures are stored and shown in a scene.

    Attributes
    ----------
    window_coordinates : bool
        Map the picture by window coordinates instead of the baked projection.
    emission, diffuse : float
        Strength of the picture as emission, and its factor as a diffuse color.
    as_float : bool
        Store linear float values instead of 8-bit sRGB.
    folder : Path or None
        Folder to save images in. None packs them into the .blend file.
    device : {"cpu", "gpu", "auto"}
        Device that draws the pictures.
    """

    window_coordinates: bool = False
    emission: float = 1.0
    diffuse: float = 0.0
    as_float: bool = False
    folder: Path | None = None
    device: str = "cpu"


@dataclass(frozen=True, eq=False)
class BakeResult:
    """The result of a bake from one camera.

    Attributes
    ----------
    camera : str
        Name of the camera, or ``3D View``.
    image : bpy.types.Image
    material : bpy.types.Material
    objects : tuple of bpy.types.Object
        The objects that show the picture.
    picture : Picture
    warnings : tuple of str
        Messages for the user.
    """

    camera: str
    image: bpy.types.Image
    material: bpy.types.Material
    objects: tuple[bpy.types.Object, ...]
    picture: Picture
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class BakeInfo:
    """A baked picture in a scene, as listed for the user.

    Attributes
    ----------
    camera : str
        Name of the camera, or ``3D View``.
    width, height : int
        Pixels.
    image : bpy.types.Image
    stale_reason : str
        Why the picture is out of date. Empty if it is up to date.
    is_shown : bool
        Whether any object shows the picture.
    frame_range : str
        First and last frame of a sequence. Empty for a single picture.
    """

    camera: str
    width: int
    height: int
    image: bpy.types.Image
    stale_reason: str
    is_shown: bool
    frame_range: str = ""


@dataclass(frozen=True)
class RemovalCounts:
    """Numbers of what was removed from a scene.

    Attributes
    ----------
    objects : int
        Objects whose modifier was removed.
    images, materials, node_groups : int
        Datablocks that were deleted.
    """

    objects: int = 0
    images: int = 0
    materials: int = 0
    node_groups: int = 0


@dataclass(frozen=True, eq=False)
class RenderedView:
    """A picture and the camera that it was drawn from.

    Attributes
    ----------
    picture : Picture
    camera : Camera
    camera_object : bpy.types.Object or None
        None for a 3D view.
    """

    picture: Picture
    camera: Camera
    camera_object: bpy.types.Object | None = None


def read_output_settings(scene: bpy.types.Scene) -> OutputSettings:
    """Return the output settings that are stored in a scene.

    Raises
    ------
    RosyError
        See `output_folder`.
    """
    properties = scene.rosy
    folder = output_folder(scene) if properties.store == "SAVED" else None
    return OutputSettings(
        window_coordinates=properties.placement == "WINDOW",
        emission=properties.emission,
        diffuse=properties.diffuse,
        as_float=properties.image_format == "FLOAT",
        folder=folder,
        device=properties.device.lower(),
    )


def output_folder(scene: bpy.types.Scene) -> Path:
    """Return the folder in which the pictures of a scene are saved.

    Raises
    ------
    RosyError
        If the folder is relative to the .blend file, and this was never saved.
    """
    directory = scene.rosy.directory
    if directory.startswith("//") and not bpy.data.filepath:
        raise RosyError(f"{directory}: save the .blend file first, or choose an absolute path")
    return Path(bpy.path.abspath(directory))


def check_targets(objects: Iterable[bpy.types.Object], settings: OutputSettings) -> None:
    """Check that pictures can be applied to objects. Call this before a long task.

    Raises
    ------
    RosyError
        If an object is linked from a library without an override, or the folder for images cannot
        be written.
    """
    for obj in objects:
        if not is_editable(obj):
            library = obj.library.filepath if obj.library else "its library"
            raise RosyError(
                f"object '{obj.name}' is linked from {library} and cannot get a modifier: make a "
                "library override of it, or make it local"
            )
    if settings.folder is not None:
        check_folder(settings.folder)


def apply_picture(
    scene: bpy.types.Scene,
    scene_data: SceneData,
    rendered_view: RenderedView,
    settings: OutputSettings | None = None,
) -> BakeResult:
    """Apply a picture to the objects that it shows. An older one from the same camera is replaced.

    If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    scene_data : SceneData
        The mesh instances that the picture was drawn from, and their objects.
    rendered_view : RenderedView
    settings : OutputSettings, optional
        By default those of the scene.

    Raises
    ------
    RosyError
        See `check_targets`.
    """
    settings = read_output_settings(scene) if settings is None else settings
    objects = list(dict.fromkeys(scene_data.objects))
    check_targets(objects, settings)
    name = rendered_view.camera.name
    matrices = _object_to_clip_matrices(scene_data, rendered_view.camera)
    with rollback_on_error() as created:
        image = new_image(
            f"RoSy {name}",
            rendered_view.picture,
            as_float=settings.as_float,
            folder=settings.folder,
        )
        created.append(image)
        material = new_material(
            f"RoSy {name}",
            image,
            rendered_view.camera.projection @ rendered_view.camera.view,
            window_coordinates=settings.window_coordinates,
            emission=settings.emission,
            diffuse=settings.diffuse,
        )
        created.append(material)
        node_groups = []
        for obj in objects:
            node_groups.append(new_group(f"RoSy {obj.name}", material, matrices[obj]))
            created.append(node_groups[-1])
    for obj, node_group in zip(objects, node_groups, strict=True):
        _set_picture_modifier(obj, node_group)
    _store_record(scene, rendered_view, image, material, matrices)
    return BakeResult(
        name,
        image,
        material,
        tuple(objects),
        rendered_view.picture,
        tuple(_display_warnings(scene)),
    )


@contextmanager
def rollback_on_error() -> Iterator[list[bpy.types.ID]]:
    """Yield a list to which new datablocks are appended.

    At the end they are tagged as created by RoSy. If an error is raised, they are deleted instead.
    """
    created: list[bpy.types.ID] = []
    try:
        yield created
        for datablock in created:
            datablock[OWNED_TAG] = True
    except BaseException:
        for datablock in reversed(created):
            delete_owned(datablock)
        raise


@dataclass(frozen=True)
class ImageSequence:
    """An image sequence on disk.

    Attributes
    ----------
    name : str
        Name of the camera, or of the scene if the camera changes between frames.
    path : Path
        File of the first frame.
    first, last : int
        Frame numbers, both included.
    width, height : int
        Pixels.
    """

    name: str
    path: Path
    first: int
    last: int
    width: int
    height: int


def apply_sequence(
    scene: bpy.types.Scene,
    scene_data: SceneData,
    sequence: ImageSequence,
    camera: Camera,
    settings: OutputSettings,
) -> None:
    """Apply an image sequence to the objects of a scene. An older one of the same name is replaced.

    The pictures are mapped by window coordinates, so they fill the frame of the rendering camera.
    Each is shown at its own frame. Any machine that has the files can show them without RoSy.
    """
    with rollback_on_error() as created:
        image = load_sequence(sequence.path, settings.as_float)
        created.append(image)
        image.name = f"RoSy {sequence.name}"
        material = new_material(
            image.name,
            image,
            camera.projection @ camera.view,
            window_coordinates=True,
            emission=settings.emission,
            diffuse=settings.diffuse,
        )
        created.append(material)
        set_sequence_frames(material, sequence.first, sequence.last)
        objects = list(dict.fromkeys(scene_data.objects))
        node_groups = [new_group(f"RoSy {obj.name}", material, None) for obj in objects]
        created += node_groups
    for obj, node_group in zip(objects, node_groups, strict=True):
        _set_picture_modifier(obj, node_group)
    record = _update_record(scene, sequence.name, image, material)
    record.width, record.height = sequence.width, sequence.height
    record.frames = f"{sequence.first} to {sequence.last}"
    record.look, record.camera_state = _look_state(read_look(scene.rosy)), ""
    record.objects.clear()
    for obj in objects:
        entry = record.objects.add()
        entry.name = obj.name


def show_bake(scene: bpy.types.Scene, camera: str) -> None:
    """Show the picture that was baked from a camera on its objects.

    Parameters
    ----------
    scene : bpy.types.Scene
    camera : str
        Name of a camera, as in `list_bakes`.

    Raises
    ------
    RosyError
        If no picture was baked from this camera.
    """
    record = scene.rosy.bakes.get(camera)
    if record is None:
        names = ", ".join(f"'{other.name}'" for other in scene.rosy.bakes) or "none"
        raise RosyError(f"no picture was baked from camera '{camera}', only from {names}")
    for entry in record.objects:
        obj = scene.objects.get(entry.name) or bpy.data.objects.get(entry.name)
        if obj is None or not is_editable(obj):
            continue
        matrix = np.array(entry.matrix).reshape(4, 4)
        node_group = new_group(
            f"RoSy {obj.name}", record.material, matrix if matrix.any() else None
        )
        node_group[OWNED_TAG] = True
        _set_picture_modifier(obj, node_group)


def remove_bakes(
    scene: bpy.types.Scene, objects: Sequence[bpy.types.Object] | None = None
) -> RemovalCounts:
    """Remove baked pictures from a scene. Fields and files of saved pictures are kept.

    Parameters
    ----------
    scene : bpy.types.Scene
    objects : sequence of bpy.types.Object, optional
        Remove the pictures from these objects only. An image and its material are deleted when no
        object is left. By default all pictures are removed.
    """
    records = scene.rosy.bakes
    recorded_names = {entry.name for record in records for entry in record.objects}
    baked_objects = [
        obj
        for obj in bpy.data.objects
        if (obj.name in recorded_names or obj.name in scene.objects)
        and any(map(is_rosy_modifier, obj.modifiers))
    ]
    targets = baked_objects if objects is None else [obj for obj in objects if obj in baked_objects]
    node_groups = 0
    for obj in targets:
        node_groups += _remove_picture_modifiers(obj)
    for record in records:
        for index in reversed(range(len(record.objects))):
            if record.objects[index].name in {obj.name for obj in targets}:
                record.objects.remove(index)
    images = materials = 0
    for index in reversed(range(len(records))):
        if objects is None or not records[index].objects:
            image, material = records[index].image, records[index].material
            records.remove(index)
            materials += delete_owned(material)
            images += delete_owned(image)
    return RemovalCounts(len(targets), images, materials, node_groups)


def list_bakes(scene: bpy.types.Scene) -> list[BakeInfo]:
    """Return the baked pictures of a scene, sorted by camera name, and whether they are up to date.

    Fast enough for every redraw of a panel: the state of a mesh is cached for `STATE_TTL_SECONDS`.
    """
    infos = []
    for record in scene.rosy.bakes:
        if record.image is None:
            continue
        stale_reason, is_shown = _stale_reason(scene, record), _is_shown(record)
        size = record.width, record.height
        infos.append(
            BakeInfo(record.name, *size, record.image, stale_reason, is_shown, record.frames)
        )
    return sorted(infos, key=lambda info: info.camera)


def _is_shown(record: bpy.types.PropertyGroup) -> bool:
    """Whether any object shows the picture of a record."""
    objects = (bpy.data.objects.get(entry.name) for entry in record.objects)
    node_groups = (
        modifier.node_group
        for obj in objects
        if obj is not None
        for modifier in obj.modifiers
        if is_rosy_modifier(modifier)
    )
    return any(material_of_group(node_group) == record.material for node_group in node_groups)


def _object_to_clip_matrices(
    scene_data: SceneData, camera: Camera
) -> dict[bpy.types.Object, np.ndarray | None]:
    """Return the (4, 4) object-to-clip matrix of each object; None if it has several instances."""
    matrices: dict[bpy.types.Object, np.ndarray | None] = {}
    for instance, owner in zip(scene_data.instances, scene_data.objects, strict=False):
        is_repeated = owner in matrices
        matrices[owner] = None if is_repeated else camera.projection @ camera.view @ instance.matrix
    return matrices


def _set_picture_modifier(obj: bpy.types.Object, node_group: bpy.types.NodeTree) -> None:
    """Set the node group of RoSy's modifier, and move it to the end of the object's stack."""
    existing = [modifier for modifier in obj.modifiers if is_rosy_modifier(modifier)]
    modifier = existing[0] if existing else obj.modifiers.new(MODIFIER_NAME, "NODES")
    modifier.show_expanded = False
    old_group, modifier.node_group = modifier.node_group, node_group
    for extra in existing[1:]:
        obj.modifiers.remove(extra)
    last = len(obj.modifiers) - 1
    obj.modifiers.move(obj.modifiers.find(modifier.name), last)
    if old_group is not None and old_group != node_group and not old_group.users:
        bpy.data.node_groups.remove(old_group)
    node_group.name = f"RoSy {obj.name}"


def _remove_picture_modifiers(obj: bpy.types.Object) -> int:
    """Remove RoSy's modifiers from an object, and return the number of deleted node groups."""
    existing = [modifier for modifier in obj.modifiers if is_rosy_modifier(modifier)]
    node_groups = {modifier.node_group for modifier in existing}
    for modifier in existing:
        obj.modifiers.remove(modifier)
    return sum(delete_owned(node_group) for node_group in node_groups if not node_group.users)


def delete_owned(datablock: bpy.types.ID | None) -> int:
    """Delete a datablock that RoSy created. Return the number of deleted datablocks, 0 or 1."""
    if datablock is None or not datablock.get(OWNED_TAG, True):
        return 0
    bpy.data.batch_remove([datablock])
    return 1


def _store_record(
    scene: bpy.types.Scene,
    rendered_view: RenderedView,
    image: bpy.types.Image,
    material: bpy.types.Material,
    matrices: dict[bpy.types.Object, np.ndarray | None],
) -> None:
    """Store the record of a picture. An older picture from the same camera is deleted."""
    record = _update_record(scene, rendered_view.camera.name, image, material)
    record.frames = ""
    record.height, record.width = rendered_view.picture.rgba.shape[:2]
    record.look = _look_state(read_look(scene.rosy))
    record.camera_state = (
        _camera_state(scene, rendered_view.camera_object)
        if rendered_view.camera_object is not None
        else ""
    )
    record.objects.clear()
    for obj, matrix in matrices.items():
        entry = record.objects.add()
        entry.name = obj.name
        entry.matrix = (np.zeros(16) if matrix is None else matrix.ravel()).tolist()
        entry.state = _object_state(obj, recompute=True)


def _update_record(
    scene: bpy.types.Scene, name: str, image: bpy.types.Image, material: bpy.types.Material
) -> bpy.types.PropertyGroup:
    """Return the record of a name with a new image and material. The older ones are deleted."""
    record = scene.rosy.bakes.get(name)
    if record is None:
        record = scene.rosy.bakes.add()
        record.name = name
    old_datablocks = (record.material, record.image)
    record.image, record.material = image, material
    for old_datablock, new_datablock in zip(old_datablocks, (material, image), strict=True):
        if old_datablock is not None:
            old_datablock.user_remap(new_datablock)
            delete_owned(old_datablock)
            new_datablock.name = f"RoSy {name}"
    return record


def _display_warnings(scene: bpy.types.Scene) -> list[str]:
    """Return warnings about view settings that change the colors of pictures."""
    transform = scene.view_settings.view_transform
    if transform in NEUTRAL_VIEW_TRANSFORMS:
        return []
    return [f"the view transform {transform} changes the colors of pictures: choose Standard"]


# --- whether a picture is out of date ---------------------------------------------------------


def _stale_reason(scene: bpy.types.Scene, record: bpy.types.PropertyGroup) -> str:
    """Return why a picture is out of date; empty if it is up to date."""
    if record.frames:
        return ""  # sidecar files of the frames record their state
    if record.look != _look_state(read_look(scene.rosy)):
        return "the look was changed"
    if record.camera_state:
        camera = scene.objects.get(record.name)
        if camera is None or camera.type != "CAMERA":
            return f"camera '{record.name}' was deleted"
        if record.camera_state != _camera_state(scene, camera):
            return f"camera '{record.name}' was changed"
    for entry in record.objects:
        obj = bpy.data.objects.get(entry.name)
        if obj is None:
            return f"object '{entry.name}' was deleted"
        transform_hash, mesh_state = entry.state.split(" ")
        current_transform_hash, current_mesh_state = _object_state(obj).split(" ")
        if transform_hash != current_transform_hash:
            return f"'{entry.name}' was moved"
        if mesh_state != current_mesh_state:
            return f"the mesh or field of '{entry.name}' was changed"
    return ""


def _look_state(look: Look) -> str:
    """Return a look as text."""
    return json.dumps(asdict(look))


def _camera_state(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """Return the transform and settings of a camera as text."""
    data, render = camera.data, scene.render
    values = [
        round(value, 5) if isinstance(value, float) else value
        for value in (getattr(data, name) for name in _CAMERA_PROPERTIES)
    ]
    aspect = (render.resolution_x * render.pixel_aspect_x) / (
        render.resolution_y * render.pixel_aspect_y
    )
    return json.dumps([_rounded_entries(camera.matrix_world), values, round(aspect, 5)])


#: Camera settings that change the picture.
_CAMERA_PROPERTIES = (
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


def _rounded_entries(matrix: Iterable[Iterable[float]]) -> list[float]:
    """Return the entries of a matrix by rows, rounded to 5 decimals, without negative zeros."""
    return [round(value, 5) + 0.0 for row in matrix for value in row]


def _object_state(obj: bpy.types.Object, recompute: bool = False) -> str:
    """Return two checksums as text: of an object's transform, and of its mesh and field."""
    transform_hash = zlib.crc32(json.dumps(_rounded_entries(obj.matrix_world)).encode())
    return f"{transform_hash:08x} {_mesh_state(obj.data, recompute)}"


def _mesh_state(mesh: bpy.types.Mesh, recompute: bool = False) -> str:
    """Return a checksum of a mesh and its field. It is cached for `STATE_TTL_SECONDS`."""
    key = mesh.as_pointer()
    now = time.monotonic()
    if (
        not recompute
        and key in _mesh_state_cache
        and now - _mesh_state_cache[key][0] < STATE_TTL_SECONDS
    ):
        return _mesh_state_cache[key][1]
    name = attribute_name(mesh)
    checksum = zlib.crc32(f"{name} {field_degree(mesh)}".encode())
    if not mesh.is_editmode:
        for attribute in (mesh.attributes.get("position"), mesh.attributes.get(name)):
            checksum = zlib.crc32(_attribute_bytes(attribute), checksum)
    state = f"{checksum:08x}" if not mesh.is_editmode else "editing"
    if len(_mesh_state_cache) > 256:
        _mesh_state_cache.clear()
    _mesh_state_cache[key] = (now, state)
    return state


def _attribute_bytes(attribute: bpy.types.Attribute | None) -> bytes:
    """Return the values of a float or vector attribute as bytes; empty for others."""
    if attribute is None or attribute.data_type not in ("FLOAT_VECTOR", "FLOAT"):
        return b""
    is_vector = attribute.data_type == "FLOAT_VECTOR"
    values = np.empty(len(attribute.data) * (3 if is_vector else 1), dtype=np.float32)
    attribute.data.foreach_get("vector" if is_vector else "value", values)
    return values.tobytes()


#: By the pointer of a mesh: the time of the last checksum in seconds, and the checksum.
_mesh_state_cache: dict[int, tuple[float, str]] = {}
