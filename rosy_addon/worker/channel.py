"""Messages between a process and its helper process: pickles, with large arrays sent without a copy.

Meshes and fields are sent once. Later messages refer to them by number. So a request for the same meshes with
another look takes only a few kilobytes. The other process gets the same Python objects again, and finds them
in its caches, which compare meshes by identity.
"""

import io
import pickle
import time
from collections.abc import Iterator
from dataclasses import fields
from itertools import count
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np

from ..compositor.target_tone import ReferenceRender
from ..field.guided_system import GuidedSystem
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from .start import PACKAGE

#: Classes of large, immutable objects. The other process keeps objects of these classes for later messages.
KEPT_CLASSES = (GuidedSystem, MeshInstance, ReferenceRender, RosyField, Surface, SurfaceTone)

#: Largest number of bytes of an array that are sent at once.
CHUNK_BYTES = 1 << 20


class Message(NamedTuple):
    """A message as it is received.

    Attributes
    ----------
    forgotten : list of int
        Numbers of kept objects that this process can drop.
    stream : bytes
        The pickle, without the data of arrays.
    buffers : list of (n,) uint8 ndarray
        The bytes of the arrays of the pickle.
    """

    forgotten: list[int]
    stream: bytes
    buffers: list[np.ndarray]


class Channel:
    """One end of a connection to another process of this package.

    Parameters
    ----------
    connection : Connection
    package : str
        Name of this package in the other process.
    """

    def __init__(self, connection: Connection, package: str) -> None:
        self.connection = connection
        self._package = package
        #: Objects that the other process keeps, by id, each with its number there.
        self._sent: dict[int, tuple[int, Any]] = {}
        self._numbers = count()
        #: Objects that this process keeps, as later messages may refer to them, by number.
        self._kept: dict[int, Any] = {}
        #: The generator that receives messages in parts, and the next message. The message is None until
        #: it is complete.
        self._parts = _message_parts(connection)
        self._message: Message | None = None

    def has_received(self, seconds: float) -> bool:
        """Receive parts of the next message that are available, for some seconds.

        Return whether it is complete.

        Raises
        ------
        EOFError, OSError
            If the other process has ended.
        """
        deadline = time.monotonic() + seconds
        while self._message is None and self.connection.poll():
            self._message = next(self._parts)
            if time.monotonic() > deadline:
                break
        return self._message is not None

    def send(self, message: Any) -> None:
        """Send an object to the other process.

        The other process then keeps only those objects of `KEPT_CLASSES` that this message contains.

        Raises
        ------
        OSError
            If the other process has ended.
        """
        pickler = _Pickler(self._sent, self._numbers)
        pickler.dump(message)
        forgotten = [number for key, (number, _) in self._sent.items() if key not in pickler.used]
        arrays = [buffer.raw() for buffer in pickler.buffers]
        self.connection.send((forgotten, [array.nbytes for array in arrays]))
        self.connection.send_bytes(pickler.stream.getbuffer())
        for array in arrays:
            for start in range(0, array.nbytes, CHUNK_BYTES):
                self.connection.send_bytes(array[start : start + CHUNK_BYTES])
        self._sent = pickler.used

    def receive(self) -> Any:
        """Wait for the next object from the other process, and return it.

        Raises
        ------
        EOFError, OSError
            If the other process has ended.
        """
        while self._message is None:
            self._message = next(self._parts)
        (forgotten, stream, buffers), self._message = self._message, None
        for number in forgotten:
            del self._kept[number]
        return _Unpickler(stream, buffers, self._kept, self._package).load()


def _message_parts(connection: Connection) -> Iterator[Message | None]:
    """Receive messages in parts of up to `CHUNK_BYTES`.

    Yields
    ------
    Message or None
        None before the next part of a message is waited for; the message after its last part.
    """
    while True:
        forgotten, sizes = connection.recv()
        yield None
        stream = connection.recv_bytes()
        buffers = [np.empty(size, dtype=np.uint8) for size in sizes]
        for buffer in buffers:
            position = 0
            while position < len(buffer):
                yield None
                position += connection.recv_bytes_into(buffer, position)
        yield Message(forgotten, stream, buffers)


class _Pickler(pickle.Pickler):
    """A pickler that writes a number in place of each object that the other process keeps.

    An object of `KEPT_CLASSES` that is sent for the first time is written as a new number, its class and its
    fields. Cached properties are left out.

    Attributes
    ----------
    stream : io.BytesIO
        The pickle, without the data of arrays.
    buffers : list of pickle.PickleBuffer
        The data of the arrays.
    used : dict of int to (int, object)
        Objects of `KEPT_CLASSES` in the message, by id, each with its number.
    """

    def __init__(self, sent: dict[int, tuple[int, Any]], numbers: Iterator[int]) -> None:
        self.stream, self.buffers = io.BytesIO(), []
        super().__init__(self.stream, 5, buffer_callback=self.buffers.append)
        self._sent, self._numbers = sent, numbers
        self.used: dict[int, tuple[int, Any]] = {}

    def persistent_id(self, obj: Any) -> int | tuple[int, type, dict[str, Any]] | None:
        """Return what the pickle holds in place of an object of `KEPT_CLASSES`; None for other objects.

        The first time, this is a new number, the class and the attributes; after that, the number alone.
        """
        if not isinstance(obj, KEPT_CLASSES):
            return None
        self._use(id(obj))
        if id(obj) in self.used:
            return self.used[id(obj)][0]
        number = next(self._numbers)
        self.used[id(obj)] = number, obj
        return number, type(obj), {field.name: getattr(obj, field.name) for field in fields(obj)}

    def _use(self, key: int) -> None:
        """Record that the message contains an object that was sent before, and the objects in its fields.

        `key` is the id of the object. Nothing is recorded if the object was not sent before.
        """
        if key in self._sent:
            self.used[key] = self._sent[key]
            for value in vars(self._sent[key][1]).values():
                self._use(id(value))


class _Unpickler(pickle.Unpickler):
    """An unpickler that keeps the objects that `_Pickler` has numbered, and returns them for their numbers.

    It also replaces the name of this package in the other process by its name in this process.
    """

    def __init__(
        self, stream: bytes, buffers: list[np.ndarray], kept: dict[int, Any], package: str
    ) -> None:
        super().__init__(io.BytesIO(stream), buffers=buffers)
        self._kept, self._package = kept, package

    def persistent_load(self, written: Any) -> Any:
        """Return the object for what `_Pickler.persistent_id` has returned."""
        if isinstance(written, int):
            return self._kept[written]
        number, kind, state = written
        self._kept[number] = kept = object.__new__(kind)
        vars(kept).update(state)
        return kept

    def find_class(self, module: str, name: str) -> Any:
        """Return a class or function, given its module in the other process and its name."""
        if module == self._package or module.startswith(f"{self._package}."):
            module = PACKAGE + module.removeprefix(self._package)
        return super().find_class(module, name)
