"""Combing: guides along strokes, and the field that follows them."""

import numpy as np
import pytest
from field_helpers import angle_differences
from scipy.spatial import cKDTree
from shapes import from_quads, icosphere, joined, plane, torus

from rosy_addon.field.combing import BrushStroke, Combing, GuideBrush, start_combing
from rosy_addon.field.frames import normalize
from rosy_addon.field.generate import GeneratorSettings, axis_field, generate
from rosy_addon.field.guided_system import guided_system
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.surface import Surface

MAJOR, MINOR = 1.0, 0.4


def start(surface: Surface, degree: int, kind: str = "smoothest", reach: float = 0.1) -> Combing:
    system = guided_system(surface, degree)
    no_guides = np.zeros((surface.face_count, 3))
    return start_combing(system, generate(surface, kind, degree), no_guides, reach * surface.extent)


def draw(combing: Combing, points: np.ndarray, batch: int = 1000, pressure: float = 1.0, **brush):
    """Draw a stroke, and let the field settle."""
    tree = cKDTree(combing.system.surface.face_center)
    settings = GuideBrush(**({"radius": 0.15} | brush))
    stroke = BrushStroke(combing.system, combing.guides, settings, lambda at: tree.query(at)[1])
    for first in range(0, len(points), batch):
        part = points[first : first + batch]
        combing.follow(stroke.extend(part, np.full(len(part), pressure)))
    combing.follow(stroke.finish())
    combing.settle()


def angles(combing: Combing, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(F,) degrees between the RoSys of (F, 3) members."""
    return np.degrees(angle_differences(combing.system.surface, a, b, combing.system.degree))


def on_torus(u: np.ndarray) -> np.ndarray:
    """Points of a curve on the torus."""
    v = 1 + 3 * u
    ring = MAJOR + MINOR * np.cos(v)
    return np.stack([ring * np.cos(u), ring * np.sin(u), MINOR * np.sin(v)], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("degree", "is_exact", "limit"), [(1, False, 3.0), (4, True, 0.1), (6, False, 3.0)]
)
def test_field_runs_along_strokes(degree, is_exact, limit):
    combing = start(torus(192, 96, MAJOR, MINOR), degree)
    u = np.linspace(0, 1.2, 4000)
    curve, along = on_torus(u), np.gradient(on_torus(u), axis=0)
    draw(combing, curve[::10], is_exact=is_exact)
    distance, nearest = cKDTree(curve).query(combing.system.surface.face_center)
    # Faces on the stroke, away from its ends: there the direction is that of a shorter piece.
    chosen = (distance < 0.02) & (nearest > 200) & (nearest < 3800)
    assert chosen.sum() > 50
    assert angles(combing, combing.vectors, along[nearest])[chosen].max() < limit


@pytest.mark.slow
def test_strokes_do_not_depend_on_the_rate_of_their_points():
    results = []
    for batch in (1, 7, 1000):
        combing = start(torus(96, 48, MAJOR, MINOR), 4)
        draw(combing, on_torus(np.linspace(0, 1, 60)), batch, pressure=0.5)
        results.append(combing.guides.copy())
    assert np.array_equal(results[0], results[1]) and np.array_equal(results[0], results[2])


@pytest.mark.slow
def test_settled_field_is_the_guided_field():
    surface = icosphere(4)
    combing = start(surface, 4)
    random = np.random.default_rng(3)
    for index in range(25):
        around = np.linalg.qr(random.standard_normal((3, 3)))[0]
        angle = np.linspace(0, random.uniform(0.2, 2), 40)[:, None]
        points = np.cos(angle) * around[0] + np.sin(angle) * around[1]
        effect = ("comb", "comb", "comb", "erase", "smooth")[index % 5]
        radius = random.uniform(0.1, 0.4)
        draw(combing, points, radius=radius, effect=effect, is_exact=index % 7 == 0)
        if index % 5:
            continue
        vectors = combing.guide_vectors
        settings = GeneratorSettings("guided", vectors=vectors, vectors_have_firmness=True)
        expected = generate(surface, settings, 4)
        assert np.percentile(angles(combing, combing.vectors, expected.vectors), 95) < 0.01
        found = find_singularities(surface, RosyField(4, combing.vectors))
        for values, others in zip(found, find_singularities(surface, expected), strict=True):
            assert np.array_equal(values, others)


def test_erasing_everything_removes_all_guides():
    combing = start(icosphere(2), 4)
    circle = np.linspace(0, 2 * np.pi, 100)
    points = np.stack([np.cos(circle), np.sin(circle), 0 * circle], axis=1)
    # All of the surface is within the radius, where the falloff is not yet 0.
    for _ in range(60):
        draw(combing, points, radius=4.0, effect="erase", front_faces=False)
    assert not combing.guides.any() and np.isfinite(combing.vectors).all()


def test_smoothing_lowers_the_difference_between_neighbors():
    combing = start(plane(40, 40), 4)
    noise = np.exp(1j * np.random.default_rng(0).uniform(-1, 1, len(combing.guides)))
    combing.guides *= noise
    line = np.stack([np.linspace(-0.6, 0.6, 50), np.zeros(50), np.zeros(50)], axis=1)
    is_near = np.abs(combing.system.surface.face_center[:, 1]) < 0.05
    is_near &= np.abs(combing.system.surface.face_center[:, 0]) < 0.5
    spread = np.std(np.angle(combing.guides[is_near]))
    draw(combing, line, radius=0.3, effect="smooth")
    assert np.std(np.angle(combing.guides[is_near])) < spread


def test_mirrored_strokes_are_symmetric():
    surface = plane(40, 40)
    combing = start(surface, 1)
    combing.guides[:] = 0
    wave = np.linspace(-0.1, 0.6, 60)
    points = np.stack([wave, 0.3 * np.sin(4 * wave), 0 * wave], axis=1)
    draw(combing, points, mirror=(True, False, False))
    mirrored = combing.guide_vectors * [-1, 1, 1]
    center = surface.face_center
    partner = cKDTree(center).query(center * [-1, 1, 1])[1]
    is_combed = (np.abs(combing.guides) > 0.5) & (np.abs(center[:, 0]) > 0.25)
    assert is_combed.sum() > 50
    assert np.abs(combing.guide_vectors[partner] - mirrored)[is_combed].max() < 1e-9


def test_other_side_of_a_sheet_is_left_out():
    front = plane(20, 20)
    corners = front.corner_vertex.reshape(-1, 4)
    surface = joined(front, from_quads(front.vertices - [0, 0, 0.01], corners[:, ::-1]))
    line = np.stack([np.linspace(-0.5, 0.5, 50), np.zeros(50), np.zeros(50)], axis=1)
    for front_faces, expected in ((True, 0), (False, 1)):
        combing = start(surface, 4)
        before = combing.guides.copy()
        draw(combing, line, front_faces=front_faces)
        is_changed = (combing.guides != before)[front.face_count :]
        assert is_changed.any() == expected


def test_magnitude_stays():
    surface = icosphere(3)
    field = axis_field(surface, 2)
    system = guided_system(surface, 2)
    combing = start_combing(system, field, np.zeros((surface.face_count, 3)), 0.1)
    angle = np.linspace(0, 1, 50)
    draw(combing, np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    assert np.linalg.norm(combing.vectors, axis=1) == pytest.approx(field.magnitude)


@pytest.mark.parametrize("far", [1e9, np.inf, np.nan])
def test_points_far_away_are_refused(far, error_of):
    combing = start(icosphere(2), 4)
    message = error_of(draw, combing, np.array([[1.0, 0, 0], [far, 0, 0]]))
    assert "far away from the surface" in message
    # A tiny brush makes no more dabs than the size of the surface asks for.
    draw(combing, np.array([[1.0, 0, 0], [-1.0, 0, 0]]), radius=1e-12)


def test_undefined_field_is_refused(error_of):
    surface = plane()
    system = guided_system(surface, 4)
    zero = np.zeros((surface.face_count, 3))
    message = error_of(start_combing, system, RosyField(4, zero), zero, 0.1)
    assert "undefined everywhere: make a field first" in message


def test_exact_guides_survive_storing():
    combing = start(torus(96, 48, MAJOR, MINOR), 4)
    draw(combing, on_torus(np.linspace(0, 1, 100)), is_exact=True)
    is_exact = np.abs(combing.guides) > 0.99
    stored = combing.guide_vectors.astype(np.float32)
    again = start_combing(combing.system, RosyField(4, combing.vectors), stored, 0.1)
    again.settle()
    assert is_exact.any() and angles(again, again.vectors, normalize(stored))[is_exact].max() < 1e-4
