"""The hue of each pixel, if each family of lines has its own hue.

Families are the lines that a field distinguishes, such as the major and the minor directions of a
tensor. Equation 6 of Palacios and Zhang (IEEE TVCG 2011) restores the contrast that the mean of M gray
images loses. If the images differ in hue, their mean loses saturation as well. That paper leaves this to
future work. Here brightness and hue are computed separately. The brightness is taken from the corrected gray
picture. The hue is a mean of the family colors, with softmax weights of the member images: the family with
the brightest streak at the pixel dominates. The weights are scaled by the standard deviation of streaks,
which is known from theory (`contrast.expected_std`), so no image has to be analyzed.
"""

import numpy as np

from .contrast import expected_std
from .lic_images import LicImages
from .look_units import PixelLook
from .pixel_field import PixelField, all_members

#: Sharpness of the softmax over the member images, per standard deviation of the streaks.
SOFTMAX_SHARPNESS = 1.6

#: (12, 3) display values (sRGB) of the families, in order. Their luminances (Rec. 709) are similar,
#: 0.27 to 0.31. The first two are orange and blue, which most people with color blindness can
#: distinguish.
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


def family_hues(field: PixelField, images: LicImages, look: PixelLook) -> np.ndarray | None:
    """Compute the color of each pixel from the families whose streaks are bright there.

    Parameters
    ----------
    field : PixelField
    images : LicImages
        Member images in the order of `all_members(field, look.guiding_angle)`.
    look : PixelLook

    Returns
    -------
    (P, 3) float32 ndarray or None
        Display values (sRGB). None if the field does not distinguish its lines.
    """
    families = line_families(field, look)
    if families is None:
        return None
    weights = images.members.mean(axis=2)
    weights = np.exp((weights - weights.mean(axis=0)) * (SOFTMAX_SHARPNESS / expected_std(look)))
    total = np.zeros((len(field.pixel), 3), dtype=np.float32)
    for family, weight in zip(families, weights, strict=True):
        total += weight[:, None] * PALETTE.take(family, axis=0)
    return total / weights.sum(axis=0)[:, None]


def line_families(field: PixelField, look: PixelLook) -> list[np.ndarray] | None:
    """Find the family of each of the M lines (pairs of opposite directions of the field) at each pixel.

    Parameters
    ----------
    field : PixelField
    look : PixelLook
        Its `guiding_angle` determines the order of the lines.

    Returns
    -------
    list of M (P,) intp ndarrays, or None
        Family indices from 0, for the first M of `all_members(field, look.guiding_angle)`. None if
        the field does not distinguish its lines.
    """
    family_channel = next((pair for pair in field.channels.items() if pair[0][0] == "family"), None)
    if family_channel is None:
        return None
    (_, family_count), stored_line = family_channel
    labels = []
    for member in all_members(field, look.guiding_angle)[: field.line_count]:
        # The angle from the stored line, in steps of one family. It is 0 where no line is stored:
        # adding 0 turns -0, whose angle can be pi, into +0.
        line = member.astype(np.complex128) ** (field.degree // family_count)
        relative = line * stored_line.conj() + 0
        line_offset = np.rint(np.angle(relative) * (family_count / (2 * np.pi)))
        labels.append(line_offset.astype(np.intp) % family_count)
    return labels
