"""Draw figure 5: the steps from a 3-RoSy field to a picture."""

from functools import partial

import numpy as np

from rosy_addon.compositor.per_pixel_lic import blend_weights
from tests.harness.planar import DegreeLayer, compose_planar, planar_pixel_field
from tests.harness.streaks import correlation

from .looks import MEASURED, RED
from .page import fill_tables, picture
from .plane import averaged, enlarged, points, singularity
from .sheet import Panel, gray, inset, magnified, outlined

DEGREE, SUPERSAMPLING = 3, 2

#: Side of the square in which the field is drawn, and of the large and small pictures that are cut out of it,
#: in pixels. So streamlines do not end at the borders of the pictures.
FIELD_SIZE, LARGE, SMALL = 480, 400, 256

LOOK = enlarged(MEASURED, SUPERSAMPLING)

#: Factor of the contrast of all pictures except the uncorrected blend.
GAIN = 2.2

#: Side of a closeup in pixels, and its magnification.
CLOSEUP, TIMES = 52, 3


def write() -> None:
    """Draw the pictures and measure the table."""
    angles = np.angle(singularity(1)(points(FIELD_SIZE, SUPERSAMPLING))) / DEGREE
    draw = partial(_layer, angles)
    first = draw(weights="none", guiding_angle=0.0)
    second = draw(weights="none", guiding_angle=np.pi / DEGREE)
    blend, brute = draw(), draw(method="brute")
    picture("figure-05-members", _members(first, "I", 0), _members(second, "I′", 60))
    means = [
        Panel(_with_closeup(first, -1), "I, the mean of I₀, I₁, I₂, corrected; closeup 3 times"),
        Panel(
            _with_closeup(second, 1), "I′, the mean of I′₀, I′₁, I′₂, corrected; closeup 3 times"
        ),
    ]
    picture("figure-05-means", means)
    weight = blend_weights(planar_pixel_field(angles, DEGREE), 0.0)[:, None]
    weights = [
        Panel(gray(_shown(weight, SMALL)), "cos²(3θ/2), the share of I"),
        Panel(gray(_shown(1 - weight, SMALL)), "sin²(3θ/2), the share of I′"),
        Panel(gray(_shown(blend.images.blend, SMALL)), "the blend, not corrected"),
    ]
    picture("figure-05-weights", weights)
    result = [
        Panel(_contrasted(blend.tone, LARGE), "the blend, corrected"),
        Panel(_contrasted(brute.tone, LARGE), "brute force, corrected"),
    ]
    picture("figure-05-result", result)
    tones = {
        name: averaged(layer.images.blend, FIELD_SIZE, SUPERSAMPLING)
        for name, layer in (("I", first), ("I′", second), ("blend", blend), ("brute", brute))
    }
    rows = [_correlations(name, tones[name], tones["brute"]) for name in ("I", "I′", "blend")]
    fill_tables("figure-05", [*rows, _correlations("I, with I′", tones["I"], tones["I′"])])


def _layer(angles: np.ndarray, **settings: object) -> DegreeLayer:
    return compose_planar(angles, DEGREE, LOOK.with_settings(settings)).layer


def _correlations(name: str, tone: np.ndarray, other: np.ndarray) -> list[object]:
    """Return a table row: correlations of two pictures left and right of the singularity, and in the rest."""
    position = points(FIELD_SIZE)
    in_picture = np.maximum(np.abs(position.real), np.abs(position.imag)) < LARGE / 2
    strip = in_picture & (np.abs(position.imag) < 8.5)
    left, right = strip & (position.real < -24), strip & (position.real > 24)
    rest = in_picture & (np.abs(position.imag) > 40)
    return [name, *(correlation(tone[part], other[part]) for part in (left, right, rest))]


def _shown(values: np.ndarray, size: int) -> np.ndarray:
    """Return the central (size, size) pixels of a picture with (P, 1) values."""
    middle = slice((FIELD_SIZE - size) // 2, (FIELD_SIZE + size) // 2)
    return averaged(values, FIELD_SIZE, SUPERSAMPLING)[middle, middle]


def _contrasted(values: np.ndarray, size: int) -> np.ndarray:
    return gray(0.5 + GAIN * (_shown(values, size) - 0.5))


def _members(layer: DegreeLayer, name: str, guide: int) -> list[Panel]:
    return [
        Panel(_contrasted(image, SMALL), f"{name}{'₀₁₂'[index]}, guided by {guide + 120 * index}°")
        for index, image in enumerate(layer.images.members)
    ]


def _with_closeup(layer: DegreeLayer, side: int) -> np.ndarray:
    """Return the mean of the images of members, with a closeup of its breaking points.

    At breaking points, streaks of the mean are interrupted. `side` is -1 for the left half, 1 for the right
    half.
    """
    shown = _contrasted(layer.tone, LARGE)
    left, top = LARGE // 2 + side * 110 - CLOSEUP // 2, LARGE // 2 - CLOSEUP // 2
    closeup = magnified(shown[top : top + CLOSEUP, left : left + CLOSEUP], TIMES)
    shown = outlined(shown, (left, top, left + CLOSEUP, top + CLOSEUP), RED)
    far_offset = LARGE - CLOSEUP * TIMES - 6
    return inset(shown, closeup, far_offset if side < 0 else 6, far_offset, RED)
