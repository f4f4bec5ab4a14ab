"""The page of looks: every setting from its own metadata, and what the main ones do."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.presets import load_preset, preset_names
from rosy_addon.field.generate import curvature_field

from .figure_11 import smoothed_a_little
from .page import ROOT
from .plane import draw_field
from .shapes import suzanne
from .sheet import Panel, display, save, sheet
from .solid import compose_view, view

PAGE = ROOT / "docs" / "looks.md"
IMAGES = ROOT / "docs" / "images"

#: Settings shown at several values, and what is to be seen there.
SHOWN = {
    "length": (
        (10, 40, 160),
        "Longer streaks show where directions lead, and want more gain; short ones show turns.",
    ),
    "grain": ((1.0, 1.5, 4.0), "Broader streaks read from further away and hide small detail."),
    "density": (
        (0.02, 0.1, 0.5),
        "Few bright cells leave single streaks; half of them are a weave.",
    ),
    "high_pass": (
        (0.0, 16.0, 4.0),
        "Without it crossing streaks gather into clouds; 0 is the paper's.",
    ),
    "gain": ((1.0, 2.5, 6.0), "1 is the contrast of one direction alone; more comes near ink."),
}
SIDE = 256

#: What is said of a user's own presets, a paragraph each.
OWN = (
    "![The presets in the panel, each with its picture and its sentence](images/presets.png)",
    "In the panel's *Look* section, the picture opens all presets; a choice can be undone. The "
    "line below says which one the look was taken from, and whether it was changed since. **+** "
    "keeps the look of the scene as a preset of your own, with a name, a sentence, and a picture "
    "that RoSy draws; the menu beside it renames and deletes your own, and imports and exports. "
    "None is replaced or deleted unless you say so, and those that come with RoSy stay as they are.",
    "They are in the extension's folder among Blender's user files, which stays when RoSy is "
    "updated; `blender -b --command rosy presets` lists all with their sentences and says where "
    "yours are. Plain Python, which knows no Blender, keeps its own with the user's data: "
    "`python -m rosy_addon presets` says where, and the environment variable `ROSY_PRESETS` "
    "names one folder for both.",
    "`--preset` takes what `presets` lists, a name as it is in the panel, or the path of a file.",
    "A preset is a small `.json` file that can be read, mailed and pasted: a `name` (a line of at "
    "most 48 characters), a `description` (200) and a `look` of the settings that differ from the "
    "default. There is no picture in it, since every RoSy draws the same one from the look. It is "
    "data, and a stranger's is safe to import: at most 64 KiB, nothing but these entries, and a "
    "setting or a value that does not exist is refused in one line that names it.",
    """```json
{
  "name": "Wet ink",
  "description": "Long lines that run together in the dark",
  "look": {
    "length": 90,
    "ink": "hatch",
    "ink_colour": "#102030"
  }
}
```""",
    "The buttons are operators, `preset_apply`, `preset_save`, `preset_rename`, `preset_remove`, "
    "`preset_import` and `preset_export`, over functions of `rosy_addon.compositor.presets`: "
    "`load_preset`, `save_preset`, `rename_preset`, `remove_preset`, `read_preset`, `write_preset`.",
)


def write() -> None:
    """Draw and write the page."""
    pieces = [
        "# Looks",
        "A *look* is everything that can be chosen about a picture. In Blender it is in the panel's "
        "*Look* section, on the command line `--preset NAME` and `--set NAME=VALUE`, in a script a "
        "`Look` from `rosy_addon.compositor.look`. Lengths are in pixels of the finished picture. "
        "This page is written, and its pictures are drawn, by `make gallery`.",
        "## Presets",
        _presets(),
        "## Presets of your own",
        *OWN,
        "## What the main settings do",
        *(_setting(name, values, text) for name, (values, text) in SHOWN.items()),
        "## All settings",
        _table(),
    ]
    PAGE.write_text("\n\n".join(pieces) + "\n", encoding="utf-8")


def _presets() -> str:
    """A sheet of Suzanne in every preset, and their descriptions."""
    monkey = suzanne()
    curved = curvature_field(monkey, 4)
    even = smoothed_a_little(monkey, curved)
    presets = [load_preset(name) for name in preset_names()]
    panels = []
    for preset in presets:
        look = preset.look.with_settings({"supersampling": 2})
        field = even if look.magnitude == "none" else curved
        camera = view(monkey, (-26, 8), (SIDE, SIDE), look.supersampling)
        shown = display(compose_view(monkey, field, look, camera).rgba)
        panels.append(Panel(shown, preset.name))
    path = IMAGES / "looks-presets.png"
    save(sheet([panels[start : start + 3] for start in range(0, len(panels), 3)]), path)
    lines = [f"![Suzanne in every preset](images/{path.name})", ""]
    lines += [f"- **{preset.name}**: {preset.description}." for preset in presets]
    return "\n".join(lines)


def _pair(p: np.ndarray) -> np.ndarray:
    """Singularities of index 1 / N and -1 / N, a third of the picture apart."""
    left, right = p + SIDE / 6, p - SIDE / 6
    return left / np.abs(left) * (right / np.abs(right)).conj() * np.exp(0.6j)


def _setting(name: str, values: tuple[Any, ...], text: str) -> str:
    """One setting at several values."""
    panels = []
    for value in values:
        look = Look().with_settings({name: value})
        panels.append(Panel(draw_field(_pair, 4, SIDE, look), f"{name} {value:g}"))
    path = IMAGES / f"looks-{name.replace('_', '-')}.png"
    save(sheet([panels]), path)
    return f"`{name}`: {text}\n\n![{name} at {_listed(values)}](images/{path.name})"


def _table() -> str:
    lines = ["| setting | default | values | what it does |", "| --- | --- | --- | --- |"]
    for entry in fields(Look):
        rules, default = entry.metadata, entry.default
        text = rules["text"]
        if "options" in rules:
            values = "<br>".join(
                f"`{option}`: {about}" for option, about in rules["options"].items()
            )
        elif "colour" in rules:
            values = "a colour, `#rrggbb`"
        elif isinstance(default, bool):
            values = "`true`, `false`"
        else:
            values = f"{rules['low']:g} to {rules['high']:g}"
            values += " radians" if rules.get("unit") == "angle" else ""
        shown = str(default).lower() if isinstance(default, bool) else default
        lines.append(f"| `{entry.name}` | `{shown}` | {values} | {text} |")
    return "\n".join(lines)


def _listed(values: tuple[Any, ...]) -> str:
    return ", ".join(f"{value:g}" for value in values)
