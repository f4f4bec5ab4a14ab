"""A program that uses every public name. `make test-wheel` runs it and checks its types strictly."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rosyfields as rf
from numpy.typing import NDArray


def surfaces() -> rf.Surface:
    """A cube, which has a UV map."""
    x, y, z = np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0], indexing="ij")
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    cube = rf.Surface(vertices, faces, name="cube", up="z", uv=vertices[:, :2], sharp_angle=0.5)
    counts: tuple[int, int] = cube.face_count, cube.euler_characteristic
    axes: tuple[NDArray[np.float64], NDArray[np.float64]] = cube.face_frames
    arrays: list[NDArray[np.float64]] = [cube.vertices, cube.face_normal, *axes]
    corners: NDArray[np.int32] | list[NDArray[np.int32]] = cube.faces
    uv: NDArray[np.float64] | None = cube.uv
    data: list[Mapping[str, NDArray[Any]]] = [cube.vertex_data, cube.face_data]
    assert counts == (6, 2) and len(corners) == 6 and uv is not None and len(data) == 2
    assert all(np.isfinite(array).all() for array in arrays)
    return cube


def fields(cube: rf.Surface, folder: Path) -> rf.Field:
    """Fields of every kind; returns one of them."""
    vectors: NDArray[np.float64] = cube.face_frames[0]
    made: list[rf.Field] = [
        rf.form(cube),
        rf.smoothest(cube, 6),
        rf.curvature(cube, degree=2, reach=0.0),
        rf.features(cube, sharp_angle=0.5, edges=[[0, 1]]),
        rf.guided(cube, 2, strokes=[[[0.1, 0.5, 1.0], [0.9, 0.5, 1.0]]], uv=False),
        rf.along_axis(cube, (1.0, 2.0, 3.0), degree=1),
        rf.along_uv(cube),
        rf.prescribed(cube, {vertex: 1 for vertex in range(8)}, 4),
        rf.from_vectors(cube, vectors, 4, nonfinite="zero"),
        rf.from_angles(cube, np.zeros(6), 4, magnitude=0.5),
        rf.from_representation(cube, np.ones(6), 4),
        rf.from_directions(cube, np.stack([vectors, -vectors], axis=1)),
        rf.from_tensors(cube, np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (6, 3, 3))),
    ]
    field = (
        made[1].to_degree(2).rotated(0.1).smoothed(0.01).without_pairs(0.01).with_magnitude("unit")
    )
    field.save(folder / "cube.rosy")
    again = rf.read_field(folder / "cube.rosy", cube, 2)
    difference: rf.Difference = field.difference(again)
    numbers: list[float] = [difference.mean, difference.rms, difference.max, difference.compared]
    singularities: rf.Singularities = made[0].singularities
    vertex, index = singularities
    made[0].with_moved_singularity(0, 6, 1, reach=0.5)
    energy: float = field.energy
    degree: int = field.degree
    is_rosy: bool = field.is_rosy
    assert field.surface is cube and is_rosy and degree == 2 and energy >= 0
    assert max(numbers[:3]) < 0.01 and len(difference.angle) == cube.face_count
    assert vertex.dtype == index.dtype == np.int32
    assert field.angles.shape == field.magnitude.shape == (6,)
    assert field.directions.shape == (6, 2, 3) and field.vectors.shape == (6, 3)
    z: NDArray[np.complex128] = field.representation
    assert z.shape == (6,)
    try:
        rf.from_array(cube, "velocity", degree=1)
    except rf.RosyError as error:
        assert "velocity" in str(error)
    return again


def pictures(cube: rf.Surface, field: rf.Field, folder: Path) -> None:
    """A picture, strokes, a turntable and a film."""
    presets: dict[str, str] = rf.list_presets()
    picture: rf.Picture = rf.render(
        cube, field, view=(30, 20), size=(48, 32), preset=sorted(presets)[0], workers=1, seed=3
    )
    picture.save(folder / "cube.png")
    linear: NDArray[np.float32] = picture.rgba
    array: NDArray[np.uint8] = np.asarray(picture)
    assert array.shape == linear.shape == (32, 48, 4)
    tone: NDArray[np.float32] = rf.ambient_occlusion(cube, directions=16)
    rf.render(cube, tone_values=tone, size=(16, 16), tone_image=None, workers=1)
    rf.render(cube, color_values=tone, size=(16, 16), color_map="magma")
    drawing: rf.Drawing = rf.strokes(cube, field, size=(48, 48), spacing=8, colors=["navy"])
    drawing.save(folder / "cube.svg")
    svg: str = drawing.svg
    lines: list[NDArray[np.float64]] = drawing.polylines
    names: list[str] = drawing.family_names
    assert svg.startswith("<?xml") and len(lines) == len(names) == len(drawing)
    flat = rf.Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], uv=[[0, 0], [1, 0], [0, 1]])
    texture: rf.Texture = rf.texture(flat, rf.along_uv(flat), size=32, margin=2, udim=False)
    texture.save(folder / "flat.png")
    tiles: dict[int, rf.Picture] = texture.tiles
    overlap: float = texture.overlap
    assert list(tiles) == [1001] and overlap < 0.5
    file: Path = rf.turntable(
        cube, field, path=folder / "cube.gif", pictures=2, size=(16, 16), workers=1
    )
    assert file.is_file()
    film: Path = rf.film(
        [field, field.rotated(0.001)], folder / "film.gif", between=1, size=(16, 16), workers=1
    )
    assert film.is_file()


def comparisons(field: rf.Field, folder: Path) -> None:
    """A table, and a figure if matplotlib is installed."""
    comparison: rf.Comparison = rf.compare({"one": field, "two": field.rotated(0.1)}, reach=0.1)
    rows: list[dict[str, Any]] = comparison.rows
    texts: list[str] = [str(comparison), comparison.to_json(), comparison.to_latex()]
    differences: dict[str, rf.Difference] = comparison.differences
    assert rows[1]["matched"] == len(comparison.matchings["two"].distance) and all(texts)
    assert set(comparison.fields) == {"one", "two"} and comparison.cells()[0][0] == "field"
    assert differences["two"].worst_face >= 0 and 0.09 < differences["two"].p95 < 0.11
    try:
        figure = rf.figure([field], parts=("fields", "table"), dpi=20, workers=1)
        rf.save_figures(folder / "cube.pdf", figure)
    except rf.RosyError as error:
        assert "matplotlib" in str(error)


def errors(cube: rf.Surface) -> None:
    """An error and a warning."""
    try:
        rf.form(cube, degree=99)
    except rf.RosyError as error:
        assert "99" in str(error)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rf.RosyWarning)
        rf.curvature(cube)


def main(folder: Path) -> None:
    """Use all of it, and write files into a folder."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rf.RosyWarning)
        cube = surfaces()
        field = fields(cube, folder)
    comparisons(field, folder)
    pictures(cube, field, folder)
    errors(cube)
