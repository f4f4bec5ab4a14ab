"""Noise that is carried along the sheets of the covering: the method "ibfv" of `compositor.ibfv`.

The sums and origins of all states are images with a layer for each sheet. Each pass doubles the number of
steps of the sums, and reads one pair of images to write the other.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from typing import Any

import numpy as np

from ..compositor.even_lines import has_even_lines
from ..compositor.filter_kernel import look_for_symmetry
from ..compositor.hatching import has_breaks
from ..compositor.ibfv import doubling_count
from ..compositor.look import Look, has_flow
from ..errors import RosyError
from ..progress import Progress, Task
from . import passes
from .field_kind import FieldKind
from .frame import Frame
from .screen_box import Box
from .uniforms import doubling_uniforms

#: Bytes of a state: its sums and its origin, in two images each.
STATE_BYTES = 2 * (8 + 8)

#: Maximum size of the states of a frame. Cards have little more memory than this beside that of a window
#: system and of the other images.
MAX_STATE_BYTES = 1 << 31

#: Label of all steps of this stage.
STEP_LABEL = "carrying noise"


def ibfv_obstacle(look: Look) -> str | None:
    """Return what a look with the method "ibfv" has that the shaders do not draw by it, if anything."""
    if not has_breaks(look):
        return None
    if has_even_lines(look):
        return "breaks or wobble of even lines"
    # A texel has the sums of one image, and of one more channel.
    if has_flow(look):
        return "breaks or wobble of streaks that drift"
    return "breaks or wobble of colored noise" if look.noise == "colour" else None


def is_carried(look: Look) -> bool:
    """Return whether the streaks of a look are drawn by this method. Others are traced."""
    return look.method == "ibfv" and not has_even_lines(look) and ibfv_obstacle(look) is None


def states_fit(size: tuple[int, int], degree: int) -> bool:
    """Return whether the states of a field of N directions fit into the memory of a card.

    Parameters
    ----------
    size : (int, int)
        Width and height of the frame, in pixels.
    degree : int
        N, which is also the number of sheets that streaks come along.
    """
    return size[0] * size[1] * degree * STATE_BYTES <= MAX_STATE_BYTES


def check_states(look: Look, size: tuple[int, int], degree: int) -> None:
    """Raise an error if a look needs the states of a frame, and these do not fit.

    Parameters
    ----------
    look : Look
    size, degree
        As for `states_fit`.
    """
    if is_carried(look) and not states_fit(size, degree):
        raise RosyError(
            f"a frame of {size[0]} x {size[1]} pixels with {degree} directions takes too much memory of "
            "the graphics card with the method 'ibfv': choose a smaller size, another method, or the "
            "processor"
        )


def carry_task(
    frame: Frame, kind: FieldKind, box: Box, textures: dict[str, Any], uniforms: dict[str, Any]
) -> Task[Any]:
    """Average the noise upstream of every state of the fields of a kind.

    The sums of the last picture of this size are used again if only the phase of the flow has changed.

    Parameters
    ----------
    frame : Frame
    kind : FieldKind
    box : Box
    textures : dict of str to texture
        Of the LIC pass, and the directions of the covering.
    uniforms : dict
        Of the LIC pass, and `carried_uniforms`.

    Returns
    -------
    texture
        The sums of `IBFV_DOUBLE`: a layer for each sheet.
    """
    yield Progress(0.0, STEP_LABEL)
    variants = [passes.IBFV_DOUBLE.variant({**uniforms, "is_last": last}) for last in (0, 1)]
    yield from frame.resources.device.compile_task(variants)
    pairs = _image_pairs(frame, kind)
    decays = [uniforms["decay"], uniforms["break_decay"] if uniforms["break_steps"] else 0.0]
    doublings = doubling_count(max(decays))
    sums = pairs[doublings % 2]["next_sums"]
    contents, place = frame.resources.contents, id(pairs[0]["next_sums"])
    key = _still_key(frame, kind)
    if contents.get(place) == key:
        return sums
    # Until all is done, the images are only those of this task.
    contents[place] = task_mark = object()
    links = frame.resources.image("links", *frame.size, "R32F")
    frame.run(passes.IBFV_LINKS, box, textures, {"links": links}, uniforms)
    textures = {**textures, "links": links}
    frame.run(passes.IBFV_START, box, textures, pairs[0], uniforms, layers=kind.degree)
    look = look_for_symmetry(frame.look, kind.symmetry)
    for doubling in range(doublings):
        yield Progress(doubling / doublings, STEP_LABEL)
        if contents.get(place) is not task_mark:
            contents.pop(place, None)
        read, written = pairs[doubling % 2], pairs[1 - doubling % 2]
        read_textures = {"state_origins": read["next_origins"], "state_sums": read["next_sums"]}
        frame.run(
            passes.IBFV_DOUBLE,
            box,
            {**textures, **read_textures},
            written,
            {**uniforms, **doubling_uniforms(look, 1 << doubling, doubling == doublings - 1)},
            layers=kind.degree,
        )
    if contents.get(place) is task_mark:
        contents[place] = key
    return sums


def _image_pairs(frame: Frame, kind: FieldKind) -> list[dict[str, Any]]:
    """Return two pairs of images of origins and sums, by their names in shaders."""
    formats = dict(passes.IBFV_DOUBLE.images)
    return [
        {
            name.removesuffix("[]"): frame.resources.image(
                f"{name} {index}", *frame.size, texel_format, kind.degree
            )
            for name, texel_format in formats.items()
        }
        for index in range(2)
    ]


def _still_key(frame: Frame, kind: FieldKind) -> Hashable:
    """Return what the sums depend on: not the phase of the flow, which is applied to them afterwards."""
    camera = frame.camera
    return (
        kind,
        replace(frame.look, flow_phase=0.0),
        (camera.view.tobytes(), camera.projection.tobytes(), frame.size),
        np.asarray(frame.clip_planes).tobytes(),
        tuple(
            (item.mesh, item.kind, item.model_matrix.tobytes(), item.object_scale)
            for item in frame.items
        ),
    )
