"""Records of baked pictures in ``scene.rosy.bakes``: store, list and remove them.

A record holds the image, the material, the objects, and the states that the picture was drawn from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from .look_properties import read_look
from .owned_data import delete_owned, delete_unused, is_rosy_modifier, removable_modifiers
from .picture_nodes import material_of_group, remove_picture_modifiers
from .staleness import camera_state, find_stale_reason, look_state, object_state


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
    """Numbers of objects and datablocks that were removed from a scene.

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


def store_record(
    scene: bpy.types.Scene,
    name: str,
    image: bpy.types.Image,
    material: bpy.types.Material,
    matrices: dict[bpy.types.Object, np.ndarray | None],
    *,
    size: tuple[int, int],
    camera: bpy.types.Object | None = None,
    frame_range: str = "",
) -> None:
    """Store the record of a picture or sequence. An older picture of the same name is deleted.

    Parameters
    ----------
    scene : bpy.types.Scene
    name : str
        Name of the camera, or of the scene for a sequence from several cameras.
    image : bpy.types.Image
    material : bpy.types.Material
    matrices : dict of bpy.types.Object to (4, 4) ndarray or None
        The objects that show the picture, and the object-to-clip matrices by which it is mapped.
    size : (int, int)
        Width and height in pixels.
    camera : bpy.types.Object, optional
        The picture is out of date if this camera changes.
    frame_range : str
        First and last frame of a sequence. The objects' states are then not stored, because the
        sidecar files of the frames record them.
    """
    record = _update_record(scene, name, image, material)
    record.frames = frame_range
    record.width, record.height = size
    record.look = look_state(read_look(scene.rosy))
    record.camera_state = "" if camera is None else camera_state(scene, camera)
    record.objects.clear()
    for obj, matrix in matrices.items():
        entry = record.objects.add()
        entry.name = obj.name
        if not frame_range:
            entry.matrix = (np.zeros(16) if matrix is None else matrix.ravel()).tolist()
            entry.state = object_state(obj, recompute=True)


def _update_record(
    scene: bpy.types.Scene, name: str, image: bpy.types.Image, material: bpy.types.Material
) -> bpy.types.PropertyGroup:
    """Return the record of a name with a new image and material.

    The older ones are deleted, unless another scene shows them.
    """
    record = scene.rosy.bakes.get(name)
    if record is None:
        record = scene.rosy.bakes.add()
        record.name = name
    old_datablocks = (record.material, record.image)
    record.image, record.material = image, material
    for old_datablock, new_datablock in zip(old_datablocks, (material, image), strict=True):
        if old_datablock is not None and not _is_recorded(old_datablock):
            old_datablock.user_remap(new_datablock)
            delete_owned(old_datablock)
            new_datablock.name = f"RoSy {name}"
    return record


def _is_recorded(datablock: bpy.types.ID | None) -> bool:
    """Whether a record of any scene has an image or material. Copies of a scene share them."""
    return any(
        datablock in (record.image, record.material)
        for scene in bpy.data.scenes
        for record in scene.rosy.bakes
    )


def list_bakes(scene: bpy.types.Scene) -> list[BakeInfo]:
    """Return the baked pictures of a scene, sorted by camera name, and whether they are up to date.

    Fast enough for every redraw of a panel: the state of a mesh is cached for `STATE_TTL_SECONDS`.
    """
    infos = []
    for record in scene.rosy.bakes:
        if record.image is None:
            continue
        stale_reason, is_shown = find_stale_reason(scene, record), _is_shown(record)
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


def has_pictures(scene: bpy.types.Scene) -> bool:
    """Whether there is anything for `remove_bakes` to remove.

    A picture may have no record, as on appended objects, and a record no image, if the user deleted
    it.
    """
    return bool(scene.rosy.bakes or _baked_objects(scene))


def _baked_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects of a scene, and of the collections that it instances, with pictures."""
    reached: dict[bpy.types.Object, None] = {}

    def add_objects(collection: bpy.types.Collection) -> None:
        for obj in collection.all_objects:
            if obj not in reached:
                reached[obj] = None
                if obj.instance_collection is not None:
                    add_objects(obj.instance_collection)

    add_objects(scene.collection)
    return [obj for obj in reached if removable_modifiers(obj)]


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
    baked_objects = _baked_objects(scene)
    targets = baked_objects if objects is None else [obj for obj in objects if obj in baked_objects]
    node_groups = 0
    for obj in targets:
        node_groups += remove_picture_modifiers(obj)
    for record in records:
        for index in reversed(range(len(record.objects))):
            if record.objects[index].name in {obj.name for obj in targets}:
                record.objects.remove(index)
    images = materials = 0
    for index in reversed(range(len(records))):
        if objects is None or not records[index].objects:
            image, material = records[index].image, records[index].material
            records.remove(index)
            materials += 0 if _is_recorded(material) else delete_owned(material)
            images += 0 if _is_recorded(image) else delete_owned(image)
    delete_unused()
    return RemovalCounts(len(targets), images, materials, node_groups)
