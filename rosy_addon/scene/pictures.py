"""Apply baked pictures and textures to objects: the image, the material and the modifiers that show it.

There is one image and one material for each camera, and for each texture. An object shows a picture by a
modifier at the end of its stack, with a node group of its own. The user's mesh, material slots and modifiers
are not changed. Datablocks that RoSy creates have the custom property ``rosy_made``. The records in
``scene.rosy.bakes`` store what each picture was drawn from.

A picture is projected onto the shape at the time of the bake. It moves with an object that is
transformed, and slides over one that deforms. A texture is mapped by a UV map, and stays in place.
"""

import glob
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from bpy.types import Image, Material, NodeTree, Object, Scene

from ..annotation.key_contents import PictureKey
from ..compositor.look import Look, has_clear_paper
from ..compositor.picture import Picture
from ..compositor.picture_key import picture_key
from ..core.errors import RosyError
from ..core.file_io import check_folder, check_writable
from ..image_io.image_data import ImageData, image_size
from ..projection.camera import Camera
from ..rendering.view_input import ViewInput
from ..surface_texture.draw import TextureImages, TextureSettings
from . import datablocks, picture_nodes, texture_nodes
from .bake_records import (
    NAME_PREFIX,
    baked_objects,
    camera_name,
    recorded_materials,
    store_record,
)
from .blender_images import image_path, load_sequence, new_image, new_tiled_image
from .cameras import CameraSource
from .files import output_folder, picture_stem
from .ink_objects import find_ink_object, new_ink_object
from .keys import update_keys
from .picture_nodes import OutputSettings, new_group
from .picture_state import PictureState
from .scene_reader import SceneData

#: View transforms of Blender's color management that do not change the colors of a picture.
NEUTRAL_VIEW_TRANSFORMS = ("Standard", "Raw")


@dataclass(frozen=True, eq=False)
class BakeResult:
    """A picture that was baked from one camera.

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
    image: Image
    material: Material
    objects: tuple[Object, ...]
    picture: Picture
    warnings: tuple[str, ...]


def read_output_settings(scene: Scene, folder: Path | None = None) -> OutputSettings:
    """Return the output settings that are stored in a scene.

    Parameters
    ----------
    scene : bpy.types.Scene
    folder : Path, optional
        Folder in which images are saved. By default, the settings of the scene decide.

    Raises
    ------
    RosyError
        If images are to be saved and the scene has no valid folder; see `output_folder`.
    """
    properties = scene.rosy
    if folder is None and properties.store == "SAVED":
        folder = output_folder(scene)
    return OutputSettings(
        window_coordinates=properties.placement == "WINDOW",
        emission=properties.emission,
        diffuse=properties.diffuse,
        as_float=properties.image_format == "FLOAT",
        folder=folder,
        device=properties.device.lower(),
        relight=properties.relight,
        over_material=properties.over_material,
    )


def check_targets(objects: Iterable[Object], settings: OutputSettings) -> None:
    """Check that pictures can be applied to objects. It is called before they are drawn.

    Raises
    ------
    RosyError
        If an object is linked from a library without an override, or the folder for images cannot
        be written.
    """
    for obj in objects:
        if not datablocks.is_editable(obj):
            library = obj.library.filepath if obj.library else "its library"
            raise RosyError(
                f"object '{obj.name}' is linked from {library} and cannot get a modifier: make a "
                "library override of it, or make it local"
            )
    if settings.folder is not None:
        check_folder(settings.folder)


def check_files(
    settings: OutputSettings, names: Iterable[str], kind: str = "camera", *, is_udim: bool = False
) -> None:
    """Check that the files of pictures can be replaced, if they exist. It is called before they are drawn.

    Parameters
    ----------
    settings : OutputSettings
    names : iterable of str
        Names of the cameras or, if `kind` is not "camera", of the objects; see `picture_stem`.
    kind : str
    is_udim : bool
        Whether the pictures have UDIM tiles. All files that may be tiles are checked.

    Raises
    ------
    RosyError
        If a file is an input, is not a regular file, or is not writable.
    """
    for name in names if settings.folder is not None else ():
        path = image_path(_image_stem(settings, name, kind), settings.as_float)
        pattern = glob.escape(path.stem) + ".[0-9]*" * is_udim + path.suffix
        for existing in path.parent.glob(pattern):
            check_writable(existing)


def apply_picture(
    scene: Scene,
    scene_data: SceneData,
    settings: OutputSettings,
    view: ViewInput,
    picture: Picture,
    image_data: ImageData,
    source: CameraSource,
    state: PictureState,
) -> BakeResult:
    """Apply a picture to the objects that it shows. It replaces an earlier picture from the same camera.

    If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    scene_data : SceneData
        The mesh instances that the picture was drawn from, and their objects. The objects have passed
        `check_targets`.
    settings : OutputSettings
    view : ViewInput
        The input that the picture was drawn from.
    picture : Picture
    image_data : ImageData
        The picture, converted for the output settings.
    source : bpy.types.Object or Camera
        The camera that the view was read from.
    state : PictureState
        The state of the scene that the picture was drawn from.

    Raises
    ------
    RosyError
        If the image cannot be saved.
    """
    camera = view.camera
    hatching = (
        texture_nodes.Hatching(view.look, picture.line_count) if view.draws_thresholds else None
    )
    name, stem = f"{NAME_PREFIX}{camera.name}", _image_stem(settings, camera.name)
    with datablocks.rollback_on_error() as track:
        image = track(new_image(name, image_data, is_color=hatching is None, stem=stem))
        material = picture_nodes.new_material(image, camera, track, settings, view.look, hatching)
        matrices = _clip_matrices(scene_data, camera)
        is_over = settings.over_material and has_clear_paper(view.look)
        node_groups = _new_groups(material, matrices, track, is_over=is_over)
    size, key = image_size(image_data), picture_key(view.look, picture)
    store_record(scene, camera.name, image, material, source, {None: state}, size, key)
    _show_on_objects(node_groups)
    _remove_from_others(material, node_groups)
    warnings = (*scene_data.warnings, *_display_warnings(scene))
    return BakeResult(camera.name, image, material, tuple(matrices), picture, warnings)


def apply_sequence(
    scene: Scene,
    scene_data: SceneData,
    name: str,
    path: Path,
    camera: Camera,
    settings: OutputSettings,
    source: CameraSource | None,
    states: Mapping[int, PictureState],
    look: Look,
    key: PictureKey,
) -> None:
    """Apply an image sequence to the objects of a scene. It replaces an earlier sequence of the same name.

    The pictures are mapped by window coordinates, so they fill the frame of the camera that renders. Each
    picture is shown at its own frame. Blender shows them without RoSy wherever the files are available.

    Parameters
    ----------
    scene : bpy.types.Scene
    scene_data : SceneData
        Its objects get the pictures.
    name : str
        Name of the camera, or of the scene if the camera changes between frames.
    path : Path
        File of the first frame.
    camera : Camera
        The camera of the last frame.
    settings : OutputSettings
    source : bpy.types.Object, Camera or None
        The camera of all frames. None: each frame was drawn from the camera that renders it.
    states : mapping of int to PictureState
        The state of the scene that each frame was drawn from.
    look : Look
        The look of the last frame.
    key : PictureKey
        Contents of the key (legend) of the pictures.
    """
    settings = replace(settings, window_coordinates=True)
    with datablocks.rollback_on_error() as track:
        image = track(load_sequence(path, settings.as_float))
        image.name = f"{NAME_PREFIX}{name}"
        material = picture_nodes.new_material(image, camera, track, settings, look)
        picture_nodes.set_sequence_frames(material, min(states), max(states))
        matrices = dict.fromkeys(scene_data.objects)
        is_over = settings.over_material and has_clear_paper(look)
        node_groups = _new_groups(material, matrices, track, is_over=is_over)
    store_record(scene, name, image, material, source, states, camera.size, key)
    _show_on_objects(node_groups)
    _remove_from_others(material, node_groups)


def apply_texture(
    scene: Scene,
    obj: Object,
    uv_map: str,
    texture: TextureImages,
    state: PictureState,
    look: Look,
    texture_settings: TextureSettings,
    settings: OutputSettings,
) -> Image:
    """Show a texture on its object, and return its image. It replaces an earlier texture of the object.

    If an error is raised, the scene is not changed.

    Parameters
    ----------
    scene : bpy.types.Scene
    obj : bpy.types.Object
    uv_map : str
        Name of the UV map.
    texture : TextureImages
        Without UDIM, only the first tile is used.
    state : PictureState
        The state of the scene that the texture was drawn from.
    look : Look
        The look of the texture.
    texture_settings : TextureSettings
        The settings with which the texture was drawn.
    settings : OutputSettings

    Raises
    ------
    RosyError
        If the file cannot be written.
    """
    name, content = f"{NAME_PREFIX}{obj.name}", texture_settings.content
    stem = _image_stem(settings, obj.name, texture_kind(content))
    first = next(iter(texture.tiles.values()))
    is_udim = texture_settings.is_udim
    create, image_data = (new_tiled_image, texture.tiles) if is_udim else (new_image, first)
    with datablocks.rollback_on_error() as track:
        image = track(create(name, image_data, is_color=not texture.is_data, stem=stem))
        is_clear = content == "look" and has_clear_paper(look)
        add_shader = partial(texture_nodes.color_shader, is_clear=is_clear)
        if content == "anisotropy":
            add_shader = partial(texture_nodes.brushed_metal_shader, uv_map=uv_map)
        elif content == "look" and texture.is_data:
            hatching = texture_nodes.Hatching(look, texture.line_count)
            add_shader = partial(texture_nodes.hatching_shader, hatching=hatching, track=track)
        material = track(texture_nodes.new_texture_material(name, image, uv_map, add_shader))
        is_over = settings.over_material and is_clear
        node_groups = _new_groups(material, {obj: None}, track, is_over=is_over)
    store_record(scene, obj.name, image, material, obj, {None: state}, image_size(first))
    # The object can still show its pictures, but no longer an earlier texture.
    _show_on_objects(node_groups, keep_textures=False)
    return image


def texture_kind(content: str) -> str:
    """Return the kind of the files of a texture (see `picture_stem`), given what the texture shows."""
    return "texture" if content == "look" else content


def _image_stem(settings: OutputSettings, name: str, kind: str = "camera") -> Path | None:
    """Return the path of an image file without its suffix; None if the image is packed.

    `name` is the name of what the picture belongs to: a camera or, if `kind` is not "camera", an object. The
    kind is part of the name of the file (`picture_stem`).
    """
    return None if settings.folder is None else settings.folder / picture_stem(name, kind)


def _new_groups(
    material: Material,
    matrices: Mapping[Object, np.ndarray | None],
    track: datablocks.Track,
    *,
    is_over: bool,
) -> dict[Object, NodeTree]:
    """Create the node groups that show a picture, and return them by object; see `new_group`.

    `matrices` has the (4, 4) matrix from object space to clip space, or None, of each object. If `is_over` is true, the
    picture is shown over the objects' materials: their ink objects get the groups. `track` is called with each new
    datablock.
    """
    groups = {}
    for obj, matrix in matrices.items():
        if is_over:
            obj = find_ink_object(obj) or new_ink_object(obj, track)
        groups[obj] = track(new_group(obj, material, matrix))
    return groups


def _show_on_objects(node_groups: Mapping[Object, NodeTree], *, keep_textures: bool = True) -> None:
    """Show a recorded picture on objects, with one new node group for each, and delete the earlier groups.

    `keep_textures` says whether an object can still show an earlier texture; see `set_picture_modifier`. The
    earlier groups are not used again, because `store_record` has replaced the material in them by the new
    one.
    """
    materials = recorded_materials(textures=keep_textures)
    for obj, node_group in node_groups.items():
        picture_nodes.set_picture_modifier(obj, node_group, materials)
        replaced = obj.parent if obj.get(datablocks.INK_TAG) else find_ink_object(obj)
        if replaced is not None:
            datablocks.remove_picture_modifiers(replaced)
    datablocks.delete_unused()


def _remove_from_others(material: Material, objects: Container[Object]) -> None:
    """Remove a picture that was baked again from objects that show the earlier bake, but not the new one.

    These objects then show another picture or, if they have none, their own materials. `material` is the material
    of the picture, which also replaces the material of the earlier bake. `objects` show the new bake.
    """
    pictures = recorded_materials() - {material}
    for obj in list(bpy.data.objects):
        projections = {} if obj in objects else _projections(obj)
        if material not in projections:
            continue
        others = [other for other in projections if other in pictures]
        if not others:
            datablocks.remove_picture_modifiers(obj)
        elif material in picture_nodes.shown_materials(obj):
            _show(obj, others[-1], projections[others[-1]], pictures)
    datablocks.delete_unused()


def show_bake(scene: Scene, camera: str) -> None:
    """Let the objects of a picture show it again, if they show another one.

    Parameters
    ----------
    scene : bpy.types.Scene
    camera : str
        Name of the camera of the picture, as in `list_bakes`.

    Raises
    ------
    RosyError
        If no picture was baked from this camera.
    """
    record = next((each for each in scene.rosy.bakes if camera_name(each) == camera), None)
    if record is None:
        names = ", ".join(f"'{camera_name(other)}'" for other in scene.rosy.bakes) or "none"
        raise RosyError(f"no picture was baked from camera '{camera}', only from {names}")
    materials = recorded_materials()
    for obj in baked_objects(scene):
        projections = _projections(obj)
        if record.material in projections and datablocks.is_editable(obj):
            _show(obj, record.material, projections[record.material], materials)
    update_keys(scene)


def _projections(obj: Object) -> dict[Material, np.ndarray | None]:
    """Return the projections of the pictures that an object can show; see `projections_of_group`."""
    projections = {}
    for modifier in datablocks.removable_modifiers(obj):
        projections |= picture_nodes.projections_of_group(modifier.node_group)
    return projections


def _show(
    obj: Object, material: Material, matrix: np.ndarray | None, pictures: Container[Material]
) -> None:
    """Let an object show a picture that it showed before; see `new_group` and `set_picture_modifier`."""
    node_group = new_group(obj, material, matrix)
    node_group[datablocks.OWNED_TAG] = True
    picture_nodes.set_picture_modifier(obj, node_group, pictures)


def _clip_matrices(scene_data: SceneData, camera: Camera) -> dict[Object, np.ndarray | None]:
    """Return the (4, 4) object-to-clip matrix of each object; None for objects with several instances."""
    matrices: dict[Object, np.ndarray | None] = {}
    for instance, owner in zip(scene_data.instances, scene_data.objects, strict=False):
        is_repeated = owner in matrices
        matrices[owner] = None if is_repeated else camera.projection @ camera.view @ instance.matrix
    return matrices


def _display_warnings(scene: Scene) -> list[str]:
    """Return warnings about settings of the scene's color management that change the colors of pictures."""
    transform = scene.view_settings.view_transform
    if transform in NEUTRAL_VIEW_TRANSFORMS:
        return []
    return [f"the view transform {transform} changes the colors of pictures: choose Standard"]
