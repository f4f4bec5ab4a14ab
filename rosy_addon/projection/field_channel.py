"""Field channels: values that a field can have in addition to its representation z."""

from __future__ import annotations

#: Key of a value that a field can have in addition to z. ("deviation", j) is the harmonic C_j of
#: `field.directional_field`. ("family", m) is the representation, of degree N / m, of the line that
#: the stored member is on.
FieldChannel = tuple[str, int]


def rotation_order(channel: FieldChannel, degree: int) -> int:
    """Return the power by which a channel rotates with its frame.

    If a unit complex number p rotates z by p^N, it rotates the channel by p to this power.
    """
    kind, number = channel
    return -number if kind == "deviation" else degree // number
