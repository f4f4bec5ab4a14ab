"""Cached meshes of each view layer, for the live view."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field

import bpy

from ..compositor.look import Look
from ..scene.read_view import nonfinite_policy
from ..scene.scene_cache import InstanceState, SceneCache
from ..scene.tone_inputs import make_tone_request

#: Types of data-blocks whose changes may change a picture.
RELEVANT_ID_TYPES = ("OBJECT", "MESH", "COLLECTION", "SCENE", "LIGHT", "ARMATURE", "KEY", "IMAGE")


@dataclass(eq=False)
class LayerState:
    """The instances of one view layer of a scene.

    Attributes
    ----------
    scene_cache : SceneCache
    instances : list of InstanceState
        As they were read last.
    stale : bool
        Whether they must be read again.
    request_key : hashable
        The options with which they were read: whether with occluders, and with which tones.
    """

    scene_cache: SceneCache = field(default_factory=SceneCache)
    instances: list[InstanceState] = field(default_factory=list)
    stale: bool = True
    request_key: Hashable = None


class LayerStates:
    """The states of all view layers that are shown in live views.

    Parameters
    ----------
    schedule_resolving : callable
        Called without arguments while Blender draws. It must arrange for a later call of
        `resolve_topologies`.
    """

    def __init__(self, schedule_resolving: Callable[[], None]) -> None:
        self._schedule_resolving = schedule_resolving
        self._layers: dict[tuple[str, str], LayerState] = {}
        self._is_resolving = False

    def get(self, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> LayerState | None:
        """Return the state of a view layer, or None if it was never read."""
        return self._layers.get((scene.name, view_layer.name))

    def read(
        self,
        context: bpy.types.Context,
        depsgraph: bpy.types.Depsgraph,
        look: Look,
        *,
        include_occluders: bool,
    ) -> LayerState:
        """Return the state of the context's view layer, up to date."""
        key = context.scene.name, context.view_layer.name
        layer = self._layers.setdefault(key, LayerState())
        tone_request = make_tone_request(context.scene, look)
        request_key = include_occluders, tone_request
        if layer.stale or layer.request_key != request_key:
            layer.instances = layer.scene_cache.read(
                depsgraph,
                nonfinite_policy(context.scene),
                include_occluders=include_occluders,
                tone_request=tone_request,
            )
            layer.stale, layer.request_key = False, request_key
            if layer.scene_cache.has_unresolved:
                self._schedule_resolving()
        return layer

    def mark_all_stale(self) -> None:
        """Mark all layers, so that they are read again."""
        for layer in self._layers.values():
            layer.stale = True

    def clear(self) -> None:
        """Drop all layers."""
        self._layers.clear()

    def invalidate(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph | None) -> None:
        """Mark what has changed in a scene, so that it is read again.

        Parameters
        ----------
        scene : bpy.types.Scene
        depsgraph : bpy.types.Depsgraph or None
            Its `updates` list what has changed. None: anything may have changed.
        """
        if self._is_resolving:
            return
        updates = () if depsgraph is None else depsgraph.updates
        changed_names, remeshed_names = set(), set()
        is_relevant = False
        for update in updates:
            datablock = update.id.original
            if datablock.id_type not in RELEVANT_ID_TYPES:
                continue
            is_relevant = True
            if datablock.id_type == "IMAGE":
                changed_names |= {
                    obj.name for obj in bpy.data.objects if obj.rosy.tone_image == datablock
                }
            if not update.is_updated_geometry:
                continue
            if datablock.id_type == "MESH":
                remeshed_names |= {obj.name for obj in bpy.data.objects if obj.data == datablock}
            elif datablock.id_type == "OBJECT":
                changed_names.add(datablock.name)
        for (scene_name, _), layer in self._layers.items():
            if scene_name == scene.name and (is_relevant or depsgraph is None):
                layer.scene_cache.invalidate(changed_names, topology_changed=False)
                layer.scene_cache.invalidate(remeshed_names)
                layer.stale = True

    def resolve_topologies(self) -> None:
        """Read the data that cannot be read while Blender draws, in all windows."""
        self._is_resolving = True
        try:
            for window in bpy.context.window_manager.windows:
                layer = self.get(window.scene, window.view_layer)
                if layer is None or not layer.scene_cache.has_unresolved:
                    continue
                with bpy.context.temp_override(window=window):
                    depsgraph = bpy.context.evaluated_depsgraph_get()
                    layer.scene_cache.resolve_topologies(depsgraph, nonfinite_policy(window.scene))
                layer.stale = True
        finally:
            self._is_resolving = False
