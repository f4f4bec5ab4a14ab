"""Field channels: the representation z of a field, and complex values that it can have in addition."""

from collections.abc import Mapping

import numpy as np

#: Key of a complex value of a field. ("deviation", j) is the harmonic C_j of `field.directional_field`.
#: ("family", m) is the representation, of degree N / m, of the line that the stored member is on: a line
#: is a pair of opposite members.
FieldChannel = tuple[str, int]

#: The channel of z itself, of degree N, which every field has.
REPRESENTATION: FieldChannel = ("family", 1)


def rotation_order(channel: FieldChannel, degree: int) -> int:
    """Return the power by which a channel rotates with its frame.

    It is k, if a change of frame that multiplies the representation of the field by p^N (N is `degree`)
    multiplies the channel by p^k.
    """
    kind, number = channel
    return -number if kind == "deviation" else degree // number


def deviations(channels: Mapping[FieldChannel, np.ndarray]) -> list[tuple[int, np.ndarray]]:
    """Return the harmonics among the channels of a field, as pairs of the order j and C_j. Empty for a RoSy."""
    return [(order, values) for (kind, order), values in channels.items() if kind == "deviation"]
