"""The data that live views read: meshes of view layers, and reference renders for the tone "picture"."""

import math
import time
from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from bpy.types import Context, Depsgraph, Scene, ViewLayer

from ..compositor.look import Look
from ..compositor.shading import Light
from ..compositor.target_tone import ReferenceRender
from ..core.errors import REPORTED_ERRORS, RosyError, error_text
from ..core.file_io import file_stamp
from ..scene import look_inputs
from ..scene.cameras import render_camera
from ..scene.datablocks import field_mesh
from ..scene.look_properties import own_presets
from ..scene.read_view import lights_for
from ..scene.scene_reader import SceneInstance, SceneReader
from ..scene.visible_objects import shown_instances

#: Types of datablocks that may change a picture if they change.
RELEVANT_ID_TYPES = (
    *("OBJECT", "MESH", "COLLECTION", "SCENE", "LIGHT", "ARMATURE", "KEY", "IMAGE", "MATERIAL"),
)

#: Length of one time slice for reading meshes, in seconds.
SLICE_SECONDS = 0.08


@dataclass(eq=False)
class LayerState:
    """The instances of one view layer of a scene.

    Attributes
    ----------
    reader : SceneReader
    instances : list of SceneInstance
        The instances at the last reading.
    lights : tuple of Light
        The lights of the look, in world space; see `lights_for`.
    request : tuple, or None
        What was read: the request for the meshes, whether meshes without a field were read too, as occluders, and
        the light and its exposure. None if all must be read again.
    is_starting : bool
        Whether the layer has not been read completely yet. Until then it is read in slices of time.
    """

    reader: SceneReader = field(default_factory=SceneReader)
    instances: list[SceneInstance] = field(default_factory=list)
    lights: tuple[Light, ...] = ()
    request: tuple[look_inputs.ReadRequest, bool, str, float] | None = None
    is_starting: bool = True


class LayerStates:
    """The states of all view layers that are shown in live views."""

    def __init__(self) -> None:
        self._layers: dict[tuple[str, str], LayerState] = {}

    def get(self, scene: Scene, view_layer: ViewLayer) -> LayerState | None:
        """Return the state of a view layer, or None if it was never read."""
        return self._layers.get((scene.name, view_layer.name))

    def read(
        self, context: Context, depsgraph: Depsgraph, look: Look, *, include_occluders: bool
    ) -> LayerState:
        """Return the state of the context's view layer, up to date unless its `is_starting` is true.

        `include_occluders` says whether meshes without a field are read too. Reading may be slow. So the
        first call only creates the state: the view can first draw the message that meshes are being read.
        """
        key = context.scene.name, context.view_layer.name
        if key not in self._layers:
            self._layers[key] = LayerState()
            return self._layers[key]
        layer = self._layers[key]
        scene = context.scene
        light = look.light, scene.rosy.exposure
        request = look_inputs.read_request(scene, look), include_occluders, *light
        if layer.request != request:
            layer.instances = layer.reader.read(
                shown_instances(depsgraph, include_occluders=include_occluders),
                request[0],
                deadline=time.monotonic() + SLICE_SECONDS if layer.is_starting else math.inf,
            )
            instances = [entry.instance for entry in layer.instances]
            layer.lights = lights_for(scene, depsgraph, look, instances)
            with_field = [entry for entry in layer.instances if entry.instance.field is not None]
            if any(own_presets(scene, [entry.owner for entry in with_field])):
                note = "objects have looks of their own: bake to see them"
                layer.reader.notes["own looks"] = note
            layer.request = request if layer.reader.is_complete else None
            layer.is_starting &= not layer.reader.is_complete
        return layer

    def clear(self) -> None:
        """Forget the states of all layers."""
        self._layers.clear()

    def forget(self, *_: Any) -> None:
        """Mark everything to be read again, except data that is cached by its contents.

        Blender calls this after an undo. The session calls it when the CPU takes over from the graphics card.
        """
        self._layers = {
            key: LayerState(SceneReader(layer.reader.cache), is_starting=layer.is_starting)
            for key, layer in self._layers.items()
        }

    def invalidate(self, scene: Scene, depsgraph: Depsgraph | None = None) -> None:
        """Mark what has changed in a scene, so that it is read again.

        Parameters
        ----------
        scene : bpy.types.Scene
        depsgraph : bpy.types.Depsgraph, optional
            Its `updates` list the datablocks that have changed. If it is None, all may have changed.
        """
        updates = () if depsgraph is None else depsgraph.updates
        updates = [update for update in updates if update.id.original.id_type in RELEVANT_ID_TYPES]
        changed_names = set()
        for update in updates:
            block, objects = update.id.original, bpy.data.objects
            if block.id_type == "IMAGE":
                changed_names |= {obj.name_full for obj in objects if obj.rosy.tone_image == block}
            elif block.id_type == "MESH" and update.is_updated_geometry:
                meshes = {obj.name_full: (obj.data, field_mesh(obj)) for obj in objects}
                changed_names |= {name for name, used in meshes.items() if block in used}
            elif block.id_type == "OBJECT" and update.is_updated_geometry:
                changed_names.add(block.name_full)
        for (scene_name, _), layer in self._layers.items():
            if scene_name == scene.name and (updates or depsgraph is None):
                layer.reader.invalidate(changed_names)
                layer.request = None


class ReferenceImages:
    """The reference renders that the tone "picture" is sampled from, by scene.

    Blender may not load files while it draws. If `current` returns None for the tone "picture",
    `load_pending` must be called later, when Blender does not draw.
    """

    def __init__(self) -> None:
        #: By the name of a scene: path and modification time of the file, and its luminance. Instead of the
        #: luminance, a str is the message of an error, and None says that the file is not loaded yet.
        self._images: dict[str, tuple[tuple, np.ndarray | str | None]] = {}
        #: By the name of a scene: a key of what the last result depends on, and this result.
        self._current: dict[str, tuple[Hashable, ReferenceRender]] = {}

    def load_pending(self) -> bool:
        """Load the files that have been requested. Return True, as all of them are loaded then."""
        for name, (file_key, image) in list(self._images.items()):
            if image is not None:
                continue
            try:
                self._images[name] = file_key, look_inputs.load_luminance(file_key[0])
            except REPORTED_ERRORS as error:
                self._images[name] = file_key, error_text(error)
        return True

    def current(self, scene: Scene, depsgraph: Depsgraph, look: Look) -> ReferenceRender | None:
        """Return the reference render of a scene.

        Returns
        -------
        ReferenceRender or None
            The same object as long as the file and the camera are unchanged. None if the tone does
            not come from a picture, or the picture is not loaded yet.

        Raises
        ------
        RosyError
            If the file cannot be read, or there is no camera.
        """
        if look.tone != "picture":
            return None
        path = look_inputs.reference_path(scene)
        file_key = path, file_stamp(path)
        if scene.name not in self._images or self._images[scene.name][0] != file_key:
            self._images[scene.name] = file_key, None
        image = self._images[scene.name][1]
        if isinstance(image, str):
            raise RosyError(image)
        if image is None:
            return None
        reference = look_inputs.load_reference(scene, depsgraph, render_camera(scene), image)
        key = file_key, reference.camera.key
        if scene.name not in self._current or self._current[scene.name][0] != key:
            self._current[scene.name] = key, reference
        return self._current[scene.name][1]
