"""Write field files of each format, and guide strokes."""

from __future__ import annotations

import io

import numpy as np
from numpy.random import Generator

from .shapes import Polygons

SUFFIXES = (".rosy", ".rawfield", ".txt", ".npy", ".sings")


def field_bytes(rng: Generator, suffix: str, mesh: Polygons) -> bytes:
    """Return the contents of a field file for a mesh: mostly one that fits it."""
    points, faces = mesh
    degree = int(rng.choice([1, 2, 3, 4, 4, 6, 7, 12]))
    if suffix == ".sings":
        rows = [(int(rng.integers(len(points))), int(rng.integers(-4, 5))) for _ in range(5)]
        return _text([(degree, len(rows)), *rows])
    normals = _normals(points, faces)
    if suffix == ".rosy" and rng.random() < 0.2:  # rows of vertices
        normals = np.resize(normals, (len(points), 3))
    vectors = _tangents(rng, normals, degree)
    vectors = _with_faults(rng, vectors)
    count = max(len(vectors) + int(rng.choice([0] * 12 + [-1, 1, 1000])), 0)
    rows = vectors.reshape(len(vectors), -1).tolist()
    if suffix == ".rosy":
        head = [(count, degree)] if rng.random() < 0.5 else [(count,), (degree,)]
        return _text([*head, *(row[:3] for row in rows)])
    if suffix == ".rawfield":
        return _text([(degree, count), *rows])
    one_member = rng.random() < 0.5
    if suffix == ".txt":
        text = _text([row[:3] if one_member else row for row in rows])
        return text.replace(b" ", b",") if rng.random() < 0.2 else b"# a field\n" + text
    file = io.BytesIO()
    array = vectors[:, 0] if one_member else vectors
    if rng.random() < 0.2:
        array = array.reshape(len(array), -1)
    kind = ("f8", "f4", ">f8", "f2", "i4", "c16", "?")[rng.choice(7, p=[0.5, 0.3] + [0.04] * 5)]
    with np.errstate(all="ignore"):
        array = np.nan_to_num(array).astype(kind) if kind in ("i4", "?") else array.astype(kind)
        if rng.random() < 0.1:
            array = np.asfortranarray(array)
    np.save(file, array)
    return file.getvalue()


def guide_bytes(rng: Generator, mesh: Polygons) -> bytes:
    """Return the contents of a file of guide strokes near a mesh."""
    points, _ = mesh
    blocks = []
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
    vectors = vectors.copy()
    picked = rng.random(len(vectors)) < 0.3
    with np.errstate(all="ignore"):
        match rng.integers(9):
            case 0:
                vectors *= 10.0 ** rng.uniform(-320, 308)
            case 1:
                vectors *= 10.0 ** rng.uniform(-30, 28, (len(vectors), 1, 1))
            case 2:
                vectors[picked] = 0
            case 3:
                vectors[picked] = rng.choice([np.nan, np.inf, -np.inf])
            case 4:
                vectors[picked] += rng.normal(size=3)
            case 5:
                vectors[:] = 0
            case 6:
                vectors = vectors[:, ::-1] * rng.uniform(0.1, 3, (1, vectors.shape[1], 1))
    return vectors


def _text(rows: list) -> bytes:
    return "\n".join(" ".join(map(repr, row)) for row in rows).encode() + b"\n"
