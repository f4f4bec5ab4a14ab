"""The interface in other languages: the .po files in the folder `locale`, registered with Blender.

Blender translates labels, descriptions and constant texts of layouts by itself. Its own translations come
first. Texts that are put together from parts go through `translated`.
"""

import re
import sys
from pathlib import Path

import bpy

from ..core.errors import RosyError
from ..core.file_io import read_bytes
from ..scene.files import EXTENSION_ID

#: Folder of the .po files. A file has Blender's name of its language, such as pt_BR, or the first part of
#: this name.
FOLDER = Path(__file__).parent / "locale"

#: Blender's context of most texts, which .po files leave out. Labels of operators have the context Operator.
DEFAULT_CONTEXT = "*"

#: A line of a .po file with a text. Without a keyword, it continues the text of the line above.
LINE = re.compile(r'(?:(msgctxt|msgid|msgstr)\s+)?"((?:[^"\\]|\\.)*)"')

#: Characters that are escaped in .po files, by the letter after the backslash. Others stand for themselves.
ESCAPED = {"n": "\n", "t": "\t"}

#: Texts of the interface, by context and English text.
Messages = dict[tuple[str, str], str]


def translated(text: str) -> str:
    """Return a text of the interface in the language of the user."""
    return bpy.app.translations.pgettext_iface(text)


def read_translations(path: Path) -> Messages:
    """Return the translations in a .po file; they are empty for texts that are not yet translated.

    Raises
    ------
    RosyError
        If the file cannot be read, or a line does not belong in a .po file. Plurals are not supported.
    """
    try:
        lines = read_bytes(path).decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise RosyError(f"{path}: is not a text in UTF-8") from None
    entries: list[dict[str, str]] = []
    keyword = None
    for number, line in enumerate(map(str.strip, lines), start=1):
        if not line or line.startswith("#"):
            continue
        match = LINE.fullmatch(line)
        keyword = match and (match[1] or keyword)
        if not match or not keyword:
            raise RosyError(f"{path}, line {number}: expected msgctxt, msgid or msgstr with a text")
        if match[1] and (not entries or "msgstr" in entries[-1]):
            entries.append({})
        text = re.sub(r"\\(.)", lambda escape: ESCAPED.get(escape[1], escape[1]), match[2])
        entries[-1][keyword] = entries[-1].get(keyword, "") + text
        if keyword == "msgstr" and "msgid" not in entries[-1]:
            raise RosyError(f"{path}, line {number}: there is no msgid above this msgstr")
    messages = {
        (entry.get("msgctxt", DEFAULT_CONTEXT), entry.get("msgid", "")): entry.get("msgstr", "")
        for entry in entries
    }
    messages.pop((DEFAULT_CONTEXT, ""), None)  # the header
    return messages


def register() -> None:
    """Register the translations with Blender. Print an error for each file that cannot be read, and skip it."""
    languages = {}
    for path in sorted(FOLDER.glob("*.po")):
        try:
            messages = read_translations(path)
        except RosyError as error:
            print(f"RoSy: no translation: {error}", file=sys.stderr)
            continue
        languages[path.stem] = {key: text for key, text in messages.items() if text}
    bpy.app.translations.register(EXTENSION_ID, languages)


def unregister() -> None:
    """Remove the translations from Blender."""
    bpy.app.translations.unregister(EXTENSION_ID)
