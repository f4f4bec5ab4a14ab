"""The part of a mesh in view: what is in the frame, the same surface where it is cut, and what can be seen."""

import numpy as np
import pytest
from rays import ray_intersections
from shapes import icosphere, instance_of, moved, plane, torus

from rosy_addon.line_drawing.mesh_in_view import (
    HIDDEN_MARGIN,
    MARGIN_PIXELS,
    MARGIN_RATIO,
    mesh_in_view,
    seen_triangles,
    triangles_near,
)
from rosy_addon.line_drawing.surface_particles import SurfaceParticles, trace_geodesics
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.line_drawing.visibility import in_frame, project_to_pixels, rasterize_depth
from rosy_addon.projection.camera import look_at, orthographic_camera, perspective_camera

#: A camera at the height 2 above a ground plane, whose horizon is in the picture.
ABOVE_GROUND = perspective_camera(look_at((0, 0, 2), (0, 20, 1)), 192, 108)

#: A camera inside a sphere of radius 1, and one that sees a part of it.
INSIDE = perspective_camera(look_at((0.2, 0.1, 0.3), (1, 0.4, 0.1)), 600, 480)
CLOSE = orthographic_camera(look_at((0, -3, 1), (0.4, 0, 0)), 100, 80, scale=0.6)

SCENES = {
    "ground": (plane(3, 3, 1000.0), ABOVE_GROUND),
    "inside a sphere": (icosphere(2), INSIDE),
    "close to a sphere": (icosphere(2), CLOSE),
}


def mesh_and_part(name):
    surface, camera = SCENES[name]
    kind = (1, 0.3, 0) if name == "ground" else "form"
    mesh = build_tangent_mesh(instance_of(surface, 4, kind))
    return mesh, mesh_in_view(mesh, camera), camera


@pytest.mark.parametrize("name", SCENES)
def test_part_is_what_is_in_the_frame(name):
    mesh, part, camera = mesh_and_part(name)
    points = part.mesh.points.reshape(-1, 3)
    expected = np.einsum("tkj,tji->tki", part.weights, mesh.points[part.triangle])
    assert np.allclose(part.mesh.points, expected)
    pixels, _ = project_to_pixels(points + 1e-7 * (points.mean(axis=0) - points), camera)
    size = np.array([camera.width, camera.height])
    limit = size / 2 + np.minimum(MARGIN_PIXELS, MARGIN_RATIO * size)
    assert np.all(np.abs(pixels[np.isfinite(pixels).all(axis=1)] - size / 2) <= limit + 0.01)
    assert 0 < part.mesh.area.sum() < mesh.area.sum()
    # Random points of triangles that are in the frame are in one part each, others in none.
    rng = np.random.default_rng(5)
    triangle = rng.integers(len(mesh.points), size=4000)
    weights = rng.dirichlet(np.ones(3), len(triangle))
    pixels, _ = project_to_pixels(mesh.points_at(triangle, weights), camera)
    with np.errstate(invalid="ignore"):
        expected = (np.abs(pixels - size / 2) <= limit).all(axis=1)
    parts_around = np.zeros(len(triangle), dtype=int)
    to_part = np.linalg.inv(part.weights[part.mesh.area > 0])
    for piece, inverse in zip(part.triangle[part.mesh.area > 0], to_part, strict=True):
        on_triangle = np.flatnonzero(triangle == piece)
        parts_around[on_triangle] += (weights[on_triangle] @ inverse >= 0).all(axis=1)
    assert expected.sum() > 30 and np.array_equal(parts_around, expected)


@pytest.mark.parametrize("name", SCENES)
def test_parts_are_connected_as_the_mesh(name):
    """A straight walk in the part ends at the same point as on the whole mesh, unless at a cut."""
    mesh, part, _ = mesh_and_part(name)
    triangle, edge = np.nonzero(part.mesh.neighbor >= 0)
    other = part.mesh.neighbor[triangle, edge], part.mesh.neighbor_edge[triangle, edge]
    assert np.array_equal(part.mesh.neighbor[other], triangle)
    assert np.array_equal(part.mesh.neighbor_edge[other], edge)
    rng = np.random.default_rng(6)
    start = rng.choice(np.flatnonzero(part.mesh.area > 0), 500).astype(np.int32)
    weights = rng.dirichlet(np.ones(3), len(start))
    direction = np.exp(2j * np.pi * rng.random(len(start)))
    length = rng.random(len(start)) * 0.4 * np.sqrt(part.mesh.area[start])
    ends = []
    on_whole = np.einsum("nk,nkj->nj", weights, part.weights[start])
    for of_mesh, at, on in ((part.mesh, start, weights), (mesh, part.triangle[start], on_whole)):
        particles = SurfaceParticles(at, on, np.ones(len(at), dtype=complex), np.ones(len(at)))
        arrived, _, walked = trace_geodesics(of_mesh, particles, direction, length)
        ends.append((of_mesh.points_at(arrived.triangle, arrived.weights), walked))
    reached = ends[0][1] >= 0.999 * length
    assert reached.mean() > 0.7
    size = np.abs(ends[1][0]).max()
    np.testing.assert_allclose(ends[0][0][reached], ends[1][0][reached], atol=1e-6 * size)


def test_a_mesh_in_the_frame_is_not_changed():
    mesh = build_tangent_mesh(instance_of(icosphere(2), 4, "form"))
    camera = perspective_camera(look_at((0, -5, 1), (0, 0, 0)), 100, 100)
    assert mesh_in_view(mesh, camera).mesh is mesh


# --- triangles that are seen ---------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "camera",
    [
        perspective_camera(look_at((0, -6, 1.5), (0, 0, 0)), 240, 180),
        # Triangles are smaller than pixels.
        perspective_camera(look_at((0, -40, 10), (0, 0, 0)), 80, 60),
        orthographic_camera(look_at((0, -3, 0.5), (0.6, 0, 0)), 120, 100, scale=0.8),
    ],
    ids=["side", "far", "close"],
)
def test_every_triangle_that_is_not_hidden_is_seen(camera):
    """A sphere behind a torus: rays to points on a third of its triangles meet nothing else."""
    ball, ring = instance_of(icosphere(3), 4), instance_of(torus(24, 12), 4, matrix=moved(y=-2.2))
    instances = [ring, ball]
    found = seen_triangles(ball, 1, rasterize_depth(instances, camera))[::3]
    corners = ball.world_points()[ball.surface.triangle_vertex][::3]
    occluders = [other.world_points()[other.surface.triangle_vertex] for other in instances]
    weights = np.random.default_rng(3).dirichlet(np.ones(3), size=len(corners))
    points = np.einsum("tk,tki->ti", weights, corners)
    toward = camera.view_directions(points)
    barycentric, distance = ray_intersections(points, toward, np.concatenate(occluders))
    is_seen = ~((barycentric >= 0).all(axis=2) & (distance > 1e-6)).any(axis=1)
    assert is_seen.sum() > 50 and found[is_seen].mean() > 0.98
    pixels, _ = project_to_pixels(corners.reshape(-1, 3), camera)
    inside = in_frame(pixels, camera).reshape(-1, 3).all(axis=1)
    assert found[inside & ~is_seen].mean() < 0.6


def test_the_margin_is_a_distance_on_the_surface():
    """Triangles are kept up to the margin, also if they are long and thin."""
    mesh = build_tangent_mesh(instance_of(plane(200, 2, 1.0), 4))
    x = mesh.points[:, :, 0]
    spacing = 0.02
    first = x.max(axis=1) < x.min() + 0.011
    kept = triangles_near(mesh, first, np.full((len(x), 3), spacing))
    reach = x[kept].max() - x[first].max()
    assert abs(reach / spacing - HIDDEN_MARGIN) < 0.1 * HIDDEN_MARGIN
    assert not triangles_near(mesh, np.zeros(len(x), bool), np.full((len(x), 3), spacing)).any()
    assert triangles_near(mesh, first, np.full((len(x), 3), 1.0)).all()
