"""What one bake leaves for the next: results, found again by what they were made of.

Nothing here can be out of date. Meshes and fields are known by the digest of their arrays, what is
made of them by the objects themselves, which the entry keeps alive.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

Result = TypeVar("Result")

#: Bytes that are kept at most: a bake of a character at 1920 x 1080 takes a third.
LIMIT = 1 << 29


class Kept:
    """Results up to so many bytes, those used longest ago given up first.

    Parameters
    ----------
    limit : int
        Bytes.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self._limit = limit
        self._entries: OrderedDict[Hashable, Any] = OrderedDict()
        self._used: set[Hashable] = set()

    def find(self, key: Hashable) -> Any | None:
        """What was put under a key, None if that is no longer there."""
        if key not in self._entries:
            return None
        self._entries.move_to_end(key)
        self._used.add(key)
        return self._entries[key]

    def put(self, key: Hashable, result: Result) -> Result:
        """Keep a result, and return it."""
        self._entries[key] = result
        self._used.add(key)
        return result

    def find_or_make(self, key: Hashable, make: Callable[[], Result]) -> Result:
        """What was put under a key; made and put there if there is nothing."""
        found = self.find(key)
        return self.put(key, make()) if found is None else found

    def trim(self) -> None:
        """Give up what is over the limit. Results may have grown since they were put."""
        counted: set[int] = set()
        total = 0
        for key in reversed(list(self._entries)):
            total += _size(self._entries[key], counted)
            if total > self._limit:
                del self._entries[key]

    def forget_unused(self) -> None:
        """Give up what was neither put nor found since this was asked for last."""
        for key in [key for key in self._entries if key not in self._used]:
            del self._entries[key]
        self._used.clear()

    def clear(self) -> None:
        """Give up everything."""
        self._entries.clear()
        self._used.clear()

    def __len__(self) -> int:
        return len(self._entries)


#: What bakes keep for each other, as long as Blender runs.
KEPT = Kept()


def digest(*parts: object) -> bytes:
    """A number that tells contents apart: arrays by shape, type and bytes, all else by its repr."""
    number = hashlib.sha1(usedforsecurity=False)  # processors have instructions for it
    for part in parts:
        if isinstance(part, np.ndarray):
            number.update(f"{part.shape}{part.dtype}".encode())
            number.update(np.ascontiguousarray(part))
        else:
            number.update(repr(part).encode())
        number.update(b"|")
    return number.digest()


def _size(thing: object, counted: set[int]) -> int:
    """Bytes of all arrays within, but for those counted before."""
    if id(thing) in counted:
        return 0
    counted.add(id(thing))
    if isinstance(thing, np.ndarray):
        return thing.nbytes if thing.base is None else _size(thing.base, counted)
    if isinstance(thing, (list, tuple)):
        return sum(_size(part, counted) for part in thing)
    if isinstance(thing, dict):
        return sum(_size(part, counted) for part in thing.values())
    if is_dataclass(thing):
        own = {field.name: getattr(thing, field.name) for field in fields(thing)}
        return _size([*{**own, **vars(thing)}.values()], counted)
    return 0
