"""The cache: what it keeps, and by which keys."""

import weakref

import numpy as np

from rosy_addon.core.cache import Cache, content_hash


def test_the_least_recently_used_entries_are_evicted():
    cache = Cache(max_bytes=10_000)
    for number in range(5):
        cache.put(number, np.zeros(500))
    assert cache.get(0) is not None
    cache.evict_over_limit()
    assert [number for number in range(5) if cache.get(number) is not None] == [0, 4]


def test_evicted_entries_are_not_kept_alive():
    """Keys hold G-buffers and meshes."""

    class Mesh:
        pass

    cache, mesh = Cache(max_bytes=0), Mesh()
    cache.put(mesh, np.zeros(10))
    reference = weakref.ref(mesh)
    del mesh
    cache.evict_over_limit()
    assert not len(cache) and reference() is None


def test_a_shared_array_counts_once():
    cache = Cache(max_bytes=10_000)
    array = np.zeros(1000)
    for number in range(5):
        cache.put(number, [array, array[:10]])
    cache.evict_over_limit()
    assert len(cache) == 5


def test_hashes_of_different_contents_differ():
    array = np.arange(6.0)
    assert content_hash(array) == content_hash(array.copy())
    close = array + 1e-16 * np.arange(6) ** 2 + np.spacing(array)
    others = (array.reshape(2, 3), array.astype(np.float32), array[::-1], close)
    assert len({content_hash(array), *map(content_hash, others)}) == 5
    assert content_hash("ab", "c") != content_hash("a", "bc")
    assert content_hash(None) != content_hash("")
