"""Parse text files as rows of numbers, with errors that name the file and the line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain, islice
from pathlib import Path

import numpy as np

from ...core.errors import RosyError, counted
from ...core.file_io import read_bytes
from ..blocks import row_blocks

#: Number of rows, and number of words, of a text file that are parsed or written at once.
ROWS_PER_BLOCK, WORDS_PER_BLOCK = 1 << 14, 1 << 16


@dataclass(frozen=True, eq=False)
class TextRows:
    """The rows (nonempty lines) of a text file, split into words at white space.

    Attributes
    ----------
    path : Path
    words : list of sequence of bytes
        The words of each row. A row has at least one word, except after `select`.
    line_numbers : list of int
        Line number of each row in the file, counted from 1.
    """

    path: Path
    words: list[Sequence[bytes]]
    line_numbers: list[int]

    def __len__(self) -> int:
        return len(self.words)

    def __getitem__(self, rows: slice) -> TextRows:
        return TextRows(self.path, self.words[rows], self.line_numbers[rows])

    def select(self, is_selected: np.ndarray, words: slice) -> TextRows:
        """Return the rows for which the (rows,) bool array is True, each reduced to a slice of its words."""
        rows = np.flatnonzero(is_selected).tolist()
        line_numbers = [self.line_numbers[row] for row in rows]
        return TextRows(self.path, [self.words[row][words] for row in rows], line_numbers)

    def with_words(self, words: list[Sequence[bytes]]) -> TextRows:
        """Return the rows with other words."""
        return TextRows(self.path, words, self.line_numbers)

    def check_lengths(self, least: int, subject: str, noun: str, expected: str) -> None:
        """Raise a `RosyError` if a row has fewer than `least` words.

        The message is "`subject` has COUNT `noun`, expected `expected`", such as "a face has 2 corners,
        expected 3 or more".
        """
        for row, words in enumerate(self.words):
            if len(words) < least:
                found = counted(len(words), noun)
                raise self.error(row, f"{subject} has {found}, expected {expected}")

    def error(self, row: int, message: str) -> RosyError:
        """Return the error to raise for a row. It names the file and, if the row exists, its line."""
        if row < len(self.line_numbers):
            return RosyError(f"{self.path}:{self.line_numbers[row]}: {message}")
        return RosyError(f"{self.path}: {message}")

    def floats(self, label: str) -> np.ndarray:
        """Parse all words of all rows as a flat float64 array; `label` is the name of a value in messages."""
        return self._parse(float, np.float64, f"a number ({label})")

    def ints(self, label: str) -> np.ndarray:
        """Parse all words of all rows as a flat int64 array; `label` is the name of a value in messages."""
        return self._parse(int, np.int64, f"a whole number ({label})")

    def points(self, label: str) -> np.ndarray:
        """Parse the first three words of each row as a point; `label` is the name of a point in messages.

        Returns
        -------
        (rows, 3) float64 ndarray

        Raises
        ------
        RosyError
            If a row has fewer than three words, or a coordinate is not a finite number.
        """
        self.check_lengths(3, label, "coordinate", "3")
        points = self.with_words([words[:3] for words in self.words]).floats(label).reshape(-1, 3)
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            row = int(np.argmin(finite))
            raise self.error(row, f"{label} {row} has a coordinate that is not finite")
        return points

    def row_of_word(self, word: int) -> int:
        """Return the index of the row that contains a word. Words are counted from 0 over all rows."""
        return int(np.searchsorted(list(accumulate(map(len, self.words))), word, side="right"))

    def _parse(self, convert: Callable, dtype: type, expected: str) -> np.ndarray:
        """Convert all words of all rows, or raise an error about the first word that cannot be converted.

        `convert` is float or int, and `dtype` the type of the result. `expected` says in the message what a
        word should be, such as "a number".
        """
        count = sum(map(len, self.words))
        values = np.empty(count, dtype=dtype)
        words = chain.from_iterable(self.words)
        for start in range(0, count, WORDS_PER_BLOCK):
            stop = min(start + WORDS_PER_BLOCK, count)
            try:
                values[start:stop] = list(map(convert, islice(words, stop - start)))
            except (ValueError, OverflowError):
                raise self._parse_error(convert, expected, self.row_of_word(start)) from None
        return values

    def _parse_error(self, convert: Callable, expected: str, first_row: int) -> RosyError:
        """Return the error to raise for the first word that cannot be converted, from row `first_row` on.

        `convert` is float or int. `expected` says what a word should be, such as "a number".
        """
        for row, words in enumerate(self.words[first_row:], first_row):
            for word in words:
                try:
                    if abs(convert(word)) >= 2**63 and convert is int:
                        return self.error(row, f"{abbreviate(word)} is too large")
                except ValueError:
                    return self.error(row, f"expected {expected}, found {abbreviate(word)}")
        raise AssertionError("every word is a number")


def read_rows(path: Path, *, comment: bytes | None = b"#", data: bytes | None = None) -> TextRows:
    """Read the rows of a text file as words. Empty lines are left out.

    Parameters
    ----------
    path : Path
    comment : bytes, optional
        Characters that start a comment, which runs to the end of the line; None for no comments.
    data : bytes, optional
        The contents of the file, if they have already been read.

    Raises
    ------
    RosyError
        If the file cannot be read or is not text.
    """
    data = read_bytes(path, reject_binary=True) if data is None else data
    # Accept a lone CR as the end of a line, too, but not the other separators of `splitlines`.
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    lines = data.split(b"\n")
    if comment is not None and comment in data:
        lines = [line.partition(comment)[0] for line in lines]
    # Store words as tuples: Python's garbage collector stops tracking tuples of bytes, but not lists.
    words: list[Sequence[bytes]] = []
    line_numbers: list[int] = []
    for number, line in enumerate(lines, 1):
        if line_words := tuple(line.split()):
            words.append(line_words)
            line_numbers.append(number)
    return TextRows(path, words, line_numbers)


def is_number(word: bytes) -> bool:
    """Return whether a word is a number, or nan or inf."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def abbreviate(word: bytes) -> str:
    """Return a word in quotes for a message: at most 24 of its bytes, and printable characters only."""
    text = word[:24].decode("ascii", "backslashreplace")
    return repr("".join(c if c.isprintable() else "?" for c in text) + "..." * (len(word) > 24))


def format_rows(rows: np.ndarray) -> list[str]:
    """Return each row of (n, k) numbers as text. Parsing it gives exactly the same float64 values."""
    return [" ".join(map(repr, row)) for row in rows.tolist()]


def format_lines(rows: np.ndarray, prefix: str = "") -> str:
    """Return (n, k) numbers as lines of text, each with a prefix. Parsing them gives the same values."""
    # Strings of single rows take much more memory than the text, so they are joined block by block.
    blocks = row_blocks(len(rows), ROWS_PER_BLOCK)
    return "".join(
        "".join([f"{prefix}{line}\n" for line in format_rows(rows[block])]) for block in blocks
    )
