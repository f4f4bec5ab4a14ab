"""Reading of meshes: every format, and the errors for damaged files."""

import struct

import numpy as np
import pytest
from field_helpers import assert_damaged, ply_header, read_damaged
from hypothesis import given
from hypothesis import strategies as st

from rosy_addon.field.formats.stl import weld
from rosy_addon.field.surface import Surface

# A square, and a triangle on its edge from vertex 1 to vertex 2.
VERTICES = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (1, 0.5, 1e-3)])
FACES = [(0, 1, 2, 3), (2, 1, 4)]

OBJ = """\
# a comment
mtllib none.mtl
v 0 0 0
v 1 0 0  # and one here
v 1 1 0 1.0 0.5 0.5 0.5
v 0 1 0
vt 0 0
vn 0 0 1
usemtl paint
f 1/1/1 2/1/1 3/1/1 4/1/1
v 1 0.5 1e-3
s off
f -3//1 2//1 -1//1
"""
OFF = """\
OFF 5 2 0
# vertices
0 0 0
1 0 0
1 1 0

0 1 0
1 .5 1e-3
4 0 1 2 3 255 0 0
3 2 1 4
"""
PLY_HEADER = ply_header(
    "{format}",
    ("vertex", 5, "float x", "float y", "float z", "uchar red"),
    ("face", 2, "list uchar int vertex_indices", "float quality"),
    ("edge", 1, "int vertex1", "int vertex2"),
)
PLY_BODY = "".join(f"{x:g} {y:g} {z:g} 9\n" for x, y, z in VERTICES)
PLY_BODY += "".join(f"{len(face)} {' '.join(map(str, face))} 0.5\n" for face in FACES) + "0 1\n"


def ply_with_float_count(count: float) -> bytes:
    """A binary file whose first face claims a list length that is a float."""
    data = binary_ply("<").replace(b"list uchar int", b"list float int")
    start = data.index(b"end_header\n") + 11 + 5 * 13
    return data[:start] + struct.pack("<f", count) + data[start + 1 :]


def binary_ply(order: str, faces=FACES) -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = PLY_HEADER.format(format=name).replace("face 2", f"face {len(faces)}")
    instance = b"".join(struct.pack(order + "3fB", *point, 9) for point in VERTICES)
    for face in faces:
        instance += struct.pack(f"{order}B{len(face)}if", len(face), *face, 0.5)
    return header.encode() + instance + struct.pack(order + "2i", 0, 1)


FILES = {
    "a.obj": OBJ.encode(),
    "dos.obj": OBJ.replace("\n", "\r\n").encode(),
    "a.off": OFF.encode(),
    "split.off": OFF.replace("OFF 5", "OFF\n5").encode(),
    "bare.off": OFF.replace("OFF 5", "5").encode(),
    "colored.off": OFF.replace("OFF", "COFF").replace(" 0\n", " 0 0 0 255\n").encode(),
    "a.ply": (PLY_HEADER.format(format="ascii") + PLY_BODY).encode(),
    "dos.ply": (PLY_HEADER.format(format="ascii") + PLY_BODY).replace("\n", "\r\n").encode(),
    "little.ply": binary_ply("<"),
    "big.ply": binary_ply(">"),
}


@pytest.mark.parametrize("name", FILES)
def test_polygons_are_read_in_their_order(name, tmp_path):
    (tmp_path / name).write_bytes(FILES[name])
    surface = Surface(tmp_path / name)
    assert np.allclose(surface.vertices, VERTICES, atol=1e-9)
    assert surface.corner_vertex.tolist() == [*FACES[0], *FACES[1]]
    assert surface.face_start.tolist() == [0, 4, 7]


@pytest.mark.parametrize("order", "<>")
def test_binary_ply_of_equal_faces(order, tmp_path):
    triangles = [(0, 1, 2), (2, 3, 0), (2, 1, 4)]
    (tmp_path / "a.ply").write_bytes(binary_ply(order, triangles))
    surface = Surface(tmp_path / "a.ply")
    assert surface.corner_vertex.reshape(-1, 3).tolist() == [list(face) for face in triangles]


TRIANGLES = VERTICES[[(0, 1, 2), (2, 3, 0), (2, 1, 4)]].astype(np.float32)


def binary_stl(count: int | None = None) -> bytes:
    count = len(TRIANGLES) if count is None else count
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, *points.ravel(), 0) for points in TRIANGLES)
    return b"solid in name only".ljust(80) + struct.pack("<I", count) + rows


def text_stl() -> bytes:
    lines = ["solid thing"]
    for points in TRIANGLES:
        lines += ["facet normal 0 0 1", "outer loop"]
        lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in points.astype(float).tolist()]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid thing", ""]).encode()


@pytest.mark.parametrize("binary", [False, True])
def test_strips_of_a_ply_file(binary, tmp_path):
    """A tube of two strips in one list, with -1 between them, and a third list for its bottom."""
    angle = np.arange(8) * np.pi / 4
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.concatenate([np.column_stack([ring, np.full(8, z)]) for z in (0.0, 1.0)])
    around = [(k % 8 + 8 * upper) for k in range(9) for upper in (1, 0)]
    strips = [[*around[:8], -1, *around[6:]], [0, 7, 1, 6, 2, 5, 3, 4]]
    header = ply_header(
        "binary_little_endian" if binary else "ascii",
        ("vertex", 16, "double x", "double y", "double z"),
        ("tristrips", 2, "list int int vertex_indices"),
    )
    rows = [[len(strip), *strip] for strip in strips]
    if binary:
        body = points.tobytes() + b"".join(np.array(row, "<i4").tobytes() for row in rows)
    else:
        lines = [*points.tolist(), *rows]
        body = "".join(" ".join(map(str, line)) + "\n" for line in lines).encode()
    (tmp_path / "a.ply").write_bytes(header.encode() + body)
    surface = Surface(tmp_path / "a.ply")
    assert surface.face_count == 16 + 6 and surface.euler_characteristic == 1
    outward = surface.face_center - (0.0, 0.0, 0.5)
    assert ((surface.face_normal * outward).sum(axis=1) > 0.1).all()


@pytest.mark.parametrize("data", [binary_stl(), text_stl()], ids=["binary", "text"])
def test_stl_corners_at_the_same_position_are_one_vertex(data, tmp_path):
    (tmp_path / "a.stl").write_bytes(data)
    surface = Surface(tmp_path / "a.stl")
    assert len(surface.vertices) == 5
    assert surface.corner_vertex.tolist() == [0, 1, 2, 2, 3, 0, 2, 1, 4]
    assert np.array_equal(surface.vertices[surface.corner_vertex], TRIANGLES.reshape(-1, 3))


@given(st.lists(st.tuples(*3 * [st.sampled_from([-1.0, -0.0, 0.0, 1e-300, 2.5])]), max_size=40))
def test_weld_keeps_positions_and_removes_duplicates(points):
    points = np.array(points, dtype=float).reshape(-1, 3)
    vertices, index = weld(points)
    assert np.array_equal(vertices[index], points)
    assert len({tuple(vertex + 0.0) for vertex in vertices}) == len(vertices)
    first = [index.tolist().index(number) for number in range(len(vertices))]
    assert first == sorted(first)


def test_edges_sharper_than_60_degrees_are_sharp(tmp_path):
    # Three squares with edges along z, at angles of 90 and 45 degrees.
    (tmp_path / "bent.off").write_text(
        "OFF 8 3 0\n0 0 0\n0 0 1\n1 0 0\n1 0 1\n1 1 0\n1 1 1\n0 2 0\n0 2 1\n"
        "4 0 2 3 1\n4 2 4 5 3\n4 4 6 7 5\n"
    )
    surface = Surface(tmp_path / "bent.off")
    fans = (set(surface.corner_fan[surface.corner_vertex == vertex]) for vertex in (2, 4))
    assert [len(each) for each in fans] == [2, 1]


DAMAGED = {
    "empty.obj": (b"", "no faces"),
    "word.obj": (b"v 0 0 0\nv 1 zero 0\n", "word.obj:2: expected a number (vertex), found 'zero'"),
    "short.obj": (b"v 0 0\n", "short.obj:1: vertex has 2 coordinates"),
    "edge.obj": (b"v 0 0 0\nv 1 0 0\nf 1 2\n", "edge.obj:3: a face has 2 corners"),
    "far.obj": (OBJ.encode() + b"f 1 2 9\n", "far.obj:14: a face refers to vertex 9, but"),
    "back.obj": (OBJ.encode() + b"f 1 2 -6\n", "back.obj:14: a face refers to vertex -6"),
    "huge.obj": (OBJ.encode() + b"f 1 2 99999999999999999999\n", "huge.obj:14:"),
    "nan.obj": (b"v 0 0 0\nv 1 nan 0\n", "nan.obj:2: vertex 1 has a coordinate that is not finite"),
    "binary.obj": (b"v 0 0 0\n\0\1\2", "binary data"),
    "truncated.off": (OFF[:60].encode(), "declares 5 vertices and 2 faces, but ends after"),
    "torn.off": (OFF.encode()[:-3], "torn.off:10: face 1 declares 3 corners, but lists 2"),
    "claims.off": (b"OFF 90000000 180000000 0\n0 0 0\n", "declares 90,000,000 vertices"),
    "far.off": (OFF.replace("3 2 1 4", "3 2 1 5").encode(), "far.off:10: a face refers to vertex 5"),
    "pair.off": (OFF.replace("3 2 1 4", "2 2 1").encode(), "pair.off:10: face 1 has 2 corners"),
    "other.off": (b"MESH 1 2 3\n", "other.off:1: expected OFF, found 'MESH'"),
    "minus.off": (b"OFF -1 2 0\n", "minus.off:1: expected the numbers"),
    "large.obj": (OBJ.replace("1e-3", "1e100").encode(), "vertex 4 has a coordinate above 1e+12"),
    "small.off": (b"OFF 3 1 0\n0 0 0\n1e-40 0 0\n0 1e-40 0\n3 0 1 2\n", "is smaller than 1e-12"),
    "truncated.ply": (binary_ply("<")[:-20], "declares 2 rows of element 'face', but ends after 1"),
    "text.ply": (FILES["a.ply"][:-9], "text.ply:22: face 1 has 4 values, expected 5"),
    "ascii.ply": (FILES["a.ply"][:-20], "declares 2 rows of element 'face', but ends after 1"),
    "header.ply": (FILES["a.ply"][:100], "the header has no line 'end_header'"),
    "kind.ply": (FILES["a.ply"].replace(b"float z", b"real z"), "kind.ply:7: expected"),
    "noz.ply": (FILES["a.ply"].replace(b"float z", b"float w"), "the vertices have no property 'z'"),
    "far.ply": (FILES["a.ply"].replace(b"3 2 1 4", b"3 2 1 7"), "face 1 refers to vertex 7"),
    "claims.ply": (binary_ply("<").replace(b"vertex 5", b"vertex 190000000"), "declares 190,000,000 rows"),
    "nan.ply": (ply_with_float_count(np.nan), "face 0 has a list of length nan"),
    "huge.ply": (ply_with_float_count(1e30), "declares 2 rows of element 'face', but ends after 0"),
    "twice.ply": (FILES["a.ply"].replace(b"float y", b"float x"), "twice.ply:6: property 'x' is declared twice"),
    "again.ply": (FILES["a.ply"].replace(b"edge 1", b"face 1"), "again.ply:12: element 'face' is declared"),
    "many.ply": (FILES["a.ply"].replace(b"3 2 1 4", b"nan 2 1 4"), "the length of a list, found nan"),
    "void.ply": (binary_ply("<").replace(b"element edge", b"element none 99999999999999\nelement edge")[:-1],
                 "declares 1 row of element 'edge', but ends after 0"),
    "nomesh.ply": (PLY_HEADER.format(format="ascii").split("element face")[0].encode()
                   + b"end_header\n" + PLY_BODY[:50].encode(), "no faces"),
    "signal.ply": (binary_ply(">").replace(struct.pack(">f", 0.001), b"\x7f\x81\0\0"), "vertex 4 has"),
    "not.ply": (b"solid\n", "expected 'ply', found 'sol'"),
    "truncated.stl": (binary_stl()[:-30], "declares 3 triangles, but ends after 2"),
    "claims.stl": (binary_stl(40_000_000), "declares 40,000,000 triangles, but ends after 3"),
    "torn.stl": (text_stl()[:-60], "corners in 2 complete triangles"),
    "none.stl": (b"solid nothing\nendsolid nothing\n", "no faces"),
    "garbage.stl": (b"\x89PNG", "is not an .stl file"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_raise_one_line_errors(name, tmp_path, error_of):
    assert_damaged(error_of, tmp_path / name, *DAMAGED[name], Surface)


def test_missing_files_and_folders(tmp_path, error_of):
    assert "no such file" in error_of(Surface, tmp_path / "none.obj")
    (tmp_path / "folder.obj").mkdir()
    assert "is a directory" in error_of(Surface, tmp_path / "folder.obj")


@pytest.mark.slow
@given(st.binary(max_size=300), st.sampled_from(sorted(FILES)), st.integers(0, 400))
def test_random_damage_raises_only_rosy_errors(tmp_path_factory, garbage, name, offset):
    path = tmp_path_factory.getbasetemp() / f"damaged-{name}"
    read_damaged(path, FILES[name], garbage, offset, Surface)
