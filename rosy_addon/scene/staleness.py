"""Find out whether a picture is out of date: compare the recorded state of the scene with the present one."""

import atexit
import time

import bpy
from bpy.types import Depsgraph, Image, Scene

from .app_handlers import add_handlers, remove_handlers
from .picture_state import MeshStates, PictureState, SceneState, settings_key

#: Digests of objects or lights by name, as in the attributes of `PictureState`.
Digests = dict[str, list[str]]

#: Least time between two readings of a scene, as a multiple of the time that a reading takes. So panels spend
#: at most a tenth of the time on readings, and playback and sculpting stay fluent.
TTL_READINGS = 10.0

#: Names of the lists in `bpy.app.handlers` whose handlers Blender calls when objects may have changed.
_WATCHED_EVENTS = ("depsgraph_update_post", "frame_change_post", "undo_post", "redo_post")

#: Names of properties of the output in messages, where they differ from the identifiers.
_OUTPUT_LABELS = {
    "texture_content": "content",
    "texture_bake_light": "baked light",
    "texture_udim": "kind of tiles",
    "relight": "relighting",
    "over_material": "material under the ink",
    "store": "storage",
    "directory": "folder",
    "image_format": "format",
}


class SceneStateCache:
    """A cache of the present state of a scene, for panels, which need it at every redraw.

    Handlers note which objects change, so that only their meshes are read again. The handlers are added when
    a panel first shows a scene with pictures. They exist until a file is loaded or `clear` is called.
    """

    def __init__(self) -> None:
        self._mesh_states: MeshStates = {}
        self._scene_state: SceneState | None = None
        self._key: tuple | None = None
        self._is_outdated = True
        self._next_reading = 0.0
        self._handlers = dict.fromkeys(_WATCHED_EVENTS, self.note_changes)

    def get(self, scene: Scene, depsgraph: Depsgraph) -> SceneState:
        """Return the state of the view layer of a depsgraph.

        After a change, the scene is read again, but only after a pause of `TTL_READINGS` times the duration
        of the last reading. Until then, the earlier state is returned.
        """
        view_layer = depsgraph.view_layer
        key = scene.session_uid, view_layer.name, settings_key(scene, view_layer)
        if key != self._key or not self._is_watching():
            self.clear()
            self._key = key
            add_handlers(self._handlers)
            atexit.register(self.clear)  # Blender's Python module requires that no handler is left
        is_due = self._is_outdated and time.monotonic() >= self._next_reading
        if self._scene_state is None or is_due:
            start = time.monotonic()
            self._scene_state = SceneState(scene, depsgraph, self._mesh_states)
            self._is_outdated = False
            end = time.monotonic()
            self._next_reading = end + TTL_READINGS * (end - start)
        return self._scene_state

    def seconds_to_wait(self) -> float:
        """Return the seconds until `get` reads changes that it has not read yet; 0 if there are none."""
        is_behind = self._is_watching() and self._is_outdated
        return max(self._next_reading - time.monotonic(), 0.01) if is_behind else 0.0

    def note_changes(self, _scene: Scene, depsgraph: Depsgraph | None = None) -> None:
        """Forget the states of meshes that have changed. If there is no depsgraph, all may have changed."""
        self._is_outdated = True
        if depsgraph is None:
            self._mesh_states.clear()
            return
        for update in depsgraph.updates:
            if isinstance(update.id, Image):
                self._mesh_states.clear()  # the image may be the tone of any mesh
            elif update.is_updated_geometry:
                changed = update.id.original.session_uid
                for key in [key for key in self._mesh_states if key[0] == changed]:
                    del self._mesh_states[key]

    def clear(self) -> None:
        """Forget everything, and remove the handlers."""
        self._mesh_states.clear()
        self._scene_state, self._key, self._is_outdated = None, None, True
        remove_handlers(self._handlers)
        atexit.unregister(self.clear)

    def _is_watching(self) -> bool:
        """Return whether the handlers exist. Blender removes them when it loads a file."""
        return self.note_changes in bpy.app.handlers.depsgraph_update_post


#: The cache that all panels of this Blender process share. It is cleared by `unregister`.
SCENE_STATES = SceneStateCache()


def difference(recorded: PictureState, present: PictureState, source: str) -> str:
    """Return why a picture is out of date; empty if it is up to date.

    Parameters
    ----------
    recorded : PictureState
        The state that the picture was drawn from.
    present : PictureState
        The state that it would be drawn from now.
    source : str
        Text by which the reason refers to the camera, or for a texture to its UV map.
    """
    content = present.output.get("texture_content")
    if recorded.output.get("texture_content") != content:
        return "the content was changed"
    if recorded.look != present.look:
        return "the look was changed"
    if recorded.size != present.size and present.size:
        return f"the size was changed to {present.size[0]} x {present.size[1]}"
    if recorded.camera != present.camera:
        return f"{source} was changed"
    reason = (
        _object_difference(recorded.objects, present.objects, of_mesh="the mesh or field of ")
        or _object_difference(recorded.lights, present.lights, kind="light ")
        or _object_difference(recorded.occluders, present.occluders)
    )
    if reason:
        return reason
    if recorded.reference != present.reference:
        return "the picture of the tone was changed"
    for name, value in present.output.items():
        if recorded.output.get(name) != value:
            return f"the {_OUTPUT_LABELS.get(name, name)} was changed"
    return "" if recorded.device == present.device else "the device was changed"


def _object_difference(
    recorded: Digests, present: Digests, *, kind: str = "", of_mesh: str = ""
) -> str:
    """Return how objects or lights have changed; empty if they have not. Objects may have been renamed.

    Parameters
    ----------
    recorded, present : dict of str to list of str
        The same attribute of two `PictureState`: digests by the names of objects.
    kind : str
        Text before the names, such as "light ". If it is empty, an object of which only the transform has
        changed is called moved instead of changed.
    of_mesh : str
        Text before the name of an object with a changed mesh, such as "the mesh or field of ".
    """
    if sorted(recorded.values()) == sorted(present.values()):
        return ""
    before, after = _without_renamed(recorded, present)
    for name in sorted(before.keys() & after.keys()):
        if before[name] != after[name]:
            is_moved = not kind and before[name][1] == after[name][1]
            return f"'{name}' was moved" if is_moved else f"{kind}{of_mesh}'{name}' was changed"
    for name in sorted(before.keys() - after.keys()):
        is_there = any(obj.name_full == name and obj.users_collection for obj in bpy.data.objects)
        return f"{kind}'{name}' {'is not visible any more' if is_there else 'was deleted'}"
    for name in sorted(after.keys() - before.keys()):
        return f"{kind}'{name}' was added"
    return ""


def _without_renamed(recorded: Digests, present: Digests) -> tuple[Digests, Digests]:
    """Return copies of both arguments in which renamed objects have their new names.

    An object counts as renamed if its name is gone, and a new name has one of its digests.
    """
    before, after = dict(recorded), dict(present)
    for name in recorded.keys() - present.keys():
        for new_name in after.keys() - before.keys():
            if set(before[name]) & set(after[new_name]):
                before[new_name] = before.pop(name)
                break
    return before, after
