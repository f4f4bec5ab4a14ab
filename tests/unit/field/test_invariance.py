"""Fields do not depend on the position, the scale, the side, the numbering and the first corners of faces."""

import numpy as np
import pytest
from field_helpers import angle_differences, bumpy, symmetric_head
from scipy.spatial.transform import Rotation
from shapes import cube, globe, icosphere, plane, rebuilt, roughened

from rosy_addon.core.errors import NoFeaturesError
from rosy_addon.field.analysis import dirichlet_energy
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.prescribed import prescribed_field
from rosy_addon.field.surface import build_surface, with_delaunay_triangles

TURN = Rotation.from_rotvec([0.3, 1.0, -0.4]).as_matrix()
GLOBE = rebuilt(globe(12, 20), globe(12, 20).vertices @ TURN)
ROUGH = roughened(bumpy(icosphere(2)), 0.06)
SHEET = plane(9, 7).vertices @ [[1, 0.2, 0.3], [0.1, 0.8, 0], [0, 0, 1]]


def folded(surface):
    """The surface with its first face folded over a neighbor."""
    vertices, (a, b, c) = surface.vertices.copy(), surface.faces[0]
    vertices[a] = 0.75 * (vertices[b] + vertices[c]) - 0.5 * vertices[a]
    return rebuilt(surface, vertices)


MESHES = {
    "triangles": bumpy(icosphere(3)),
    "quads": bumpy(GLOBE),
    "sheet": rebuilt(plane(9, 7), SHEET + np.outer(np.sin(2 * SHEET[:, 0] + 1), [0, 0, 0.4])),
    "rough": folded(ROUGH),
}
KINDS = {
    "form": (1, 2, 4),
    "smoothest": range(1, 7),
    "curvature": (2, 4, 6),
    "features": range(1, 7),
    "extended": (2, 4, 6),
    "prescribed": (1, 2, 3, 4),
}
CASES = [(kind, degree) for kind, degrees in KINDS.items() for degree in degrees]
CHANGES = "moved", "larger", "reversed", "renumbered", "turned"


def changed(surface, change):
    """The same mesh after a change, a function that takes vectors back, and the new numbers of the vertices."""
    random, faces = np.random.default_rng(5), [*map(np.asarray, surface.faces)]
    vertices, order, rotation = surface.vertices, np.arange(len(faces)), np.eye(3)
    numbers = np.arange(len(vertices))
    match change:
        case "moved":
            rotation = TURN
            vertices = vertices @ rotation.T + (1, 2, 3)
        case "larger":
            vertices = 100 * vertices
        case "reversed":
            faces = [face[::-1] for face in faces]
        case "renumbered":
            old, order = random.permutation(len(vertices)), random.permutation(len(faces))
            numbers = np.argsort(old)
            vertices, faces = vertices[old], [numbers[faces[f]] for f in order]
        case "turned":
            faces = [np.roll(face, random.integers(len(face))) for face in faces]
    starts = np.cumsum([0, *map(len, faces)])
    mesh = build_surface(vertices, np.concatenate(faces), starts)
    return mesh, lambda vectors: vectors[np.argsort(order)] @ rotation, numbers


def made(surface, kind, degree, singular=None):
    """A generated field; "extended" is along curvature, with a reach."""
    if kind == "prescribed":
        return prescribed_field(surface, degree, singular, np.ones_like(singular))
    settings = GeneratorSettings("curvature", reach=0.05) if kind == "extended" else kind
    return generate(surface, settings, degree)


def spread_vertices(surface, count):
    """Some vertices inside of the border."""
    ends, interior = surface.edges.ends, surface.edges.interior
    inside = np.setdiff1d(np.arange(len(surface.vertices)), np.delete(ends, interior, axis=0))
    return inside[:: len(inside) // count][:count]


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize(("kind", "degree"), CASES)
def test_a_field_depends_on_the_shape_alone(name, kind, degree):
    """Along edges, a direction of odd degree has the sign of the side, so that only its line stays."""
    surface = MESHES[name]
    singular = spread_vertices(surface, 2 * degree)
    try:
        expected = made(surface, kind, degree, singular).vectors
    except NoFeaturesError:
        assert kind == "features" and name in ("triangles", "quads")
        return
    for change in CHANGES:
        mesh, back, numbers = changed(surface, change)
        actual = back(made(mesh, kind, degree, numbers[singular]).vectors)
        as_lines = kind == "features" and change == "reversed" and degree % 2
        members = 2 * degree if as_lines else degree
        turned = angle_differences(surface, actual, expected, members)
        assert turned.max() < np.radians(0.1), change


@pytest.mark.parametrize("degree", [1, 2])
def test_numbers_of_mirror_images_do_not_choose(degree):
    """The multigrid levels of a mirror-symmetric mesh are symmetric, too: no choice between two images is made.

    In these degrees, the field with the least energy is symmetric.
    """
    surface = symmetric_head(4)
    mesh, back, _ = changed(surface, "renumbered")
    actual = back(generate(mesh, "smoothest", degree).vectors)
    expected = generate(surface, "smoothest", degree).vectors
    assert angle_differences(surface, actual, expected, degree).max() < np.radians(0.1)


@pytest.mark.parametrize("degree", [2, 3, 6])
def test_a_cube_has_one_field_but_for_its_symmetries(degree):
    """All corners are equal, so that any field is the image of any other under one of 48 symmetries."""
    surface = cube()
    expected = generate(surface, "smoothest", degree)
    mesh, back, _ = changed(surface, "turned")
    actual = generate(mesh, "smoothest", degree)
    energies = [dirichlet_energy(s, f) for s, f in ((surface, expected), (mesh, actual))]
    assert energies[0] == pytest.approx(energies[1], abs=1e-9)
    images = Rotation.create_group("O").as_matrix()
    center, least = surface.face_center - 0.5, []
    for image in [*images, *-images]:
        face = np.abs(center[:, None] @ image.T - center).max(axis=2).argmin(axis=1)
        vectors = np.empty_like(center)
        vectors[face] = expected.vectors @ image.T
        least.append(angle_differences(surface, vectors, back(actual.vectors), degree).max())
    assert np.degrees(min(least)) < 0.1


def test_triangles_do_not_depend_on_first_corners():
    """A concave polygon, and one with corners on an ellipse."""
    angle = np.sort(np.random.default_rng(2).uniform(0, 2 * np.pi, 12))
    radius = np.where(np.arange(12) % 4, 1.0, 0.3)
    for radii in (1, radius):
        points = np.stack([radii * np.cos(angle), 0.6 * radii * np.sin(angle), 0 * angle], axis=1)
        sets = []
        for turn in range(12):
            corners = np.roll(np.arange(12), turn)
            surface = with_delaunay_triangles(build_surface(points, corners, [0, 12]))
            sets.append({frozenset(triangle) for triangle in surface.triangle_vertex.tolist()})
        assert len(sets[0]) == 10 and all(each == sets[0] for each in sets)
