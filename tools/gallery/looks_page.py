"""Fill in the settings of looks in docs/looks.md, with a picture of each, as `settings.toml` describes."""

import tomllib
from pathlib import Path
from typing import Any

from PIL import Image

from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import (
    Choice,
    Color,
    Number,
    Numbers,
    Setting,
    panel_settings,
    settings_of,
)

from .page import IMAGES, ROOT
from .sheet import sheet
from .sheets import draw_panel

PAGE = ROOT / "docs" / "looks.md"

#: The heading of the page below which everything is replaced.
HEADING = "## All settings"

TABLES = tomllib.loads(Path(__file__).with_name("settings.toml").read_text(encoding="utf-8"))

#: Side of a picture in pixels, and the number of pictures in a row.
SIDE, COLUMNS = 192, 4

#: Direction to the sun, for looks with the lights of the scene.
SUN = (-0.55, -0.5, 0.75)

#: Quality of the .webp files, which are lossy: in lossless formats, pictures of noise take much space.
WEBP_QUALITY = 60


def write() -> None:
    """Draw the pictures and write the page.

    Raises
    ------
    ValueError
        If a setting of looks has no picture in `settings.toml`, or the file has another setting.
    """
    if different := set(settings_of(Look)) ^ set(TABLES["settings"]):
        raise ValueError(f"settings and pictures differ: {', '.join(sorted(different))}")
    pieces = []
    panels = dict.fromkeys(setting.panel for setting in settings_of(Look).values())
    for panel in sorted(panels, key=lambda panel: not panel):
        pieces.append(f"### {panel.capitalize() or 'Advanced'}")
        for name in panel_settings(Look, panel):
            setting, values = settings_of(Look)[name], TABLES["settings"][name]["values"]
            path = IMAGES / f"looks-{name.replace('_', '-')}.webp"
            _strip(name).save(path, quality=WEBP_QUALITY, method=6)
            listed = ", ".join(_label(name, value) for value in values)
            picture = f"![{name} at {listed}](images/{path.name})"
            pieces += [f"**`{name}`**: {setting.text}.", _values(setting), picture]
    text = PAGE.read_text(encoding="utf-8").partition(HEADING)[0]
    PAGE.write_text("\n\n".join([text + HEADING, *pieces]) + "\n", encoding="utf-8")


def _strip(name: str) -> Image.Image:
    """Return an image with a picture for each value of a setting, side by side in rows."""
    table = {"scene": "head", "preset": "default", **TABLES["settings"][name]}
    frame = {"size": [SIDE, SIDE], "sun": SUN, "finished": True, "look": {"supersampling": 2}}
    values, panels = table.pop("values"), []
    for value in values:
        look = value if isinstance(value, dict) else {name: value}
        shown = {"look": look, "label": _label(name, value)}
        panels.append(draw_panel(TABLES["scenes"][table["scene"]], frame, table, shown))
    return sheet([panels[start : start + COLUMNS] for start in range(0, len(panels), COLUMNS)])


def _label(name: str, value: Any) -> str:
    """Return a value of a setting as text, as it is written on the command line."""
    if isinstance(value, dict):
        return ", ".join(_label(key, part) for key, part in value.items() if key in (name, "ink"))
    if isinstance(value, bool):
        return "on" if value else "off"
    parts = value if isinstance(value, (list, tuple)) else (value,)
    return ",".join(part if isinstance(part, str) else f"{part:g}" for part in parts)


def _values(setting: Setting) -> str:
    """Return the allowed values of a setting and its default, as Markdown."""
    default = _label(setting.name, setting.default)
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
