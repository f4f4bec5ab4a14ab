"""Reading and writing of fields, and the validation of vectors from outside."""

import io

import numpy as np
import pytest
from field_helpers import angle_differences, assert_damaged, read_field
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapes import cylinder, from_quads, icosphere, plane, torus

from rosy_addon.field.field_io import write_field
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import axis_field
from rosy_addon.field.representation import face_representation
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import Surface
from rosy_addon.field.validate import (
    VectorPolicy,
    validated_directions,
    validated_field,
    vertex_normals,
)

SQUARES = plane(3, 2)  # 6 faces, 12 vertices, facing +z
WEST = np.tile((-2.0, 0.0, 0.0), (6, 1))


def rosy_text(rows, count=None, degree=4, form="{count}\n{degree}\n"):
    head = form.format(count=len(rows) if count is None else count, degree=degree)
    return head + "".join(" ".join(map(str, row)) + "\n" for row in rows)


def npy_that_claims(count):
    """An array of 6 rows whose header claims more."""
    file = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (count, 3)}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue() + WEST.tobytes()


# --- reading and writing ---------------------------------------------------------------------


@pytest.mark.parametrize(
    "form", ["{count}\n{degree}\n", "{count} {degree}\n", "\t{count}\r\n\n {degree} \n\n"]
)
def test_line_breaks_have_no_meaning(form, tmp_path):
    text = rosy_text(WEST, form=form)
    for content in (text, "\n".join(text.split())):
        (tmp_path / "a.rosy").write_text(content)
        field = read_field(tmp_path / "a.rosy", SQUARES)
        assert field.degree == 4 and np.array_equal(field.vectors, WEST)


def test_a_vertex_count_is_accepted_above_face_rows(tmp_path, error_of):
    (tmp_path / "a.rosy").write_text(rosy_text(WEST, count=12))
    assert np.array_equal(read_field(tmp_path / "a.rosy", SQUARES).vectors, WEST)
    (tmp_path / "b.rosy").write_text(rosy_text(np.tile(WEST, (2, 1)), count=6))
    message = error_of(read_field, tmp_path / "b.rosy", SQUARES)
    assert "declares 6 rows of 3 numbers, but contains 12" in message


def test_rows_for_vertices_are_averaged_onto_faces(tmp_path):
    # Any member may be stored at a vertex: here they alternate between two of the four.
    members = np.where(np.arange(12)[:, None] % 2, (0.0, 3.0, 0.0), (3.0, 0.0, 0.0))
    (tmp_path / "a.rosy").write_text(rosy_text(members))
    field = read_field(tmp_path / "a.rosy", SQUARES)
    assert field.vectors.shape == (6, 3)
    # The mean of the vectors would be shorter, and at 45 degrees to all of them.
    assert np.allclose(face_representation(SQUARES, field), 3)


#: Components that are neither treated as zero nor as infinite.
component = st.just(0.0) | st.floats(1e-29, 1e29) | st.floats(-1e29, -1e-29)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.integers(1, 12),
    st.lists(st.tuples(component, component), min_size=6, max_size=6),
    st.sampled_from([".rosy", ".rawfield", ".txt", ".npy"]),
)
def test_written_fields_are_read_back_exactly(tmp_path, degree, vectors, ending):
    vectors = np.concatenate([np.array(vectors), np.zeros((6, 1))], axis=1)
    field = RosyField(degree, vectors)
    path = tmp_path / f"field{ending}"
    write_field(path, field, SQUARES)
    again = read_field(path, SQUARES, degree)
    assert again.degree == degree and np.array_equal(again.vectors, field.vectors)


def test_rawfield_members_run_counter_clockwise_from_the_stored_one(tmp_path):
    write_field(tmp_path / "a.rawfield", RosyField(4, WEST), SQUARES)
    lines = (tmp_path / "a.rawfield").read_text().splitlines()
    assert lines[0] == "4 6"
    members = np.array(lines[1].split(), dtype=float).reshape(4, 3)
    assert np.allclose(members, [(-2, 0, 0), (0, -2, 0), (2, 0, 0), (0, 2, 0)], atol=1e-15)


def test_members_may_be_listed_in_any_order(tmp_path):
    members = np.array([(-2, 0, 0), (0, 2, 0), (2, 0, 0), (0, -2, 0)], dtype=float)
    rows = np.tile(members.reshape(1, 12), (6, 1))
    (tmp_path / "a.rawfield").write_text(rosy_text(rows, form="{degree} {count}\n"))
    assert np.array_equal(read_field(tmp_path / "a.rawfield", SQUARES).vectors, WEST)


@pytest.mark.parametrize("name", ["vase-2", "vase-4", "vase-7", "dome-6", "cheburashka"])
def test_fields_of_other_programs(name, shared_data):
    mesh, _, degree = name.partition("-")
    surface = Surface(shared_data / "meshes" / f"{mesh}.off")
    field = read_field(shared_data / "fields" / f"{name}.rawfield", surface)
    assert field.degree == int(degree or 4) and np.allclose(field.magnitude, 1, atol=1e-4)
    assert np.abs(dot(field.vectors, surface.face_normal)).max() < 3e-7
    if name == "cheburashka":  # the only closed mesh
        _, index = find_singularities(surface, field)
        assert index.sum() == field.degree * surface.euler_characteristic


@pytest.mark.parametrize(
    ("angle", "longer", "rosy"), [(0.9, 0.009, True), (1.2, 0.0, False), (0.0, 0.02, False)]
)
def test_tolerances_of_a_rosy(angle, longer, rosy, tmp_path):
    angles = np.radians([0, 120 + angle, 240])
    members = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    members[2] *= 1 + longer
    rows = np.tile(members.reshape(1, 9), (6, 1))
    (tmp_path / "a.rawfield").write_text(rosy_text(rows, degree=3, form="{degree} {count}\n"))
    field = read_field(tmp_path / "a.rawfield", SQUARES)
    assert field.degree == 3 and (field.direction_ratios is None) == rosy


DAMAGED = {
    "empty.rosy": (b"", "ends before the count"),
    "torn.rosy": (rosy_text(WEST)[:-5].encode(), "but contains 5 and part of another"),
    "claims.rosy": (b"178956970 4\n1 0 0\n", "declares 178,956,970 rows of 3 numbers, but contains 1"),
    "claims.rawfield": (b"12 59652323\n1 0 0\n", "declares 59,652,323 rows of 36 numbers, but contains 0"),
    "binary.rosy": (bytes(range(200)), "expected text, found binary data"),
    "binary.rawfield": (b"\x89PNG\r\n\x1a\n\xff\xfe", "binary.rawfield:1: expected"),
    "word.rosy": (rosy_text(WEST).replace("-2.0", "two", 2).replace("two", "-2.0", 1).encode(),
                  "word.rosy:4: expected a number (part of a vector), found 'two'"),
    "zero.rosy": (rosy_text(WEST, degree=0).encode(), "zero.rosy:2: degree 0 is not"),
    "half.rosy": (rosy_text(WEST, degree=2.5).encode(), "half.rosy:2: expected the degree, a whole number, found '2.5'"),
    "negative.rosy": (b"-6 4\n", "declares -6 rows"),
    "many.rosy": (rosy_text(np.ones((7, 3))).encode(), "contains 7 rows, but plane has 6 faces and 12 v"),
    "nan.rosy": (rosy_text(np.where(np.arange(6)[:, None] == 4, np.nan, WEST)).encode(),
                 "1 of 6 vectors are not finite, the first on face 4"),
    "upright.rosy": (rosy_text(np.tile((0, 0, 1), (6, 1))).encode(), "face 0 by 90.0 degrees"),
    "claims.npy": (npy_that_claims(10**11), "which is more than it contains"),
    "a.vtk": (b"", "is not a field file"),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_raise_one_line_errors(name, tmp_path, error_of):
    assert_damaged(error_of, tmp_path / name, *DAMAGED[name], read_field, SQUARES)


def test_missing_file_and_conflicting_degree(tmp_path, error_of):
    assert "no such file" in error_of(read_field, tmp_path / "none.rosy", SQUARES)
    (tmp_path / "a.rosy").write_text(rosy_text(WEST))
    message = error_of(read_field, tmp_path / "a.rosy", SQUARES, 6)
    assert "the field has degree 4, but degree 6 was requested" in message


# --- vectors from outside ----------------------------------------------------------------------


def test_small_deviations_are_projected_and_keep_their_length():
    field = validated_field(SQUARES, WEST + (0, 0, 0.1), 4, "here")
    assert np.allclose(field.vectors, (-np.hypot(2, 0.1), 0, 0), atol=1e-14)


def test_vectors_off_the_surface_are_refused(error_of):
    surface = torus()
    field = axis_field(surface, 4)
    vectors = field.vectors + surface.face_normal * 0.05 * field.magnitude[:, None]
    few = np.array([7, 100, 2000])
    vectors[few] += 0.3 * surface.face_normal[few] * field.magnitude[few, None]
    z = face_representation(surface, validated_field(surface, vectors, 4, "here"))
    is_far = np.isin(np.arange(surface.face_count), few)
    length = np.hypot(1, np.where(is_far, 0.35, 0.05))
    assert np.allclose(z, length * face_representation(surface, field))
    many = np.arange(0, surface.face_count, 50)
    vectors[many] += 0.3 * surface.face_normal[many] * field.magnitude[many, None]
    vectors[500] += 2 * surface.face_normal[500] * field.magnitude[500, None]
    message = error_of(validated_field, surface, vectors, 4, "there")
    assert message.startswith("there: ") and "face 500 by" in message
    assert f"{np.degrees(np.arctan(2.35)):.1f} degrees" in message


@pytest.mark.parametrize("stored", ["members", "directions"])
@pytest.mark.parametrize("domain", ["face", "vertex"])
def test_vectors_off_the_surface_are_projected_or_undefined_on_request(domain, stored, error_of):
    """Vectors turned out of the plane by 60 degrees, on one face or vertex in 20."""
    surface = icosphere(3)
    normal = surface.face_normal if domain == "face" else vertex_normals(surface)
    right = normalize(np.cross((0.0, 0.0, 1.0), normal))
    is_off = np.arange(len(normal)) % 20 == 7
    sine = np.where(is_off, np.sin(np.radians(60)), 0.0)[:, None]
    given = np.sqrt(1 - sine**2) * right + sine * normal

    def made(vectors, policy):
        if stored == "members":
            return validated_field(surface, vectors, 2, "a", policy, domain)
        directions = np.stack([vectors, -vectors], axis=1)
        return validated_directions(surface, directions, "a", policy, domain)

    assert "off_surface, --off-surface" in error_of(made, given, VectorPolicy())
    expected = made(right, VectorPolicy()).vectors
    projected = made(given, VectorPolicy(off_surface="project"))
    assert np.abs(projected.vectors - expected).max() < 1e-12
    assert projected.source_directions is None
    undefined = made(given, VectorPolicy(off_surface="undefined"))
    if domain == "face":
        assert np.array_equal(~undefined.vectors.any(axis=1), is_off)
        assert np.array_equal(undefined.vectors[~is_off], expected[~is_off])
    else:
        # The other vertices of a face decide. The three corners of a face are never all off here.
        assert undefined.vectors.any(axis=1).all()
        is_near = is_off[surface.faces].any(axis=1)
        assert np.abs(undefined.vectors - expected)[~is_near].max() < 1e-12
        assert (undefined.magnitude < np.linalg.norm(expected, axis=1))[is_near].all()


def test_nonfinite_vectors_are_undefined_on_request():
    vectors = WEST.copy()
    vectors[1, 2], vectors[4] = np.nan, np.inf
    field = validated_field(SQUARES, vectors, 3, "here", VectorPolicy("zero"))
    assert field.magnitude.tolist() == [2, 0, 2, 2, 0, 2]


def test_the_field_is_undefined_on_faces_without_area():
    quads = np.array([(0, 1, 2, 3), (1, 1, 2, 2)])
    surface = from_quads(np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.0)]), quads)
    field = validated_field(surface, np.ones((2, 3)) * (1, 1, 0), 4, "here")
    assert field.magnitude.tolist() == [np.sqrt(2), 0]


def test_the_domain_decides_if_both_counts_agree(error_of):
    surface = torus(24, 12)  # as many faces as vertices
    assert surface.face_count == len(surface.vertices)
    angle = np.arctan2(surface.vertices[:, 1], surface.vertices[:, 0])
    around = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    exact = np.cross((0, 0, 1.0), surface.face_center)
    field = validated_field(surface, around, 4, "here", domain="vertex")
    assert angle_differences(surface, field.vectors, exact, 4).max() < 1e-9
    assert "not tangent to the surface" in error_of(validated_field, surface, around, 4, "here")


def test_a_field_belongs_to_the_rest_shape():
    tube = cylinder(24, 4)
    field = axis_field(tube, 4)
    turned = tube.vertices[:, [2, 1, 0]] * (1, 1, -1.0)
    bent = tube.with_parts(vertices=turned, rest_vertices=tube.vertices)
    assert np.array_equal(validated_field(bent, field.vectors, 4, "here").vectors, field.vectors)


def test_vectors_beyond_the_range_of_single_precision(error_of):
    vectors = np.tile([[1.0, 0.0, 0.0]], (6, 1))
    vectors[2] *= 1e160
    message = error_of(validated_field, SQUARES, vectors, 4, "a")
    assert "1 of 6 vectors are 1e+30 or larger" in message
    vectors[2] = 5e-324, 0.0, 0.0
    field = validated_field(SQUARES, vectors, 4, "a")
    assert not field.vectors[2].any() and field.vectors[3].any()
