"""The .po files of the interface: complete, with the placeholders and the lengths that fit, and read correctly."""

import json
import subprocess
import sys
from pathlib import Path
from string import Formatter
from types import SimpleNamespace

import pytest
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.ui import translations

ROOT = Path(__file__).resolve().parents[2]

FILES = sorted(translations.FOLDER.glob("*.po"))

#: The tool registers the extension, which these tests have registered in part, so another process runs it.
COLLECT = """
import json
from tools.translations import interface_texts, po_text
limits = interface_texts()
from rosy.rosy_addon.ui import translations
files = {
    path.name: po_text(path.stem, limits, translations.read_translations(path))
    for path in translations.FOLDER.glob("*.po")
}
print(json.dumps([[[*key, limit] for key, limit in limits.items()], files]))
"""


@pytest.fixture(scope="module")
def collected():
    """The limits of the lengths by context and text, and what the tool would write to each file."""
    command = [sys.executable, "-c", COLLECT]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    rows, files = json.loads(done.stdout.splitlines()[-1])
    return {(context, text): limit for context, text, limit in rows}, files


def test_there_is_a_german_translation():
    assert "de.po" in [path.name for path in FILES]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_files_have_all_texts_and_no_others(path, collected):
    """After a change of a text, `make translations` updates the files. Texts may wait for their translation."""
    limits, files = collected
    assert len(limits) > 500
    assert path.read_text(encoding="utf-8") == files[path.name]
    messages = translations.read_translations(path)
    assert messages.keys() == limits.keys()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_translations_have_the_placeholders_of_the_texts(path):
    for (_, text), translation in translations.read_translations(path).items():
        assert not translation or placeholders(translation) == placeholders(text), text


def placeholders(text):
    """The names and formats in braces, in any order."""
    return sorted((name, form) for _, name, form, _ in Formatter().parse(text) if name is not None)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_labels_fit_into_the_panels(path, collected):
    messages = translations.read_translations(path)
    limits = {key: limit for key, limit in collected[0].items() if limit}
    assert len(limits) > 100
    too_long = {
        key[1]: messages[key] for key, limit in limits.items() if len(messages[key]) > limit
    }
    assert too_long == {}


def read(tmp_path, text):
    path = tmp_path / "xx.po"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return translations.read_translations(path)


def test_escapes_contexts_and_texts_of_several_lines(tmp_path):
    text = r"""
# A comment, and the header
msgid ""
msgstr "Language: xx\n"

#. Up to 15 characters
msgctxt "Operator"
msgid "Bake"
msgstr "B\"a\\c\tk"

msgid ""
"one "
"two\n"
msgstr "eins "
"\\n zwei"
msgid "open"
msgstr ""
"""
    assert read(tmp_path, text) == {
        ("Operator", "Bake"): 'B"a\\c\tk',
        ("*", "one two\n"): "eins \\n zwei",
        ("*", "open"): "",
    }


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ('msgid "a"\nmsgstr "b', "line 2: expected msgctxt"),
        ('msgid "a"\nmsgid_plural "b"', "line 2: expected msgctxt"),
        ('\n"a"', "line 2: expected msgctxt"),
        ('msgstr "a"', "line 1: there is no msgid"),
        (b'msgid "\xff"', "is not a text in UTF-8"),
    ],
)
def test_broken_files_are_refused_with_the_line(tmp_path, text, fault):
    with pytest.raises(RosyError, match=rf"xx\.po.*: {fault}|xx\.po, {fault}"):
        read(tmp_path, text)


def test_a_broken_file_leaves_the_english_texts(tmp_path, monkeypatch, capsys):
    (tmp_path / "xx.po").write_text("msgid a")
    (tmp_path / "yy.po").write_text('msgid "a"\nmsgstr "b"\nmsgid "open"\nmsgstr ""')
    registered = []
    monkeypatch.setattr(translations, "FOLDER", tmp_path)
    app = SimpleNamespace(
        translations=SimpleNamespace(register=lambda *given: registered.append(given))
    )
    monkeypatch.setattr(translations, "bpy", SimpleNamespace(app=app))
    translations.register()
    assert [languages for _, languages in registered] == [{"yy": {("*", "a"): "b"}}]
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("RoSy: no translation: ") and "xx.po, line 1" in line
