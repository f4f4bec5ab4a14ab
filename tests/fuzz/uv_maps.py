"""UV maps in several tiles, on their borders, outside of them, overlapping, tiny and huge; and files of tiles."""

import os
import re
from pathlib import Path

import numpy as np
from numpy.random import Generator
from PIL import Image

from .meshes import Polygons

#: Coordinates that are at the end of a range, or none.
_HOSTILE = ("nan", "inf", "1e300", "-0.0", "1e-320", "0.9999999999", "1000.0000001", "-1000", "1e5")

#: Names of outputs, with the placeholder once, twice, elsewhere and not at all.
OUTPUTS = (
    *("out.<UDIM>.png", "out.<UDIM>.png", "out.<UDIM>.png", "<UDIM>.png", "out.png", "out.png"),
    *("a<UDIM>b<UDIM>.png", "out.<udim>.png", "out<UDIM>.PNG", "<UDIM>/out.png"),
    "<UDIM>/<UDIM>.png",
)


def uv_mesh_bytes(rng: Generator, mesh: Polygons) -> tuple[bytes, set[int]]:
    """Return an `.obj` file with a UV map that has a chart for each face, and the tiles that the map uses.

    The tiles are empty if charts are not within single tiles, or are not where UDIM numbers tiles.
    """
    points, faces = mesh
    reach = [(1, 1), (3, 1), (10, 2), (10, 20), (13, 130)][
        rng.choice(5, p=[0.3, 0.2, 0.3, 0.1, 0.1])
    ]
    cells = rng.integers((0, 0), reach, (int(rng.choice([1, 2, 5, 9])), 2))
    size = float(rng.choice([1.0, 0.8, 0.3, 1e-3, 1e-6, 1e-12], p=[0.3, 0.3, 0.2, 0.1, 0.05, 0.05]))
    shift = float(rng.choice([0.0, -1.0, -40.0, 0.5, 900.0], p=[0.7, 0.1, 0.05, 0.1, 0.05]))
    chosen = cells[rng.integers(len(cells), size=len(faces))]
    lines, rows, count = [], [], 0
    for face, cell in zip(faces, chosen, strict=True):
        angle = 2 * np.pi * (np.arange(len(face)) + 0.5) / len(face)
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        uv = cell + 0.5 + shift + 0.5 * size * circle / np.abs(circle).max()
        rows += [[f"{value:.17g}" for value in row] for row in uv.tolist()]
        corners = [f"{vertex + 1}/{count + place}" for place, vertex in enumerate(face, 1)]
        lines.append("f " + " ".join(corners))
        count += len(face)
    is_plain = shift == 0 and reach[0] <= 10 and reach[1] <= 100
    if rng.random() < 0.1:
        rows[rng.integers(count)][rng.integers(2)] = _HOSTILE[rng.integers(len(_HOSTILE))]
        is_plain = False
    lines = [f"vt {' '.join(row)}" for row in rows] + lines
    lines = ["v {!r} {!r} {!r}".format(*point) for point in points.tolist()] + lines
    tiles = {1001 + int(u) + 10 * int(v) for u, v in chosen} if is_plain else set()
    return "\n".join(lines).encode() + b"\n", tiles


def tile_names(output: str) -> set[str]:
    """Return the names of all files that a texture with this output may write."""
    folder, name = os.path.split(output)
    return {os.path.join(folder, name.replace("<UDIM>", str(1001 + tile))) for tile in range(1000)}


def make_tiles(rng: Generator, folder: Path, output: str, tiles: set[int]) -> None:
    """Make the folder of the output, and some files and folders where its tiles will be written."""
    directory, name = os.path.split(output)
    (folder / directory).mkdir(exist_ok=True)
    for number in rng.permutation(sorted(tiles) or [1001, 1002])[: rng.integers(3)]:
        path = folder / directory / name.replace("<UDIM>", str(number))
        if path.exists():
            continue
        if rng.random() < 0.3:
            path.mkdir()
        else:
            path.write_bytes(b"the previous contents")


def tile_fault(folder: Path, output: str, size: int, tiles: set[int], *, is_exact: bool) -> str:
    """Return what is wrong with the files of a texture, or an empty text.

    `tiles` are the tiles that the UV map may use; empty if they are not known. If `is_exact`, all of them have
    to be there.
    """
    directory, name = os.path.split(output)
    if "<UDIM>" not in name:
        tiles, is_exact = {1001}, True
    pattern = re.escape(name).replace("<UDIM>", "(....+)")
    found = set()
    for path in (folder / directory).iterdir():
        match = re.fullmatch(pattern, path.name)
        is_old = path.is_dir() or path.stat().st_size < 30
        if match is None or is_old:
            continue
        found.add(int(match[1]) if match.groups() else 1001)
        with Image.open(path) as picture:
            if picture.size != (size, size):
                return f"{path.name} has {picture.size} texels"
    if tiles and (found - tiles or (is_exact and found != tiles)):
        return f"tiles {sorted(found)} instead of {sorted(tiles)}"
    return "" if found and found <= set(range(1001, 2001)) else f"tiles {sorted(found)}"
