"""The grammar of messages."""

import pytest

from rosy_addon.core.errors import RosyError, as_sentence, counted


@pytest.mark.parametrize(
    ("message", "shown"),
    [
        ("object 'a/b': the mesh has no faces", "Object 'a/b': the mesh has no faces"),
        ("an .mp4 needs ffmpeg", "An .mp4 needs ffmpeg"),
        ("'plaid' is not one of your presets", "'plaid' is not one of your presets"),
        ("/tmp/ink.json: is damaged", "/tmp/ink.json: is damaged"),
        ("fields\\ink.json: is damaged", "fields\\ink.json: is damaged"),
        ("ink.json: is damaged", "ink.json: is damaged"),
        ("min_length must be less than max_length", "min_length must be less than max_length"),
        ("dir0 is missing", "dir0 is missing"),
        ("", ""),
    ],
)
def test_only_words_get_a_capital(message, shown):
    assert as_sentence(message) == shown


def test_an_error_can_be_written_in_any_encoding_of_unicode():
    """A name of a file may have bytes that are no text; Python reads them as lone surrogates."""
    error = str(RosyError("a\udcff\ud800\uffff\x1b\n\t: is missing"))
    assert error == r"a\udcff\ud800\uffff\x1b\n\t: is missing" and error.encode()


def test_one_is_singular():
    texts = [counted(count, "picture") for count in (0, 1, 2)]
    assert texts == ["0 pictures", "1 picture", "2 pictures"]
