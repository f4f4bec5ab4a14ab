"""Field files of other programs: matrices, archives, and crosses of two directions."""

import io

import numpy as np
import pytest
from field_helpers import assert_damaged, read_damaged, read_field
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapes import icosphere

from rosy_addon.field.directional_field import field_directions
from rosy_addon.field.field_io import field_file, load_field
from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import axis_field

BALL = icosphere(2)
CROSS = normalize(field_directions(BALL, axis_field(BALL, 4, (0.3, -0.2, 1.0))))
HALVES = CROSS[:, :2].reshape(-1, 6)
TRIANGLES = BALL.triangle_vertex


def dmat_bytes(matrix, binary=False):
    """As igl::writeDMAT does: columns first."""
    size = f"{matrix.shape[1]} {matrix.shape[0]}\n".encode()
    if binary:
        return b"0 0\n" + size + np.asarray(matrix, "<f8").tobytes(order="F")
    return size + "".join(f"{value!r}\n" for value in matrix.T.ravel().tolist()).encode()


def frames_bytes(rows):
    """As ExporterFIELD of VCG writes them."""
    head = "# frame generated with VCG \ntarget frame \n{}\nk1\t k2\t k1v_x\t k1v_y\t k1v_z\t k2v_x\t k2v_y\t k2v_z\n"
    lines = ["1 1 " + " ".join(map(repr, row)) + "\n" for row in rows.tolist()]
    return (head.format(len(rows)) + "".join(lines)).encode()


def crossfield_bytes(rows):
    lines = ["0 " + " ".join(map(repr, row)) + "\n" for row in rows.tolist()]
    return (f"2 {len(rows)}\n" + "".join(lines)).encode()


def archive_bytes(**arrays):
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


FLAGGED = np.column_stack([np.arange(len(HALVES)) % 2, HALVES])
FILES = {
    "text.dmat": dmat_bytes(HALVES),
    "binary.dmat": dmat_bytes(HALVES, binary=True),
    "flags.dmat": dmat_bytes(FLAGGED),
    "a.crossfield": crossfield_bytes(HALVES),
    "a.ffield": frames_bytes(HALVES),
    "compressed.npz": archive_bytes(Q=HALVES),
    "a.csv": "".join(",".join(map(repr, row)) + "\n" for row in HALVES.tolist()).encode(),
}


@pytest.mark.parametrize("name", FILES)
def test_crosses_of_two_directions(name, tmp_path):
    (tmp_path / name).write_bytes(FILES[name])
    loaded = load_field(tmp_path / name, BALL)
    assert loaded.field.degree == 4 and loaded.field.direction_ratios is None
    assert np.abs(field_directions(BALL, loaded.field) - CROSS).max() < 1e-12
    # These two formats hold crosses only; in the others it is an assumption.
    assert bool(loaded.note) == (not name.endswith(("crossfield", "ffield")))


def test_frames_need_not_be_orthogonal(tmp_path):
    skewed = np.concatenate([CROSS[:, 0], CROSS[:, 0] + 2 * CROSS[:, 1]], axis=1)
    (tmp_path / "a.crossfield").write_bytes(crossfield_bytes(skewed))
    field = read_field(tmp_path / "a.crossfield", BALL)
    assert field.degree == 4 and field.direction_ratios is not None
    assert np.abs(field.source_directions[:, :2].reshape(-1, 6) - skewed).max() < 1e-12


def test_frames_on_vertices(tmp_path, error_of):
    axis = np.cross(BALL.vertices, (0.0, 0.0, 1.0))
    rows = np.concatenate([axis, np.cross(BALL.vertices, axis)], axis=1)
    (tmp_path / "a.vfield").write_bytes(frames_bytes(rows))
    field = read_field(tmp_path / "a.vfield", BALL)
    assert field.degree == 4 and field.vectors.any(axis=1).all()
    (tmp_path / "b.vfield").write_bytes(FILES["a.ffield"])
    assert "contains 320 rows, but" in error_of(read_field, tmp_path / "b.vfield", BALL)


ARCHIVES = {
    "miq": ({"V": BALL.vertices, "F": TRIANGLES, "Q": CROSS[:, 0]}, 4),
    "one array": ({"anything": CROSS, "faces": TRIANGLES, "energy": np.float64(3)}, 4),
    "degree": ({"directions": CROSS[:, 1], "degree": np.array(2)}, 2),
    "halves": ({"field": HALVES}, 4),
}


@pytest.mark.parametrize("name", ARCHIVES)
def test_archives(name, tmp_path):
    arrays, degree = ARCHIVES[name]
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", **arrays)
        field = read_field(tmp_path / "a.npz", BALL)
        assert field.degree == degree
        cosine = np.einsum("fki,fi->fk", CROSS, field.vectors).max(axis=1)
        assert np.abs(cosine - 1).max() < 1e-12


def test_the_mesh_of_an_archive_tells_where_its_rows_are(tmp_path):
    order = np.random.default_rng(1).permutation(len(TRIANGLES))[1:]
    arrays = {"V": BALL.vertices, "F": TRIANGLES[order], "Q": CROSS[order, 0]}
    np.savez(tmp_path / "a.npz", **arrays)
    loaded = load_field(tmp_path / "a.npz", BALL)
    assert "transferred by position" in loaded.note
    assert np.abs(loaded.field.vectors - CROSS[:, 0])[order].max() < 1e-9


DAMAGED = {
    "a.dmat": (b"6 x\n", "expected the numbers of columns and of rows"),
    "b.dmat": (b"3 2\n1\n2\n", "declares 6 numbers, but contains 2"),
    "c.dmat": (b"0 0\n3 2\n" + bytes(40), "declares 6 numbers, but contains 5"),
    "d.dmat": (b"3 1\n1\nx\n2\n", "d.dmat:3: expected a number"),
    "e.dmat": (b"4 1\n5\n1\n2\n3\n", "has 4 numbers per row"),
    "f.dmat": (b"3 0\n", "contains no numbers"),
    "a.crossfield": (b"3 1\n", "a.crossfield:1: expected '2' and the number of rows"),
    "b.crossfield": (b"2 1\n0 1 2\n", "b.crossfield:2: expected 7 numbers, found 3 words"),
    "c.crossfield": (b"2 1\n", "contains no rows of 7 numbers"),
    "d.crossfield": (b"2 5\n0 1 0 0 0 1 0\n", "declares 5 rows"),
    "a.ffield": (b"target frame\n", "expected the header of a frame field"),
    "b.ffield": (b"", "expected the header of a frame field"),
    "a.txt": (b"1 2 3\n1 2\n", "a.txt:2: the row has 2 numbers, the rows above have 3"),
    "b.txt": (b"1 2 3 4\n3 4 5 6\n", "has 4 numbers per row"),
    "c.txt": (b"", "contains no numbers"),
    "d.txt": (b"1 2 x\n", "d.txt:1: expected a number (part of a vector), found 'x'"),
    "e.txt": (b"1 2 3\n", "contains 1 row, but sphere has"),
    "f.txt": (b"1 2\n", "contains 1 row, but sphere has"),
    "f.npy": (b"hello", "is not a valid .npy file"),
    "a.npz": (b"hello", "is not a valid .npz file"),
    "b.npz": (archive_bytes(a=CROSS, b=CROSS), "several arrays can be the field; call it 'dir"),
    "c.npz": (archive_bytes(a=np.arange(3)), "no array can be the field"),
    "d.npz": (archive_bytes(), "no array can be the field"),
    "e.npz": (archive_bytes(Q=CROSS.astype(object)), "is not a valid .npy file"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_raise_one_line_errors(name, tmp_path, error_of):
    assert_damaged(error_of, tmp_path / name, *DAMAGED[name], read_field, BALL)


WRITTEN = ["a.rosy", "a.rawfield", "a.obj", "a.txt", "a.npy"]


@pytest.mark.slow
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200), st.integers(0, 300), st.sampled_from([*FILES, *WRITTEN]))
def test_random_damage_raises_only_rosy_errors(tmp_path, garbage, offset, name):
    path = tmp_path / name
    data = FILES[name] if name in FILES else field_file(path, axis_field(BALL, 4), BALL)
    read_damaged(path, data, garbage, offset, lambda path: read_field(path, BALL))
