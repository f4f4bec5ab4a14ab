"""Operators: apply, save, rename, delete, import and export presets of looks."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..rosy_addon.core.errors import RosyError
from ..rosy_addon.preset_files import store
from ..rosy_addon.scene.files import user_presets_folder
from ..rosy_addon.scene.look_properties import read_look
from ..rosy_addon.ui import preset_library
from ..rosy_addon.ui.property_makers import file_filter, text, toggle
from ..rosy_addon.ui.translations import translated
from ..rosy_addon.viewport.view3d import redraw
from .base import Condition, RosyOperator

HAS_USER_PRESETS = Condition(
    lambda _: preset_library.user_preset_keys(), "You have no presets yet: save one first"
)

#: The property that lets an operator replace a preset of the user.
REPLACE = toggle("Replace Existing", "Replace your preset of the same name", options={"SKIP_SAVE"})


def _preset_property(search: Any) -> Any:
    """Return the text property for the key of the preset that an operator acts on.

    `search` returns the keys to choose from.
    """
    description = "Name of the preset. Empty: the active preset of the scene"
    return text("Preset", description, search=search, options={"SKIP_SAVE"})


class _PresetOperator(RosyOperator):
    """Mixin of operators on files of presets, which cannot be undone."""

    bl_options = {"REGISTER"}


def _target_preset(operator: Any, context: bpy.types.Context) -> str:
    """Return the key of the preset that an operator acts on. By default, it is the preset of the scene."""
    return operator.preset or context.scene.rosy.preset_name


class ROSY_OT_preset_apply(RosyOperator, bpy.types.Operator):
    """Replace the look of the scene with the look of this preset"""

    bl_label = "Apply Preset"

    preset: text(
        "Preset",
        "Name of a preset, or path of a .json file",
        search=preset_library.search_presets,
        search_options={"SUGGESTION"},
    )

    def act(self, context: bpy.types.Context) -> None:
        preset_library.apply_preset(context.scene.rosy, self.preset)


class _DescribedPreset(_PresetOperator):
    """Mixin of operators that ask for the name and the description of a preset."""

    #: Label of the button that confirms the dialog.
    confirm_text = ""

    name: text("Name", "Name of the preset", maxlen=store.MAX_NAME_LENGTH)
    sentence: text(
        "Description",
        "What the look is like, or what it is for",
        maxlen=store.MAX_DESCRIPTION_LENGTH,
    )

    def ask(self, context: bpy.types.Context, entry: preset_library.PresetEntry | None) -> set[str]:
        """Open the dialog for the name and the description of a preset.

        If there is an `entry`, the dialog first shows the name and the description of this preset.
        """
        if entry is not None:
            self.name, self.sentence = entry.preset.name, entry.preset.description
        return context.window_manager.invoke_props_dialog(
            self, width=400, confirm_text=self.confirm_text
        )

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.use_property_split = True
        self.layout.prop(self, "name")
        self.layout.prop(self, "sentence")


class ROSY_OT_preset_save(_DescribedPreset, bpy.types.Operator):
    """Save the look of this scene as one of your presets"""

    bl_label = "Save Preset"
    confirm_text = "Save"

    replace: REPLACE

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        entry = preset_library.active_entry(context.scene.rosy)
        return self.ask(context, entry if entry is not None and entry.is_user else None)

    def draw(self, context: bpy.types.Context) -> None:
        super().draw(context)
        with suppress(RosyError):  # the name may not be complete yet
            if store.preset_key(self.name) in preset_library.user_preset_keys():
                self.layout.label(text="You already have a preset of this name", icon="INFO")
                self.layout.prop(self, "replace")

    def act(self, context: bpy.types.Context) -> None:
        settings = context.scene.rosy
        preset = store.Preset(self.name.strip(), self.sentence.strip(), read_look(settings.look))
        folder = user_presets_folder()
        settings.preset_name = store.save_preset(preset, folder, replace=self.replace)
        self.report_done(f"Saved preset '{preset.name}'")
        redraw()


class ROSY_OT_preset_rename(_DescribedPreset, bpy.types.Operator):
    """Change the name or the description of one of your presets"""

    bl_label = "Rename Preset"
    confirm_text = "Rename"
    conditions = (HAS_USER_PRESETS,)

    preset: _preset_property(preset_library.user_preset_keys)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        return self.ask(context, preset_library.entries().get(_target_preset(self, context)))

    def act(self, context: bpy.types.Context) -> None:
        old, name = _target_preset(self, context), self.name.strip()
        old_name = preset_library.preset_name(old)
        new = store.rename_preset(old, name, self.sentence.strip(), user_presets_folder())
        preset_library.rename_references(old, new)
        self.report_done(f"Renamed preset '{old_name}' to '{name}'")
        redraw()


class ROSY_OT_preset_remove(_PresetOperator, bpy.types.Operator):
    """Delete one of your presets. The look of the scene does not change"""

    bl_label = "Delete Preset"
    conditions = (HAS_USER_PRESETS,)

    preset: _preset_property(preset_library.user_preset_keys)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        name = preset_library.preset_name(_target_preset(self, context))
        question = translated("Delete the preset '{name}'?").format(name=name)
        message, verb = translated("This cannot be undone"), translated("Delete")
        return self.ask_to_confirm(context, event, question, message, verb)

    def act(self, context: bpy.types.Context) -> None:
        key = _target_preset(self, context)
        name = preset_library.preset_name(key)
        store.remove_preset(key, user_presets_folder())
        self.report_done(f"Deleted preset '{name}'")
        redraw()


class ROSY_OT_preset_import(_PresetOperator, bpy.types.Operator, ImportHelper):
    """Add a preset from a file to your presets"""

    bl_label = "Import Preset"

    filename_ext = ".json"
    filter_glob: file_filter(".json")
    replace: REPLACE

    def act(self, context: bpy.types.Context) -> None:
        preset = store.read_preset(bpy.path.abspath(self.filepath))
        store.save_preset(preset, user_presets_folder(), replace=self.replace)
        self.report_done(f"Added preset '{preset.name}' to your presets")
        redraw()


class ROSY_OT_preset_export(_PresetOperator, bpy.types.Operator, ExportHelper):
    """Write a preset to a file that others can import"""

    bl_label = "Export Preset"

    filename_ext = ".json"
    filter_glob: file_filter(".json")
    preset: _preset_property(preset_library.search_presets)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.filepath = f"{Path(_target_preset(self, context)).stem}.json"
        return ExportHelper.invoke(self, context, event)

    def act(self, context: bpy.types.Context) -> None:
        path = Path(bpy.path.abspath(self.filepath))
        preset = store.load_preset(_target_preset(self, context), user_presets_folder())
        store.write_preset(path, preset, follow_links=True)
        self.report_done(f"Wrote {path}")
