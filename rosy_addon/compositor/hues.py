"""Families of directions, each with a hue of its own: a tensor's major and minor, say.

Equation 6 of the paper gives the mean of M grey images the contrast of one. If they differ in hue,
the mean of the colours loses in hue as it does in brightness, which the paper leaves to future
work. So brightness and hue go separate ways: brightness is that of the grey picture, corrected as
there, and the hue of a pixel is that of the families whose streaks stand out at it, by how much in
units of the deviation that streaks have. That is known from theory, like the factor of equation 6,
and nothing has to be found out from the image.
"""

from __future__ import annotations

import numpy as np

from .contrast import expected_deviation
from .flow import Flow, all_members
from .images import Images
from .look import Look

#: How much brighter than another, in deviations, makes a streak's hue e times as strong.
SHARPNESS = 1.6

#: Display values of about the same luminance (Rec. 709, 0.27 to 0.31): orange and blue, which most
#: eyes tell apart, then green and magenta, then others.
PALETTE = np.array(
    [
        (0.86, 0.50, 0.13),
        (0.27, 0.58, 0.92),
        (0.30, 0.64, 0.35),
        (0.87, 0.42, 0.71),
        (0.60, 0.56, 0.20),
        (0.20, 0.64, 0.64),
        (0.66, 0.50, 0.89),
        (0.86, 0.47, 0.42),
        (0.45, 0.62, 0.16),
        (0.45, 0.56, 0.71),
        (0.74, 0.51, 0.41),
        (0.56, 0.56, 0.56),
    ],
    dtype=np.float32,
)


def family_hues(flow: Flow, images: Images, look: Look) -> np.ndarray | None:
    """The hue of each pixel.

    Parameters
    ----------
    flow : Flow
    images : Images
        Of the members from that nearest to the look's guiding angle on.
    look : Look

    Returns
    -------
    (P, 3) float32 ndarray or None
        Display values (sRGB); None if the field's lines are not told apart.
    """
    family_of = families_of_lines(flow, look)
    if family_of is None:
        return None
    stands_out = images.members.mean(axis=2)
    stands_out = np.exp(
        (stands_out - stands_out.mean(axis=0)) * (SHARPNESS / expected_deviation(look))
    )
    total = np.zeros((len(flow.pixel), 3), dtype=np.float32)
    for family, weight in zip(family_of, stands_out, strict=True):
        total += weight[:, None] * PALETTE.take(family, axis=0)
    return total / stands_out.sum(axis=0)[:, None]


def families_of_lines(flow: Flow, look: Look) -> list[np.ndarray] | None:
    """M times (P,) int: the family of each line, from that nearest to the look's guiding angle on.

    None if the field's lines are not told apart.
    """
    found = next((pair for pair in flow.traits.items() if pair[0][0] == "family"), None)
    if found is None:
        return None
    (_, families), stored = found
    family_of = []
    for member in all_members(flow, look.guiding_angle)[: flow.lines]:
        # The angle from the stored line, in units of that between neighbouring ones. Where no line
        # is stored it is 0: the sum has no -0, whose angle is pi.
        ahead = member.astype(np.complex128) ** (flow.degree // families) * stored.conj() + 0
        turns = np.rint(np.angle(ahead) * (families / (2 * np.pi)))
        family_of.append(turns.astype(np.intp) % families)
    return family_of
