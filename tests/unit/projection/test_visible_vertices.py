"""Which vertices a camera sees, against convex solids and rays against every triangle."""

import numpy as np
import pytest
from rays import ray_intersections
from shapes import cube, icosphere, joined, placed, plane, rebuilt, torus

from rosy_addon.field.surface import build_surface
from rosy_addon.projection import visible_vertices
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.visible_vertices import project_vertices

EYE = np.array([3.0, -4.0, 2.0])
CAMERAS = [
    perspective_camera(look_at(EYE, (0, 0, 0)), 300, 200, fov=0.7, clip=(0.05, 30.0)),
    orthographic_camera(look_at(EYE, (0, 0, 0)), 300, 200, scale=4.0, clip=(0.05, 30.0)),
]


def project(instances, camera, **options):
    """All vertices of all instances."""
    vertices = [np.arange(len(instance.surface.vertices)) for instance in instances]
    return project_vertices(instances, camera, vertices, **options)


def moved(surface, offset=(0, 0, 0), scale=1.0) -> MeshInstance:
    return MeshInstance(surface, placed(scale, offset))


def rays_reach_the_eye(instances, camera, planes=None):
    """(V,) bool: no triangle of another vertex is between a vertex and the near plane."""
    whole = joined(*(rebuilt(each.surface, each.world_points()) for each in instances))
    world, triangles = whole.vertices, whole.triangle_vertex
    toward = camera.eye - world if camera.is_perspective else 0 * world + camera.view[2, :3]
    barycentric, distance = ray_intersections(world, toward, world[triangles])
    hit = world[:, None] + distance[..., None] * toward[:, None]
    depth = -(hit @ camera.view[2, :3] + camera.view[2, 3])
    hits = (barycentric > 1e-9).all(axis=2) & (distance > 1e-6) & (depth >= 0.05)
    hits &= ~(triangles == np.arange(len(world))[:, None, None]).any(axis=2)
    if planes is not None:
        hits &= (hit @ planes[:, :3].T + planes[:, 3] >= 0).all(axis=2)
    return ~hits.any(axis=1)


@pytest.mark.parametrize("camera", CAMERAS, ids=["perspective", "orthographic"])
@pytest.mark.parametrize("pairs", [1 << 20, 50])
def test_vertices_are_visible_if_rays_reach_the_eye(camera, pairs, monkeypatch):
    """Of solids that hide each other, and one that reaches behind the eye."""
    monkeypatch.setattr(visible_vertices, "PAIRS_PER_BLOCK", pairs)
    monkeypatch.setattr(visible_vertices, "TRIANGLES_PER_BLOCK", 300)
    instances = [
        moved(torus(32, 16)),
        moved(icosphere(2), (0.9, -0.9, 0.3), 0.3),
        moved(plane(6, 6), (0.2, 0.1, -0.6), 6.0),
        moved(cube(), (1.2, -2.6, 1.1), 0.3),
    ]
    projected = project(instances, camera)
    free = rays_reach_the_eye(instances, camera)
    in_frame = (projected.position >= 0).all(axis=1)
    in_frame &= (projected.position <= (camera.width, camera.height)).all(axis=1)
    expected = projected.is_in_view & in_frame & free
    assert 200 < expected.sum() < 0.8 * len(expected)
    np.testing.assert_array_equal(projected.is_visible, expected)


def test_what_is_cut_away_neither_shows_nor_hides():
    """As with a clipped region of a 3D view."""
    camera = CAMERAS[0]
    instances = [moved(torus(32, 16)), moved(icosphere(2), (0.9, -0.9, 0.3), 0.3)]
    planes = np.array([(0.0, 1, 0, 0.6), *[(0.0, 0, 0, 1.0)] * 5])
    projected = project(instances, camera, clip_planes=planes)
    world = np.concatenate([instance.world_points() for instance in instances])
    expected = rays_reach_the_eye(instances, camera, planes) & (world[:, 1] >= -0.6)
    assert 0 < (~expected).sum() < len(expected)
    np.testing.assert_array_equal(projected.is_visible, expected & projected.is_in_view)


def test_vertices_behind_the_camera_have_no_place():
    surface = build_surface(np.array([(0.0, 0, 0), (1, 0, 0), (9, -12, 6)]), [0, 1, 2], [0, 3])
    projected = project([moved(surface)], CAMERAS[0])
    assert projected.is_visible.tolist() == [True, True, False]
    assert np.isnan(projected.position[2]).all() and projected.depth[2] < 0
    np.testing.assert_allclose(projected.position[0], (150, 100))


def test_coincident_surfaces_do_not_hide_each_other():
    """Two sides of a seam that are not welded, or a copy of an object at the same place."""
    projected = project([moved(plane(4, 4)), moved(plane(4, 4))], CAMERAS[0])
    assert projected.is_visible.all()
