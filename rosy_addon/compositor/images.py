"""One LIC image a member, and their blend."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..progress import Progress, Work
from .contrast import even_out
from .flow import Flow
from .kernel import weights_of
from .look import Look
from .streamlines import Direction, blocks, gather

#: For a block of pixels, the directions forward and backward along the streamlines of one member.
Walker = Callable[[slice], tuple[Direction, Direction]]


@dataclass(frozen=True, eq=False)
class Images:
    """The LIC of each member of a field, before contrast correction.

    Attributes
    ----------
    members : (M, P, K) float32 ndarray
        K is 1 for grey noise, 3 for coloured.
    blend : (P, K) float32 ndarray
        Their mean.
    samples : (P,) float32 ndarray
        Samples on a pixel's streamlines, as many as would vary as much if all counted the same
        (`kernel`), mean over its members.
    weight : (P,) float32 ndarray
        Share of `members` in `blend`, the rest being that of another set.
    """

    members: np.ndarray
    blend: np.ndarray
    samples: np.ndarray
    weight: np.ndarray

    def blended(self, other: Images, weight: np.ndarray) -> Images:
        """These images where `weight` is 1, the `other` ones where it is 0."""
        return replace(
            self,
            blend=other.blend + weight[:, None] * (self.blend - other.blend),
            samples=other.samples + weight * (self.samples - other.samples),
            weight=weight,
        )


def member_images(
    flow: Flow, look: Look, noise: np.ndarray, walkers: Sequence[Walker]
) -> Work[Images]:
    """Walk the streamlines of each member through every pixel and average the noise along them.

    Parameters
    ----------
    flow : Flow
    look : Look
        Its `length`, `taper`, `step` and `magnitude` count.
    noise : (P, K) float32 ndarray
    walkers : sequence of functions
        One a member.
    """
    count, channels = noise.shape
    limit = limits(flow, look)
    ended = np.concatenate([noise, np.zeros((1, channels), dtype=np.float32)])
    members = np.empty((len(walkers), count, channels), dtype=np.float32)
    samples = np.zeros(count, dtype=np.float32)
    for member, walker in enumerate(walkers):
        for block in blocks(count):
            steps = None if limit is None else limit[block]
            (forth, ahead), (back, behind) = (
                gather(flow, block, follow, ended, look.length, look.step, steps, look.taper)
                for follow in walker(block)
            )
            reach = look.length if steps is None else steps
            weights = weights_of(ahead, behind, reach, look.taper)
            mean = (noise[block] + forth + back) / weights.total[:, None]
            members[member, block] = even_out(mean, weights.samples, look)
            samples[block] += weights.samples
            fraction = (member + block.stop / count) / len(walkers)
            yield Progress(fraction, "Following streamlines")
    samples /= len(walkers)
    return Images(members, members.mean(axis=0), samples, np.ones(count, dtype=np.float32))


def limits(flow: Flow, look: Look) -> np.ndarray | None:
    """(P,) steps each way where the magnitude drives the length; None where it does not."""
    if look.magnitude not in ("length", "both"):
        return None
    return np.rint(look.length * relative_magnitude(flow, look)).astype(np.int32)


def relative_magnitude(flow: Flow, look: Look) -> np.ndarray:
    """(P,) float32: rho from 0 to 1, as a part of `Look.magnitude_range`."""
    rho = np.abs(flow.representation)
    top = look.magnitude_range or float(rho.max(initial=0.0)) or 1.0
    return np.minimum(rho / np.float32(top), 1)
