"""What is done before a picture: shaders are compiled, and meshes prepared for the device."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

from ..worker.job import Call, Step, Steps
from .device import Device
from .passes import ComputePass, RasterPass

#: Seconds that may be computed in Blender's process: less than a redraw takes.
IN_PLACE_SECONDS = 0.05


class Preparation(NamedTuple):
    """Something that has to be computed, and is then sent to the device.

    Attributes
    ----------
    call : Call
        Computes it. It has a label.
    seconds : float
        About how long that takes. 0 for what only Blender's process can do.
    send : callable
        Sends the result of the call to the device and returns the handle.
    """

    call: Call
    seconds: float
    send: Callable[[Any], Any]


def prepare_steps(lookups: Iterable[Callable[[], Any]]) -> Steps[list[Any]]:
    """Look up handles, and prepare those that are not there yet.

    Parameters
    ----------
    lookups : iterable of callable
        Each returns a handle or a `Preparation`, given what was prepared before.

    Yields
    ------
    Call or Step
        A call if it takes long. Otherwise the call is made here.

    Returns
    -------
    list
        The handles.
    """
    handles = []
    for look_up in lookups:
        found = look_up()
        if isinstance(found, Preparation):
            call = found.call
            if found.seconds > IN_PLACE_SECONDS:
                answer = yield call
            else:
                yield Step(call.start, call.label or "")
                answer = call()
            found = found.send(answer)
        handles.append(found)
    return handles


def compile_lookups(
    device: Device, shaders: Sequence[ComputePass | RasterPass]
) -> list[Callable[[], Preparation | None]]:
    """Return a function for each shader that looks up whether it is compiled."""
    count = len(shaders)
    return [
        partial(_compilation, device, shader, index / count) for index, shader in enumerate(shaders)
    ]


def _compilation(
    device: Device, shader: ComputePass | RasterPass, fraction: float
) -> Preparation | None:
    if device.is_compiled(shader):
        return None
    call = Call(device.compile, (shader,), fraction, fraction, "compiling shaders")
    return Preparation(call, 0.0, lambda _: None)
