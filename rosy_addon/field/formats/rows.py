"""Text files as rows of numbers, and errors that name the file and the line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate, chain
from pathlib import Path

import numpy as np

from ...errors import RosyError
from ...files import read_bytes


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of a text file that hold anything, split at white space.

    Attributes
    ----------
    path : Path
    words : list of list of bytes
        The words of each row.
    line : list of int
        Its number in the file, from 1.
    """

    path: Path
    words: list[list[bytes]]
    line: list[int]

    def __len__(self) -> int:
        return len(self.words)

    def __getitem__(self, part: slice) -> Rows:
        return Rows(self.path, self.words[part], self.line[part])

    def error(self, row: int, message: str) -> RosyError:
        """An error on a row; past the last one, at the end of the file."""
        if row < len(self.line):
            return RosyError(f"{self.path}:{self.line[row]}: {message}")
        return RosyError(f"{self.path}: {message}")

    def floats(self, what: str) -> np.ndarray:
        """(all words,) float64, in order."""
        return self._numbers(float, np.float64, f"a number ({what})")

    def ints(self, what: str) -> np.ndarray:
        """(all words,) int64, in order."""
        return self._numbers(int, np.int64, f"a whole number ({what})")

    def points(self, what: str) -> np.ndarray:
        """(rows, 3) float64: the first three words of each row, finite."""
        for row, words in enumerate(self.words):
            if len(words) < 3:
                raise self.error(row, f"{what} has {len(words)} coordinates, 3 are wanted")
        points = Rows(self.path, [words[:3] for words in self.words], self.line).floats(what)
        points = points.reshape(-1, 3)
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            row = int(np.argmin(finite))
            raise self.error(row, f"{what} {row} has a coordinate that is not finite")
        return points

    def row_of_word(self, word: int) -> int:
        """Which row holds the word of this number, counted over all rows."""
        ends = list(accumulate(map(len, self.words)))
        return int(np.searchsorted(ends, word, side="right"))

    def _numbers(self, convert: Callable, dtype: type, wanted: str) -> np.ndarray:
        try:
            return np.array(list(map(convert, chain.from_iterable(self.words))), dtype=dtype)
        except (ValueError, OverflowError):
            raise self._first_unlike(convert, wanted) from None

    def _first_unlike(self, convert: Callable, wanted: str) -> RosyError:
        for row, words in enumerate(self.words):
            for word in words:
                try:
                    if abs(convert(word)) >= 2**63 and convert is int:
                        return self.error(row, f"{shown(word)} is too large")
                except ValueError:
                    return self.error(row, f"found {shown(word)}, wanted {wanted}")
        raise AssertionError("every word is a number")


def read_rows(path: Path, *, comment: bytes | None = b"#", data: bytes | None = None) -> Rows:
    """Read a text file.

    Parameters
    ----------
    path : Path
    comment : bytes, optional
        What starts a comment, to the end of its line.
    data : bytes, optional
        Its contents, if read already.

    Raises
    ------
    RosyError
        If it cannot be read or is not text.
    """
    data = read_bytes(path, text=True) if data is None else data
    # Line ends of old Macs, too, but not what str.splitlines takes for them.
    lines = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
    if comment is not None and comment in data:
        lines = [line.partition(comment)[0] for line in lines]
    split = [(words, number) for number, line in enumerate(lines, 1) if (words := line.split())]
    return Rows(path, [words for words, _ in split], [number for _, number in split])


def shown(word: bytes) -> str:
    """A word as it can stand in a message: printable and short."""
    text = word[:24].decode("ascii", "backslashreplace")
    return repr("".join(c if c.isprintable() else "?" for c in text) + "..." * (len(word) > 24))


def lines(rows: np.ndarray) -> list[str]:
    """Rows of numbers as text: the shortest that gives the same float64."""
    return [" ".join(map(repr, row)) for row in rows.tolist()]
