"""Hostile names: titles of fields, labels, and names of files."""

from numpy.random import Generator

#: Control characters, bytes that are not UTF-8 (lone surrogates), and characters that XML cannot hold.
_CONTROLS = (
    *("\x01", "\x1b[31m", "\x07", "\r", "\n", "\t", "\x7f", "\x9b2J", "\udcff\udc80", "\ufffe"),
)

#: Other scripts, some of them from right to left, signs that join or combine, and signs without a glyph.
_SCRIPTS = (
    *("\u202e", "\u05e9\u05dc\u05d5\u05dd", "\u0645\u0631\u062d\u0628\u0627", "\u65e5\u672c\u8a9e"),
    *("\U0001f600", "\ufeff", "e\u0301\u0301", "\u200d", "\u0915\u094d\u0937", "\U0010ffff"),
    "\u2028",
)

#: Formulas, markup, patterns, and parts of command lines and of paths.
_SYNTAX = (
    *(r"$\frac{", "$E = mc^2$", "$\u65e5$", r"\$", "$$", r"$\x01$", "$x_", r"$\sqrt[3]{\alpha}$"),
    *("^_{}~", "<b>&amp;", "]]>", "&#0;", '"/><script>', "<!--", "'", "%d", "%s%n", "%(default)s"),
    *("{0}", "{x}", "\\", "=", "form", "--", "-o", " ", "..", "a", "Ours", "#", "<UDIM>"),
    *("\\input{a}", "(endobj"),
)


def hostile_text(rng: Generator) -> str:
    """Return a text of a few hostile pieces, sometimes of 256 or 4,000 letters."""
    pieces = []
    for _ in range(rng.integers(1, 4)):
        kind = (_CONTROLS, _SCRIPTS, _SYNTAX)[rng.integers(3)]
        pieces.append(kind[rng.integers(len(kind))])
    text = "".join(pieces)
    repeated = int(rng.choice([0] * 16 + [256, 4000]))
    return (text * repeated)[:repeated] if repeated else text


def hostile_stem(rng: Generator) -> str:
    """Return the name of a file, without its suffix, in at most 200 bytes."""
    text = hostile_text(rng).replace("/", "-").encode("utf-8", "surrogateescape")[:200]
    stem = text.decode("utf-8", "surrogateescape")
    return f"x{stem}" if stem.startswith(("-", ".")) else stem
