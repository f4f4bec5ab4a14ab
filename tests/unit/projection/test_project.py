"""The G-buffer against explicit transport, closed forms and invariances."""

from dataclasses import replace

import numpy as np
import pytest
from field_helpers import with_random_members
from hypothesis import given, settings
from hypothesis import strategies as st
from lenses import shifted
from scipy.spatial.transform import Rotation
from shapes import cube, from_quads, from_triangles, icosphere, placed, plane, rebuilt, torus

from rosy_addon.field.frames import dot, normalize, tangent_frame, transport, view_frame
from rosy_addon.field.representation import from_representation, to_representation
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import look_at, orbit_camera, orthographic_camera
from rosy_addon.projection.camera import perspective_camera as lens
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.pixel_neighbors import screen_jacobians
from rosy_addon.projection.project import project

pytestmark = pytest.mark.filterwarnings("error")

seeds = st.integers(0, 2**32 - 1)
degrees = st.integers(1, 7)
IDENTITY = np.eye(4)
ON_EDGE = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def tangent_field(surface, degree, seed=0):
    """A field that varies smoothly over the surface, with magnitudes around 1."""
    random = np.random.default_rng(seed)
    matrix, shift = random.normal(size=(3, 3)), random.normal(size=3)
    normal = surface.face_normal
    vectors = surface.face_center @ matrix + shift
    return RosyField(degree, vectors - dot(vectors, normal)[:, None] * normal)


def members_in_space(gbuffer, degree):
    """(P, 3) unit members in camera space, from the representation."""
    toward_eye, z = gbuffer.view_direction.astype(float), gbuffer.representation.astype(complex)
    in_view = from_representation(z / np.abs(z), *view_frame(toward_eye), degree)
    return transport(in_view, toward_eye, gbuffer.normal.astype(float))


def screen_directions(gbuffer, degree):
    """(P,) complex directions of a member on screen."""
    axes = screen_jacobians(gbuffer).astype(complex)
    angle = np.angle(gbuffer.representation.astype(complex)) / degree
    return axes[:, 0] * np.cos(angle) + axes[:, 1] * np.sin(angle)


def screen_places(camera, points):
    """(P,) places of points of camera space, in pixels from the middle, as complex numbers."""
    clip = points @ camera.projection[:, :3].T + camera.projection[:, 3]
    return (clip[:, :2] / clip[:, 3:]) @ [camera.width / 2, camera.height / 2 * 1j]


def moved_on_screen(gbuffer, vectors, h=1e-6):
    """(P,) how the places of pixels move along vectors, by finite differences."""
    position, camera = gbuffer.position.astype(float), gbuffer.camera
    ahead, behind = (screen_places(camera, position + side * h * vectors) for side in (1, -1))
    return (ahead - behind) / (2 * h)


def explicit_values(surface, field, gbuffer, chosen, linear):
    """z at some pixels in the view frame, by transporting vectors in space."""
    degree, corner_normal = field.degree, surface.corner_normal @ linear.T
    vectors, faces = field.vectors @ linear.T, surface.face_normal @ linear.T
    points = surface.vertices[surface.corner_vertex]
    previous_corner = np.argsort(surface.next_corner)
    to_next = normalize(points[surface.next_corner] - points)
    angle = np.arccos(dot(to_next, normalize(points[previous_corner] - points)))
    at_corner, length = np.zeros((len(angle), 3)), np.zeros(len(angle))
    for corner, normal in enumerate(corner_normal):
        fan = np.flatnonzero(surface.corner_fan == surface.corner_fan[corner])
        face, share = surface.corner_face[fan], angle[fan] / angle[fan].sum()
        frame = tangent_frame(normal)
        z = to_representation(transport(vectors[face], faces[face], normal), *frame, degree)
        # Lengths have means of their own: directions that differ do not shorten them.
        length[corner] = share @ field.magnitude[face]
        at_corner[corner] = from_representation(share @ z, *frame, degree)
    corners = surface.triangles[gbuffer.triangle[chosen]]
    weights = gbuffer.barycentric[chosen].astype(float)
    normal = normalize(np.einsum("pk,pki->pi", weights, corner_normal[corners]))
    x, y = tangent_frame(normal)
    members = transport(at_corner[corners], corner_normal[corners], normal[:, None])
    z = to_representation(members, x[:, None], y[:, None], degree)
    direction = from_representation((weights * z).sum(axis=1), x, y, degree)
    eye = gbuffer.view_direction[chosen].astype(float)
    side = np.sign(dot(gbuffer.normal[chosen].astype(float), normal))[:, None]
    z = to_representation(transport(direction, side * normal, eye), *view_frame(eye), degree)
    return (weights * length[corners]).sum(axis=1) * z / np.abs(z)


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("inside", [False, True])
def test_values_match_explicit_transport(degree, inside):
    """On a very coarse sphere, where other paths of transport differ by many degrees."""
    surface = icosphere(1)
    field = tangent_field(surface, degree)
    camera = orbit_camera(surface.vertices, 30, 20, 64, 64)
    if inside:
        camera = lens(look_at((0.1, 0, 0.1), (1, 1, 0)), 64, 64, fov=1.5, clip=(0.01, 9))
    gbuffer = project([MeshInstance(surface, IDENTITY, field)], camera)
    assert gbuffer.front_facing.all() != inside
    chosen = np.arange(0, len(gbuffer.pixel), 37)
    expected = explicit_values(surface, field, gbuffer, chosen, camera.view[:3, :3])
    np.testing.assert_allclose(gbuffer.representation[chosen], expected, atol=2e-5)


@settings(max_examples=20)
@given(seeds, degrees, st.booleans(), st.sampled_from(["smooth", "flat"]))
def test_values_do_not_depend_on_the_stored_member(seed, degree, deformed, display):
    random = np.random.default_rng(seed)
    surface = torus(12, 7)
    rest = surface
    if deformed:
        noise = 0.1 * random.normal(size=surface.vertices.shape)
        surface = rebuilt(rest, rest.vertices + noise, rest_vertices=rest.vertices)
    matrix = placed(random.normal(size=(3, 3)) + 1.5 * np.eye(3))
    camera = orbit_camera(surface.vertices @ matrix[:3, :3].T, 20, 50, 48, 48)
    field = tangent_field(rest, degree, seed)
    other = with_random_members(rest, field, seed)
    first = project([MeshInstance(surface, matrix, field)], camera, display)
    second = project([MeshInstance(surface, matrix, other)], camera, display)
    z = first.representation
    assert np.abs(z - second.representation).max() < 1e-5 * np.abs(z).max()
    assert np.abs(first.representation).max() > 0.1


@settings(max_examples=15)
@given(seeds, degrees, st.booleans(), st.sampled_from(["smooth", "flat"]))
def test_moving_mesh_and_camera_together_changes_nothing(seed, degree, perspective, display):
    random = np.random.default_rng(seed)
    surface = torus(16, 9)
    field = tangent_field(surface, degree, seed)
    camera = orbit_camera(surface.vertices, 25, 40, 64, 64, perspective=perspective)
    motion = placed(Rotation.random(None, random).as_matrix(), random.normal(size=3))
    moved = type(camera)(camera.view @ np.linalg.inv(motion), camera.projection, 64, 64)
    first = project([MeshInstance(surface, IDENTITY, field)], camera, display)
    second = project([MeshInstance(surface, motion, field)], moved, display)
    _, at_first, at_second = np.intersect1d(first.pixel, second.pixel, return_indices=True)
    assert len(at_first) >= max(len(first.pixel), len(second.pixel)) - 3
    same = first.triangle[at_first] == second.triangle[at_second]
    assert same.mean() > 0.99
    at_first, at_second = at_first[same], at_second[same]
    strong = np.abs(first.representation[at_first]) > 0.05
    at_first, at_second = at_first[strong], at_second[strong]
    ratio = second.representation[at_second] / first.representation[at_first]
    assert np.abs(np.angle(ratio)).max() / degree < np.radians(0.1)
    axes = screen_jacobians(first)[at_first] - screen_jacobians(second)[at_second]
    assert np.abs(axes).max() < 1e-3


@pytest.mark.parametrize("perspective", [True, False])
@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_a_tilted_plane_under_a_wide_lens(perspective, display):
    """Two triangles at 80 degrees: directions on screen match the projected vector."""
    surface = plane(1, 1, 6.0)
    vector = np.array([0.6, 0.8, 0.0])
    tilt = np.radians(80)
    view = look_at(4 * np.array([0.2, -np.sin(tilt), np.cos(tilt)]), (0, 0, 0))
    if perspective:
        camera = lens(view, 300, 200, fov=1.9)
    else:
        camera = orthographic_camera(view, 300, 200, scale=5.0)
    instance = MeshInstance(surface, IDENTITY, RosyField(1, vector[None]))
    gbuffer = project([instance], camera, display)
    expected = moved_on_screen(gbuffer, camera.view[:3, :3] @ vector)
    actual = screen_directions(gbuffer, 1)
    off = np.degrees(np.abs(np.angle(actual / expected)))
    assert len(gbuffer.pixel) > 5000 and off.max() < 5e-3
    depth = -gbuffer.position[:, 2] if perspective else 1.0
    length = np.abs(expected) * depth / camera.pixels_per_unit
    np.testing.assert_allclose(np.abs(actual), length, rtol=1e-3)


def test_directions_on_a_sphere_match_projected_members():
    """N = 4, against finite differences of the members in space."""
    surface = icosphere(3)
    camera = lens(look_at((2.5, 1, 1), (0, 0, 0)), 200, 200, fov=1.2)
    gbuffer = project([MeshInstance(surface, IDENTITY, tangent_field(surface, 4))], camera)
    expected = moved_on_screen(gbuffer, members_in_space(gbuffer, 4))
    facing = dot(gbuffer.normal, gbuffer.view_direction) > 0.1
    actual = screen_directions(gbuffer, 4)
    assert np.degrees(np.abs(np.angle(actual / expected)))[facing].max() < 0.05


@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_flat_faces_show_their_own_member(display):
    """A cube with flat faces: in both displays each pixel shows the member of its face."""
    surface = rebuilt(cube(), flat_faces=np.ones(6, dtype=bool))
    field = tangent_field(surface, 3)
    camera = orbit_camera(surface.vertices, 30, 30, 100, 80)
    gbuffer = project([MeshInstance(surface, IDENTITY, field)], camera, display)
    face = surface.triangle_face[gbuffer.triangle]
    assert len(np.unique(face)) == 3
    modulus = np.abs(gbuffer.representation)
    np.testing.assert_allclose(modulus, field.magnitude[face], rtol=1e-5)
    own = field.vectors[face] @ camera.view[:3, :3].T
    frame = tangent_frame(gbuffer.normal.astype(float))
    turn = to_representation(members_in_space(gbuffer, 3), *frame, 3)
    z = to_representation(own, *frame, 3)
    np.testing.assert_allclose(turn, z / np.abs(z), atol=1e-4)


@pytest.mark.parametrize("display", ["smooth", "flat"])
@pytest.mark.parametrize("degree", [1, 4, 5])
def test_mirrored_objects(display, degree):
    """A negative scale has the same result as a mirrored mesh with mirrored vectors."""
    surface = torus(14, 8)
    field = tangent_field(surface, degree)
    mirror = np.array([-1.0, 1, 1])
    mirrored = rebuilt(surface, surface.vertices * mirror)
    # Each face is reversed from the same first corner, so that it is triangulated the same way.
    backward = surface.corner_vertex.reshape(-1, 4)[:, [0, 3, 2, 1]]
    outward = from_quads(mirrored.vertices, backward)
    reflected = RosyField(degree, field.vectors * mirror)
    camera = orbit_camera(mirrored.vertices, 40, 30, 64, 64)
    by_scale = project([MeshInstance(surface, placed(np.diag(mirror)), field)], camera, display)
    by_mesh = project([MeshInstance(mirrored, IDENTITY, reflected)], camera, display)
    by_turned_mesh = project([MeshInstance(outward, IDENTITY, reflected)], camera, display)
    for other in (by_mesh, by_turned_mesh):
        same = surface.triangle_face[by_scale.triangle] == surface.triangle_face[other.triangle]
        assert same.mean() > 0.99
        np.testing.assert_allclose(by_scale.normal[same], other.normal[same], atol=1e-5)
        z, other_z = (gbuffer.representation[same] for gbuffer in (by_scale, other))
        np.testing.assert_allclose(z, other_z, atol=1e-4)
    assert (by_scale.front_facing != by_turned_mesh.front_facing).all()


@pytest.mark.parametrize("cells", [(4, 4), (9, 2), (1, 6)])
def test_stretching_rotates_members_by_its_polar_rotation(cells):
    """A stretch along the axes rotates nothing; a shear by s rotates by -atan(s / 2).

    This does not depend on the shape of the faces.
    """
    surface = plane(*cells)
    field = RosyField(4, np.tile([np.cos(0.3), np.sin(0.3), 0], (surface.face_count, 1)) * 2.0)
    camera = orthographic_camera(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 50, 50, scale=8)

    def angle(linear):
        gbuffer = project([MeshInstance(surface, placed(linear), field)], camera)
        np.testing.assert_allclose(np.abs(gbuffer.representation), 2.0, rtol=1e-6)
        return np.angle(gbuffer.representation) / 4

    np.testing.assert_allclose(angle(np.diag([3.0, 0.7, 1])), 0.3, atol=1e-6)
    shear = np.eye(3)
    shear[0, 1] = 0.8
    np.testing.assert_allclose(angle(shear), 0.3 - np.arctan(0.4), atol=1e-6)


@pytest.mark.parametrize("columns", [4, 40])
def test_the_field_of_a_sheet_bends_with_it(columns):
    """A sheet is rolled to a half tube, and the members rotate with it."""
    sheet = plane(columns, columns)
    x, y, _ = sheet.vertices.T
    radius = 2 / np.pi
    rolled = np.stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)], axis=1)
    surface = rebuilt(sheet, rolled, rest_vertices=sheet.vertices)
    field = RosyField(1, np.tile([0.8, 0.6, 0.0], (columns**2, 1)))
    camera = orbit_camera(rolled, 15, 35, 120, 120)
    gbuffer = project([MeshInstance(surface, IDENTITY, field)], camera)
    world = gbuffer.position.astype(float) - camera.view[:3, 3]
    world = world @ camera.view[:3, :3]
    about = np.arctan2(world[:, 0], world[:, 2])
    expected = np.stack([0.8 * np.cos(about), 0.6 + 0 * about, -0.8 * np.sin(about)], axis=1)
    actual = members_in_space(gbuffer, 1) @ camera.view[:3, :3]
    off = np.degrees(np.arccos(np.clip(dot(actual, expected), -1, 1)))
    # Normals at the border of the sheet are averages over one side only: half a column off.
    assert off.max() < 1.3 * 90 / columns and np.median(off) < 8 / columns


def test_instances_are_projected_independently():
    surface = torus(20, 10)
    field = tangent_field(surface, 6)
    matrices = [placed(1.0, (0, -2, 0)), placed(0.5 * np.diag([1, -1, 1]), (0, 1.5, 0))]
    camera = lens(look_at((6, 0, 3), (0, 0, 0)), 150, 100)
    instances = [MeshInstance(surface, matrix, field) for matrix in matrices]
    together = project(instances, camera)
    assert set(together.instance_id) == {0, 1} and together.instance_degrees == [6, 6]
    for index, instance in enumerate(instances):
        alone, pixels = project([instance], camera), together.instance_id == index
        for name in ("pixel", "triangle", "normal", "position", "representation"):
            assert (getattr(together, name)[pixels] == getattr(alone, name)).all()


def test_instances_of_different_degrees_and_an_occluder():
    ball, wall = icosphere(2), plane(1, 1)
    camera = lens(look_at((0, -6, 0), (0, 0, 0)), 120, 60)
    instances = [
        MeshInstance(wall, placed(ON_EDGE, (-1.5, -3, 0))),
        MeshInstance(ball, placed(1.0, (-1.2, 0, 0)), tangent_field(ball, 2)),
        MeshInstance(ball, placed(1.0, (1.2, 0, 0)), tangent_field(ball, 5)),
    ]
    free = project(instances[1:], camera)
    hidden = project(instances, camera)
    assert hidden.instance_degrees == [0, 2, 5] and set(hidden.instance_id) == {1, 2}
    assert (hidden.instance_id == 2).sum() == (free.instance_id == 1).sum()
    assert 0 < (hidden.instance_id == 1).sum() < 0.9 * (free.instance_id == 0).sum()
    where = np.searchsorted(free.pixel, hidden.pixel)
    assert (free.pixel[where] == hidden.pixel).all()
    assert (free.representation[where] == hidden.representation).all()


def test_pixels_positions_and_frames_agree():
    surface = torus()
    camera = shifted(lens(look_at((3, -2, 2), (0, 0, 0)), 160, 120), (0.1, -0.05))
    gbuffer = project([MeshInstance(surface, IDENTITY, tangent_field(surface, 4))], camera)
    assert (np.diff(gbuffer.pixel) > 0).all()
    row, column = np.divmod(gbuffer.pixel, 160)
    places = screen_places(camera, gbuffer.position)
    np.testing.assert_allclose(places, column - 79.5 + 1j * (row - 59.5), atol=1e-3)
    points = surface.vertices @ camera.view[:3, :3].T + camera.view[:3, 3]
    corners = points[surface.corner_vertex[surface.triangles[gbuffer.triangle]]]
    position = np.einsum("pc,pci->pi", gbuffer.barycentric, corners)
    np.testing.assert_allclose(gbuffer.position, position, atol=1e-5)
    np.testing.assert_allclose(gbuffer.view_direction, -normalize(gbuffer.position), atol=1e-6)
    for name in ("normal", "geometric_normal", "view_direction"):
        np.testing.assert_allclose(np.linalg.norm(getattr(gbuffer, name), axis=1), 1, atol=1e-5)
    assert (dot(gbuffer.geometric_normal, gbuffer.view_direction) > -1e-6).all()
    assert gbuffer.representation.dtype == np.complex64
    assert gbuffer.pixel.dtype == gbuffer.triangle.dtype == gbuffer.instance_id.dtype == np.int32
    assert gbuffer.position.dtype == gbuffer.normal.dtype == np.float32


@pytest.mark.parametrize("display", ["smooth", "flat"])
def test_undefined_and_degenerate_faces_are_zero(display):
    surface = icosphere(2)
    vertices = surface.vertices.copy()
    triangles = surface.corner_vertex.reshape(-1, 3).copy()
    triangles[5, 1] = triangles[5, 0]
    vertices[triangles[9, 2]] = vertices[triangles[9, 1]]
    surface = from_triangles(vertices, triangles)
    vectors = tangent_field(surface, 4).vectors.copy()
    vectors[::3] = 0
    camera = orbit_camera(surface.vertices, 0, 0, 100, 100)
    for matrix in (IDENTITY, placed(np.diag([1.0, 0.0, 1.0])), placed(np.diag([1, 1e-9, 1]))):
        gbuffer = project([MeshInstance(surface, matrix, RosyField(4, vectors))], camera, display)
        assert np.isfinite(gbuffer.representation).all() and np.isfinite(gbuffer.normal).all()
        assert (gbuffer.representation[gbuffer.triangle % 3 == 0] == 0).all()
    assert (gbuffer.representation[gbuffer.triangle % 3 == 1] != 0).mean() > 0.9


def test_custom_normals_within_a_fan():
    """Corner normals that differ within a fan: values are close to those with equal normals."""
    surface = icosphere(2)
    field = tangent_field(surface, 4)
    noise = 0.05 * np.random.default_rng(1).normal(size=surface.corner_normal.shape)
    custom = rebuilt(surface, corner_normal=normalize(surface.corner_normal + noise))
    camera = orbit_camera(surface.vertices, 0, 0, 60, 60)
    first, second = (project([MeshInstance(s, IDENTITY, field)], camera) for s in (surface, custom))
    facing = dot(first.normal, first.view_direction) > 0.3
    assert 0 < np.abs(first.representation - second.representation)[facing].max() < 0.5


WALL, CLOSED = plane(1, 1, size=20), icosphere(1)
FIELD = tangent_field(CLOSED, 4)
SHOWN = MeshInstance(CLOSED, IDENTITY, FIELD)
SQUARE = MeshInstance(plane(), IDENTITY, tangent_field(plane(), 4))
SHORT = RosyField(4, FIELD.vectors[1:])
DAMAGED = RosyField(4, np.where(np.arange(80)[:, None] == 7, np.nan, FIELD.vectors))


@pytest.mark.parametrize(
    ("instances", "message"),
    [
        ([replace(SHOWN, matrix=placed(1.0, (0, 0, 9)))], "sphere is outside the frame"),
        ([MeshInstance(WALL, placed(1.0, (0, 0, 2))), SHOWN], "sphere is hidden"),
        ([replace(SQUARE, matrix=placed(ON_EDGE))], "is seen exactly edge-on, or smaller than"),
        ([MeshInstance(WALL, IDENTITY)], "no object has a RoSy field"),
        ([replace(SHOWN, field=SHORT)], "sphere: its field has 79 vectors, but the mesh has 80"),
        ([replace(SHOWN, field=DAMAGED)], "sphere: its field is not finite on face 7"),
        ([replace(SHOWN, matrix=np.full((4, 4), np.inf))], "sphere: its matrix must be"),
    ],
)
def test_errors_of_projection(instances, message, error_of):
    camera = lens(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 50, 50, name="Camera.001")
    assert message in error_of(project, instances, camera)


def test_unknown_displays_are_refused(error_of):
    camera = lens(look_at((0, 0, 5), (0, 0, 0), (0, 1, 0)), 50, 50)
    assert "'round': choose smooth, flat" in error_of(project, [SHOWN], camera, "round")
