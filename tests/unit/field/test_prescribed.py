"""The smoothest field with given singularities: closed forms, all surfaces, and a dense solver."""

import itertools

import awkward
import numpy as np
import pytest
from field_helpers import cross_errors
from shapes import (
    cylinder,
    from_quads,
    from_triangles,
    globe,
    icosphere,
    tetrahedron,
    torus,
    walls_of,
)

from rosy_addon.core.errors import RosyError
from rosy_addon.field import prescribed, turning_angles
from rosy_addon.field.analysis import dirichlet_energy
from rosy_addon.field.cheapest_singularities import cheapest_singularities
from rosy_addon.field.face_graph import face_graph, spanning_forest, triangle_graph
from rosy_addon.field.frames import dot, normalize
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.prescribed import prescribed_field
from rosy_addon.field.representation import face_representation, matching_angles
from rosy_addon.field.singularities import find_singularities
from rosy_addon.field.smoothest import smoothest_field
from rosy_addon.field.surface import Surface, build_surface


def two_octahedra() -> Surface:
    """Two octahedra that share vertex 5, and nothing else."""
    points, faces = map(np.array, awkward.octahedron())
    mirrored = np.array([6, 7, 8, 9, 10, 5])[faces[:, ::-1]]
    points = np.concatenate([points, (2 * points[5] - points)[:5]])
    return from_triangles(points, np.concatenate([faces, mirrored]))


def block(holes: int, missing: int = 0) -> Surface:
    """A rounded block of quads with holes through it, and some patches cut out of its surface."""
    solid = np.ones((3 + 4 * max(holes, 1), 7, 3), dtype=bool)
    for hole in range(holes):
        solid[3 + 4 * hole : 5 + 4 * hole, 2:5] = False
    vertices, quads = walls_of(np.kron(solid, np.ones((2, 2, 2), dtype=bool)))
    sides = np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)])
    for _ in range(8):
        sums = [np.bincount(sides[:, 0], column[sides[:, 1]]) for column in vertices.T]
        vertices = (vertices + np.transpose(sums / np.bincount(sides[:, 0]))) / 2
    random = np.random.default_rng(missing)
    center = vertices[quads].mean(axis=1)
    for patch in center[random.integers(len(quads), size=missing)]:
        far = np.linalg.norm(center - patch, axis=1) > 3
        quads, center = quads[far], center[far]
    return from_quads(vertices, quads)


def spread_vertices(surface: Surface, count: int, seed: int) -> np.ndarray:
    """Interior vertices in random order, no two of which share a face."""
    graph = face_graph(surface)
    is_interior = np.zeros(len(surface.vertices), dtype=bool)
    is_interior[surface.corner_vertex[graph.is_interior[graph.corner_node]]] = True
    faces = surface.corner_vertex.reshape(surface.face_count, -1)
    chosen = []
    for vertex in np.random.default_rng(seed).permutation(np.flatnonzero(is_interior)):
        if is_interior[vertex] and len(chosen) < count:
            chosen.append(vertex)
            is_interior[faces[(faces == vertex).any(axis=1)]] = False
    return np.array(chosen)


@pytest.mark.parametrize("degree", [1, 2, 4, 6])
def test_poles_give_the_meridians(degree):
    """The smoothest field with all of the index at the poles is that of a rotated meridian."""
    surface = globe()
    last = len(surface.vertices) - 1
    field = prescribed_field(surface, degree, [0, last], [degree, degree])
    vertex, index = find_singularities(surface, field)
    assert vertex.tolist() == [0, last] and index.tolist() == [degree, degree]
    east = normalize(np.cross((0, 0, 1), surface.face_center))
    assert errors(field, east, np.cross(surface.face_normal, east), 0).max() < 1e-4


def test_a_torus_without_singularities_has_parallel_lines():
    surface = torus(48, 24)
    field = prescribed_field(surface, 4, [], [])
    assert not len(find_singularities(surface, field)[0])
    along = normalize(np.cross((0, 0, 1), surface.face_center))
    assert cross_errors(surface, field.vectors, along).max() < 1e-4


def on_cone(azimuth: np.ndarray, slope: float) -> np.ndarray:
    """(n, 3) unit vectors from the apex of a cone that opens downward."""
    height = np.full(len(azimuth), -np.sqrt(1 - slope**2))
    return np.stack([slope * np.cos(azimuth), slope * np.sin(azimuth), height], axis=1)


def rings(
    count: int, segments: int, total: float = 2 * np.pi, shear: float = 0.0, quads: bool = False
) -> Surface:
    """Rings of triangles or quads around vertex 0: a disc, or a cone whose angles add up to `total`.

    Each ring is turned by a number of segments from the one inside it. The triangles are right ones if it is 0.
    """
    radius = np.repeat(np.arange(1, count + 1) / count, segments)
    turn = shear * np.arange(count)[:, None] + np.arange(segments)
    azimuth = turn.ravel() * 2 * np.pi / segments
    slope = total / (2 * np.pi)
    points = radius[:, None] * on_cone(azimuth, slope)
    inner = 1 + np.arange(segments)
    following = np.roll(inner, -1)
    fan = np.stack([np.zeros_like(inner), inner, following], axis=1)
    band = np.stack([inner, inner + segments, following + segments, following], axis=1)
    band = (band + segments * np.arange(count - 1)[:, None, None]).reshape(-1, 4)
    if not quads:
        band = band[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    size = np.repeat([3, band.shape[1]], [len(fan), len(band)])
    return build_surface(
        np.concatenate([[[0, 0, 0]], points]),
        np.concatenate([fan.ravel(), band.ravel()]),
        np.concatenate([[0], np.cumsum(size)]),
    )


def errors(field, first_axis, second_axis, angle) -> np.ndarray:
    """(F,) degrees from a field to angles in frames, which it may differ from by a constant."""
    own = np.arctan2(dot(field.vectors, second_axis), dot(field.vectors, first_axis))
    relative = np.exp(1j * field.degree * (own - angle))
    return np.degrees(np.abs(np.angle(relative * relative.mean().conj()))) / field.degree


@pytest.mark.parametrize("quads", [False, True], ids=["triangles", "quads"])
@pytest.mark.parametrize("degree, shear", [(1, 0), (2, 0), (4, 0), (6, 0), (1, 0.5)])
def test_a_pair_in_a_disc_turns_as_its_closed_form(degree, shear, quads):
    """Its potential is that of two charges and their images in the border."""
    surface = rings(60, 120, shear=shear, quads=quads)
    points = surface.vertices @ (1, 1j, 0)
    pair = [int(np.abs(points - place).argmin()) for place in (0.4 + 0.1j, -0.3 - 0.35j)]
    field = prescribed_field(surface, degree, pair, [1, -1])
    center = (surface.face_center @ (1, 1j, 0))[:, None]
    phase = np.angle(center - points[pair]) - np.angle(1 - points[pair].conj() * center)
    error = errors(field, (1, 0, 0), (0, 1, 0), (phase[:, 0] - phase[:, 1]) / degree)
    # Sheared triangles are obtuse, and much longer in one direction than in the other.
    assert np.percentile(error, 90) < (0.4 if shear else 0.1) / degree
    assert np.median(error) < (0.12 if shear else 0.03) / degree


@pytest.mark.parametrize("degree, index", [(1, 1), (2, 0), (4, 0), (6, 1)])
def test_a_cone_turns_evenly_around_its_apex(degree, index):
    surface = rings(30, 120, np.radians(240))
    field = prescribed_field(surface, degree, [0][:index], [1][:index])
    azimuth = np.arctan2(surface.face_center[:, 1], surface.face_center[:, 0])
    outward = on_cone(azimuth, 240 / 360)
    around = np.cross(surface.face_normal, outward)
    assert errors(field, outward, around, (index / degree - 1) * azimuth).max() < 0.1


def test_a_face_without_neighbors_follows_its_guide():
    """Its matrix has no edges: adding to its integers was an error of numpy."""
    surface = from_triangles([(0, 0, 0), (2, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    field = prescribed_field(surface, 4, [], [], np.array([[3.0, 4.0, 0.0]]), reach=0.1)
    np.testing.assert_allclose(np.sort(np.abs(field.vectors[0])), [0, 0.6, 0.8], atol=1e-9)


def test_a_face_that_touches_itself_is_refused_in_one_line(error_of):
    """Its corner at vertex 3 is inside of the face, where the equation of the potential is 0 = 0."""
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.2, 0)]
    surface = build_surface(np.array(points), np.array([0, 1, 2, 0, 3]), np.array([0, 5]))
    assert "would turn too fast" in error_of(prescribed_field, surface, 4, [], [])


def test_guides_turn_the_whole_field():
    surface = globe(12, 24)
    last = len(surface.vertices) - 1
    guides = np.zeros((surface.face_count, 3))
    guides[100] = surface.vertices[surface.corner_vertex[surface.face_start[100] + 2]]
    guides[100] -= surface.vertices[surface.corner_vertex[surface.face_start[100]]]  # a diagonal
    field = prescribed_field(surface, 2, [0, last], [2, 2], guides)
    cosine = abs(field.vectors[100] @ guides[100]) / np.linalg.norm(guides[100])
    assert cosine == pytest.approx(1, abs=1e-4)
    assert find_singularities(surface, field)[0].tolist() == [0, last]


@pytest.mark.parametrize("degree", [1, 4])
@pytest.mark.parametrize("holes, missing", [(0, 0), (1, 0), (3, 0), (0, 1), (0, 3), (1, 2)])
def test_all_singularities_are_found_again(holes, missing, degree):
    surface = block(holes, missing)
    needed = degree * surface.euler_characteristic if not missing else 0
    vertex = spread_vertices(surface, abs(needed) + 6, seed=degree)
    index = np.where(np.arange(len(vertex)) < abs(needed), np.sign(needed), 1)
    index[-3:] = -1
    field = prescribed_field(surface, degree, vertex, index)
    found, found_index = find_singularities(surface, field)
    order = np.argsort(vertex)
    np.testing.assert_array_equal(found, vertex[order])
    np.testing.assert_array_equal(found_index, index[order])


def test_there_is_no_index_where_parts_share_only_a_vertex():
    """Smooth fields on both parts were said to have the index -1 there."""
    surface, vertex = two_octahedra(), [0, 1, 6, 7]
    field = prescribed_field(surface, 1, vertex, [1, 1, 1, 1])
    found, index = find_singularities(surface, field)
    assert found.tolist() == vertex and index.tolist() == [1, 1, 1, 1]


def least_squares(system: np.ndarray, sums: np.ndarray) -> np.ndarray:
    """The smallest solution of a system whose rows depend on each other."""
    return np.linalg.lstsq(system, sums, rcond=None)[0]


@pytest.mark.parametrize(
    "surface, degree, vertex, index",
    [
        (icosphere(2), 2, [0, 1, 2, 3], [1, 1, 1, 1]),
        (torus(16, 8), 4, [3, 60], [1, -1]),
        (torus(16, 8), 3, [], []),
        (cylinder(12, 6), 4, [30], [1]),
        (cylinder(8, 1), 4, [], []),
    ],
    ids=["sphere", "torus-pair", "torus", "tube", "ring"],
)
def test_the_energy_is_that_of_a_dense_solver(surface, degree, vertex, index):
    """Which tries all multiples of a turn around the loops."""
    faces = face_graph(surface)
    triangles = triangle_graph(faces)
    graph = triangles.graph
    edge = np.arange(len(graph.source))
    sums = np.zeros((graph.node_count, len(edge)))
    sums[graph.head, edge] += 1
    sums[graph.tail, edge] -= 1
    node_index = prescribed.index_at_nodes(faces, np.array(vertex, int), np.array(index, int))
    turn = 2 * np.pi / degree
    required = turn * node_index - faces.defect
    forest = spanning_forest(len(graph.component), graph.source, graph.target)
    loops = turning_angles._loops(graph, forest)
    rows = np.zeros((len(loops), len(edge)))
    for row, (crossed, signs) in zip(rows, loops, strict=True):
        row[crossed] = signs
    # Within the quads of these meshes, there is no resistance.
    assert graph.conductance.min() > -1e-12
    root = np.sqrt(np.maximum(graph.conductance, 1e-12))
    system = np.concatenate([sums[graph.is_interior], rows]) * root
    start = least_squares(system, np.r_[required[graph.is_interior], rows @ -graph.unfolding])
    nearest = np.rint(rows @ (root * start + graph.unfolding) / turn)
    energies, angles = [], []
    for change in itertools.product((-1, 0, 1), repeat=len(loops)):
        loop_sums = turn * (nearest + change) - rows @ graph.unfolding
        solution = least_squares(system, np.r_[required[graph.is_interior], loop_sums])
        energies.append(solution @ solution)
        to_center = triangles.turns_to_centers(solution / root)
        angles.append(triangles.on_faces(root * solution, to_center))
    angle, _ = turning_angles.turning_angles(faces, degree, required)
    nearest = int(np.argmin([np.abs(other - angle).max() for other in angles]))
    np.testing.assert_allclose(angle, angles[nearest], atol=1e-6)
    assert energies[nearest] == pytest.approx(min(energies), rel=1e-6, abs=1e-9)
    # The field turns by these angles at all edges, also at those that close the loops.
    field = prescribed_field(surface, degree, vertex, index)
    turned = matching_angles(surface, face_representation(surface, field), degree)
    np.testing.assert_allclose(turned, angle, atol=1e-9)


@pytest.mark.parametrize(
    "surface, vertex, index, message",
    [
        (torus(), [10], [1], "add up to 1/4, but this closed surface needs 0/4"),
        (icosphere(2), [9999], [8], "has no vertex 9999: its vertices are numbered 0 to 161"),
        (cylinder(12, 4), [0], [1], "vertex 0 cannot be singular, because it is at a border"),
        # With exactly pi / N between its faces, a tetrahedron could have these or others.
        (tetrahedron(), [0, 1, 2, 3], [3, 3, 1, 1], "would turn too fast"),
        (tetrahedron(), [0], [10**9], "index 1000000000/4: the faces around it allow 1/4 to 3/4"),
        (tetrahedron(), [0], [0], "index 0/4: the faces around it allow 1/4 to 3/4"),
        (torus(), [10, 30, 10], [1, -2, 1], "vertex 10 is given more than once"),
        (two_octahedra(), [5], [1], "vertex 5 cannot be singular, because it is at a border"),
    ],
)
def test_what_is_not_possible(surface, vertex, index, message, error_of):
    assert message in error_of(prescribed_field, surface, 4, vertex, index)


def test_multiples_of_loops_end_with_a_matrix_of_rounding_errors():
    # Of a mesh whose faces are far too large for its singularities: the energy had no least value.
    matrix = np.array([[0.00060347, -0.00141453], [-0.03459111, 0.14504907]])
    sums = np.array([-25.94447767, 87.74193075])
    coefficients = turning_angles._nearest_lattice_coefficients(matrix, sums, np.pi / 2)
    assert np.isfinite(coefficients).all()


# --- missing singularities ------------------------------------------------------------------------


def energy_of(surface, degree, vertex, index):
    return dirichlet_energy(surface, prescribed_field(surface, degree, vertex, index))


def test_what_is_missing_costs_as_much_as_at_the_opposite_point():
    """With one singularity of index 1 on a sphere, the other one belongs there."""
    ball = icosphere(4)
    vertex, index = cheapest_singularities(ball, 1, [7], [1])
    assert vertex[0] == 7 and index.tolist() == [1, 1]
    opposite = int((ball.vertices @ ball.vertices[7]).argmin())
    assert energy_of(ball, 1, vertex, index) < 1.03 * energy_of(ball, 1, [7, opposite], [1, 1])


@pytest.mark.slow
def test_given_ones_stay_and_the_sum_is_right():
    """Also where the smoothest field wants one of the others at the vertex of a given one."""
    random = np.random.default_rng(4)
    for surface, characteristic in ((torus(24, 12), 0), (icosphere(3), 2)):
        for count in (1, 2, 4, 4):
            given = random.choice(len(surface.vertices), count, replace=False)
            sign = random.choice([-1, 1], count)
            vertex, index = cheapest_singularities(surface, 4, given, sign)
            assert vertex[:count].tolist() == given.tolist()
            assert index[:count].tolist() == sign.tolist()
            assert len(set(vertex.tolist())) == len(vertex)
            assert index.sum() == 4 * characteristic


@pytest.mark.parametrize("points, faces", [awkward.octahedron(), awkward.cube()], ids=["8", "6"])
def test_given_ones_are_found_on_few_faces_or_refused(points, faces):
    """Where all neighbors of a given vertex are singular, what is added stayed at the given one."""
    random, made = np.random.default_rng(5), 0
    surface = Surface(points, faces)
    for _ in range(40):
        given = random.permutation(len(points))[: random.integers(1, 4)]
        index, degree = random.integers(-1, 3, len(given)), int(random.choice([1, 2, 4, 6]))
        settings = GeneratorSettings("prescribed", singularities=(given, index), add_missing=True)
        try:
            field = generate(surface, settings, degree)
        except RosyError:
            continue
        found = np.zeros(len(points), dtype=int)
        vertex, found_index = find_singularities(surface, field)
        found[vertex] = found_index
        assert found[given].tolist() == index.tolist()
        made += 1
    assert made > 10


def test_one_given_costs_no_more_than_the_smoothest_field():
    """The sphere can be turned so that one of its singularities is there."""
    ball = icosphere(4)
    vertex, index = cheapest_singularities(ball, 4, [7], [1])
    assert index.tolist() == [1] * 8
    energy = energy_of(ball, 4, vertex, index)
    # The search places the singularities on the eigenvector; the smoothest field has moved them further.
    assert energy < 1.1 * dirichlet_energy(ball, smoothest_field(ball, 4))


def test_a_field_with_a_border_needs_no_more():
    tube = cylinder(24, 12)
    given = np.array([150]), np.array([1])
    settings = GeneratorSettings("prescribed", singularities=given, add_missing=True)
    vertex, index = find_singularities(tube, generate(tube, settings, 4))
    assert vertex.tolist() == [150] and index.tolist() == [1]
