"""Faults of the bytes, lines and words of a file."""

from __future__ import annotations

from collections.abc import Callable

from numpy.random import Generator

#: Words that readers may stumble over.
WORDS = (
    *("nan", "inf", "-inf", "NaN", "1e400", "-1e308", "1e-320", "5e-324", "1e38", "1e160", "1e13"),
    *(
        "-1",
        "0",
        "-0",
        "00",
        "1.5",
        "2147483648",
        "4294967296",
        "9" * 20,
        "9" * 5000,
        "-" + "9" * 19,
    ),
    *("", "#", "\\", "1,2", "0x10", "1_000", "1d5", "+1", "--1", "1e", "e", ".", "True", "None"),
    *(
        "\x1b[31m",
        "\x07",
        "\u202e",
        "\u0663",
        "\xa0",
        "\ufeff",
        "é",
        "a" * 300,
        "%s",
        "{0}",
        "/",
        "//",
    ),
    *("f", "v", "vt", "element", "property", "list", "end_header", "OFF", "nan nan nan", "solid"),
)


def damaged(rng: Generator, data: bytes) -> bytes:
    """Return the data with one to four random faults."""
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        data = _FAULTS[rng.integers(len(_FAULTS))](rng, data)
    return data


def _truncate(rng: Generator, data: bytes) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _flip_bytes(rng: Generator, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.integers(1, 9)):
        if changed:
            changed[rng.integers(len(changed))] = rng.integers(256)
    return bytes(changed)


def _replace_words(rng: Generator, data: bytes) -> bytes:
    lines = data.split(b"\n")
    for _ in range(rng.integers(1, 4)):
        row = rng.integers(min(len(lines), 12) if rng.random() < 0.4 else len(lines))
        words = lines[row].split(b" ")
        words[rng.integers(len(words))] = _word(rng)
        lines[row] = b" ".join(words)
    return b"\n".join(lines)


def _insert_word(rng: Generator, data: bytes) -> bytes:
    position = rng.integers(len(data) + 1)
    return data[:position] + b" " + _word(rng) + b" " + data[position:]


def _edit_lines(rng: Generator, data: bytes) -> bytes:
    lines = data.split(b"\n")
    row, other = rng.integers(len(lines), size=2)
    match rng.integers(5):
        case 0:
            del lines[row]
        case 1:
            lines.insert(row, lines[other])
        case 2:
            lines[row], lines[other] = lines[other], lines[row]
        case 3:
            lines.insert(row, _word(rng))
        case 4:
            lines[row:] = lines[row : row + 1] * int(rng.integers(2, 50))
    return b"\n".join(lines)


def _change_newlines(rng: Generator, data: bytes) -> bytes:
    return data.replace(b"\n", (b"\r\n", b"\r", b"\n\n", b" ")[rng.integers(4)])


def _change_encoding(rng: Generator, data: bytes) -> bytes:
    match rng.integers(4):
        case 0:
            return b"\xef\xbb\xbf" + data
        case 1:
            return data.decode("latin-1").encode("utf-16")
        case 2:
            return b"\x1f\x8b\x08" + data
        case _:
            return data + b"\0" * int(rng.integers(1, 5000))


def _cut_out(rng: Generator, data: bytes) -> bytes:
    start, end = sorted(rng.integers(len(data) + 1, size=2))
    return data[:start] + data[end:] if rng.random() < 0.5 else data[:end] + data[start:]


def _replace_all(rng: Generator, data: bytes) -> bytes:
    return rng.bytes(rng.integers(200)) if rng.random() < 0.5 else b""


def _word(rng: Generator) -> bytes:
    return WORDS[rng.integers(len(WORDS))].encode()


_FAULTS: tuple[Callable[[Generator, bytes], bytes], ...] = (
    *(_truncate, _flip_bytes, _flip_bytes, _replace_words, _replace_words, _replace_words),
    *(_insert_word, _edit_lines, _edit_lines, _change_newlines, _change_encoding, _cut_out),
    _replace_all,
)
