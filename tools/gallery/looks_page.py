"""Write docs/looks.md: the presets, and all settings with a picture of each."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.look import Look, uses_magnitude
from rosy_addon.core.settings import (
    Choice,
    Color,
    Number,
    Numbers,
    Setting,
    panel_settings,
    settings_of,
)
from rosy_addon.field.analysis import angle_errors
from rosy_addon.field.curvature import curvature_field
from rosy_addon.field.generate import generate
from rosy_addon.preset_files.store import load_preset, preset_keys
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

from .page import ROOT
from .setting_pictures import (
    SETTINGS,
    WEBP_QUALITY,
    check_every_setting_is_shown,
    setting_strip,
    value_label,
)
from .shapes import suzanne
from .sheet import Panel, display, save, sheet
from .solid import compose_view, smoothed_a_little, view

PAGE = ROOT / "docs" / "looks.md"
IMAGES = ROOT / "docs" / "images"

SIDE = 256

#: Markdown about the user's own presets.
OWN = (
    "![The presets in the panel, each with its picture and its description](images/presets.png)",
    "To choose a preset, click the picture in the panel's *Look* section. You can undo the choice. "
    "The line below the picture shows the name of the preset, and whether the look has changed "
    "since. **+** saves the look of the scene as your own preset, with a name, a description, and "
    "a picture that RoSy draws. The menu beside it renames, deletes, imports and exports your "
    "presets. RoSy never replaces or deletes a preset unless you confirm. The presets that come "
    "with RoSy do not change.",
    "Your presets are in the extension's folder among Blender's user files. An update of RoSy "
    "keeps this folder. `blender -b --command rosy presets` lists all presets with their "
    "descriptions and prints the folder. Plain Python, without Blender, keeps its presets in the "
    "user's data folder; `rosyfields presets` prints it. The environment variable "
    "`ROSY_PRESETS` sets one folder for both.",
    "`--preset` takes a name from the output of `presets`, a name as shown in the panel, or the "
    "path of a file.",
    "A preset is a small, readable `.json` file with three entries: a `name` (one line of at most "
    "48 characters), a `description` (at most 200 characters), and a `look` with the settings that "
    "differ from the default. It contains no picture, because RoSy draws the picture from the "
    "look. A preset is only data, so you can safely import one from other people. A file has at "
    "most 64 KiB and no other entries. If a setting or a value does not exist, the error message "
    "names it.",
    """```json
{
  "name": "Wet ink",
  "description": "Long lines that run together in the dark",
  "look": {
    "length": 90,
    "ink": "hatch",
    "ink_color": "#102030"
  }
}
```""",
    "The buttons are operators: `preset_apply`, `preset_save`, `preset_rename`, `preset_remove`, "
    "`preset_import` and `preset_export`. They call functions of the module "
    "`rosy_addon.preset_files.store`: `load_preset`, `save_preset`, `rename_preset`, `remove_preset`, "
    "`read_preset` and `write_preset`.",
)

#: Markdown about attributes as colors.
NUMBERS = (
    "`hue` with `values` shows numbers on the surface through the color map: the angle between two "
    "fields, a curvature, an error. In Blender, choose *Look > Color > Hue: Values* and the "
    "*Attribute*: numbers on points, faces or corners; of colors, the luminance. Scripts give "
    "`color_values` to `render`, `turntable` and `texture`, and the commands `render` and `turntable` "
    "have `--color-values NAME`, for an array of the file:",
    """```python
import numpy as np
import rosyfields as rf

surface = rf.Surface("spot.obj")
field, other = rf.form(surface, 4), rf.curvature(surface, 4)
degrees = np.degrees(field.difference(other).angle)
rf.render(surface, field, color_values=degrees, color_range=(0, 45)).save("spot.png")
```""",
    "- Numbers of faces are constant on each face; those of points and corners are interpolated.\n"
    "- `color_range` holds the numbers at the bottom and at the top of `color_map`. If both are 0, they "
    "are the lowest and the highest number on all objects with a field, whether the camera sees them or "
    "not, so that pictures from several sides have the same colors. If the bottom is the greater number, "
    "the map is inverted.\n"
    "- Where there is no number (NaN, or another object without the attribute), streaks are gray, and "
    "hatching has the color of its ink.\n"
    "- Hatching of [textures](textures.md) and pictures with *Output > Relight* have the colors of their inks.",
)


def write() -> None:
    """Draw and write the page."""
    check_every_setting_is_shown()
    pieces = [
        "# Looks",
        "With a *look* you choose how a field is drawn. A look is the set of all settings of a "
        "picture. In Blender, it is the *Look* section of the panel. On the command line, use "
        "`--preset NAME` and `--set NAME=VALUE`. In a script, use a `Look` from "
        "`rosy_addon.compositor.look`. Lengths are in pixels of the finished picture. `make "
        "gallery` writes this page and draws its pictures.",
        "## Presets",
        _presets(),
        "## Your own presets",
        *OWN,
        "## Numbers as colors",
        _numbers(),
        *NUMBERS,
        "## All settings",
        *_settings(),
    ]
    PAGE.write_text("\n\n".join(pieces) + "\n", encoding="utf-8")


def _presets() -> str:
    """Draw Suzanne in every preset, and return Markdown with the descriptions of the presets."""
    monkey = suzanne()
    curved = curvature_field(monkey, 4)
    even = smoothed_a_little(monkey, curved)
    presets = [load_preset(name) for name in preset_keys()]
    panels = []
    for preset in presets:
        look = preset.look.with_settings({"supersampling": 2})
        field = even if not uses_magnitude(look) else curved
        camera = view(monkey, (-26, 8), (SIDE, SIDE), look.supersampling)
        shown = display(compose_view(monkey, field, look, camera).rgba)
        panels.append(Panel(shown, preset.name))
    path = IMAGES / "looks-presets.png"
    save(sheet([panels[start : start + 3] for start in range(0, len(panels), 3)]), path)
    lines = [f"![Suzanne in every preset](images/{path.name})", ""]
    lines += [f"- **{preset.name}**: {preset.description}." for preset in presets]
    return "\n".join(lines)


def _numbers() -> str:
    """Draw Suzanne with attributes as colors, and return Markdown about them.

    The attributes are the angle between two fields, and a height that is not known everywhere.
    """
    monkey = suzanne()
    field, other = generate(monkey, "form", 4), curvature_field(monkey, 4)
    angle = np.degrees(angle_errors(monkey, field, other))[monkey.corner_face]
    height = monkey.vertices[monkey.corner_vertex, 2]
    known = np.where(monkey.vertices[monkey.corner_vertex, 0] < 0.2, height, np.nan)
    panels = []
    for text, preset, values, settings in (
        ("angle to the curvature field", "default", angle, {"color_range": (0.0, 45.0)}),
        ("height, magma, as an engraving", "engraving", height, {"color_map": "magma"}),
        ("height, on the left only", "default", known, {}),
    ):
        look = load_preset(preset).look.with_settings(
            {"supersampling": 2, "hue": "values", **settings}
        )
        instance = MeshInstance(monkey, np.eye(4), field, color_values=values.astype(np.float32))
        camera = view(monkey, (-26, 8), (SIDE, SIDE), look.supersampling)
        rgba = compose(project([instance], camera, look.display), look).rgba
        panels.append(Panel(display(rgba), text))
    path = IMAGES / "looks-values.png"
    save(sheet([panels]), path)
    return (
        "![Suzanne, colored by the angle between two fields, by height, and by height on one side]"
        f"(images/{path.name})"
    )


def _settings() -> list[str]:
    """Return Markdown that describes all settings, panel by panel, and draw a picture of each setting."""
    pieces = []
    panels = dict.fromkeys(setting.panel for setting in settings_of(Look).values())
    for panel in sorted(panels, key=lambda panel: not panel):
        pieces.append(f"### {panel.capitalize() or 'Advanced'}")
        for name in panel_settings(Look, panel):
            setting = settings_of(Look)[name]
            pieces.append(f"**`{name}`**: {setting.text}.")
            pieces.append(_values(setting))
            path = IMAGES / f"looks-{name.replace('_', '-')}.webp"
            setting_strip(name).save(path, quality=WEBP_QUALITY, method=6)
            listed = ", ".join(value_label(name, value) for value in SETTINGS[name].values)
            pieces.append(f"![{name} at {listed}](images/{path.name})")
    return pieces


def _values(setting: Setting) -> str:
    """Return the allowed values of a setting and its default, as Markdown."""
    default = value_label(setting.name, setting.default)
    match setting:
        case Choice(options=options):
            return "\n".join(
                f"- `{option}`{' (default)' * (option == default)}: {text}."
                for option, text in options.items()
            )
        case Color(has_alpha=has_alpha):
            text = "a color, `#rrggbb`" + " or `#rrggbbaa`" * has_alpha
        case Number(low=low, high=high, is_integer=True):
            text = f"{low:,} to {high:,}"
        case Number(low=low, high=high, unit=unit):
            text = f"{low:g} to {high:g}{' radians' if unit == 'angle' else ''}"
        case Numbers(parts=parts):
            text = ", ".join(
                f"{name.lower()} {low:g} to {high:g}" for name, (low, high) in parts.items()
            )
        case _:
            text = "`on` or `off`"
    return f"Values: {text}. Default: `{default}`."
