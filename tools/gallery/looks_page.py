"""The page of looks: every setting from its own metadata, and what the main ones do."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.presets import Preset, load_preset, preset_names
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
        "A preset of your own is a `.json` file with a `name`, a `description` and a `look` of the "
        "settings that differ from the default: `--preset mine.json`. It is data; a file with "
        "a setting or a value that does not exist is refused with its name.",
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
    presets = [Preset("Default", "What a new scene has", Look())]
    presets += [load_preset(name) for name in preset_names()]
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
