"""The G-buffer against explicit transport, closed forms and invariances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import from_quads, from_triangles, icosphere, plane, torus

from rosy_addon.errors import RosyError
from rosy_addon.field.frames import dot, normalize, tangent_frame, transport, view_frame
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import build_surface
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.camera import perspective_camera as lens
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.pixel_neighbors import screen_jacobians
from rosy_addon.projection.project import project, project_task

pytestmark = pytest.mark.filterwarnings("error")

seeds = st.integers(0, 2**32 - 1)
degrees = st.integers(1, 7)
IDENTITY = np.eye(4)


def random_rotation(random):
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def matrix_of(linear, shift=(0, 0, 0)):
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    matrix[:3, 3] = shift
    return matrix


def tangent_field(surface, degree, seed=0):
    """A field that varies smoothly over the surface, with magnitudes around 1."""
    random = np.random.default_rng(seed)
    matrix, shift = random.normal(size=(3, 3)), random.normal(size=3)
    normal = surface.face_normal
    vectors = surface.face_center @ matrix + shift
    return RosyField(degree, vectors - dot(vectors, normal)[:, None] * normal)


def with_other_members(surface, field, turns):
    """The same field by other members: each vector turned by `turns` times 2 pi / N."""
    angle = turns * 2 * np.pi / field.degree
    sideways = np.cross(surface.face_normal, field.vectors)
    return RosyField(
        field.degree, np.cos(angle)[:, None] * field.vectors + np.sin(angle)[:, None] * sideways
    )


def members_in_space(buffer, degree):
    """(P, 3) in camera space: the member that the representation stands for."""
    angle = np.angle(buffer.representation.astype(complex)) / degree
    toward_eye = buffer.view_direction.astype(float)
    x, y = view_frame(toward_eye)
    seen = np.cos(angle)[:, None] * x + np.sin(angle)[:, None] * y
    return transport(seen, toward_eye, buffer.normal.astype(float))


def representation(vectors, normal, degree):
    """z in `tangent_frame(normal)`, by trigonometry."""
    x, y = tangent_frame(normal)
    angle = np.arctan2(dot(vectors, y), dot(vectors, x))
    return np.linalg.norm(vectors, axis=-1) * np.exp(1j * degree * angle)


def member(z, normal, degree):
    x, y = tangent_frame(normal)
    angle = np.angle(z) / degree
    return np.abs(z) * (np.cos(angle) * x + np.sin(angle) * y)


def screen_directions(buffer, degree):
    """(P,) complex: N-th power of a member's direction on screen (face-on the same for all)."""
    axes = screen_jacobians(buffer).astype(complex)
    angle = np.angle(buffer.representation.astype(complex)) / degree
    return axes[:, 0] * np.cos(angle) + axes[:, 1] * np.sin(angle)


def explicit_values(surface, field, buffer, chosen, linear):
    """z at some pixels in the view frame, every vector carried one at a time in space."""
    degree = field.degree
    vectors, faces = field.vectors @ linear.T, surface.face_normal @ linear.T
    corner_normal = surface.corner_normal @ linear.T
    points = surface.vertices[surface.corner_vertex]
    before = np.argsort(surface.next_corner)
    ahead = normalize(points[surface.next_corner] - points)
    angle = np.arccos(dot(ahead, normalize(points[before] - points)))
    at_corner = np.zeros((len(angle), 3))
    for corner in range(len(angle)):
        fan = np.flatnonzero(surface.corner_fan == surface.corner_fan[corner])
        around, normal = surface.corner_face[fan], corner_normal[corner]
        there = [transport(vectors[f], faces[f], normal) for f in around]
        z = np.array([representation(vector, normal, degree) for vector in there])
        at_corner[corner] = member((z * angle[fan]).sum() / angle[fan].sum(), normal, degree)
    values = []
    for pixel in chosen:
        corners = surface.triangles[buffer.triangle[pixel]]
        weights = buffer.barycentric[pixel].astype(float)
        normal = normalize(weights @ corner_normal[corners])
        there = [transport(at_corner[c], corner_normal[c], normal) for c in corners]
        z = sum(w * representation(v, normal, degree) for w, v in zip(weights, there, strict=True))
        direction = member(z, normal, degree)
        eye = buffer.view_direction[pixel].astype(float)
        side = np.sign(dot(buffer.normal[pixel].astype(float), normal))
        seen = transport(direction, side * normal, eye)
        x, y = view_frame(eye)
        values.append(np.abs(z) * np.exp(1j * degree * np.arctan2(dot(seen, y), dot(seen, x))))
    return np.array(values)


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("inside", [False, True])
def test_values_match_explicit_transport(degree, inside):
    """On a very coarse sphere, where the ways of transport differ by many degrees."""
    surface = icosphere(1)
    field = tangent_field(surface, degree)
    camera = orbit_camera(surface, 30, 20, 64, 64)
    if inside:
        camera = lens(look_at((0.1, 0, 0.1), (1, 1, 0)), 64, 64, fov=1.5, clip=(0.01, 9))
    buffer = project([MeshInstance(surface, IDENTITY, field)], camera)
    assert buffer.front_facing.all() != inside
    chosen = np.arange(0, len(buffer.pixel), 37)
    expected = explicit_values(surface, field, buffer, chosen, camera.view[:3, :3])
    np.testing.assert_allclose(buffer.representation[chosen], expected, atol=2e-5)


def test_values_are_continuous_across_edges_of_triangles():
    """Neighbouring pixels on a coarse sphere, of one triangle and of two, differ alike."""
    surface = icosphere(1)
    buffer = project(
        [MeshInstance(surface, IDENTITY, tangent_field(surface, 4))],
        orbit_camera(surface, 10, 70, 400, 400),
    )
    there = np.searchsorted(buffer.pixel, buffer.pixel + 1)[:-1]
    here = np.flatnonzero(
        buffer.pixel[np.minimum(there, len(buffer.pixel) - 1)] == buffer.pixel[:-1] + 1
    )
    facing = buffer.normal[here, 2] > 0.5
    here = here[facing]
    change = np.abs(buffer.representation[here + 1] - buffer.representation[here])
    same = buffer.triangle[here + 1] == buffer.triangle[here]
    assert (~same).sum() > 500
    assert change[~same].max() < 1.2 * change[same].max()
    assert np.median(change[~same]) < 1.2 * np.median(change[same])


@settings(max_examples=20)
@given(seeds, degrees, st.booleans(), st.sampled_from(["smooth", "flat"]))
def test_values_do_not_depend_on_the_stored_member(seed, degree, deformed, display):
    random = np.random.default_rng(seed)
    surface = torus(12, 7)
    if deformed:
        moved = surface.vertices + 0.1 * random.normal(size=surface.vertices.shape)
        surface = build_surface(
            moved, surface.corner_vertex, surface.face_start, rest_vertices=surface.vertices
        )
    matrix = matrix_of(random.normal(size=(3, 3)) + 1.5 * np.eye(3))
    camera = orbit_camera(surface.vertices @ matrix[:3, :3].T, 20, 50, 48, 48)
    rest = build_surface(
        surface.vertices if surface.rest_vertices is None else surface.rest_vertices,
        surface.corner_vertex,
        surface.face_start,
    )
    field = tangent_field(rest, degree, seed)
    other = with_other_members(rest, field, random.integers(0, degree, surface.face_count))
    one = project([MeshInstance(surface, matrix, field)], camera, display)
    two = project([MeshInstance(surface, matrix, other)], camera, display)
    z = one.representation
    assert np.abs(z - two.representation).max() < 1e-5 * np.abs(z).max()
    assert np.abs(one.representation).max() > 0.1


@settings(max_examples=15)
@given(seeds, degrees, st.booleans(), st.sampled_from(["smooth", "flat"]))
def test_moving_mesh_and_camera_together_changes_nothing(seed, degree, perspective, display):
    random = np.random.default_rng(seed)
    surface = torus(16, 9)
    field = tangent_field(surface, degree, seed)
    camera = orbit_camera(surface, 25, 40, 64, 64, perspective=perspective)
    motion = matrix_of(random_rotation(random), random.normal(size=3))
    moved = type(camera)(camera.view @ np.linalg.inv(motion), camera.projection, 64, 64)
    one = project([MeshInstance(surface, IDENTITY, field)], camera, display)
    two = project([MeshInstance(surface, motion, field)], moved, display)
    _, at_one, at_two = np.intersect1d(one.pixel, two.pixel, return_indices=True)
    assert len(at_one) >= max(len(one.pixel), len(two.pixel)) - 3
    same = one.triangle[at_one] == two.triangle[at_two]
    assert same.mean() > 0.99
    at_one, at_two = at_one[same], at_two[same]
    strong = np.abs(one.representation[at_one]) > 0.05
    at_one, at_two = at_one[strong], at_two[strong]
    ratio = two.representation[at_two] / one.representation[at_one]
    assert np.abs(np.angle(ratio)).max() / degree < np.radians(0.1)
    axes = screen_jacobians(one)[at_one] - screen_jacobians(two)[at_two]
    assert np.abs(axes).max() < 1e-3


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_a_tilted_plane_under_a_wide_lens(perspective, display):
    """Two triangles at 80 degrees: directions on screen are those of the projected vector."""
    corners = np.array([[-3, -3, 0], [3, -3, 0], [3, 3, 0], [-3, 3, 0.0]])
    surface = from_quads(corners, np.array([[0, 1, 2, 3]]))
    vector = np.array([0.6, 0.8, 0.0])
    tilt = np.radians(80)
    view = look_at(4 * np.array([0.2, -np.sin(tilt), np.cos(tilt)]), (0, 0, 0))
    if perspective:
        camera = lens(view, 300, 200, fov=1.9)
    else:
        camera = orthographic_camera(view, 300, 200, scale=5.0)
    buffer = project([MeshInstance(surface, IDENTITY, RosyField(1, vector[None]))], camera, display)
    moved = camera.view[:3, :3] @ vector
    h = 1e-6

    def on_screen(points):
        clip = points @ camera.projection[:, :3].T + camera.projection[:, 3]
        ndc = clip[:, :2] / clip[:, 3:]
        return 150 * ndc[:, 0] + 100j * ndc[:, 1]

    position = buffer.position.astype(float)
    expected = (on_screen(position + h * moved) - on_screen(position - h * moved)) / (2 * h)
    found = screen_directions(buffer, 1)
    off = np.degrees(np.abs(np.angle(found / expected)))
    assert len(buffer.pixel) > 5000
    assert off.max() < 5e-3
    depth = -position[:, 2] if perspective else 1.0
    length = np.abs(expected) * depth / camera.pixels_per_unit
    np.testing.assert_allclose(np.abs(found), length, rtol=1e-3)


def test_directions_on_a_sphere_match_projected_members():
    """N = 4, against finite differences of the members in space."""
    surface = icosphere(3)
    camera = lens(look_at((2.5, 1, 1), (0, 0, 0)), 200, 200, fov=1.2)
    buffer = project([MeshInstance(surface, IDENTITY, tangent_field(surface, 4))], camera)
    along = members_in_space(buffer, 4)
    position, h = buffer.position.astype(float), 1e-6

    def on_screen(points):
        clip = points @ camera.projection[:, :3].T + camera.projection[:, 3]
        return (clip[:, 0] + 1j * clip[:, 1]) / clip[:, 3]

    expected = (on_screen(position + h * along) - on_screen(position - h * along)) / (2 * h)
    facing = dot(buffer.normal, buffer.view_direction) > 0.1
    found = screen_directions(buffer, 4)
    assert np.degrees(np.abs(np.angle(found / expected)))[facing].max() < 0.05


@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_flat_faces_show_their_own_member(display):
    """A cube of flat faces: in either display each pixel shows its face's member."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1.0)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    surface = from_quads(corners, np.array(quads), flat_faces=np.ones(6, dtype=bool))
    field = tangent_field(surface, 3)
    camera = orbit_camera(surface, 30, 30, 100, 80)
    buffer = project([MeshInstance(surface, IDENTITY, field)], camera, display)
    assert len(np.unique(buffer.face)) == 3
    np.testing.assert_allclose(
        np.abs(buffer.representation), field.magnitude[buffer.face], rtol=1e-5
    )
    own = field.vectors[buffer.face] @ camera.view[:3, :3].T
    normal = buffer.normal.astype(float)
    turn = representation(members_in_space(buffer, 3), normal, 3)
    np.testing.assert_allclose(turn, unit_z(representation(own, normal, 3)), atol=1e-4)


def unit_z(z):
    return z / np.abs(z)


@pytest.mark.parametrize("display", ["smooth", "flat"])
@pytest.mark.parametrize("degree", [1, 4, 5])
def test_mirrored_objects(display, degree):
    """A negative scale shows what the mirrored mesh with mirrored vectors shows."""
    surface = torus(14, 8)
    field = tangent_field(surface, degree)
    mirror = np.array([-1.0, 1, 1])
    mirrored = build_surface(surface.vertices * mirror, surface.corner_vertex, surface.face_start)
    # Each face the other way round from the same first corner, so that it is cut the same way.
    backward = (np.arange(0, surface.face_start[-1], 4)[:, None] + [0, 3, 2, 1]).ravel()
    outward = build_surface(
        surface.vertices * mirror, surface.corner_vertex[backward], surface.face_start
    )
    reflected = RosyField(degree, field.vectors * mirror)
    camera = orbit_camera(mirrored, 40, 30, 64, 64)
    by_scale = project([MeshInstance(surface, matrix_of(np.diag(mirror)), field)], camera, display)
    by_mesh = project([MeshInstance(mirrored, IDENTITY, reflected)], camera, display)
    by_turned_mesh = project([MeshInstance(outward, IDENTITY, reflected)], camera, display)
    for other in (by_mesh, by_turned_mesh):
        same = by_scale.face == other.face
        assert same.mean() > 0.99
        np.testing.assert_allclose(by_scale.normal[same], other.normal[same], atol=1e-5)
        np.testing.assert_allclose(
            by_scale.representation[same], other.representation[same], atol=1e-4
        )
    assert (by_scale.front_facing != by_turned_mesh.front_facing).all()


@pytest.mark.parametrize("cells", [(4, 4), (9, 2), (1, 6)])
def test_stretching_rotates_members_by_its_polar_rotation(cells):
    """A stretch along the axes turns nothing; a shear by s turns by -atan(s / 2).

    Whatever the shape of the faces that the map is read from.
    """
    surface = plane(*cells)
    field = RosyField(4, np.tile([np.cos(0.3), np.sin(0.3), 0], (surface.face_count, 1)) * 2.0)
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 50, 50, scale=8)

    def angle(linear):
        buffer = project([MeshInstance(surface, matrix_of(linear), field)], camera)
        np.testing.assert_allclose(np.abs(buffer.representation), 2.0, rtol=1e-6)
        return np.angle(buffer.representation) / 4

    np.testing.assert_allclose(angle(np.diag([3.0, 0.7, 1])), 0.3, atol=1e-6)
    shear = np.eye(3)
    shear[0, 1] = 0.8
    np.testing.assert_allclose(angle(shear), 0.3 - np.arctan(0.4), atol=1e-6)


@pytest.mark.parametrize("columns", [4, 40])
def test_the_field_of_a_sheet_bends_with_it(columns):
    """A strip rolled to a half tube: the members roll with it."""
    sheet = plane(columns, columns)
    x, y, _ = sheet.vertices.T
    radius = 2 / np.pi
    rolled = np.stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)], axis=1)
    surface = build_surface(
        rolled, sheet.corner_vertex, sheet.face_start, rest_vertices=sheet.vertices
    )
    field = RosyField(1, np.tile([0.8, 0.6, 0.0], (columns**2, 1)))
    camera = orbit_camera(rolled, 15, 35, 120, 120)
    buffer = project([MeshInstance(surface, IDENTITY, field)], camera)
    world = buffer.position.astype(float) - camera.view[:3, 3]
    world = world @ camera.view[:3, :3]
    about = np.arctan2(world[:, 0], world[:, 2])
    expected = np.stack([0.8 * np.cos(about), 0.6 + 0 * about, -0.8 * np.sin(about)], axis=1)
    found = members_in_space(buffer, 1) @ camera.view[:3, :3]
    off = np.degrees(np.arccos(np.clip(dot(found, expected), -1, 1)))
    # At the sheet's border normals are one-sided, half a column off.
    assert off.max() < 1.3 * 90 / columns
    assert np.median(off) < 8 / columns


def test_instances_are_projected_independently():
    surface = torus(20, 10)
    field = tangent_field(surface, 6)
    places = [matrix_of(np.eye(3), (0, -2, 0)), matrix_of(0.5 * np.diag([1, -1, 1]), (0, 1.5, 0))]
    camera = lens(look_at((6, 0, 3), (0, 0, 0)), 150, 100)
    instances = [MeshInstance(surface, place, field) for place in places]
    both = project(instances, camera)
    assert set(both.instance_id) == {0, 1}
    assert both.instance_names == ("torus", "torus")
    assert both.instance_degrees == (6, 6)
    for number, instance in enumerate(instances):
        alone, mine = project([instance], camera), both.instance_id == number
        for name in ("pixel", "face", "triangle", "normal", "position", "representation"):
            assert (getattr(both, name)[mine] == getattr(alone, name)).all()


def test_instances_of_different_degrees_and_an_occluder():
    ball, wall = icosphere(2), plane(1, 1)
    camera = lens(look_at((0, -6, 0), (0, 0, 0)), 120, 60)
    stand = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    instances = [
        MeshInstance(wall, matrix_of(stand, (-1.5, -3, 0))),
        MeshInstance(ball, matrix_of(np.eye(3), (-1.2, 0, 0)), tangent_field(ball, 2)),
        MeshInstance(ball, matrix_of(np.eye(3), (1.2, 0, 0)), tangent_field(ball, 5)),
    ]
    free = project(instances[1:], camera)
    hidden = project(instances, camera)
    assert hidden.instance_degrees == (0, 2, 5)
    assert set(hidden.instance_id) == {1, 2}
    assert (hidden.instance_id == 2).sum() == (free.instance_id == 1).sum()
    assert 0 < (hidden.instance_id == 1).sum() < 0.9 * (free.instance_id == 0).sum()
    where = np.searchsorted(free.pixel, hidden.pixel)
    assert (free.pixel[where] == hidden.pixel).all()
    assert (free.representation[where] == hidden.representation).all()


def test_pixels_positions_and_frames_agree():
    surface = torus()
    camera = lens(look_at((3, -2, 2), (0, 0, 0)), 160, 120, shift=(0.1, -0.05))
    buffer = project([MeshInstance(surface, IDENTITY, tangent_field(surface, 4))], camera)
    assert (np.diff(buffer.pixel) > 0).all()
    clip = buffer.position @ camera.projection[:, :3].T + camera.projection[:, 3]
    x, y = (clip[:, :2] / clip[:, 3:] + 1).T * ([80], [60])
    row, column = np.divmod(buffer.pixel, 160)
    np.testing.assert_allclose(x, column + 0.5, atol=1e-3)
    np.testing.assert_allclose(y, row + 0.5, atol=1e-3)
    points = surface.vertices @ camera.view[:3, :3].T + camera.view[:3, 3]
    corners = points[surface.corner_vertex[surface.triangles[buffer.triangle]]]
    position = np.einsum("pc,pci->pi", buffer.barycentric, corners)
    np.testing.assert_allclose(buffer.position, position, atol=1e-5)
    assert (surface.triangle_face[buffer.triangle] == buffer.face).all()
    np.testing.assert_allclose(buffer.view_direction, -normalize(buffer.position), atol=1e-6)
    for name in ("normal", "geometric_normal", "view_direction"):
        np.testing.assert_allclose(np.linalg.norm(getattr(buffer, name), axis=1), 1, atol=1e-5)
    assert (dot(buffer.geometric_normal, buffer.view_direction) > -1e-6).all()
    assert buffer.representation.dtype == np.complex64
    assert buffer.pixel.dtype == buffer.face.dtype == buffer.instance_id.dtype == np.int32
    assert buffer.position.dtype == buffer.normal.dtype == np.float32


@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_undefined_and_degenerate_faces_are_zero(display):
    surface = icosphere(2)
    vertices = surface.vertices.copy()
    triangles = surface.corner_vertex.reshape(-1, 3).copy()
    triangles[5, 1] = triangles[5, 0]
    vertices[triangles[9, 2]] = vertices[triangles[9, 1]]
    surface = from_triangles(vertices, triangles)
    field = tangent_field(surface, 4)
    vectors = field.vectors.copy()
    vectors[::3] = 0
    camera = orbit_camera(surface, 0, 0, 100, 100)
    for matrix in (IDENTITY, matrix_of(np.diag([1.0, 0.0, 1.0])), matrix_of(np.diag([1, 1e-9, 1]))):
        buffer = project([MeshInstance(surface, matrix, RosyField(4, vectors))], camera, display)
        assert np.isfinite(buffer.representation).all()
        assert np.isfinite(buffer.normal).all()
        assert (buffer.representation[buffer.face % 3 == 0] == 0).all()
    assert (buffer.representation[buffer.face % 3 == 1] != 0).mean() > 0.9


def test_custom_normals_within_a_fan():
    """Corner normals that differ within a fan: finite, near the values with common ones."""
    surface = icosphere(2)
    field = tangent_field(surface, 4)
    random = np.random.default_rng(1)
    leaned = normalize(
        surface.corner_normal + 0.05 * random.normal(size=surface.corner_normal.shape)
    )
    custom = build_surface(
        surface.vertices, surface.corner_vertex, surface.face_start, corner_normal=leaned
    )
    camera = orbit_camera(surface, 0, 0, 60, 60)
    one, two = (project([MeshInstance(s, IDENTITY, field)], camera) for s in (surface, custom))
    facing = dot(one.normal, one.view_direction) > 0.3
    assert 0 < np.abs(one.representation - two.representation)[facing].max() < 0.5


def test_an_eye_inside_a_mesh_sees_it_at_all_pixels():
    surface = icosphere(2)
    camera = lens(look_at((0, 0, 0), (1, 0, 0)), 40, 30, fov=1.6, clip=(0.01, 10))
    buffer = project([MeshInstance(surface, IDENTITY, tangent_field(surface, 4))], camera)
    assert len(buffer.pixel) == 1200
    assert not buffer.front_facing.any()
    assert (dot(buffer.normal, buffer.view_direction) > 0.8).all()


def test_errors_of_projection():
    ball, wall = icosphere(1), plane(1, 1, size=20)
    field = tangent_field(ball, 4)
    camera = lens(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 50, 50, name="Camera.001")
    shown = MeshInstance(ball, IDENTITY, field)
    with pytest.raises(RosyError, match=r"in view of camera 'Camera\.001': sphere is outside the"):
        project([MeshInstance(ball, matrix_of(np.eye(3), (0, 0, 9)), field)], camera)
    with pytest.raises(RosyError, match=r"in view of camera 'Camera\.001': sphere is hidden"):
        project([MeshInstance(wall, matrix_of(np.eye(3), (0, 0, 2))), shown], camera)
    with pytest.raises(RosyError, match="no object has a RoSy field"):
        project([MeshInstance(wall, IDENTITY)], camera)
    with pytest.raises(RosyError, match="unknown display 'round': choose smooth, flat"):
        project([shown], camera, "round")
    with pytest.raises(
        RosyError, match="sphere: its field has 79 vectors, but the mesh has 80 faces"
    ):
        project([MeshInstance(ball, IDENTITY, RosyField(4, field.vectors[1:]))], camera)
    spoiled = field.vectors.copy()
    spoiled[7, 1] = np.nan
    with pytest.raises(RosyError, match="sphere: its field is not finite on face 7"):
        project([MeshInstance(ball, IDENTITY, RosyField(4, spoiled))], camera)
    with pytest.raises(RosyError, match="sphere: its matrix must be"):
        project([MeshInstance(ball, np.full((4, 4), np.inf), field)], camera)


def test_progress_grows_and_the_task_can_be_closed():
    surface = torus()
    instances = [MeshInstance(surface, IDENTITY, tangent_field(surface, 4))] * 2
    camera = orbit_camera(surface, 0, 40, 300, 300)
    fractions = [step.fraction for step in project_task(instances, camera)]
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] <= fractions[-1] <= 1
    assert len(fractions) > 4
    work = project_task(instances, camera)
    next(work)
    work.close()


def test_the_same_input_gives_the_same_bits():
    surface = torus()
    instance = MeshInstance(surface, IDENTITY, tangent_field(surface, 4))
    camera = orbit_camera(surface, 0, 40, 90, 90)
    one, two = project([instance], camera), project([instance], camera)
    assert one.representation.tobytes() == two.representation.tobytes()
