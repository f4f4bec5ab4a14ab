"""Strokes are traced only where they can be seen: all that is seen, and as if there were more."""

import numpy as np
import pytest
from rays import ray_intersections
from shapes import icosphere, instance_of, moved, plane, torus

from rosy_addon.line_drawing.mesh_in_view import HIDDEN_MARGIN, seen_triangles, triangles_near
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.line_drawing.visibility import in_frame, project_to_pixels, rasterize_depth
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera


def instance(surface, location=(0, 0, 0)):
    return instance_of(surface, 4, matrix=moved(*location))


def seen(instances, index, camera):
    return seen_triangles(instances[index], index, rasterize_depth(instances, camera))


SIDE = perspective_camera(look_at((0, -6, 1.5), (0, 0, 0)), 240, 180)
#: Triangles are smaller than pixels.
FAR = perspective_camera(look_at((0, -40, 10), (0, 0, 0)), 80, 60)
CLOSE = orthographic_camera(look_at((0, -3, 0.5), (0.6, 0, 0)), 120, 100, scale=0.8)


@pytest.mark.slow
@pytest.mark.parametrize("camera", [SIDE, FAR, CLOSE], ids=["side", "far", "close"])
def test_every_triangle_that_is_not_hidden_is_seen(camera):
    """A sphere behind a torus: rays to points on a third of its triangles meet nothing else."""
    ball, ring = instance(icosphere(3)), instance(torus(24, 12), (0, -2.2, 0))
    instances = [ring, ball]
    found = seen(instances, 1, camera)[::3]
    corners = ball.world_points()[ball.surface.triangle_vertex][::3]
    occluders = [other.world_points()[other.surface.triangle_vertex] for other in instances]
    weights = np.random.default_rng(3).dirichlet(np.ones(3), size=len(corners))
    points = np.einsum("tk,tki->ti", weights, corners)
    barycentric, distance = ray_intersections(
        points, camera.view_directions(points), np.concatenate(occluders)
    )
    is_seen = ~((barycentric >= 0).all(axis=2) & (distance > 1e-6)).any(axis=1)
    assert is_seen.sum() > 50 and found[is_seen].mean() > 0.98
    pixels, _ = project_to_pixels(corners.reshape(-1, 3), camera)
    inside = in_frame(pixels, camera).reshape(-1, 3).all(axis=1)
    assert found[inside & ~is_seen].mean() < 0.6


def test_the_margin_is_a_distance_on_the_surface():
    """Triangles are kept up to the margin, also if they are long and thin."""
    mesh = build_tangent_mesh(instance(plane(200, 2, 1.0)))
    x = mesh.points[:, :, 0]
    spacing = 0.02
    first = x.max(axis=1) < x.min() + 0.011
    kept = triangles_near(mesh, first, np.full((len(x), 3), spacing))
    reach = x[kept].max() - x[first].max()
    assert abs(reach / spacing - HIDDEN_MARGIN) < 0.1 * HIDDEN_MARGIN
    assert not triangles_near(mesh, np.zeros(len(x), bool), np.full((len(x), 3), spacing)).any()
    assert triangles_near(mesh, first, np.full((len(x), 3), 1.0)).all()
