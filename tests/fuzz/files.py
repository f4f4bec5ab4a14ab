"""Write field files of each format, guide strokes, pictures and presets: mostly valid ones."""

import io
import json
import struct
import zlib
from typing import Any

import numpy as np
from numpy.random import Generator

from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import settings_of
from rosy_addon.image_io.png import _pack_chunk

from .meshes import Polygons
from .options import setting_value

FIELD_SUFFIXES = (
    *(".rosy", ".rawfield", ".txt", ".npy", ".sings"),
    *(".npz", ".dmat", ".crossfield", ".ffield"),
)


def field_bytes(rng: Generator, suffix: str, mesh: Polygons, degree: int | None = None) -> bytes:
    """Return the contents of a field file for a mesh: mostly one that fits it. By default any degree."""
    points, faces = mesh
    degree = degree or int(rng.choice([1, 2, 3, 4, 4, 6, 7, 12]))
    if suffix == ".sings":
        rows = [(int(rng.integers(len(points))), int(rng.integers(-4, 5))) for _ in range(5)]
        return _text([(degree, len(rows)), *rows])
    vectors = _with_faults(rng, _tangents(rng, _normals(points, faces), degree))
    count = max(len(vectors) + int(rng.choice([0] * 12 + [-1, 1, 1000])), 0)
    rows = vectors.reshape(len(vectors), -1).tolist()
    if suffix == ".rosy":
        head = [(count, degree)] if rng.random() < 0.5 else [(count,), (degree,)]
        return _text([*head, *(row[:3] for row in rows)])
    if suffix == ".rawfield":
        return _text([(degree, count), *rows])
    if suffix in (".crossfield", ".ffield"):
        crosses = vectors[:, [0, degree // 4]].reshape(len(vectors), 6).tolist()
        if suffix == ".crossfield":
            return _text([(2, count), *([0, *row] for row in crosses)])
        return b"# frame\ntarget frame\n" + _text(
            [(count,), ("k1", "k2"), *([1, 1, *row] for row in crosses)]
        )
    one_member = rng.random() < 0.5
    if suffix == ".txt":
        text = _text([row[:3] if one_member else row for row in rows])
        return text.replace(b" ", b",") if rng.random() < 0.2 else b"# a field\n" + text
    array = vectors[:, 0] if one_member else vectors.reshape(len(vectors), -1)
    kind = ("f8", "f8", "f4", ">f8", "f2", "i4", "c16", "?")[rng.integers(8)]
    with np.errstate(all="ignore"):
        array = np.nan_to_num(array).astype(kind) if kind in ("i4", "?") else array.astype(kind)
    file = io.BytesIO()
    if suffix == ".dmat":
        matrix = np.nan_to_num(array.real).astype("<f8")
        file.write(f"0 0\n{matrix.shape[1]} {count}\n".encode() + matrix.tobytes(order="F"))
        return file.getvalue()
    if suffix == ".npz":
        np.savez(file, V=points, F=np.arange(6).reshape(2, 3), Q=array)
        return file.getvalue()
    np.save(file, np.asfortranarray(array) if rng.random() < 0.1 else array)
    return file.getvalue()


def guide_bytes(rng: Generator, mesh: Polygons) -> bytes:
    """Return the contents of a file of guide strokes near a mesh."""
    points, blocks = mesh[0], []
    for _ in range(rng.integers(1, 4)):
        stroke = points[rng.integers(len(points), size=rng.integers(1, 9))]
        if rng.random() < 0.3:
            stroke = stroke * 10.0 ** rng.uniform(-300, 300) + rng.normal(size=stroke.shape)
        blocks.append(_text(stroke.tolist()))
    return b"\n".join(blocks)


def _normals(points: np.ndarray, faces: list) -> np.ndarray:
    """Return (F, 3) unit normals from the first corners; arbitrary ones where there is none."""
    corners = np.array([(face * 3)[:3] for face in faces])
    with np.errstate(all="ignore"):
        a, b, c = (points[corners[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal[~np.isfinite(normal).all(axis=1)] = (0, 0, 1)
    return normal


def _tangents(rng: Generator, normals: np.ndarray, degree: int) -> np.ndarray:
    """Return (F, N, 3) directions in the planes of the normals, evenly spaced."""
    axis = np.cross(normals, rng.normal(size=3))
    axis[np.abs(axis).max(axis=1) < 1e-12] = (1, 0, 0)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = 2 * np.pi * np.arange(degree)[:, None] / degree
    return axis[:, None] * np.cos(angle) + np.cross(normals, axis)[:, None] * np.sin(angle)


def _with_faults(rng: Generator, vectors: np.ndarray) -> np.ndarray:
    """Return vectors with other lengths, zeros, or values that are not finite."""
    picked = rng.random(len(vectors)) < 0.3
    with np.errstate(all="ignore"):
        match rng.integers(7):
            case 0:
                vectors = vectors * 10.0 ** rng.uniform(-320, 308)
            case 1:
                vectors[picked] = rng.choice([0, 0, np.nan, np.inf, -np.inf])
            case 2:
                vectors[picked] += rng.normal(size=3)
            case 3:
                vectors = vectors[:, ::-1] * rng.uniform(0, 3, (1, vectors.shape[1], 1))
    return vectors


def _text(rows: list) -> bytes:
    return "\n".join(" ".join(map(repr, row)) for row in rows).encode() + b"\n"


def png_bytes(rng: Generator, size: tuple[int, int] | None = None) -> bytes:
    """Return a PNG file, by default a small one, valid in half of all cases."""
    width, height = size or (int(side) for side in rng.integers(1, 40, 2))
    bits, color = int(rng.choice([8] * 24 + [16] * 8 + [1, 4])), int(rng.choice([0, 2, 3, 4, 6]))
    header = [width, height, bits, color, 0, 0, 0]
    row_size = 1 + (width * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color] * bits + 7) // 8
    rows = np.frombuffer(rng.bytes(height * row_size), np.uint8).reshape(height, row_size).copy()
    rows[:, 0] %= 5
    data, palette = rows.tobytes(), rng.bytes(3 * int(rng.choice([256, 256, 256, 2])))
    match rng.integers(12):
        case 0:
            header[rng.integers(2)] = int(rng.choice([0, 1, 18000, 2**31 - 1, 2**32 - 1]))
        case 1:
            header[rng.integers(2, 7)] = int(rng.integers(256))
        case 2:
            data = data[: rng.integers(len(data) + 1)]
        case 3:
            data += bytes(int(rng.choice([1, 1000, 50_000_000])))
    compressed = zlib.compress(data, 1)
    half = int(rng.integers(len(compressed) + 1))
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", *header)), (b"PLTE", palette)]
    chunks += [(b"tRNS", rng.bytes(int(rng.integers(300)))), (b"IDAT", compressed[:half])]
    chunks += [(b"IDAT", compressed[half:]), (b"IEND", b"")]
    if rng.random() < 0.05:
        del chunks[rng.integers(len(chunks))]
    data = b"\x89PNG\r\n\x1a\n"
    return data + b"".join(_pack_chunk(kind, content) for kind, content in chunks)


_OTHER_VALUES = (None, [], {}, [1], "", "nan", True, -1, 10**400, 1e308, "\x1b[31m", "\u202e", 0.1)


def preset_bytes(rng: Generator) -> bytes:
    """Return the contents of a preset file, valid in about half of all cases."""
    settings = list(settings_of(Look).values())
    picked = [settings[i] for i in rng.integers(len(settings), size=rng.integers(9))]
    look: dict[str, Any] = {setting.name: setting_value(rng, setting) for setting in picked}
    preset: dict[str, Any] = {"name": "Mine", "description": "A preset", "look": look}
    other = _OTHER_VALUES[rng.integers(len(_OTHER_VALUES))]
    match rng.integers(8):
        case 0 if look:
            look[list(look)[rng.integers(len(look))]] = other
        case 1:
            look[("color", "unknown", "", "a\x1b]0;b")[rng.integers(4)]] = 1
        case 2:
            preset[("name", "description", "look", "more")[rng.integers(4)]] = other
        case 3:
            return (b"[" * 100_000, b'{"look":' * 5000, b"1", b"null")[rng.integers(4)]
    return json.dumps(preset, allow_nan=True).encode("utf-16" if rng.random() < 0.03 else "utf-8")
