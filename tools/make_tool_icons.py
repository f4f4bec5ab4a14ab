"""Make the icons of RoSy's tools in Blender: ``python tools/make_tool_icons.py``.

A file stores the colored triangles of a picture of 256 x 256 units, with y up. It begins with the letters
``VCO``, a zero byte, and one byte each for the width, the height, and x and y of the origin. Then follow x
and y of all corners of the triangles, one byte each, and the RGBA colors of the corners. Blender's own icons
of tools have this format.
"""

from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parents[1] / "rosy_addon" / "ui" / "icons"

WHITE, ORANGE = (255, 255, 255, 255), (255, 150, 60, 255)


def stroke(points: np.ndarray, width: float) -> np.ndarray:
    """Return (n, 3, 2) triangles of a stroke of a width through (m, 2) points."""
    along = np.gradient(points, axis=0)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    across *= width / 2 / np.linalg.norm(across, axis=1, keepdims=True)
    left, right = points + across, points - across
    first = np.stack([left[:-1], right[:-1], right[1:]], axis=1)
    second = np.stack([left[:-1], right[1:], left[1:]], axis=1)
    return np.concatenate([first, second])


def disc(center: tuple[float, float], radius: float, count: int = 24) -> np.ndarray:
    """Return (count, 3, 2) triangles of a disc."""
    angle = np.linspace(0, 2 * np.pi, count + 1)
    rim = np.array(center) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.stack([np.broadcast_to(center, rim[1:].shape), rim[:-1], rim[1:]], axis=1)


def write_icon(name: str, parts: list[tuple[np.ndarray, tuple[int, ...]]]) -> None:
    """Write an icon file. Each part is a list of triangles and their RGBA color."""
    corners = np.concatenate([triangles for triangles, _ in parts]).reshape(-1, 2)
    colors = np.concatenate([np.tile(color, (3 * len(part), 1)) for part, color in parts])
    header = b"VCO\x00" + bytes([255, 255, 0, 0])
    data = np.rint(corners).clip(0, 255).astype(np.uint8).tobytes()
    (FOLDER / f"{name}.dat").write_bytes(header + data + colors.astype(np.uint8).tobytes())


def singularities() -> list[tuple[np.ndarray, tuple[int, ...]]]:
    """Return the parts of an icon: lines around a singularity of index 1/2, parabolas with the same focus."""
    center = np.array((128.0, 120.0))
    parts = []
    for distance in (26.0, 60.0):
        half_width = np.sqrt(4 * distance * (distance + 78))
        x = np.linspace(-min(half_width, 88), min(half_width, 88), 17)
        y = distance - x**2 / (4 * distance)
        parts.append((stroke(center + np.stack([x, y], axis=1), 13), WHITE))
    parts.append((stroke(center + np.array([[0, -26.0], [0, -86.0]]), 13), WHITE))
    return [*parts, (disc((128.0, 120.0), 19), ORANGE)]


def comb() -> list[tuple[np.ndarray, tuple[int, ...]]]:
    """Return the parts of an icon: three lines that bend in the same way, as if combed."""
    x = np.linspace(-88.0, 88.0, 25)
    parts = []
    for y, color in ((58.0, WHITE), (6.0, ORANGE), (-46.0, WHITE)):
        wave = y + 26 * np.sin(x / 56)
        parts.append((stroke(np.stack([128 + x, 122 + wave], axis=1), 15), color))
    return parts


if __name__ == "__main__":
    write_icon("comb", comb())
    write_icon("singularities", singularities())
