"""Find angles at the nodes of a graph, given their differences along its edges (angular synchronization).

The unknowns are complex numbers of modulus 1 that minimize the squared error of these differences. They are
smoothed on a hierarchy of graphs, from coarse to fine, like the position fields of Jakob, Tarini, Panozzo and
Sorkine-Hornung, "Instant Field-Aligned Meshes" (SIGGRAPH Asia 2015). An edge may also relate a value to the
complex conjugate of its neighbor's value.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..core.progress import report
from .blocks import run_starts
from .connectivity import sorted_with_order
from .representation import unit_complex

#: Text that is shown with the progress bar.
LABEL = "spacing lines"

#: Number of smoothing steps on the finest level, its factor from a level to the next coarser one, and its
#: largest value.
SMOOTHING_STEPS, STEP_GROWTH, MAX_SMOOTHING_STEPS = 8, 1.5, 100

#: Weight of the old value in a smoothing step, relative to the total weight of all neighbors. It damps oscillations.
INERTIA = 0.3

#: A level is coarsened only if it has more nodes than this, and if the number of nodes shrinks by at least
#: this factor.
MIN_LEVEL_NODES, MIN_COARSENING = 12, 1.1

#: Factor of the multiplicative hash of two nodes: 2^64 divided by the golden ratio.
HASH_FACTOR = 0x9E3779B97F4A7C15

#: Number of rounds in which nodes are paired on a level.
MATCHING_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class PhaseGraph:
    """A graph of n nodes with unknown complex values of modulus 1, and m relations between pairs of nodes.

    Each relation is an *entry*, one element of each of the arrays `row`, `column`, `a` and `b`, as in a
    sparse matrix. It demands that the value at node `row` is ``a z + b conj(z)``, where z is the value at
    node `column`. Its weight is |a| + |b|. For each pair of related nodes, there is an entry in both
    directions.

    Attributes
    ----------
    node_count : int
        n.
    row, column : (m,) int64 ndarray
        The two nodes of each entry. Entries are sorted by row.
    a, b : (m,) complex128 ndarray
        The factors of each entry.
    """

    node_count: int
    row: np.ndarray
    column: np.ndarray
    a: np.ndarray
    b: np.ndarray

    @cached_property
    def row_start(self) -> np.ndarray:
        """Index of the first entry of each row, for the rows (nodes) that have entries."""
        return run_starts(self.row)

    @cached_property
    def strength(self) -> np.ndarray:
        """(m,) float64: the weight |a| + |b| of each relation between two nodes, with its factors `a` and `b`."""
        return np.abs(self.a) + np.abs(self.b)

    @cached_property
    def conjugating(self) -> np.ndarray:
        """Indices of the entries in which b is not 0."""
        return np.flatnonzero(self.b)


def phase_graph(
    node_count: int, row: np.ndarray, column: np.ndarray, a: np.ndarray, b: np.ndarray
) -> PhaseGraph:
    """Return a `PhaseGraph`, given its entries in any order.

    `row`, `column`, `a` and `b` have one element for each entry, as in `PhaseGraph`. Entries with the same
    row and column are added. Entries on the diagonal are left out.
    """
    entry = np.flatnonzero(row != column)
    key = row[entry].astype(np.int64) * node_count + column[entry]
    key, order = sorted_with_order(key, max(node_count, 1) ** 2)
    entry = entry[order]
    first = run_starts(key)
    if len(first):
        a, b = (np.add.reduceat(values.take(entry), first) for values in (a, b))
    row, column = np.divmod(key[first], max(node_count, 1))
    return PhaseGraph(node_count, row, column, a[: len(row)], b[: len(row)])


def synchronize(graph: PhaseGraph, depth: int = 0) -> np.ndarray:
    """Return (n,) complex128 values of modulus 1, one for each node, that nearly satisfy all relations.

    First, the nodes are grouped into clusters, and this function is called for the graph of the clusters. Its
    result gives the initial values of the nodes, which are then smoothed. `depth` counts these recursive
    calls; other callers leave it 0.
    """
    clustering = _clustering(graph) if graph.node_count > MIN_LEVEL_NODES else None
    if clustering is None or clustering.count * MIN_COARSENING > graph.node_count:
        z = np.ones(graph.node_count, dtype=np.complex128)
    else:
        z = synchronize(_coarse_graph(graph, clustering), depth + 1)[clustering.cluster]
        z = clustering.p * z + clustering.q * z.conj()
    inertia = np.zeros(graph.node_count)
    rows = graph.row[graph.row_start]
    inertia[rows] = INERTIA * np.add.reduceat(graph.strength, graph.row_start)
    for _ in range(int(min(SMOOTHING_STEPS * STEP_GROWTH**depth, MAX_SMOOTHING_STEPS))):
        report(0.8**depth, LABEL)
        z = _smoothed(graph, z, inertia)
    return z


def _smoothed(graph: PhaseGraph, z: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Return the values after a smoothing step: weighted means, normalized to modulus 1.

    `z` holds the (n,) old values. Each mean is over the values that the entries of a node demand, and over
    its old value. `inertia` holds the (n,) weights of the old values.
    """
    neighbor = z.take(graph.column)
    terms = graph.a * neighbor
    conjugating = graph.conjugating
    terms[conjugating] += graph.b[conjugating] * neighbor[conjugating].conj()
    total = inertia * z
    total[graph.row[graph.row_start]] += np.add.reduceat(terms, graph.row_start)
    modulus = np.sqrt(total.real**2 + total.imag**2)
    return np.divide(total, modulus, out=z.copy(), where=modulus > 0)


class _Clustering(NamedTuple):
    """Clusters of nodes. The values of all nodes of a cluster follow from one value z of the cluster.

    Attributes
    ----------
    cluster : (n,) int ndarray
        Cluster of each node.
    p, q : (n,) complex128 ndarray
        The value of a node is p z + q conj(z). One of p and q is 0, and the other has the modulus 1.
    count : int
        Number of clusters.
    """

    cluster: np.ndarray
    p: np.ndarray
    q: np.ndarray
    count: int


def _clustering(graph: PhaseGraph) -> _Clustering:
    """Group the nodes of a graph into clusters: pairs along strong entries, and nodes that join a pair.

    A node without a partner joins the pair of a neighbor that is the first node of its pair. If there is no
    such neighbor, the node is a cluster of its own.
    """
    count = graph.node_count
    # A random factor makes the strengths distinct, so that many nodes find a partner in each round.
    low, high = np.minimum(graph.row, graph.column), np.maximum(graph.row, graph.column)
    hashed = (low * count + high).astype(np.uint64) * np.uint64(HASH_FACTOR)
    strength = graph.strength * (1 + 0.5 * (hashed >> np.uint64(40)).astype(np.float64) / 2**24)
    partner, link = np.full((2, count), -1, dtype=np.int64)
    nodes = np.arange(count)
    entry = np.arange(len(graph.row))
    for _ in range(MATCHING_ROUNDS):
        entry = entry[(partner[graph.row[entry]] < 0) & (partner[graph.column[entry]] < 0)]
        chosen = _strongest_of_row(graph.row, strength, entry)
        chooser, choice = graph.row[chosen], np.full(count, -1, dtype=np.int64)
        choice[chooser] = graph.column[chosen]
        mutual = choice[choice[chooser]] == chooser
        partner[chooser[mutual]] = choice[chooser[mutual]]
        link[chooser[mutual]] = chosen[mutual]
    # The first node of a pair is the root of its cluster. The values of the second node and of single
    # neighbors of the root follow from the value of the root.
    is_root = (partner < 0) | (partner > nodes)
    root = np.where(is_root, nodes, partner)
    joins = np.flatnonzero((partner[graph.row] < 0) & (partner[graph.column] > graph.column))
    if len(joins):
        chosen = _strongest_of_row(graph.row, strength, joins)
        root[graph.row[chosen]] = graph.column[chosen]
        link[graph.row[chosen]] = chosen
        is_root[graph.row[chosen]] = False
    p, q = np.ones(count, dtype=np.complex128), np.zeros(count, dtype=np.complex128)
    follower = np.flatnonzero(~is_root)
    a, b = graph.a[link[follower]], graph.b[link[follower]]
    keeps = np.abs(a) >= np.abs(b)
    value = unit_complex(np.where(keeps, a, b), otherwise=1)
    p[follower], q[follower] = np.where(keeps, value, 0), np.where(keeps, 0, value)
    return _Clustering((np.cumsum(is_root) - 1)[root], p, q, int(np.count_nonzero(is_root)))


def _strongest_of_row(row: np.ndarray, strength: np.ndarray, entry: np.ndarray) -> np.ndarray:
    """Return the index of the strongest given entry of each row that has one of them.

    `row` and `strength` hold the row and the strength of all entries of a graph. `entry` holds the indices of
    the given entries, in ascending order.
    """
    first = run_starts(row[entry])
    largest = np.maximum.reduceat(strength[entry], first)
    is_largest = strength[entry] == np.repeat(largest, np.diff(first, append=len(entry)))
    candidate = entry[is_largest]
    return candidate[run_starts(row[candidate])]


def _coarse_graph(graph: PhaseGraph, clustering: _Clustering) -> PhaseGraph:
    """Return the graph whose nodes are the clusters.

    It has the entries between different clusters, changed so that they relate the values of the clusters.
    """
    cluster, p, q, count = clustering
    row, column = cluster[graph.row], cluster[graph.column]
    entry = np.flatnonzero(row != column)
    tail, head = graph.column[entry], graph.row[entry]
    a, b = graph.a[entry], graph.b[entry]
    # Replace the value at the column by the value of its cluster.
    a, b = a * p[tail] + b * q[tail].conj(), a * q[tail] + b * p[tail].conj()
    # Replace the value at the row. The inverse of z -> p z is z -> conj(p) z, and z -> q conj(z) is its own
    # inverse.
    a, b = p[head].conj() * a + q[head] * b.conj(), p[head].conj() * b + q[head] * a.conj()
    return phase_graph(count, row[entry], column[entry], a, b)
