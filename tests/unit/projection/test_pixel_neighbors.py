"""Links between pixels: smooth surfaces are continuous, silhouettes and creases separate pixels."""

import numpy as np
import pytest
from harness.planar import planar_pixel_field
from shapes import cube, from_quads, from_triangles, icosphere, joined, moved, plane, rebuilt, torus

from rosy_addon.field.rosy_field import RosyField
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.pixel_neighbors import neighbor_masks
from rosy_addon.projection.project import project

pytestmark = pytest.mark.filterwarnings("error")

OFFSETS = [(dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]


def project_surfaces(surfaces, camera, shifts=None):
    shifts = np.zeros((len(surfaces), 3)) if shifts is None else shifts
    instances = []
    for surface, shift in zip(surfaces, shifts, strict=True):
        field = RosyField(4, np.tile([1.0, 0.3, 0.2], (surface.face_count, 1)))
        instances.append(MeshInstance(surface, moved(*shift), field))
    return project(instances, camera)


def camera_above(width=200, scale=4.0, perspective=False, eye=(0, 0, 6), up=(0, 1, 0)):
    """A camera at distance 6 from the origin whose frame is `scale` units wide there."""
    view = look_at(eye, (0, 0, 0), up)
    if perspective:
        fov = 2 * np.arctan(scale / 12)
        return perspective_camera(view, width, width, fov=fov, clip=(0.01, 100))
    return orthographic_camera(view, width, width, scale=scale, clip=(0.01, 100))


def neighbor_pairs(gbuffer, masks):
    """(K, 2) pairs of neighboring covered pixels, and (K,) whether they are linked."""
    width, height = gbuffer.camera.width, gbuffer.camera.height
    entry = np.full((height + 2, width + 2), -1)
    row, column = np.divmod(gbuffer.pixel, width)
    entry[row + 1, column + 1] = np.arange(len(row))
    pairs, linked = [], []
    for bit, (dx, dy) in enumerate(OFFSETS):
        neighbor = entry[row + 1 + dy, column + 1 + dx]
        covered = np.flatnonzero(neighbor >= 0)
        pairs.append(np.stack([covered, neighbor[covered]], axis=1))
        linked.append(masks[covered] >> bit & 1 == 1)
        assert not (masks[neighbor < 0] >> bit & 1).any()
    return np.concatenate(pairs), np.concatenate(linked)


def unlinked_fraction(gbuffer, crease_angle=None):
    _, linked = neighbor_pairs(gbuffer, neighbor_masks(gbuffer, crease_angle))
    return 1 - linked.mean()


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("tilt", [0, 45, 80, 85, 87])
@pytest.mark.parametrize("roll", [0, 33])
def test_a_tilted_plane_is_continuous(perspective, tilt, roll):
    t, r = np.radians([tilt, roll])
    eye = 6 * np.array([np.sin(t) * np.sin(r), -np.sin(t) * np.cos(r), np.cos(t)])
    camera = camera_above(perspective=perspective, eye=eye)
    gbuffer = project_surfaces([plane(7, 5)], camera)
    assert len(gbuffer.pixel) > 200 and unlinked_fraction(gbuffer, 0.01) == 0


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("radius", [4, 12, 40, 90])
def test_spheres_are_continuous(perspective, radius):
    """Spheres of a radius in pixels, up to the silhouette, where the surface is seen edge-on."""
    camera = camera_above(200, 200 / radius, perspective)
    gbuffer = project_surfaces([icosphere(5)], camera)
    assert unlinked_fraction(gbuffer) == 0 and unlinked_fraction(gbuffer, 1.3) < 0.002


@pytest.mark.slow
@pytest.mark.parametrize(("perspective", "height"), [(False, 1.0), (True, 0.4)])
def test_an_uneven_surface_is_continuous(perspective, height):
    """Waves of up to 80 degrees, seen from above: inflections do not count as silhouettes.

    Under perspective they are less steep, because there would be silhouettes near the border.
    """
    surface = plane(300, 300, 4.0)
    x, y, _ = surface.vertices.T
    z = height * (0.5 * np.sin(6 * x + 2 * y) + 0.3 * np.sin(9 * y - 1))
    waves = rebuilt(surface, np.stack([x, y, z], axis=1))
    assert unlinked_fraction(project_surfaces([waves], camera_above(250, 3.6, perspective))) == 0


@pytest.mark.parametrize("perspective", [False, True])
def test_the_near_side_of_a_torus_is_separate_from_the_far_side(perspective):
    """A torus seen over its near side: the near tube is not linked to the far one."""
    camera = camera_above(300, 3.2, perspective, eye=(0, -5.6, 2.2), up=(0, 0, 1))
    gbuffer = project_surfaces([torus(200, 100)], camera)
    pairs, linked = neighbor_pairs(gbuffer, neighbor_masks(gbuffer, None))
    first, second = pairs.T
    jump = np.abs(gbuffer.position[first, 2] - gbuffer.position[second, 2])
    far = jump > 0.5
    assert far.sum() > 100 and not linked[far].any()
    near = jump < 0.1
    assert linked[near].mean() > 0.9995


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("tilt", [0, 40, 60, 75, 80])
@pytest.mark.parametrize("same_instance", [False, True])
def test_parallel_sheets_are_separate(perspective, tilt, same_instance):
    """A sheet partly covered by another one, two pixels above it."""
    t = np.radians(tilt)
    camera = camera_above(200, 4.0, perspective, eye=(0, -6 * np.sin(t), 6 * np.cos(t)))
    low, high = plane(3, 3, 6.0), plane(2, 2, 1.0)
    gap = np.array([0, 0, 2 * 4.0 / 200])
    if same_instance:
        gbuffer = project_surfaces([joined(low, rebuilt(high, high.vertices + gap))], camera)
        upper = gbuffer.triangle >= len(low.triangles)
    else:
        gbuffer = project_surfaces([low, high], camera, [np.zeros(3), gap])
        upper = gbuffer.instance_id == 1
    assert 100 < upper.sum() < len(upper) - 100
    pairs, linked = neighbor_pairs(gbuffer, neighbor_masks(gbuffer, None))
    across = upper[pairs[:, 0]] != upper[pairs[:, 1]]
    assert across.sum() > 100 and not linked[across].any() and linked[~across].all()


def test_the_rim_of_a_bowl_is_a_silhouette():
    """The outside of the near wall and the inside of the far wall are not linked at the rim."""
    ball = icosphere(4)
    triangles = ball.corner_vertex.reshape(-1, 3)
    bowl = from_triangles(ball.vertices, triangles[ball.face_center[:, 2] < 0.2])
    gbuffer = project_surfaces([bowl], camera_above(200, 2.4, eye=(0, -5, 2.5), up=(0, 0, 1)))
    pairs, linked = neighbor_pairs(gbuffer, neighbor_masks(gbuffer, None))
    front = gbuffer.front_facing
    assert 0.1 < front.mean() < 0.9
    across_rim = front[pairs[:, 0]] != front[pairs[:, 1]]
    assert across_rim.sum() > 100 and not linked[across_rim].any()
    assert linked[~across_rim].mean() > 0.999


@pytest.mark.parametrize("perspective", [False, True])
def test_creases_separate_pixels_unless_crossed(perspective):
    box = rebuilt(cube(), 2 * cube().vertices - 1, flat_faces=np.ones(6, dtype=bool))
    camera = camera_above(200, 4, perspective, eye=(2, -4, 3.5), up=(0, 0, 1))
    gbuffer = project_surfaces([box], camera)
    pairs, linked = neighbor_pairs(gbuffer, neighbor_masks(gbuffer, 0.7))
    face = box.triangle_face[gbuffer.triangle]
    across = face[pairs[:, 0]] != face[pairs[:, 1]]
    assert across.sum() > 300 and not linked[across].any()
    assert linked[~across].all() and unlinked_fraction(gbuffer) == 0
    assert unlinked_fraction(gbuffer, 1.6) == 0


def test_inconsistently_oriented_faces_are_continuous():
    """Half of the faces have the opposite winding, but the surface is continuous."""
    sheet = plane(8, 8, 3.0)
    quads = sheet.corner_vertex.reshape(-1, 4).copy()
    quads[::2] = quads[::2, ::-1]
    gbuffer = project_surfaces([from_quads(sheet.vertices, quads)], camera_above(eye=(1, -5, 2)))
    assert 0.2 < gbuffer.front_facing.mean() < 0.8 and unlinked_fraction(gbuffer) == 0


def test_links_are_symmetric_and_include_the_pixel_itself():
    surfaces, shifts = [torus(30, 20), icosphere(1)], [(0, 0, 0), (0, 0.8, 0.3)]
    gbuffer = project_surfaces(surfaces, camera_above(97, 3.0, True), shifts)
    masks = neighbor_masks(gbuffer, 0.4)
    assert (masks >> 4 & 1).all() and (masks < 512).all()
    pairs, linked = neighbor_pairs(gbuffer, masks)
    linked_pairs = set(map(tuple, pairs[linked].tolist()))
    assert len(linked_pairs) < len(pairs) and all((b, a) in linked_pairs for a, b in linked_pairs)


def test_streamlines_end_at_the_frame_and_at_holes():
    size = 7
    angles = np.zeros((size, size))
    angles[3, 2:5] = np.nan
    field = planar_pixel_field(angles, 4)
    defined = np.pad(np.isfinite(angles), 1)
    for bit, (dx, dy) in enumerate(OFFSETS):
        neighbor = np.roll(defined, (-dy, -dx), axis=(0, 1))
        expected = (defined & neighbor)[1:-1, 1:-1].ravel()
        np.testing.assert_array_equal(field.neighbor_mask >> bit & 1 == 1, expected)
