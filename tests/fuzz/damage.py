"""Faults of the bytes, lines and words of a file."""

from collections.abc import Callable

from numpy.random import Generator

#: Words that readers may stumble over, and words of the formats in other places.
_NUMBERS = (
    "nan inf -inf 1e400 -1e308 1e-320 5e-324 1e160 1e38 1e13 -1 0 -0 00 1.5 2147483648 4294967296"
)
_SIGNS = (
    "# \\ 1,2 0x10 1_000 1d5 +1 --1 1e . True None \x1b[31m \x07 \u202e \u0663 \ufeff é %s {0} / //"
)
_KEYWORDS = "f v vt element property list end_header OFF solid"
WORDS = (
    *f"{_NUMBERS} {_SIGNS} {_KEYWORDS}".split(" "),
    *("", "\xa0", "9" * 20, "9" * 5000, "-" + "9" * 19, "a" * 300, "nan nan nan"),
)


def damaged(rng: Generator, data: bytes) -> bytes:
    """Return the data with one to four random faults."""
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        data = _FAULTS[rng.integers(len(_FAULTS))](rng, data)
    return data


def random_word(rng: Generator) -> str:
    """Return one of `WORDS`."""
    return WORDS[rng.integers(len(WORDS))]


def _cut_out(rng: Generator, data: bytes) -> bytes:
    start, end = sorted(rng.integers(len(data) + 1, size=2))
    return (data[:start], data[:start] + data[end:], data[:end] + data[start:])[rng.integers(3)]


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
        words[rng.integers(len(words))] = random_word(rng).encode()
        lines[row] = b" ".join(words)
    return b"\n".join(lines)


def _edit_lines(rng: Generator, data: bytes) -> bytes:
    lines = data.split(b"\n")
    row, other = rng.integers(len(lines), size=2)
    match rng.integers(4):
        case 0:
            del lines[row]
        case 1:
            lines[row], lines[other] = lines[other], lines[row]
        case 2:
            lines.insert(row, random_word(rng).encode())
        case 3:
            lines[row:] = lines[row : row + 1] * int(rng.integers(2, 50))
    return b"\n".join(lines)


def _change_encoding(rng: Generator, data: bytes) -> bytes:
    return (
        data.replace(b"\n", (b"\r\n", b"\r", b"\n\n", b" ")[rng.integers(4)]),
        b"\xef\xbb\xbf" + data,
        data.decode("latin-1").encode("utf-16"),
        b"\x1f\x8b\x08" + data,
        data + b"\0" * int(rng.integers(1, 5000)),
        rng.bytes(rng.integers(200)),
    )[rng.integers(6)]


_FAULTS: tuple[Callable[[Generator, bytes], bytes], ...] = (
    *(_cut_out, _flip_bytes, _replace_words, _replace_words, _edit_lines, _change_encoding),
)
