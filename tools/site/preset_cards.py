"""Hook of MkDocs: add clickable pictures of the presets, and their settings, to the page of the presets."""

import json
from pathlib import Path
from typing import NamedTuple

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import Files
from pymdownx.slugs import slugify
from repository_pages import ROOT, repository_file

PAGE = "docs/presets.md"
FOLDER = "presets"

_slug = slugify(case="lower")


class Preset(NamedTuple):
    """A preset that comes with RoSy.

    Attributes
    ----------
    key : str
        Name of its files, without the suffix.
    name, description : str
        Texts for users.
    look : dict
        The settings that differ from their defaults.
    anchor : str
        Anchor of its section in the page.
    """

    key: str
    name: str
    description: str
    look: dict[str, object]
    anchor: str


def on_files(files: Files, *, config) -> Files:
    """Add the pictures of the presets to the files of the site."""
    for preset in _presets():
        source = f"{FOLDER}/{preset.key}.png"
        files.append(repository_file(source, f"images/presets/{preset.key}.png", config))
    return files


def on_page_markdown(markdown: str, *, page, config, files) -> str:
    """Add the pictures below the title, and the settings of each preset to its section."""
    if page.file.src_uri != PAGE:
        return markdown
    introduction, *sections = markdown.split("\n## ")
    title, _, rest = introduction.partition("\n")
    presets = {preset.name: preset for preset in _presets()}
    parts = [title, _cards(list(presets.values())), rest.strip()]
    for section in sections:
        name = section.partition("\n")[0].strip()
        preset = presets.pop(name, None)
        parts.append(f"## {section.rstrip()}")
        if preset is not None:
            parts.append(_settings(preset))
    if presets:
        raise PluginError(f"{PAGE}: no section describes the preset {next(iter(presets))}")
    return "\n\n".join(parts)


def _presets() -> list[Preset]:
    """Read the presets in the order of the panel: the default first, the others by name."""
    presets = []
    for path in (ROOT / FOLDER).glob("*.json"):
        content = json.loads(path.read_text(encoding="utf-8"))
        name, look = content["name"], content.get("look", {})
        presets.append(Preset(path.stem, name, content["description"], look, _slug(name, "-")))
    return sorted(presets, key=lambda preset: (preset.key != "default", preset.key))


def _cards(presets: list[Preset]) -> str:
    pictures = Path("..") / FOLDER
    cards = [
        f"-   [![{preset.name}: {preset.description}]({(pictures / preset.key).as_posix()}.png)"
        f"](#{preset.anchor})\n"
        f"    [{preset.name}](#{preset.anchor}) [Settings](#{preset.anchor}-settings)"
        for preset in presets
    ]
    return '<div class="preset-cards" markdown>\n\n' + "\n".join(cards) + "\n\n</div>"


def _settings(preset: Preset) -> str:
    """Return Markdown with the settings that differ from their defaults, in a block that opens on a click."""
    if not preset.look:
        return f"All settings have their defaults.\n{{ #{preset.anchor}-settings }}"
    rows = [f"| `{name}` | `{json.dumps(value)}` |" for name, value in preset.look.items()]
    table = "\n".join(["| Setting | Value |", "| --- | --- |", *rows])
    return (
        f'<details id="{preset.anchor}-settings" markdown>\n<summary>Settings</summary>\n\n'
        f"{table}\n\nAll others have their defaults: [all settings](looks.md#all-settings).\n\n"
        "</details>"
    )
