"""Surfaces, matrices and measures for tests of fields."""

import numpy as np
from awkward import AWKWARD
from conftest import traced_peak
from scipy import sparse
from shapes import from_triangles, icosphere, rebuilt

from rosy_addon.core.errors import RosyError
from rosy_addon.field.convert import rotate_field
from rosy_addon.field.field_io import load_field
from rosy_addon.field.representation import from_representation, to_representation
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface


def as_scipy(matrix):
    shape = len(matrix), matrix.column_count
    return sparse.csr_matrix((matrix.data, matrix.indices, matrix.indptr), shape=shape)


def bumpy(surface, amount=0.15, stretch=(1.0, 1.2, 1.5)):
    """A surface without symmetry, so that the smallest eigenvalue is simple."""
    x, y, z = surface.vertices.T
    out = 1 + amount * np.sin(3 * x + 1) * np.cos(2 * y + 0.5) + 0.5 * amount * np.sin(4 * z + x)
    return rebuilt(surface, surface.vertices * out[:, None] * stretch)


def angle_differences(surface, first, second, degree):
    """(F,) angles between nearest members of two fields, given by vectors on the faces; radians."""
    x, y = surface.face_frames
    z, w = (to_representation(vectors, x, y, degree) for vectors in (first, second))
    return np.abs(np.angle(z * w.conj())) / degree


def awkward_surface(name):
    """One of the meshes of `awkward.AWKWARD`."""
    points, faces = AWKWARD[name]()
    return build_surface(points, np.concatenate(faces), np.cumsum([0, *map(len, faces)]), name=name)


def directions_at_angles(surface, angles, lengths=1.0):
    """(F, N, 3) directions at N angles from the first edge of each face; lengths of all or of each."""
    x, y = (axis[:, None] for axis in surface.face_frames)
    w = (np.exp(1j * np.array(angles)) * lengths)[..., None]
    return w.real * x + w.imag * y


def random_field(surface, degree, seed=0):
    """A field of random directions, and of random magnitudes from 0.5 to 1."""
    random = np.random.default_rng(seed)
    z = random.uniform(0.5, 1.0, surface.face_count)
    z = z * np.exp(2j * np.pi * random.random(surface.face_count))
    return RosyField(degree, from_representation(z, *surface.face_frames, degree))


def with_random_members(surface, field, seed=0):
    """The same RoSys, with a random member of each stored."""
    member_index = np.random.default_rng(seed).integers(0, field.degree, surface.face_count)
    return rotate_field(surface, field, 2 * np.pi * member_index / field.degree)


def write_off(path, surface):
    """Write a mesh as an .off file, and return its path."""
    rows = ["OFF", f"{len(surface.vertices)} {surface.face_count} 0"]
    rows += [" ".join(map(repr, point)) for point in surface.vertices.tolist()]
    faces = np.split(surface.corner_vertex, surface.face_start[1:-1])
    rows += [" ".join(map(str, [len(face), *face])) for face in faces]
    path.write_text("\n".join(rows) + "\n")
    return path


def ply_header(form, *elements):
    """Return the header of a .ply file; an element is its name, its number of rows, and its properties."""
    lines = ["ply", f"format {form} 1.0", "comment made by hand"]
    for name, count, *properties in elements:
        lines += [f"element {name} {count}", *(f"property {each}" for each in properties)]
    return "\n".join([*lines, "end_header", ""])


def read_damaged(path, data, garbage, offset, read):
    """Read a file with garbage in its data, which is possible or ends in an error that names the file."""
    path.write_bytes(data[:offset] + garbage + data[offset + len(garbage) :])
    try:
        read(path)
    except RosyError as error:
        assert "\n" not in str(error) and str(path) in str(error)
    finally:
        path.unlink()  # a field file is read with the mesh file of its name


def assert_damaged(error_of, path, data, expected, read, *arguments):
    """Check that a damaged file is refused by its name, without memory for what its header claims."""
    path.write_bytes(data)
    messages = []
    assert traced_peak(lambda: messages.append(error_of(read, path, *arguments))) < 10e6
    assert expected in messages[0] and str(path) in messages[0]


def cross_errors(surface, vectors, expected):
    """(F,) angles in degrees between the directions of crosses, projected on the faces."""
    return np.degrees(angle_differences(surface, vectors, expected, 4))


def ellipsoid(subdivisions, axes=(1.0, 0.8, 0.6)):
    ball = icosphere(subdivisions)
    return rebuilt(ball, ball.vertices * axes)


def read_field(*arguments, **settings):
    """`load_field` without the note."""
    return load_field(*arguments, **settings).field


def symmetric_head(subdivisions=3):
    """A surface with one mirror plane, x = 0, and the mirror image of each of its faces."""
    ball = icosphere(subdivisions)
    x, y, z = ball.vertices.T
    out = 1 + 0.2 * np.sin(2 * y + 1) * np.cos(2 * x) + 0.15 * np.sin(3 * z + y)
    vertices = ball.vertices * out[:, None] * (1.0, 1.3, 1.1)
    return from_triangles(vertices, ball.corner_vertex.reshape(-1, 3))
