"""The smoothest field of degree N: Knöppel, Crane, Pinkall and Schröder, SIGGRAPH 2013.

It is the smallest eigenvector of the connection Laplacian raised to the power N, found on vertices
and carried to the faces. Pieces of a mesh that hang together by nothing have each their own.
"""

from __future__ import annotations

import numpy as np

from ..errors import RosyError
from ..memory import keep_freed_memory
from ..progress import Progress, Work, drain, part
from .connection import Connection, connect, laplacian
from .frames import dot
from .representation import complex_sums, face_frames, from_representation
from .rosy_field import RosyField, check_degree
from .sparse import Level, cycle, hierarchy
from .surface import Surface

#: Change of the eigenvector, as a sine, at which it counts as found: its energy is, to eight digits.
#: Of fewer nodes than `FEW` more is asked, so that the field is the same however they are numbered;
#: of more it would take seconds to tell almost equal eigenvectors apart, and nobody would see it.
FOUND, FINELY_FOUND, FEW = 1e-4, 1e-8, 30_000
MOST_ROUNDS = 60

#: Triangles that are worked on at once: bounds memory, and fits the caches.
BLOCK = 1 << 14

#: Rounds on coarser levels, which save some on the finest.
COARSE_ROUNDS = 12

#: Of the matrix that multigrid inverts, in eigenvalues of a sphere of the same area.
SHIFT = 0.02


def smoothest_field(surface: Surface, degree: int) -> RosyField:
    """The smoothest field; see `finding_smoothest`."""
    return drain(finding_smoothest(surface, degree))


def finding_smoothest(surface: Surface, degree: int) -> Work[RosyField]:
    """Find the unit field of the least Dirichlet energy among those of one mean square.

    Parameters
    ----------
    surface : Surface
    degree : int

    Yields
    ------
    Progress

    Returns
    -------
    RosyField
        Of magnitude 1; 0 on faces without area. Turned as a whole so that it best follows the
        edges of the mesh, as any angle would do.

    Raises
    ------
    RosyError
        If no face has an area.
    """
    degree = check_degree(degree)
    keep_freed_memory()
    yield Progress(0.0, "connecting the vertices")
    connection = connect(surface)
    if not connection.mass.any():
        raise RosyError(f"{surface.name}: no face has an area, so there is no room for a field")
    z, _ = yield from part(smallest(connection, degree), 0.1, 0.95)
    z = _along_edges(connection, z, degree)
    yield Progress(0.95, "carrying the field to the faces")
    return RosyField(degree, vectors_on_faces(surface, connection, z, degree))


def smallest(connection: Connection, degree: int) -> Work[tuple[np.ndarray, np.ndarray]]:
    """The smallest eigenvectors of L z = e M z, of each connected piece.

    Returns
    -------
    z : (n,) complex128 ndarray
        At the nodes; of mean square 1 over each piece.
    energy : (pieces,) float64 ndarray
        e.
    """
    piece = connection.piece
    mass = np.maximum(connection.mass, 1e-12 * max(float(connection.mass.mean()), 1e-300))
    shift = SHIFT * 4 * np.pi / mass.sum()
    levels = yield from part(hierarchy(laplacian(connection, degree, shift)), 0.1, 0.4)
    masses, pieces = [mass], [piece]
    for level in levels[:-1]:
        share = np.abs(level.prolongation.value)
        column = level.prolongation.column
        coarse = len(levels[len(masses)].matrix)
        masses.append(np.bincount(column, masses[-1][level.prolongation.row] * share, coarse))
        below = np.zeros(coarse, dtype=piece.dtype)
        below[column] = pieces[-1][level.prolongation.row]
        pieces.append(below)
    random = np.random.default_rng(0)
    count = len(masses[-1])
    z = random.standard_normal(count) + 1j * random.standard_normal(count)
    for number in reversed(range(len(levels))):
        last = number == 0
        rounds = MOST_ROUNDS if last or number == len(levels) - 1 else COARSE_ROUNDS
        descent = _descend(levels[number:], masses[number], pieces[number], z, rounds)
        start = 0.5 - 0.1 * number / len(levels)
        z, energy = yield from part(descent, start, start + 0.1 / len(levels) if number else 1.0)
        if not last:
            z = levels[number - 1].prolongation @ z
    return z, energy - shift


def _descend(
    levels: list[Level], mass: np.ndarray, piece: np.ndarray, z: np.ndarray, rounds: int
) -> Work[tuple[np.ndarray, np.ndarray]]:
    """Locally optimal descent of the Rayleigh quotient of each piece (Knyazev 2001)."""
    matrix, count = levels[0].matrix, int(piece.max()) + 1
    goal = FOUND if len(matrix) > FEW else FINELY_FOUND

    def products(a: list[np.ndarray], b: list[np.ndarray]) -> np.ndarray:
        """(pieces, k, k) a_i* b_j of each piece, a Hermitian matrix."""
        found = np.empty((count, len(a), len(b)), dtype=np.complex128)
        for i, one in enumerate(a):
            one = one.conj()
            for j in range(i, len(b)):
                found[:, i, j] = _sums(piece, one * b[j], count)
                found[:, j, i] = found[:, i, j].conj()
        return found

    def spread(values: np.ndarray) -> np.ndarray:
        """Of each piece, to its nodes."""
        return values[piece] if count > 1 else values

    def scaled(vector: np.ndarray, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """In place."""
        size = np.sqrt(_sums(piece, mass * (vector.real**2 + vector.imag**2), count).real)
        factor = spread(1 / np.where(size > 0, size, 1))
        vector *= factor
        image *= factor
        return vector, image

    def mixed(vectors: list[np.ndarray], mixing: np.ndarray) -> np.ndarray:
        total = vectors[0] * spread(mixing[:, 0])
        for number, vector in enumerate(vectors[1:], 1):
            total += vector * spread(mixing[:, number])
        return total

    z, image = scaled(z, matrix @ z)
    ahead: list[tuple[np.ndarray, np.ndarray]] = []
    energy = _sums(piece, z.conj() * image, count).real
    for number in range(rounds):
        # Twenty to fifty rounds are usual.
        yield Progress(1 - 0.95**number, "finding the smoothest field")
        rest = image - spread(energy) * (mass * z)
        way = cycle(levels, rest)
        way -= spread(_sums(piece, mass * (z.conj() * way), count)) * z
        step = scaled(way, matrix @ way)
        basis = [(z, image), step, *ahead]
        vectors, images = [one for one, _ in basis], [one for _, one in basis]
        weighted = [mass * one for one in vectors]
        mixing, energy = _lowest(products(vectors, images), products(vectors, weighted))
        own = np.stack([mixing[:, 0], np.ones(count)], axis=1)
        z_change, i_change = mixed(vectors[1:], mixing[:, 1:]), mixed(images[1:], mixing[:, 1:])
        change = np.sqrt(
            _sums(piece, mass * (z_change.real**2 + z_change.imag**2), count).real.max()
        )
        z, image = mixed([z, z_change], own), mixed([image, i_change], own)
        z, image = scaled(z, image)
        ahead = [scaled(z_change, i_change)]
        if change < goal:
            break
    return z, energy


def _lowest(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(pieces, k) smallest eigenvectors and (pieces,) eigenvalues of small pencils A x = e B x.

    Directions in which B is nearly singular are left out.
    """
    size, basis = np.linalg.eigh(b)
    usable = size > 1e-10 * size[:, -1:]
    white = basis * np.where(usable, 1 / np.sqrt(np.where(usable, size, 1)), 0)[:, None, :]
    inner = white.conj().swapaxes(1, 2) @ a @ white
    top = np.abs(inner).max(axis=(1, 2)) * 10 + 1
    inner += np.einsum("pk,kl->pkl", np.where(usable, 0, top[:, None]), np.eye(a.shape[1]))
    energy, found = np.linalg.eigh(inner)
    mixing = (white @ found[:, :, :1])[:, :, 0]
    # A real share of the vector so far, so that convergence can be seen.
    phase = np.where(mixing[:, 0] == 0, 1, mixing[:, 0])
    return mixing * (np.abs(phase) / phase)[:, None], energy[:, 0]


def _sums(piece: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) complex sums over each piece."""
    if count == 1:
        return np.array([values.sum()], dtype=np.complex128)
    return complex_sums(piece, values, count)


def _along_edges(connection: Connection, z: np.ndarray, degree: int) -> np.ndarray:
    """The field turned as a whole, each piece alone, so that it best follows the edges.

    An eigenvector may be turned by any angle; this one depends on nothing but the mesh.
    """
    piece = connection.piece
    count = int(piece.max()) + 1
    node = connection.node
    own = np.exp(1j * degree * connection.along) * np.repeat(connection.area, 3)
    total = _sums(piece[node], own * z[node].conj(), count)
    size = np.abs(total)
    turn = np.divide(total, size, out=np.ones_like(total), where=size > 0)
    return z * turn[piece]


def vectors_on_faces(
    surface: Surface, connection: Connection, z: np.ndarray, degree: int
) -> np.ndarray:
    """(F, 3) unit members on the faces of values at the nodes."""
    x, y = face_frames(surface)
    turn = corner_turns(surface, connection, x, y)
    mean = sum_on_faces(surface, connection, z, turn, degree)
    size = np.abs(mean)
    mean = np.divide(mean, size, out=np.zeros_like(mean), where=size > 0)
    return from_representation(mean, x, y, degree)


def corner_turns(
    surface: Surface, connection: Connection, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """(3 T,) radians from the map of each corner's node to the frame x, y of its face.

    The middle of a corner is the same direction in both.
    """
    first = np.empty(surface.triangle_vertex.shape)
    for start in range(0, len(first), BLOCK):
        part = slice(start, start + BLOCK)
        face = surface.triangle_face[part]
        here_x, here_y = x.take(face, axis=0), y.take(face, axis=0)
        points = [surface.vertices.take(v, axis=0) for v in surface.triangle_vertex[part].T]
        for corner in range(3):
            edge = points[(corner + 1) % 3] - points[corner]
            first[part, corner] = np.arctan2(dot(edge, here_y), dot(edge, here_x))
    first = first.ravel()
    first += 0.5 * connection.opening
    first -= connection.middle
    return first


def sum_on_faces(
    surface: Surface, connection: Connection, z: np.ndarray, turn: np.ndarray, degree: int
) -> np.ndarray:
    """(F,) complex: values at the corners of each face, summed with the areas of triangles."""
    total = np.empty((len(connection.area), 3), dtype=np.complex128)
    node, turn = connection.node.reshape(-1, 3), turn.reshape(-1, 3)
    for start in range(0, len(total), BLOCK):
        part = slice(start, start + BLOCK)
        angle = degree * turn[part]
        np.multiply(z.take(node[part]), np.cos(angle) + 1j * np.sin(angle), out=total[part])
        total[part] *= connection.area[part, None]
    return complex_sums(surface.triangle_face, total.sum(axis=1), surface.face_count)
