"""A cache of results. The key of a result consists of all inputs on which it depends.

So cached results cannot be out of date. Settings are in the key by value,
arrays by `content_hash`, and immutable objects (meshes, fields, G-buffers) by identity.
"""

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import is_dataclass
from typing import Any, TypeVar

import numpy as np

Result = TypeVar("Result")

#: Default size limit of a cache, in bytes. Baking a character at 1920 x 1080 pixels takes a third of it.
MAX_BYTES = 1 << 29


class Cache:
    """A least-recently-used cache of results by their keys, with a size limit in bytes.

    A key may contain objects that compare by identity, such as instances of frozen dataclasses with
    ``eq=False``. The cache keeps them alive, so that no other object can have the same identity.

    Nothing is evicted until one of the `evict_` methods is called.

    Parameters
    ----------
    max_bytes : int
        Limit for the total size of all arrays in keys and results, in bytes. `evict_over_limit` enforces it.
    """

    def __init__(self, max_bytes: int = MAX_BYTES) -> None:
        self._max_bytes = max_bytes
        self._entries: OrderedDict[Hashable, Any] = OrderedDict()
        self._used: set[Hashable] = set()

    def get(self, key: Hashable) -> Any | None:
        """Return the result of a key, or None if the cache does not have it."""
        if key not in self._entries:
            return None
        self._entries.move_to_end(key)
        self._used.add(key)
        return self._entries[key]

    def put(self, key: Hashable, result: Result) -> Result:
        """Store a result under a key, and return the result."""
        self._entries[key] = result
        self._used.add(key)
        return result

    def get_or_create(self, key: Hashable, create: Callable[[], Result]) -> Result:
        """Return the result of a key. If the cache does not have it, call `create` and store what it returns.

        `create` must not return None, as None would be created again at every call.
        """
        cached = self.get(key)
        return self.put(key, create()) if cached is None else cached

    def evict_over_limit(self) -> None:
        """Remove the least recently used results until the others are within the size limit.

        The size of a result is the size of all arrays in its key and in the result itself. Arrays that
        several results share are counted once.
        """
        visited: set[int] = set()
        total = 0
        for key in reversed(list(self._entries)):
            total += _array_bytes(key, visited) + _array_bytes(self._entries[key], visited)
            if total > self._max_bytes:
                del self._entries[key]
                self._used.discard(key)

    def evict_unused(self) -> None:
        """Remove the results that were neither stored nor returned since the last call of this method."""
        for key in [key for key in self._entries if key not in self._used]:
            del self._entries[key]
        self._used.clear()

    def clear(self) -> None:
        """Remove all results."""
        self._entries.clear()
        self._used.clear()

    def __len__(self) -> int:
        return len(self._entries)


#: The cache that all bakes of one Blender process share.
BAKE_CACHE = Cache()


def cached(cache: Cache | None, create: Callable[[], Result], *parts: object) -> Result:
    """Return what `create` returns, from a cache if one is given.

    Parameters
    ----------
    cache : Cache or None
        None to call `create` every time.
    create : callable
        Function without arguments that computes the result, which must not be None. It is called if the cache
        does not have the result.
    *parts : object
        The key: all inputs on which the result depends. Arrays are replaced by their `content_hash`.
    """
    if cache is None:
        return create()
    key = tuple(content_hash(part) if isinstance(part, np.ndarray) else part for part in parts)
    return cache.get_or_create(key, create)


def content_hash(*parts: object) -> bytes:
    """Return a SHA-1 digest of arrays (shape, dtype, bytes) and of other objects (their repr)."""
    hasher = hashlib.sha1(usedforsecurity=False)  # many processors have instructions for SHA-1
    for part in parts:
        if isinstance(part, np.ndarray):
            hasher.update(f"{part.shape}{part.dtype}".encode())
            hasher.update(np.ascontiguousarray(part))
        else:
            hasher.update(repr(part).encode())
        hasher.update(b"|")
    return hasher.digest()


def _array_bytes(obj: Any, visited: set[int]) -> int:
    """Return the size of all arrays in an object in bytes. Objects that were visited before are not counted.

    `visited` holds the ids of visited objects and is updated. For a view of an array, the size of the whole
    array is counted.
    """
    if id(obj) in visited:
        return 0
    visited.add(id(obj))
    if isinstance(obj, np.ndarray):
        return obj.nbytes if obj.base is None else _array_bytes(obj.base, visited)
    if isinstance(obj, dict):
        obj = obj.values()
    elif is_dataclass(obj):
        obj = vars(obj).values()  # with cached properties, which are not fields
    elif not isinstance(obj, (list, tuple)):
        return 0
    return sum(_array_bytes(part, visited) for part in obj)
