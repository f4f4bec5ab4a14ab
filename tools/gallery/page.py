"""`Page`: a page of the gallery with its text, pictures and measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .sheet import Panel, save, sheet

#: Root of the repository.
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "gallery"

SOURCE = (
    "J. Palacios and E. Zhang, “Interactive Visualization of Rotational Symmetry Fields on "
    "Surfaces”, IEEE Transactions on Visualization and Computer Graphics 17(7), 2011"
)


class Page:
    """A page in Markdown, written piece by piece."""

    def __init__(self, name: str, title: str) -> None:
        self.name, self.title = name, title
        self._pieces = [f"# {title}"]

    def text(self, text: str) -> None:
        """Add a paragraph; line breaks in it do not count."""
        self._pieces.append(" ".join(text.split()))

    def picture(self, rows: Sequence[Sequence[Panel]], caption: str, part: str = "") -> None:
        """Add a sheet of panels, saved beside the page."""
        path = FOLDER / f"{self.name}{part and '-' + part}.png"
        save(sheet(rows), path)
        self._pieces.append(f"![{caption}]({path.name})")

    def table(self, head: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        """Add a table; floats are shown with three decimals."""
        lines = [head, ["---"] + ["---:"] * (len(head) - 1)]
        lines += [[_format_value(value) for value in row] for row in rows]
        self._pieces.append("\n".join("| " + " | ".join(line) + " |" for line in lines))

    def write(self, figure: str) -> None:
        """Write the page, with the `figure` of the paper as its source at the end."""
        self._pieces += ["---", f"Redrawn after {figure} of {SOURCE}. [All figures](README.md)"]
        (FOLDER / f"{self.name}.md").write_text("\n\n".join(self._pieces) + "\n", encoding="utf-8")


def _format_value(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def listed(angles: Sequence[float]) -> str:
    """Format angles in degrees with one decimal."""
    return ", ".join(f"{angle:.1f}" for angle in angles)


def signed(index: int) -> str:
    """Format an index with its sign."""
    return f"{index:+d}".replace("-", "−")
