"""Update the .po files in rosy_addon/ui/locale to the texts of the interface: `make translations`.

New texts are added without a translation, and those that are gone are removed. An empty file NAME.po becomes
that of a new language. It runs with Blender's Python module, in which it registers the extension.
"""

import ast
import importlib.util
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy

ROOT = Path(__file__).resolve().parents[1]

#: Blender's contexts of texts: that of most texts, which .po files leave out, and that of labels of operators.
DEFAULT_CONTEXT, OPERATOR_CONTEXT = "*", "Operator"

#: Numbers of characters of a label that fit into a sidebar of default width: beside a value, beside a value of
#: the look (`look_panels.LONG_LABEL_FACTOR` of the width instead of Blender's 0.4), and beside a checkbox.
#: They are measured in screenshots, for letters of mean width.
LABEL_LENGTH, LOOK_LABEL_LENGTH, CHECKBOX_LENGTH = 15, 18, 19

#: Arguments of layouts and dialogs that are shown, and functions whose last argument is translated.
TEXT_ARGUMENTS = {"text", "title", "heading"}
TRANSLATING_FUNCTIONS = {"translated", "Condition"}

#: Constants of classes that are shown.
TEXT_CONSTANTS = {"confirm_text"}

HEADER = """\
# The interface of RoSy. `make translations` adds and removes texts, and formats this file.
msgid ""
msgstr ""
"Language: {language}\\n"
"Content-Type: text/plain; charset=UTF-8\\n"
"""


def main() -> None:
    """Update all files, and print how many texts each of them lacks."""
    limits = interface_texts()
    from rosy.rosy_addon.ui import translations

    for path in sorted(translations.FOLDER.glob("*.po")):
        old = translations.read_translations(path)
        path.write_text(po_text(path.stem, limits, old), encoding="utf-8")
        missing = sum(not old.get(key) for key in limits)
        print(f"{path.relative_to(ROOT)}: {len(limits)} texts, {missing} without a translation")


def register_extension() -> ModuleType:
    """Register this tree as the extension `rosy`, and return its module. Blender crashes if it stays registered."""
    spec = importlib.util.spec_from_file_location(
        "rosy", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    assert spec is not None and spec.loader is not None
    module = sys.modules["rosy"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.register()
    return module


def interface_texts() -> dict[tuple[str, str], int]:
    """Return the contexts and English texts of the extension, sorted by the texts, with their limits.

    The limit of a label in a panel is the number of characters of a translation that fit. That of others is 0.
    """
    extension = register_extension()
    found = {*_class_texts(), *_preset_texts()}
    limits: dict[tuple[str, str], int] = {}
    for key, limit in _label_limits():
        limits[key] = max(min(limit, limits.get(key, limit)), len(key[1]))
    extension.unregister()
    for folder in ("rosy_addon/ui", "operators"):
        for path in (ROOT / folder).glob("*.py"):
            found |= {*_source_texts(path)}
    is_text = {key for key in found if any(map(str.isalpha, key[1]))}
    return {key: limits.get(key, 0) for key in sorted(is_text, key=lambda key: (key[1], key[0]))}


def _class_texts() -> Iterator[tuple[str, str]]:
    """Yield the texts of operators, tools, panels, menus, properties, and settings of looks and strokes."""
    from rosy.operators import registration
    from rosy.rosy_addon.compositor.look import Look
    from rosy.rosy_addon.core.settings import Numbers, settings_of
    from rosy.rosy_addon.line_drawing.style import StrokeStyle
    from rosy.rosy_addon.ui import (
        look_panels,
        main_panel,
        operator_settings,
        preferences,
        properties,
        strokes_panel,
    )

    for cls in (*main_panel.CLASSES, *look_panels.CLASSES, *strokes_panel.CLASSES):
        yield DEFAULT_CONTEXT, cls.bl_label
    for cls in (*properties.CLASSES, *preferences.CLASSES):
        yield from _property_texts(cls, cls.bl_rna)
    for cls, rna in _operators():
        yield rna.translation_context, rna.name
        yield DEFAULT_CONTEXT, rna.description
        yield from _property_texts(cls, rna)
    for tool in registration.TOOLS:
        yield OPERATOR_CONTEXT, tool.bl_label
        yield DEFAULT_CONTEXT, tool.bl_description
    for setting in [*settings_of(Look).values(), *settings_of(StrokeStyle).values()]:
        yield DEFAULT_CONTEXT, setting.panel_label
        for part in setting.parts if isinstance(setting, Numbers) else ():
            yield DEFAULT_CONTEXT, part
    for text in (*strokes_panel.STROKE_PANELS, *operator_settings.PLACEHOLDERS.values()):
        yield DEFAULT_CONTEXT, text


def _property_texts(cls: type, rna: Any) -> Iterator[tuple[str, str]]:
    """Yield the texts of the properties that RoSy gives a class."""
    for item in _properties(cls, rna):
        yield item.translation_context, item.name
        yield DEFAULT_CONTEXT, item.description
        for option in item.enum_items_static if item.type == "ENUM" else ():
            yield item.translation_context, option.name
            yield DEFAULT_CONTEXT, option.description


def _properties(cls: type, rna: Any) -> Iterator[Any]:
    """Yield the properties that RoSy gives a class, except those that are not shown."""
    bases = [base for base in cls.__mro__ if base.__module__.startswith("rosy.")]
    for name in {name for base in bases for name in inspect.get_annotations(base)}:
        item = rna.properties.get(name)
        if item is not None and not item.is_hidden and item.name not in ("", item.identifier):
            yield item


def _label_limits() -> Iterator[tuple[tuple[str, str], int]]:
    """Yield the labels of properties in the panels, and the numbers of characters that fit."""
    from rosy.rosy_addon.compositor.look import Look
    from rosy.rosy_addon.core.settings import Numbers, Switch, settings_of
    from rosy.rosy_addon.ui import properties

    for setting in settings_of(Look).values():
        label = setting.panel_label or setting.label
        length = CHECKBOX_LENGTH if isinstance(setting, Switch) else LOOK_LABEL_LENGTH
        yield (DEFAULT_CONTEXT, label), length
        for part in setting.parts if isinstance(setting, Numbers) else ():
            yield (DEFAULT_CONTEXT, part), LABEL_LENGTH
    groups = [(cls, cls.bl_rna) for cls in properties.CLASSES if cls is not properties.RosyLook]
    for cls, rna in [*groups, *_operators()]:
        for item in _properties(cls, rna):
            length = CHECKBOX_LENGTH if item.type == "BOOLEAN" else LABEL_LENGTH
            yield (item.translation_context, item.name), length


def _operators() -> Iterator[tuple[type, Any]]:
    """Yield the classes of operators, with Blender's descriptions."""
    from rosy.operators import registration

    for cls in registration.CLASSES:
        if issubclass(cls, bpy.types.Operator):
            yield cls, getattr(bpy.ops.rosy, cls.bl_idname.partition(".")[2]).get_rna_type()


def _preset_texts() -> Iterator[tuple[str, str]]:
    """Yield the names and descriptions of the presets that come with RoSy."""
    from rosy.rosy_addon.preset_files import store

    for path in store.preset_files().values():
        preset = store.read_preset(path)
        yield DEFAULT_CONTEXT, preset.name
        yield DEFAULT_CONTEXT, preset.description


def _source_texts(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the constant texts that a file shows in layouts and dialogs."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        shown: list[ast.expr] = []
        context = DEFAULT_CONTEXT
        if isinstance(node, ast.Call):
            function = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if function in ("operator", "operator_menu_enum"):
                context = OPERATOR_CONTEXT
            shown = [each.value for each in node.keywords if each.arg in TEXT_ARGUMENTS]
            if function in TRANSLATING_FUNCTIONS:
                shown.append(node.args[-1])
        elif isinstance(node, ast.Assign):
            names = {getattr(target, "id", "") for target in node.targets}
            shown = [node.value] if names & TEXT_CONSTANTS else []
        for value in shown:
            options = [value.body, value.orelse] if isinstance(value, ast.IfExp) else [value]
            for option in options:
                if isinstance(option, ast.Constant) and isinstance(option.value, str):
                    yield context, option.value


def po_text(
    language: str, limits: dict[tuple[str, str], int], translations: dict[tuple[str, str], str]
) -> str:
    """Return the contents of the .po file of a language, given `interface_texts` and what is translated."""
    parts = [HEADER.format(language=language)]
    for key, limit in limits.items():
        context, text = key
        lines = [f"#. A label: up to {limit} characters"] if limit else []
        lines += [] if context == DEFAULT_CONTEXT else [f"msgctxt {_quoted(context)}"]
        lines += [f"msgid {_quoted(text)}", f"msgstr {_quoted(translations.get(key, ''))}"]
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def _quoted(text: str) -> str:
    """Return a text in quotes, escaped for a .po file."""
    for character, escape in (("\\", "\\\\"), ('"', '\\"'), ("\n", "\\n"), ("\t", "\\t")):
        text = text.replace(character, escape)
    return f'"{text}"'


if __name__ == "__main__":
    main()
