"""Folders of the documentation, and functions that fill in its pictures and tables."""

import re
from collections.abc import Sequence
from pathlib import Path

from .sheet import Panel, save, sheet

#: Root of the repository.
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "gallery"
IMAGES = ROOT / "docs" / "images"


def picture(name: str, *rows: Sequence[Panel]) -> None:
    """Save an image with rows of panels next to the pages of the gallery."""
    save(sheet(rows), FOLDER / f"{name}.png")


def fill_tables(name: str, *tables: Sequence[Sequence[object]]) -> None:
    """Replace the rows of the tables in a page of the gallery, in the order of the tables.

    Floats are shown with three decimals.
    """
    path, remaining = FOLDER / f"{name}.md", iter(tables)

    def filled(table: re.Match[str]) -> str:
        return table["head"] + "".join(
            f"| {' | '.join(map(_shown, row))} |\n" for row in next(remaining)
        )

    text = re.sub(
        r"(?m)(?P<head>^\|.*\n\| ---.*\n)(\|.*\n)+", filled, path.read_text(encoding="utf-8")
    )
    path.write_text(text, encoding="utf-8")


def _shown(cell: object) -> str:
    return f"{cell:.3f}" if isinstance(cell, float) else str(cell)


def listed(angles: Sequence[float]) -> str:
    """Format angles in degrees with one decimal."""
    return ", ".join(f"{angle:.1f}" for angle in angles)


def signed(index: int) -> str:
    """Format an index with its sign."""
    return f"{index:+d}".replace("-", "−")
