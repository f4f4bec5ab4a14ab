"""Triangles of convex and concave polygons, which must cover each polygon exactly once."""

import numpy as np
import pytest
from conftest import traced_peak
from hypothesis import given, settings
from hypothesis import strategies as st

from rosy_addon.field.triangulate import triangulate

pytestmark = pytest.mark.filterwarnings("error")

seeds = st.integers(0, 2**32 - 1)


def triangulate_polygons(*polygons):
    """Triangulate (k, 2) or (k, 3) polygons; return the points, the triangles and their faces."""
    polygons = [np.asarray(p, dtype=float) for p in polygons]
    polygons = [np.pad(p, ((0, 0), (0, 3 - p.shape[1]))) for p in polygons]
    points = np.concatenate(polygons)
    start = np.concatenate([[0], np.cumsum([len(p) for p in polygons])]).astype(np.int32)
    triangles, face = triangulate(points, np.arange(len(points), dtype=np.int32), start)
    assert (np.bincount(face, minlength=len(polygons)) == np.diff(start) - 2).all()
    assert (np.diff(face) >= 0).all()
    assert ((triangles >= start[face][:, None]) & (triangles < start[face + 1][:, None])).all()
    return points, triangles, face


def signed_areas(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return 0.5 * np.cross(b - a, c - a)[:, 2]


def polygon_area(points):
    x, y = points[:, 0], points[:, 1]
    return 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()


def assert_filled(polygon):
    """Check that all triangles wind like the polygon and that their areas sum to its area."""
    points, triangles, _ = triangulate_polygons(polygon)
    areas = signed_areas(points, triangles)
    area = polygon_area(np.asarray(polygon, dtype=float))
    assert (areas * np.sign(area) > 0).all() and areas.sum() == pytest.approx(area)


def star(random, corners):
    """A star-shaped polygon, mostly with many reflex corners."""
    angle = np.sort((np.arange(corners) + 0.8 * random.random(corners)) * 2 * np.pi / corners)
    radius = random.uniform(0.2, 1.0, corners)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@settings(max_examples=60)
@given(seeds, st.integers(4, 24), st.booleans())
def test_star_shaped_polygons_are_filled(seed, corners, backward):
    random = np.random.default_rng(seed)
    polygon = np.roll(star(random, corners), random.integers(corners), axis=0)
    assert_filled(polygon[::-1] if backward else polygon)


#: Corners of polygons, as rows x y.
POLYGONS = {
    "a quadrangle with a reflex corner": "0 0  3 1  0 2  1 1",
    "a comb": "0 0  6 0  6 3  5 3  5 1  4 1  4 3  3 3  3 1  1 1  1 3  0 3",
    "a spiral": "0 0  5 0  5 4  1 4  1 2  3 2  3 3  4 3  4 1  .5 1  .5 5  0 5",
    "a triangle with a flat corner": "0 0  1 0  2 0  1 2",
    "a square with four flat corners": "0 0  1 0  2 0  2 1  2 2  1 2  0 2  0 1",
}


@pytest.mark.parametrize("name", POLYGONS)
def test_polygons_are_filled_from_any_first_corner(name):
    polygon = np.array(POLYGONS[name].split(), dtype=float).reshape(-1, 2)
    for turn in range(len(polygon)):
        assert_filled(np.roll(polygon, turn, axis=0))


@pytest.mark.slow
def test_polygons_of_thousands_of_corners():
    """Neither the time nor the memory may grow with the square of the corners."""
    assert_filled(star(np.random.default_rng(1), 400))
    x = np.arange(2500)
    teeth = np.stack([x[::-1], np.where(x % 2, 1.0, 0.1)], axis=1)
    polygon = np.concatenate([[[2500, -1.0]], teeth, [[-1, -1.0]]])
    assert traced_peak(lambda: assert_filled(polygon)) < 2e7


def test_convex_faces_are_fans_around_their_first_corner():
    angle = np.arange(6) * np.pi / 3
    hexagon = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    _, triangles, face = triangulate_polygons(square, hexagon, square[:3])
    expected = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [4, 7, 8], [4, 8, 9], [10, 11, 12]]
    assert triangles.tolist() == expected
    assert face.tolist() == [0, 0, 1, 1, 1, 1, 2]


@settings(max_examples=20)
@given(seeds)
def test_a_polygon_in_space_is_split_as_in_the_plane(seed):
    """A polygon that is rotated, far from the origin, and not quite planar."""
    random = np.random.default_rng(seed)
    flat = np.pad(star(random, 9), ((0, 0), (0, 1)))
    bumpy = flat + [0, 0, 1] * random.normal(size=(9, 1)) * 0.01
    q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    q *= np.sign(np.linalg.det(q))
    _, triangles, _ = triangulate_polygons(bumpy @ q.T + 100 * random.normal(size=3))
    areas = signed_areas(flat, triangles)
    assert (areas > 0).all() and areas.sum() == pytest.approx(polygon_area(flat))


def test_a_mixed_mesh_keeps_its_order():
    random = np.random.default_rng(0)
    polygons = [star(random, k) for k in (3, 7, 4, 12, 5, 4, 3, 9)]
    points, triangles, face = triangulate_polygons(*polygons)
    areas = signed_areas(points, triangles)
    assert (areas > 0).all()
    expected = [polygon_area(p) for p in polygons]
    np.testing.assert_allclose(np.bincount(face, weights=areas), expected)


def test_degenerate_and_self_intersecting_faces_are_split():
    bow_tie = [(0, 0), (1, 1), (1, 0), (0, 1)]
    pentagram = [(np.cos(a), np.sin(a)) for a in np.arange(5) * 0.8 * np.pi]
    line = [(t, t) for t in range(6)]
    triangulate_polygons(bow_tie, pentagram, np.zeros((4, 2)), np.zeros((7, 2)), line)
