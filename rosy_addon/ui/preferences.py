"""Preferences of the extension, such as what happens when the first field of a scene is made."""

from __future__ import annotations

from bpy.types import AddonPreferences, Context

from ..compositor.look import Look
from ..core.settings import settings_of
from ..scene.files import EXTENSION_ID
from . import preset_library
from .property_makers import integer, text, toggle


class ROSY_AP_preferences(AddonPreferences):
    """What happens when the first field of a scene is made, and the defaults that the scene gets."""

    bl_idname = EXTENSION_ID

    preset: text(
        "Preset",
        "Initial look of a scene: the name of a preset, or the path of a preset file. "
        "Empty: the default look",
        search=preset_library.search_presets,
        search_options={"SUGGESTION"},
    )
    directory: text(
        "Picture Folder",
        "Folder for the pictures of a scene, if they are saved to files. Empty: the "
        "folder 'rosy' beside the .blend file",
        subtype="DIR_PATH",
    )

    live_first_field: toggle(
        "Live View",
        "Show the first field of a scene live in the 3D view in which it is made",
        default=True,
    )

    workers: integer(
        "Worker Processes",
        "Number of processes that draw a large picture together on the processor. 0: one "
        "for each core. The picture is the same for any number",
        min=0,
        max=256,
    )

    use_helper: toggle(
        "Helper Process",
        "Compute in a process beside Blender, which stays responsive. Off: Blender waits",
        default=True,
    )

    def draw(self, context: Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "use_helper")
        layout.prop(self, "workers")
        layout.label(text="When the first field of a scene is made")
        layout.prop(self, "live_first_field")
        layout.prop(self, "preset")
        layout.prop(self, "directory")


def addon_preferences(context: Context) -> ROSY_AP_preferences | None:
    """Return the preferences; None if RoSy does not run as an extension."""
    return getattr(context.preferences.addons.get(EXTENSION_ID), "preferences", None)


def worker_count(context: Context) -> int:
    """Return the number of processes that draw a large picture. 0 means one for each processor core."""
    return getattr(addon_preferences(context), "workers", 0)


def uses_helper(context: Context) -> bool:
    """Return whether jobs compute in a helper process, and not in Blender's process."""
    return getattr(addon_preferences(context), "use_helper", True)


def apply_preferences(context: Context) -> None:
    """Apply the preferences to a scene, if the user has not changed its settings.

    Raises
    ------
    RosyError
        If the preset cannot be read.
    """
    settings, preferences = context.scene.rosy, addon_preferences(context)
    if preferences is None:
        return
    has_default_look = not any(settings.look.is_property_set(name) for name in settings_of(Look))
    if preferences.preset and has_default_look:
        preset_library.apply_preset(settings, preferences.preset)
    if preferences.directory and not settings.is_property_set("directory"):
        settings.directory = preferences.directory


CLASSES = (ROSY_AP_preferences,)
