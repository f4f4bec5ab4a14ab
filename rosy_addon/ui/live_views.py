"""Switch on live views automatically: when a scene gets its first field, and when a file is loaded."""

from contextlib import suppress
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..core.errors import RosyError
from ..scene.app_handlers import add_handlers, remove_handlers
from ..viewport import session
from .preferences import addon_preferences

#: Scenes, by `session_uid`, in which the user has switched a live view off.
_declined_scenes: set[int] = set()


def decline(scene: bpy.types.Scene) -> None:
    """Note that the user has switched off a live view in a scene.

    The first field of this scene then does not switch on a live view.
    """
    _declined_scenes.add(scene.session_uid)


def start_with_first_field(context: bpy.types.Context) -> None:
    """Make the 3D view of the context live, if there is one and the user has not declined live views.

    Raises
    ------
    DeviceError
        If there is no graphics context.
    """
    space = context.space_data
    if bpy.app.background or space is None or space.type != "VIEW_3D":
        return
    is_declined = context.scene.session_uid in _declined_scenes
    if not is_declined and getattr(addon_preferences(context), "live_first_field", False):
        session.start(space)


@persistent
def _save_live_views(*_: Any) -> None:
    """Before a file is saved, store which views are live, in scenes with the setting to remember them."""
    live_views = [
        f"{index} {screen.name}"
        for screen in bpy.data.screens
        for index, area in enumerate(screen.areas)
        if area.type == "VIEW_3D" and session.is_live(area.spaces.active)
    ]
    for scene in bpy.data.scenes:
        if scene.rosy.remember_live and scene.library is None:
            scene.rosy.live_views = "\n".join(live_views)


@persistent
def _restore_live_views(*_: Any) -> None:
    """After a file is loaded, make those views live that were live when it was saved."""
    with suppress(RosyError):  # the graphics card can no longer be used
        for window in bpy.context.window_manager.windows:
            settings = window.scene.rosy
            for line in settings.live_views.splitlines() if settings.remember_live else ():
                index, screen_name = line.split(" ", 1)
                screen = bpy.data.screens.get(screen_name)
                areas = screen.areas[int(index) : int(index) + 1] if screen is not None else ()
                for area in areas:
                    if area.type == "VIEW_3D":
                        session.start(area.spaces.active)


#: Handlers of Blender's events, by the names of their lists in `bpy.app.handlers`.
_HANDLERS = {"save_pre": _save_live_views, "load_post": _restore_live_views}


def register() -> None:
    """Add the handlers that store live views in files. If Blender runs without windows, add none."""
    if not bpy.app.background:
        add_handlers(_HANDLERS)


def unregister() -> None:
    """Remove the handlers."""
    remove_handlers(_HANDLERS)
    _declined_scenes.clear()
