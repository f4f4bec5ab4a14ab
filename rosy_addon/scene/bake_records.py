"""Records of baked pictures in ``scene.rosy.bakes``: store, list and remove them.

A record holds the image, the material, the camera, and the state of the scene when the picture was drawn.
An object that was appended from another file may show a picture for which this file has no record.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import bpy
import numpy as np
from bpy.types import ID, Collection, Image, Material, Object, PropertyGroup, Scene

from ..annotation.key_contents import PictureKey
from ..compositor.look import Look
from ..core.errors import RosyError
from ..projection.camera import Camera
from .cameras import FRAME_CAMERAS, CameraSource, frame_camera
from .datablocks import (
    INK_TAG,
    delete_owned,
    delete_unused,
    removable_modifiers,
    remove_picture_modifiers,
    rosy_modifiers,
)
from .keys import update_camera_planes
from .look_properties import read_look
from .picture_nodes import (
    has_applied_picture,
    image_node,
    projections_of_group,
    remove_applied_picture,
    shown_materials,
)
from .picture_state import PictureState, SceneState
from .read_view import scene_depsgraph
from .staleness import SCENE_STATES, difference

#: Prefix of the names of RoSy's images and materials. The name of the camera follows.
NAME_PREFIX = "RoSy "

#: Value of `RosyBake.view` in the records of textures.
TEXTURE_VIEW = "texture"


#: An empty key: the legend of a picture in which there is nothing to explain.
NO_KEY = PictureKey()


@dataclass(frozen=True)
class BakeInfo:
    """A baked picture in a scene, as listed for the user.

    Attributes
    ----------
    camera : str
        Name of the camera, or ``3D View``; for a texture, the name of the object.
    width, height : int
        Pixels.
    image : bpy.types.Image
    is_shown : bool
        Whether any object shows the picture.
    frame_range : str
        First and last frame of a sequence. Empty for a single picture.
    stale_reason : str
        Why the picture is out of date. Empty if it is up to date, as far as is known.
    unknown_reason : str
        Why it is not known whether the picture is up to date. Empty if it is known.
    is_texture : bool
        Whether it is a texture of an object.
    """

    camera: str
    width: int
    height: int
    image: Image
    is_shown: bool
    frame_range: str = ""
    stale_reason: str = ""
    unknown_reason: str = ""
    is_texture: bool = False


class RemovalCounts(NamedTuple):
    """The number of objects from which pictures were removed, and the number of deleted images."""

    objects: int
    images: int


def store_record(
    scene: Scene,
    name: str,
    image: Image,
    material: Material,
    source: CameraSource | None,
    states: Mapping[int | None, PictureState],
    size: tuple[int, int],
    key: PictureKey = NO_KEY,
) -> None:
    """Store the record of a picture, sequence or texture. It replaces an earlier record of the same source.

    Parameters
    ----------
    scene : bpy.types.Scene
    name : str
        Name of the camera. For a sequence from several cameras it is the name of the scene, and for a texture
        the name of its object.
    image : bpy.types.Image
    material : bpy.types.Material
    source : bpy.types.Object, Camera or None
        The camera; None for a sequence from the cameras that render the frames. For a texture, the mesh object.
    states : mapping of int or None to PictureState
        The state of the scene from which each frame was drawn, by frame number. A single picture has one
        state, with the key None. `PictureState.device` is the device that drew the picture.
    size : (int, int)
        Width and height in pixels.
    key : PictureKey
        Contents of the key (the legend) of the picture.
    """
    record = _find_or_add_record(scene, name, source)
    _replace_datablocks(record, image, material)
    record.frames = "" if None in states else f"{min(states)} to {max(states)}"
    record.width, record.height = size
    record.key = key.to_json()
    record.state = ""
    record.frame_states.clear()
    for frame, state in states.items():
        if frame is None:
            record.state = state.to_json()
        else:
            entry = record.frame_states.add()
            entry.name, entry.state = str(frame), state.to_json()


def _find_or_add_record(scene: Scene, name: str, source: CameraSource | None) -> PropertyGroup:
    """Return the record of a camera, scene or textured object, and create it if missing. Update its name."""
    records = scene.rosy.bakes
    camera, view, record = None, "", None
    if isinstance(source, Object) and source.type == "MESH":
        view, record = TEXTURE_VIEW, _find_texture_record(scene, source) or records.add()
    elif source is None:
        view = FRAME_CAMERAS
        record = next((entry for entry in records if entry.view == view), None)
    elif isinstance(source, Camera):
        view = _view_to_json(source)
    else:
        camera = source
        record = next((entry for entry in records if entry.camera == camera), None)
    record = record or records.get(name) or records.add()
    record.name, record.camera, record.view = name, camera, view
    return record


def _find_texture_record(scene: Scene, obj: Object) -> PropertyGroup | None:
    """Return the record of a texture that only this object shows; None if there is none.

    A copy of an object shows the same texture, until the object or the copy is baked again.
    """
    for record in scene.rosy.bakes:
        if record.view == TEXTURE_VIEW:
            objects = _texture_objects(record)
            if objects == [obj] or (not objects and record.name == obj.name):
                return record
    return None


def _texture_objects(record: PropertyGroup) -> list[Object]:
    """Return the objects whose modifier has the texture of a record, sorted by name."""
    objects = [
        obj.parent if obj.get(INK_TAG) else obj
        for obj in bpy.data.objects
        if obj.users_collection
        and any(
            record.material in projections_of_group(modifier.node_group)
            for modifier in rosy_modifiers(obj)
        )
    ]
    return sorted(objects, key=lambda obj: obj.name)


def _replace_datablocks(record: PropertyGroup, image: Image, material: Material) -> None:
    """Set the image and material of a record. Delete its earlier ones, unless another record uses them."""
    old_datablocks = (record.material, record.image)
    record.image, record.material = image, material
    for old_datablock, new_datablock in zip(old_datablocks, (material, image), strict=True):
        if old_datablock is not None and not _is_recorded(old_datablock):
            old_datablock.user_remap(new_datablock)
            delete_owned(old_datablock)
            new_datablock.name = f"{NAME_PREFIX}{record.name}"


def camera_name(record: PropertyGroup) -> str:
    """Return the present name of the camera of a record.

    For a sequence from several cameras it is the name of the scene, and for a texture the name of its object.
    """
    if record.view == FRAME_CAMERAS:
        return record.id_data.name
    if record.view == TEXTURE_VIEW:
        objects = _texture_objects(record)
        return objects[0].name if objects else record.name
    return record.name if record.camera is None else record.camera.name


def _view_to_json(camera: Camera) -> str:
    matrices = camera.view.tolist(), camera.projection.tolist()
    return json.dumps([*matrices, camera.width, camera.height, camera.name])


def _view_from_json(text: str) -> Camera:
    view, projection, *others = json.loads(text)
    return Camera(np.array(view), np.array(projection), *others)


def _is_recorded(datablock: ID | None) -> bool:
    """Return whether any record uses an image or material.

    Copies of a scene have records of the same images.
    """
    return any(datablock in (record.image, record.material) for record in _all_records())


def _all_records() -> list[PropertyGroup]:
    """Return the records of all scenes."""
    return [record for scene in bpy.data.scenes for record in scene.rosy.bakes]


def recorded_materials(*, textures: bool = True) -> set[Material]:
    """Return the materials of the recorded pictures of all scenes, and of textures if `textures` is true."""
    records = _all_records()
    return {record.material for record in records if textures or record.view != TEXTURE_VIEW}


def list_bakes(
    scene: Scene, *, for_panel: bool = False, automatic_device: Callable[[Look], str] | None = None
) -> list[BakeInfo]:
    """Return the pictures on the objects of a scene, sorted by camera name.

    Parameters
    ----------
    scene : bpy.types.Scene
    for_panel : bool
        Whether the state of the scene may be a cached one, as panels are redrawn often; see
        `SceneStateCache`.
    automatic_device : callable, optional
        Returns the device, "cpu" or "gpu", that would draw a look now if the scene's device is "auto". By
        default, the device that drew the picture is assumed.
    """
    recorded = [record for record in scene.rosy.bakes if record.image is not None]
    shown = {material for obj in baked_objects(scene) for material in shown_materials(obj)}
    state = None
    if recorded and for_panel:
        state = SCENE_STATES.get(scene, scene_depsgraph(scene))
    elif recorded:
        state = SceneState(scene, scene_depsgraph(scene), {})
    elif for_panel:
        SCENE_STATES.clear()
    infos = [
        BakeInfo(
            camera_name(record),
            record.width,
            record.height,
            record.image,
            record.material in shown,
            record.frames,
            is_texture=record.view == TEXTURE_VIEW,
            **_present_reason(record, state, automatic_device),
        )
        for record in recorded
    ]
    for material in shown - {record.material for record in scene.rosy.bakes}:
        node = image_node(material)
        if node is not None and node.image is not None:
            name = material.name.removeprefix(NAME_PREFIX)
            note = "baked in another file or scene"
            infos.append(BakeInfo(name, *node.image.size, node.image, True, unknown_reason=note))
    return sorted(infos, key=lambda info: info.camera)


def _present_reason(
    record: PropertyGroup, state: SceneState, automatic_device: Callable[[Look], str] | None
) -> dict[str, str]:
    """Return why a picture is out of date, or why this is not known, as a keyword argument of `BakeInfo`.

    Parameters
    ----------
    record : bpy.types.PropertyGroup
        The record of the picture.
    state : SceneState
        The present state of its scene.
    automatic_device : callable or None
        Returns the device that draws a look if the scene's device is "auto". None: the device that drew the
        picture is assumed.

    Returns
    -------
    dict of str to str
        One item, with the key ``stale_reason`` or ``unknown_reason``. An empty ``stale_reason`` says that the
        picture is up to date.
    """
    scene = record.id_data
    text, frame = record.state, scene.frame_current
    if record.frames and record.frame_states:
        entry = record.frame_states.get(str(frame))
        if entry is None or scene.frame_subframe:
            return {"unknown_reason": f"frame {frame} was not drawn"}
        text = entry.state
    recorded = PictureState.from_json(text)
    if recorded is None:
        return {"unknown_reason": "baked with another version of RoSy"}
    depsgraph = scene_depsgraph(scene)
    if record.view == TEXTURE_VIEW:
        objects = _texture_objects(record)
        if not objects:
            return {"unknown_reason": f"object '{record.name}' does not show it any more"}
        present = state.texture_state(scene, depsgraph, objects[0])
        return {"stale_reason": difference(recorded, present, f"the UV map of '{objects[0].name}'")}
    try:
        source = record.camera
        if record.view:
            is_frame_camera = record.view == FRAME_CAMERAS
            source = frame_camera(scene, frame) if is_frame_camera else _view_from_json(record.view)
    except RosyError as error:  # there is no camera at all
        return {"stale_reason": str(error)}
    if not record.view and (source is None or not source.users_collection):
        return {"stale_reason": f"camera '{camera_name(record)}' was deleted"}
    present = state.picture_state(scene, depsgraph, source, bool(record.frames))
    if present.device == "auto":
        device = automatic_device(read_look(scene.rosy)) if automatic_device else recorded.device
        present = replace(present, device=device)
    return {"stale_reason": difference(recorded, present, f"camera '{source.name}'")}


def has_pictures(scene: Scene) -> bool:
    """Return whether there is anything for `remove_bakes` to remove.

    Appended objects may show a picture that has no record. If the user has deleted an image, a record
    without an image is left.
    """
    return bool(scene.rosy.bakes or baked_objects(scene))


def baked_objects(scene: Scene) -> list[Object]:
    """Return the objects with a picture that belong to a scene, including objects of instanced collections.

    Objects that are in no scene are included too, so that their pictures can be removed.
    """
    baked = [
        obj for obj in bpy.data.objects if removable_modifiers(obj) or has_applied_picture(obj.data)
    ]
    if not baked:  # the common case when a panel is redrawn before the first bake
        return []
    own = _reached_objects(scene)
    others = {obj for other in bpy.data.scenes if other != scene for obj in _reached_objects(other)}
    return [obj for obj in baked if obj in own or obj not in others]


def _reached_objects(scene: Scene) -> set[Object]:
    """Return the objects of a scene, and the objects of all collections that these objects instance."""
    reached: set[Object] = set()

    def add_objects(collection: Collection) -> None:
        for obj in collection.all_objects:
            if obj not in reached:
                reached.add(obj)
                if obj.instance_collection is not None:
                    add_objects(obj.instance_collection)

    add_objects(scene.collection)
    return reached


def remove_bakes(scene: Scene) -> RemovalCounts:
    """Remove baked pictures, backdrops and keys (legends) from a scene. Fields and saved files are kept."""
    objects = baked_objects(scene)
    # A picture that the user has applied, by applying RoSy's modifier, cannot be removed in edit mode.
    is_editing = bpy.context.mode == "EDIT_MESH" and any(
        obj.mode == "EDIT" and has_applied_picture(obj.data) for obj in objects
    )
    if is_editing:
        bpy.ops.object.mode_set(mode="OBJECT")
    try:
        for obj in objects:
            remove_applied_picture(obj.data)
            remove_picture_modifiers(obj)
    finally:
        if is_editing:
            bpy.ops.object.mode_set(mode="EDIT")
    _clean_unused_meshes()
    image_count = _remove_records(scene)
    update_camera_planes(scene)
    return RemovalCounts(len(objects), image_count + delete_unused())


def _clean_unused_meshes() -> None:
    """Remove the materials and attributes of pictures from meshes that no object uses.

    Such a mesh has them if the user applied RoSy's modifier to an object that no longer uses the mesh.
    """
    used_data = {obj.data for obj in bpy.data.objects}
    for mesh in bpy.data.meshes:
        if mesh not in used_data:
            remove_applied_picture(mesh)


def _remove_records(scene: Scene) -> int:
    """Remove all records of a scene, and their images and materials. Return the number of deleted images."""
    datablocks = [(record.image, record.material, record.camera) for record in scene.rosy.bakes]
    scene.rosy.bakes.clear()
    image_count = 0
    for image, material, camera in datablocks:
        if not _is_recorded(material):
            delete_owned(material)
        image_count += 0 if _is_recorded(image) else delete_owned(image)
        # A camera that the user has deleted still exists while a record refers to it. `users` does not
        # count every reference, so the users are looked up.
        if camera is not None and not bpy.data.user_map(subset={camera})[camera]:
            bpy.data.objects.remove(camera)
    return image_count
