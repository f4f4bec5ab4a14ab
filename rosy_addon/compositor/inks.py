"""Inks of hatching: their colors, and the coverage of the paper that a tone requires.

A look has one ink, one ink whose color changes from the shadows to the lights, or one ink for each
family of lines. The coverage for a tone depends on the luminance of the ink. Lines of one ink are
not darker where they cross. Inks of several colors are transparent: where their lines cross, the
transmittances are multiplied. If the ink is lighter than the paper, the same is done with the
complements (1 - light), which is the blend mode "screen".
"""

from dataclasses import dataclass, replace

import numpy as np

from ..core.color import LUMINANCE_WEIGHTS, alpha_from_hex, from_hex, to_linear
from .look import Look, has_tone_inks, is_hatched

#: Maximum number of inks.
MAX_INKS = 12

#: Hue difference between the inks of successive families, and the hue that an achromatic first ink
#: counts as, in degrees of Oklab hue. With black ink the second ink is red, the third blue.
HUE_STEP, FIRST_HUE = 220.0, -185.0

#: Range of lightness and minimum chroma in Oklab of all inks but the first, so that their hues are
#: visible.
LIGHTNESS_RANGE, MIN_CHROMA = (0.5, 0.8), 0.14

#: Oklab chroma below which an ink counts as achromatic.
ACHROMATIC_CHROMA = 0.03

# Bjorn Ottosson, "A perceptual color space for image processing", 2020.
_RGB_TO_LMS = np.array(
    [
        (0.4122214708, 0.5363325363, 0.0514459929),
        (0.2119034982, 0.6806995451, 0.1073969566),
        (0.0883024619, 0.2817188376, 0.6299787005),
    ]
)
_LMS_TO_LAB = np.array(
    [
        (0.2104542553, 0.7936177850, -0.0040720468),
        (1.9779984951, -2.4285922050, 0.4505937099),
        (0.0259040371, 0.7827717662, -0.8086757660),
    ]
)


@dataclass(frozen=True, eq=False)
class Inks:
    """The colors of paper and inks.

    Attributes
    ----------
    paper : (3,) float32 ndarray
        Linear color.
    paper_alpha : float
        Opacity of the paper, 0 to 1.
    dark, light : (n, 3) float32 ndarray
        Linear colors of the n inks in the shadows and in the lights.
    is_light : bool
        Whether the ink is lighter than the paper. Lighter tones then need more ink.
    min_transmittance : float
        Smallest luminance transmittance that all inks can reach: the transmittance at full coverage of the
        lightest ink (of the darkest ink, if inks are lighter than the paper).
    """

    paper: np.ndarray
    paper_alpha: float
    dark: np.ndarray
    light: np.ndarray
    is_light: bool
    min_transmittance: float

    def ink_at_tone(self, index: np.ndarray, tone: np.ndarray) -> np.ndarray:
        """Look up the color of inks at tones.

        Parameters
        ----------
        index : (P,) ndarray
            Index of the ink. Inks are interpolated at fractional indices.
        tone : (P,) ndarray
            Linear, 0 to 1.

        Returns
        -------
        (P, 3) float32 ndarray
            Linear color. The array is read-only if it repeats a single color.
        """
        if len(self.dark) == 1 and (self.dark == self.light).all():
            return np.broadcast_to(self.dark, (len(tone), 3))
        lower = np.minimum(index.astype(np.intp), len(self.dark) - 1)
        upper = np.minimum(lower + 1, len(self.dark) - 1)
        fraction = (index - lower).astype(np.float32)[:, None]
        dark, light = (
            ink[lower] + fraction * (ink[upper] - ink[lower]) for ink in (self.dark, self.light)
        )
        return dark + tone[:, None] * (light - dark)

    def transmittance(self, ink: np.ndarray) -> np.ndarray:
        """Return the (..., 3) ratio of ink to paper in each channel.

        If the ink is lighter than the paper, it is the ratio of the complements, (1 - ink) / (1 - paper).
        """
        paper = np.maximum(self.complement_if_light(self.paper), 1e-3)
        return self.complement_if_light(ink) / paper

    def luminance_transmittance(self, ink: np.ndarray) -> np.ndarray:
        """Return the (...,) ratio of the luminances of ink and paper.

        If the ink is lighter than the paper, it is the ratio of 1 - luminance.
        """
        paper_luminance = float(self.complement_if_light(self.paper) @ LUMINANCE_WEIGHTS)
        return (self.complement_if_light(ink) @ LUMINANCE_WEIGHTS) / max(paper_luminance, 1e-3)

    def target_transmittance(self, relative_transmittance: np.ndarray) -> np.ndarray:
        """Map relative transmittances, from 0 to 1, to the range from `min_transmittance` to 1."""
        return self.min_transmittance + relative_transmittance * (1 - self.min_transmittance)

    def required_coverage(self, target_transmittance: np.ndarray, ink: np.ndarray) -> np.ndarray:
        """Return the (P,) coverage at which (P, 3) ink has the luminance transmittance that is asked for."""
        opacity = np.maximum(1 - self.luminance_transmittance(ink), 1e-3)
        return np.clip((1 - target_transmittance) / opacity, 0, 1)

    def on_paper(self, ink: np.ndarray, coverage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the (P, 3) color, not premultiplied, and (P,) opacity of ink that covers the paper.

        Parameters
        ----------
        ink : (P, 3) float32 ndarray
            Linear color.
        coverage : (P,) float32 ndarray
            0 to 1.
        """
        if self.paper_alpha == 0:
            return ink, coverage
        opacity = 1 - (1 - coverage) * (1 - self.paper_alpha)
        return self.paper + (coverage / opacity)[:, None] * (ink - self.paper), opacity

    def complement_if_light(self, light: np.ndarray) -> np.ndarray:
        """Return 1 - `light` if the ink is lighter than the paper, and `light` otherwise."""
        return 1 - light if self.is_light else light


def has_ink_per_line(look: Look) -> bool:
    """Return whether each line, or each family of lines, has its own ink."""
    return is_hatched(look) and look.hue == "families"


def ink_count(look: Look, line_count: int, family_count: int) -> int:
    """Count the inks that a look uses for a field.

    Parameters
    ----------
    look : Look
    line_count : int
        M, the number of lines through a pixel.
    family_count : int
        Number of families of lines of the field; 1 if the field does not distinguish families.
    """
    if not has_ink_per_line(look):
        return 1
    return min(family_count if family_count > 1 else line_count, MAX_INKS)


def inks_of(look: Look, families: int = 1) -> Inks:
    """Compute the colors of paper and inks of a look.

    Parameters
    ----------
    look : Look
    families : int
        Number of families of lines that have an ink of their own; 1 if all have the same ink. It is the
        result of `ink_count`.
    """
    paper = to_linear(from_hex(look.paper_color))
    dark = light = _ink_series(look.ink_color, families)
    if has_tone_inks(look):
        light = _ink_series(look.ink_color_light, families)
    inks = Inks(paper, alpha_from_hex(look.paper_color), dark, light, is_light(look), 0.0)
    solid_ink = inks.light if inks.is_light else inks.dark
    return replace(inks, min_transmittance=float(np.max(inks.luminance_transmittance(solid_ink))))


def is_light(look: Look) -> bool:
    """Return whether the ink is lighter than the paper, by luminance."""
    ink, paper = (to_linear(from_hex(code)) for code in (look.ink_color, look.paper_color))
    return bool(ink @ LUMINANCE_WEIGHTS > paper @ LUMINANCE_WEIGHTS)


def _ink_series(code: str, count: int) -> np.ndarray:
    """Return (count, 3) float32 linear colors: an ink, and variants with other hues.

    `code` is the color of the ink as ``#rrggbb``. The variants have its lightness and chroma in Oklab, but
    the lightness is clipped to `LIGHTNESS_RANGE`, and the chroma is at least `MIN_CHROMA`.
    """
    base_ink = to_linear(from_hex(code))
    lightness, a, b = _LMS_TO_LAB @ np.cbrt(_RGB_TO_LMS @ base_ink)
    chroma = np.hypot(a, b)
    hue = np.arctan2(b, a) if chroma > ACHROMATIC_CHROMA else np.radians(FIRST_HUE)
    hues = hue + np.radians(HUE_STEP) * np.arange(1, min(count, MAX_INKS))
    chroma = max(chroma, MIN_CHROMA)
    lightness = np.full(len(hues), np.clip(lightness, *LIGHTNESS_RANGE))
    lab = np.stack([lightness, chroma * np.cos(hues), chroma * np.sin(hues)])
    lms = np.linalg.solve(_LMS_TO_LAB, lab) ** 3
    other_inks = np.clip(np.linalg.solve(_RGB_TO_LMS, lms), 0, 1).T
    return np.concatenate([base_ink[None], other_inks]).astype(np.float32)
