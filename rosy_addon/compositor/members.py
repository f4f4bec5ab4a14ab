"""The paper's way: the field decomposed into member vector fields, an LIC image of each.

Palacios and Zhang, "Interactive Visualization of Rotational Symmetry Fields on Surfaces", IEEE
TVCG 17(7), 2011, section 4.
"""

from __future__ import annotations

import numpy as np

from ..progress import Work, part
from .flow import Flow, all_members, blend_weights
from .images import Images, Walker, member_images
from .look import Look
from .streamlines import direction_table, interpolate


def members_images(flow: Flow, look: Look, noise: np.ndarray) -> Work[Images]:
    """The two sets of member images and their blend.

    The first set follows V_i, the member nearest to the guiding angle phi + 2 pi i / N; where two
    are equally near, V_i jumps, at the same points for all i: the breaking points. The second set
    follows V'_i, nearest to phi + (2 i + 1) pi / N, which jumps elsewhere. The blend shows each
    where it does not jump. With one member there is nothing to choose and no second set.

    Parameters
    ----------
    flow : Flow
    look : Look
    noise : (P, K) float32 ndarray
    """
    angle = look.guiding_angle
    first = member_images(flow, look, noise, _walkers(flow, look, angle))
    if flow.degree == 1 or look.weights == "none":
        return (yield from first)
    second = member_images(flow, look, noise, _walkers(flow, look, angle + np.pi / flow.degree))
    images = yield from part(first, 0.0, 0.5)
    others = yield from part(second, 0.5, 1.0)
    return images.blended(others, _weights(flow, look))


def _weights(flow: Flow, look: Look) -> np.ndarray:
    """(P,) float32 share of the first set."""
    if look.view_plane:
        weight = blend_weights(flow, look.guiding_angle)
    else:
        chosen = _projected_fields(flow, look.guiding_angle)[0]
        turn = np.angle(chosen * np.exp(-1j * look.guiding_angle))
        weight = (0.5 + 0.5 * np.cos(flow.degree * turn)).astype(np.float32)
    return (weight > 0.5).astype(np.float32) if look.weights == "binary" else weight


def _walkers(flow: Flow, look: Look, angle: float) -> list[Walker]:
    """Walkers along the M members nearest to `angle` and to its rotations by 2 pi / N."""
    if not look.view_plane:
        fields = _projected_fields(flow, angle)
        return [_along(direction_table(flow, field, field)) for field in fields]
    members = all_members(flow, angle)[: flow.lines]
    ways = [flow.on_screen(flow.direction(member), look.foreshorten) for member in members]
    return [
        _along(direction_table(flow, way, member))
        for way, member in zip(ways, members, strict=True)
    ]


def _along(table: np.ndarray) -> Walker:
    """The walker along one vector field on screen."""

    def forward(entry: np.ndarray, offset: np.ndarray) -> np.ndarray:
        return interpolate(table.take(entry, axis=0), offset)

    def backward(entry: np.ndarray, offset: np.ndarray) -> np.ndarray:
        return -forward(entry, offset)

    return lambda block: (forward, backward)


def _projected_fields(flow: Flow, angle: float) -> list[np.ndarray]:
    """M fields chosen among the members as projected: what the paper's Figure 8 warns of.

    On a tilted surface their angles on screen are not 2 pi / N apart, so that the two sets of
    breaking points come close to each other and the weights no longer tell where they are.
    """
    members = np.stack(
        [flow.on_screen(flow.direction(member)) for member in all_members(flow, 0.0)]
    )
    fields = []
    for member in range(flow.lines):
        guide = np.exp(-1j * (angle + 2 * np.pi * member / flow.degree))
        best = np.argmax((members * guide).real, axis=0)
        fields.append(np.take_along_axis(members, best[None], axis=0)[0])
    return fields
