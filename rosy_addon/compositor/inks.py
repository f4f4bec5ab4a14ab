"""Inks on paper: one, one that changes from the shadows to the lights, or one for each family of lines.

How much of the paper an ink has to cover for a tone depends on how dark it is. Lines of one ink that
cross are no darker where they do; inks of several colours let light through, and where they cross they
multiply, as glazes do (on dark paper what they take away from the dark does: they screen).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .colour import LUMINANCE, from_hex, to_linear
from .look import Look

#: Inks that are told apart; there are never more families of lines than members of a field.
INKS = 12

#: From one family's ink to the next, degrees of hue: of black ink the second is red, the third blue.
HUE_STEP, FIRST_HUE = 220.0, -185.0

#: Lightness and least chroma in Oklab of all inks but the first: colours that can be seen as such.
LIGHTNESS, CHROMA = (0.5, 0.8), 0.14

#: Chroma below which an ink has no hue that others could start from.
GREY = 0.03

# Bjorn Ottosson, "A perceptual color space for image processing", 2020.
_TO_CONES = np.array(
    [
        (0.4122214708, 0.5363325363, 0.0514459929),
        (0.2119034982, 0.6806995451, 0.1073969566),
        (0.0883024619, 0.2817188376, 0.6299787005),
    ]
)
_TO_LAB = np.array(
    [
        (0.2104542553, 0.7936177850, -0.0040720468),
        (1.9779984951, -2.4285922050, 0.4505937099),
        (0.0259040371, 0.7827717662, -0.8086757660),
    ]
)


@dataclass(frozen=True, eq=False)
class Inks:
    """What is drawn with and on.

    Attributes
    ----------
    paper : (3,) float32 ndarray
        Linear light.
    dark, middle, light : (n, 3) float32 ndarray
        Linear light of each ink in the shadows, at the tone `turn`, and in the lights.
    turn : float
        Between 0 and 1.
    is_light : bool
        Whether the ink is lighter than the paper, so that there is the more of it the more light.
    floor : float
        Share of the paper's light (or, of light ink, of its darkness) that is left where each of them
        could cover everything.
    """

    paper: np.ndarray
    dark: np.ndarray
    middle: np.ndarray
    light: np.ndarray
    turn: float
    is_light: bool
    floor: float

    def at(self, number: np.ndarray, tone: np.ndarray) -> np.ndarray:
        """(P, 3) linear light of inks, by (P,) numbers; in between, what is between two of them."""
        below = np.minimum(number.astype(np.intp), len(self.dark) - 1)
        above = np.minimum(below + 1, len(self.dark) - 1)
        share = (number - below).astype(np.float32)[:, None]
        dark, middle, light = (
            inks[below] + share * (inks[above] - inks[below])
            for inks in (self.dark, self.middle, self.light)
        )
        lighter = np.clip((tone - np.float32(self.turn)) / np.float32(1 - self.turn), 0, 1)
        darker = np.clip(1 - tone / np.float32(self.turn), 0, 1)
        return middle + lighter[:, None] * (light - middle) + darker[:, None] * (dark - middle)

    def through(self, ink: np.ndarray) -> np.ndarray:
        """(..., 3): share of the paper's light that inks let through, channel by channel."""
        return self.inverted(ink) / np.maximum(self.inverted(self.paper), 1e-3)

    def left_by(self, ink: np.ndarray) -> np.ndarray:
        """(...,): that share of the luminance."""
        paper = float(self.inverted(self.paper) @ LUMINANCE)
        return (self.inverted(ink) @ LUMINANCE) / max(paper, 1e-3)

    def wanted(self, left: np.ndarray) -> np.ndarray:
        """(P,): what is to be left of the paper's light, of a picture from 0, all ink, to 1."""
        return self.floor + left * (1 - self.floor)

    def covering(self, wanted: np.ndarray, ink: np.ndarray) -> np.ndarray:
        """(P,): how much of the paper an ink has to cover to leave so much of its light."""
        return np.clip((1 - wanted) / np.maximum(1 - self.left_by(ink), 1e-3), 0, 1)

    def inverted(self, light: np.ndarray) -> np.ndarray:
        """Light or, where light ink takes darkness away, what is missing of white."""
        return 1 - light if self.is_light else light


def inks_of(look: Look, families: int = 1) -> Inks:
    """The inks of a look.

    Parameters
    ----------
    look : Look
    families : int
        How many are told apart, and 1 if they are all drawn with one ink.
    """
    paper = to_linear(from_hex(look.paper_colour))
    last = look.ink_colour_light if look.ink_ramp else look.ink_colour
    dark, light = (_inks_from(code, families) for code in (look.ink_colour, last))
    middle, turn = (dark + light) / 2, 0.5
    if look.ink_ramp and look.ink_middle > 0:
        middle, turn = _inks_from(look.ink_colour_middle, families), look.ink_middle
    inks = Inks(paper, dark, middle, light, turn, is_light(look), 0.0)
    full = inks.light if inks.is_light else inks.dark
    return replace(inks, floor=float(np.max(inks.left_by(full))))


def is_light(look: Look) -> bool:
    """Whether the ink is lighter than the paper, so that there is the more of it the more light."""
    ink, paper = (
        to_linear(from_hex(code)) @ LUMINANCE for code in (look.ink_colour, look.paper_colour)
    )
    return bool(ink > paper)


def _inks_from(code: str, count: int) -> np.ndarray:
    """(count, 3) float32 linear light: an ink, and others of about its lightness, of other hues."""
    first = to_linear(from_hex(code))
    lightness, a, b = _TO_LAB @ np.cbrt(_TO_CONES @ first)
    chroma = np.hypot(a, b)
    hue = np.arctan2(b, a) if chroma > GREY else np.radians(FIRST_HUE)
    turns = hue + np.radians(HUE_STEP) * np.arange(1, min(count, INKS))
    chroma = max(chroma, CHROMA)
    lab = np.stack(
        [
            np.full(len(turns), np.clip(lightness, *LIGHTNESS)),
            chroma * np.cos(turns),
            chroma * np.sin(turns),
        ]
    )
    cones = np.linalg.solve(_TO_LAB, lab) ** 3
    others = np.clip(np.linalg.solve(_TO_CONES, cones), 0, 1).T
    return np.concatenate([first[None], others]).astype(np.float32)
