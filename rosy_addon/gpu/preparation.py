"""Preparation of a picture: compiling shaders, and computing data of meshes and sending it to the device."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from ..worker.job import Call, Step, Steps
from .device import Device
from .passes import ComputePass, RasterPass

#: Computations of at most this many seconds are made in Blender's process: less than a redraw takes.
IN_PLACE_SECONDS = 0.05


class Preparation(NamedTuple):
    """A computation whose result is then sent to the device.

    Attributes
    ----------
    call : Call
        The function call that computes the result. It has a label, which the user sees meanwhile.
    seconds : float
        Approximate time that the call takes.
    send : callable
        Function that sends the result of the call to the device and returns the handle of the data there.
    """

    call: Call
    seconds: float
    send: Callable[[Any], Any]


def prepare_steps(
    lookups: Iterable[Callable[[], Any]],
    device: Device | None = None,
    shaders: Sequence[ComputePass | RasterPass] = (),
) -> Steps[list[Any]]:
    """Look up handles of data on the device, and prepare the data that is not there yet.

    Parameters
    ----------
    lookups : iterable of callable
        Functions without arguments. Each returns a handle, or a `Preparation` if the data is not there.
    device : Device, optional
        The device on which the shaders are compiled.
    shaders : sequence of ComputePass or RasterPass
        Shaders to compile first, unless they are compiled already.

    Yields
    ------
    Call or Step
        A `Call` that takes longer than `IN_PLACE_SECONDS`: the caller makes it, and passes the result to
        ``send`` of this generator. Before a shorter call, a `Step` with its label: the generator makes the
        call itself.

    Returns
    -------
    list
        The handles, in the order of `lookups`.
    """
    for index, shader in enumerate(shaders):
        if not device.is_compiled(shader):
            yield Step(index / len(shaders), "compiling shaders")
            device.compile(shader)
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
