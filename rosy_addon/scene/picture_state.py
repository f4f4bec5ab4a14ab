"""Read the state of a scene that a picture depends on, as a `PictureState`. States are compared and stored.

Reading does not change anything in the file, so it is possible while Blender draws a panel.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from itertools import product, starmap

import numpy as np
from bpy.types import Depsgraph, Object, PropertyGroup, Scene, ViewLayer

from ..compositor.ink_thresholds import unlit_look
from ..compositor.look import Look, is_hatched
from ..core.errors import RosyError
from ..core.file_io import read_bytes
from ..core.settings import settings_of
from ..field.polygon_arrays import box_corners
from ..projection.camera import Camera
from ..surface_texture.draw import DIRECTION_SETTINGS, TEXTURE_SETTINGS, texture_colors_values
from .cameras import CameraSource, camera_of_object, render_camera, resolve_camera
from .datablocks import field_mesh
from .field_attributes import attribute_name, field_degree
from .look_inputs import color_values_digest, read_request, reference_path
from .look_properties import object_looks, own_presets, read_look
from .mesh_states import MeshStates, digest, field_parts, mesh_state_key, read_mesh_state
from .meshes import evaluated_mesh, polygon_arrays, read_uvs, shape_digest
from .read_view import rendered_lights
from .visible_objects import drawn_objects, field_objects, rendered_instances

#: Properties of ``scene.rosy`` that decide how a picture is stored and shown, but not how it is drawn.
OUTPUT_PROPERTIES = (
    *("placement", "over_material", "emission", "diffuse", "store", "directory", "image_format"),
)

#: Properties of ``scene.rosy`` that decide what a texture shows, and how it is stored.
TEXTURE_OUTPUT = (
    *("texture_content", "texture_bake_light", "texture_udim"),
    *("store", "directory", "image_format"),
)


@dataclass(frozen=True)
class PictureState:
    """Everything that a picture of a scene depends on, as values and digests.

    Attributes
    ----------
    look : dict
        Values of the settings of the look that have an effect, by name.
    size : list of int
        Width and height in pixels.
    camera : str
        Digest of the view and the projection of the camera. Empty if no picture can be drawn from it.
    output : dict
        Values of `OUTPUT_PROPERTIES`, and whether the material draws hatching in the present light
        (relighting).
    device : str
        Device that draws the picture: "cpu", "gpu" or "auto".
    objects, occluders, lights : dict of str to list of str
        By the name of an object, two digests: one of the transforms of its instances, and one of their
        meshes. For a light, one digest per instance. Only occluders and lights that may change the picture
        are included.
    reference : str
        Digest of the reference render. Empty if the look uses none.
    """

    look: dict
    size: list[int]
    camera: str
    output: dict
    device: str
    objects: dict[str, list[str]]
    occluders: dict[str, list[str]] = field(default_factory=dict)
    lights: dict[str, list[str]] = field(default_factory=dict)
    reference: str = ""

    def to_json(self) -> str:
        """Return the state as JSON text."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_json(text: str) -> PictureState | None:
        """Return the state that `to_json` has written; None if it was written by another version of RoSy."""
        try:
            state = PictureState(**json.loads(text))
            # JSON turns tuples into lists.
            look = {name: tuple(v) if isinstance(v, list) else v for name, v in state.look.items()}
            return replace(state, look=look)
        except (AttributeError, TypeError, ValueError):
            return None


@dataclass(eq=False)
class _Instances:
    """Digests and bounding boxes of the instances of one object.

    Attributes
    ----------
    digests : list of (str, str)
        Digests of the transform and of the mesh of each instance.
    corners : list of (8, 3) ndarray
        The corners of the bounding box of each instance, in world space.
    """

    digests: list[tuple[str, str]] = field(default_factory=list)
    corners: list[np.ndarray] = field(default_factory=list)

    def digest_pair(self) -> list[str]:
        """Return a digest of all transforms, and one of all meshes.

        The order of instances does not matter.
        """
        return [digest(*sorted(column)) for column in zip(*self.digests, strict=True)]


class SceneState:
    """The state of the objects and lights of a view layer, which its pictures from all cameras share.

    Parameters
    ----------
    scene : bpy.types.Scene
    depsgraph : bpy.types.Depsgraph
        The evaluated depsgraph of a view layer.
    mesh_states : dict
        Known states of meshes that have not changed. The states of other meshes are read and added.
    """

    def __init__(self, scene: Scene, depsgraph: Depsgraph, mesh_states: MeshStates) -> None:
        self._lacks_tone = False
        self._fields: dict[str, _Instances] = {}
        self._occluders: dict[str, _Instances] = {}
        self._texture_states: dict[tuple, PictureState] = {}
        look = read_look(scene.rosy)
        request, targets = read_request(scene, look), drawn_objects(depsgraph)
        self._own_looks = _own_look_digests(scene, targets, look)
        self._lights = _light_digests(depsgraph) if look.light == "scene" else {}
        for instance, draws_field in rendered_instances(depsgraph, targets):
            obj, owner = instance.object, instance.object.original
            mesh_request = request if draws_field else None
            key = mesh_state_key(obj, owner, mesh_request)
            if key not in mesh_states:
                with evaluated_mesh(obj) as mesh:
                    mesh_states[key] = read_mesh_state(mesh, owner, mesh_request)
            mesh_state = mesh_states[key]
            if mesh_state is None:
                continue
            self._lacks_tone |= mesh_state.lacks_tone
            matrix = np.array(instance.matrix_world)
            group = self._fields if draws_field else self._occluders
            instances = group.setdefault(owner.name_full, _Instances())
            instances.digests.append((digest(matrix + 0.0), mesh_state.digest))
            corners = box_corners(mesh_state.bounds.astype(np.float64))
            instances.corners.append(corners @ matrix[:3, :3].T + matrix[:3, 3])

    def picture_state(
        self, scene: Scene, depsgraph: Depsgraph, source: CameraSource, is_frame: bool = False
    ) -> PictureState:
        """Return the state of a picture from a camera.

        `is_frame` says whether the picture is a frame of an animation.
        """
        camera = None
        with suppress(RosyError):  # no picture can be drawn from the camera
            camera = resolve_camera(scene, depsgraph, source)
        look = read_look(scene.rosy)
        is_relit = scene.rosy.relight and is_hatched(look) and not is_frame
        if is_relit:
            look = unlit_look(look)
        settings = applied_settings(look, self._lacks_tone)
        lights = self._lights if settings.get("light") == "scene" else {}
        output = _used_output(scene.rosy, OUTPUT_PROPERTIES) | {"relight": is_relit}
        output["over_material"] &= is_hatched(look)
        output["exposure"] = scene.rosy.exposure if lights else 0.0
        if is_frame:
            del output["placement"]  # frames always fill the frame of the camera
        occluders = self._used_occluders(camera, bool(settings.get("shadows") or lights))
        has_reference = settings["tone"] == "picture"
        return PictureState(
            look=settings | ({"own": self._own_looks} if self._own_looks else {}),
            size=[] if camera is None else [camera.width, camera.height],
            camera="" if camera is None else digest(camera.view + 0.0, camera.projection + 0.0),
            output=output,
            device="cpu" if is_relit or self._own_looks else scene.rosy.device.lower(),
            objects={name: instances.digest_pair() for name, instances in self._fields.items()},
            occluders={name: instances.digest_pair() for name, instances in occluders.items()},
            lights=lights,
            reference=_reference_digest(scene, depsgraph) if has_reference else "",
        )

    def texture_state(self, scene: Scene, depsgraph: Depsgraph, obj: Object) -> PictureState:
        """Return the state of the texture of an object. It is cached for equal settings."""
        settings = scene.rosy
        key = (
            *(obj.session_uid, obj.rosy.texture_uv_map, obj.data.uv_layers.active_index),
            *(settings.texture_size, settings.texture_margin, read_look(settings)),
            settings.color_attribute,
            *(getattr(settings, name) for name in TEXTURE_OUTPUT),
        )
        if key not in self._texture_states:
            self._texture_states[key] = read_texture_state(scene, depsgraph, obj)
        return self._texture_states[key]

    def _used_occluders(self, camera: Camera | None, casts_shadows: bool) -> dict[str, _Instances]:
        """Return the objects without a field that may change the picture, by name.

        If shadows are drawn, or no picture can be drawn from the camera (None), all of them are returned.
        Otherwise, only objects with a bounding box that may hide a part of the bounding box of an object with
        a field are returned.
        """
        if casts_shadows or camera is None:
            return self._occluders
        fields = self._boxes(camera, self._fields.values())
        return {
            name: instances
            for name, instances in self._occluders.items()
            if any(starmap(_may_hide, product(self._boxes(camera, [instances]), fields)))
        }

    @staticmethod
    def _boxes(camera: Camera, objects: Iterable[_Instances]) -> list[np.ndarray]:
        """Return the boxes of instances in a picture (`_picture_box`), without those outside it."""
        boxes = (_picture_box(camera, corners) for obj in objects for corners in obj.corners)
        return [box for box in boxes if box is not None]


def _own_look_digests(scene: Scene, objects: Sequence[Object], look: Look) -> dict[str, str]:
    """Return, by object name, digests of the looks of those objects whose look is not the look of the scene."""
    try:
        looks = object_looks(scene, objects, look)
    except RosyError as error:
        return {"error": str(error)}
    entries = zip(objects, looks, strict=True)
    return {obj.name_full: digest(repr(own)) for obj, own in entries if own != look}


def _light_digests(depsgraph: Depsgraph) -> dict[str, list[str]]:
    """Return the digests of the visible lights of a scene, by the names of their objects."""
    lights: dict[str, list[str]] = {}
    for light, owner in rendered_lights(depsgraph):
        lights.setdefault(owner.name_full, []).append(digest(*vars(light).values()))
    return {name: sorted(digests) for name, digests in lights.items()}


def bakes_light(settings: PropertyGroup, look: Look) -> bool:
    """Return whether textures show hatching that was drawn in the light of the scene.

    Otherwise, a texture of hatching stores thresholds, and its material draws the ink in the present light.

    Parameters
    ----------
    settings : bpy.types.PropertyGroup
        ``scene.rosy``.
    look : Look
    """
    return settings.texture_bake_light and settings.texture_content == "LOOK" and is_hatched(look)


def read_texture_state(scene: Scene, depsgraph: Depsgraph, obj: Object) -> PictureState:
    """Return the state that the texture of an object depends on, with the present settings of the scene.

    It does not depend on movement and deformation of the object, unless light is baked into the texture.
    """
    settings, mesh = scene.rosy, field_mesh(obj)
    look = read_look(settings)
    shape = [shape_digest(mesh), *field_parts(mesh, mesh), settings.undefined]
    uv_parts = [settings.texture_margin]
    with evaluated_mesh(obj.evaluated_get(depsgraph)) as evaluated:
        if evaluated is not None:
            shape += polygon_arrays(evaluated)
            if texture_colors_values(look, settings.texture_content.lower()):
                shape.append(color_values_digest(evaluated, settings.color_attribute))
            try:
                uv_parts.append(read_uvs(evaluated, obj.rosy.texture_uv_map, obj.name))
            except RosyError as error:
                uv_parts.append(str(error))
    if settings.texture_content == "LOOK":
        names = [name for name in TEXTURE_SETTINGS if settings_of(Look)[name].applies(look)]
    else:
        names = DIRECTION_SETTINGS
    lights, place = {}, ""
    if bakes_light(settings, look):
        lights, place = _light_digests(depsgraph), digest(np.array(obj.matrix_world) + 0.0)
    return PictureState(
        look={name: getattr(look, name) for name in names},
        size=[settings.texture_size, settings.texture_size],
        camera=digest(*uv_parts),
        output=_used_output(settings, TEXTURE_OUTPUT),
        device="cpu",
        objects={obj.name_full: [place, digest(*shape)]},
        lights=lights,
    )


def _used_output(settings: PropertyGroup, names: Iterable[str]) -> dict:
    """Return a dict of the named settings and their values, without `directory` if pictures are packed into the file."""
    is_packed = settings.store == "PACKED"
    return {name: getattr(settings, name) for name in names if name != "directory" or not is_packed}


def settings_key(scene: Scene, view_layer: ViewLayer) -> tuple:
    """Return the settings on which a `SceneState` depends. Blender does not report all changes of them."""
    look = read_look(scene.rosy)
    drawn, objects = field_objects(view_layer), []
    for obj in drawn:
        image, mesh = obj.rosy.tone_image, field_mesh(obj)
        image_key = image and (image.session_uid, *image.size, image.is_dirty)
        tone_key = image_key, obj.rosy.tone_uv_map
        objects.append((obj.session_uid, attribute_name(mesh), field_degree(mesh), tone_key))
    presets = tuple(own_presets(scene, drawn))
    return read_request(scene, look), look.light, tuple(objects), presets


def applied_settings(look: Look, lacks_tone: bool = False) -> dict:
    """Return the settings of a look that have an effect, by name.

    Parameters
    ----------
    look : Look
    lacks_tone : bool
        Whether some mesh has no tone although the look takes its tone from meshes. That mesh is lit, so the
        settings of the light have an effect.
    """
    drawn_look = replace(look, tone_lit=True) if lacks_tone else look
    return {
        name: getattr(look, name)
        for name, setting in settings_of(Look).items()
        if setting.applies(drawn_look)
    }


def _reference_digest(scene: Scene, depsgraph: Depsgraph) -> str:
    """Return a digest of the file and the camera of the reference render.

    If it cannot be read, return the error message.
    """
    try:
        path = reference_path(scene)
        camera = camera_of_object(scene, depsgraph, render_camera(scene))
        contents = np.frombuffer(read_bytes(path), dtype=np.uint8)
    except (RosyError, OSError) as error:
        return f"{error}"
    return digest(contents, camera.view + 0.0, camera.projection + 0.0)


# --- bounding boxes in a picture ------------------------------------------------------------------


def _picture_box(camera: Camera, corners: np.ndarray) -> np.ndarray | None:
    """Return a box around the projections of points in a picture; None if it is outside the picture.

    `corners` are (n, 3) points in world space.

    Returns
    -------
    (2, 3) float64 ndarray or None
        Lowest and highest x and y (normalized device coordinates) and depth (distance along the view
        direction).
    """
    points = corners @ camera.view[:3, :3].T + camera.view[:3, 3]
    clip = np.column_stack([points, np.ones(len(points))]) @ camera.projection.T
    depth = -points[:, 2]
    low, high = np.full(3, -1.0), np.full(3, 1.0)
    if clip[:, 3].min() > 0:  # otherwise a part of the box is behind the camera
        position = clip[:, :2] / clip[:, 3:]
        low[:2] = np.maximum(position.min(axis=0), -1.0)
        high[:2] = np.minimum(position.max(axis=0), 1.0)
    elif depth.max() <= 0:
        return None
    low[2], high[2] = depth.min(), depth.max()
    return np.stack([low, high]) if (low[:2] < high[:2]).all() else None


def _may_hide(box: np.ndarray, other: np.ndarray) -> bool:
    """Return whether an object in one box may hide a part of an object in another; see `_picture_box`."""
    overlaps = (box[0, :2] < other[1, :2]).all() and (other[0, :2] < box[1, :2]).all()
    return bool(overlaps and box[0, 2] < other[1, 2])
