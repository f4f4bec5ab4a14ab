"""Files of OpenMesh, whose layout is that of its own writer, and one of FrameFieldTracing."""

import struct

import numpy as np
import pytest
from field_helpers import assert_damaged, read_damaged, read_field

import rosy_addon as rf
from rosy_addon.field.formats.openmesh import read_om_mesh

#: What openmesh 1.2.1 writes for the quad 0 1 2 3 and the triangle 1 4 2 in the plane z = 0.
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]], dtype="<f8")
HALFEDGES = np.array(
    [[2, 1, 0], [7, 0, 255], [4, 2, 0], [8, 1, 1], [6, 3, 0], [11, 2, 255],
     [0, 0, 0], [5, 3, 255], [10, 4, 1], [1, 1, 255], [3, 2, 1], [9, 4, 255]],
    dtype="u1",
)  # fmt: skip
MESH = b"".join(
    [
        struct.pack("<2sccIII", b"OM", b"P", b"B", 5, 2, 6),
        *(struct.pack("<H", 0x5600), POINTS.tobytes()),
        *(struct.pack("<H", 0x16F8), HALFEDGES.tobytes()),
        *(struct.pack("<H", 0x06E0), bytes([7, 1, 11, 5, 9])),
        *(struct.pack("<H", 0x06E8), bytes([6, 3])),
    ]
)
END = struct.pack("<H", 0x1C)


def vectors(name, rows, header=0xCA, kind=b"Vec3d"):
    """A property of the faces, as FrameFieldTracing has OpenMesh write it."""
    data = np.asarray(rows, "<f8" if kind == b"Vec3d" else "<f4").tobytes()
    text = bytes([len(name)]) + name + bytes([len(kind)]) + kind
    return struct.pack("<H", header) + text + struct.pack("<I", len(data)) + data


U, V = [[2, 0, 0], [1, 1, 0]], [[0, 2, 0], [-1, 1, 0]]


def test_the_mesh_and_its_crosses(tmp_path):
    path = tmp_path / "a.om"
    index = struct.pack("<H", 0xC2) + b"\x03idx\x07int32_t" + struct.pack("<I", 20) + bytes(20)
    path.write_bytes(MESH + index + vectors(b"dir_u", U) + vectors(b"dir_v", V) + END)
    surface = rf.Surface(path)
    assert np.array_equal(surface.vertices, POINTS)
    assert [face.tolist() for face in surface.faces] == [[0, 1, 2, 3], [1, 4, 2]]
    field = read_field(path, surface)
    assert field.degree == 4 and np.array_equal(field.source_directions[:, 0], U)
    assert np.array_equal(field.source_directions[:, 1], V)
    path.write_bytes(MESH + vectors(b"wind", U, kind=b"Vec3f") + END)
    assert read_field(path, surface, 1).vectors == pytest.approx(np.array(U, float))


def test_stored_indices_of_another_program(shared_data):
    """Singularities of FrameFieldTracing's field, against the indices that it stored at the vertices."""
    path = shared_data / "fields" / "spot.om"
    data = path.read_bytes()
    start = data.index(b"\x07int32_t") + 12
    surface = rf.Surface(path)
    stored = np.frombuffer(data, "<i4", len(surface.vertices), start)
    with pytest.warns(rf.RosyWarning, match="nowhere opposite"):
        field = rf.read_field(path, surface)
    index = np.zeros(len(stored), dtype=int)
    index[field.singularities.vertex] = field.singularities.index
    assert np.count_nonzero(stored) == 50 and np.array_equal(index, stored)


DAMAGED = {
    "text": (b"OFF\n0 0 0\n", "is damaged"),
    "short": (MESH[:100], "is damaged"),
    "no end": (MESH, "is damaged"),
    "no field": (MESH + END, "expected the vectors dir_u and dir_v of faces, found none"),
    "three": (MESH + b"".join(vectors(n, U) for n in (b"a", b"b", b"c")) + END, "found a, b, c"),
    "a wrong size": (MESH + vectors(b"a", U[:1]) + END, "is damaged"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_raise_one_line_errors(name, tmp_path, error_of):
    surface = rf.Surface(POINTS, [[0, 1, 2, 3], [1, 4, 2]])
    assert_damaged(error_of, tmp_path / "a.om", *DAMAGED[name], read_field, surface)


def test_every_changed_byte_is_an_error_or_a_mesh(tmp_path):
    """Handles that point in circles or out of the file end in an error, not in a loop."""
    path = tmp_path / "a.om"
    data = MESH + vectors(b"wind", U) + END
    for position in range(len(data)):
        for value in (0, 1, 255):
            read_damaged(path, data, bytes([value]), position, read_om_mesh)
