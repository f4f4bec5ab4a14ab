"""Figure 5: the steps from a 3-RoSy field to a picture."""

from __future__ import annotations

import numpy as np

from rosy_addon.compositor.pixel_field import blend_weights
from tests.harness.planar import DegreeLayer, compose_planar, planar_pixel_field

from .looks import MEASURED, RED
from .measure import correlation
from .page import Page
from .plane import averaged, enlarged, points, singularity
from .sheet import Panel, gray, inset, magnified, outlined

DEGREE, SUPERSAMPLING = 3, 2
#: Size of the drawn field, larger than the picture so that streamlines do not end at its border.
FIELD_SIZE, LARGE, SMALL = 480, 400, 256
LOOK = enlarged(MEASURED, SUPERSAMPLING)
#: Contrast of all pictures except the uncorrected blend.
GAIN = 2.2
CLOSEUP, TIMES = 52, 3


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-05", "From a 3-RoSy field to a picture, step by step")
    angles = np.angle(singularity(1)(points(FIELD_SIZE, SUPERSAMPLING))) / DEGREE
    first, second = _set(angles, 0.0), _set(angles, np.pi / DEGREE)
    blend = compose_planar(angles, DEGREE, LOOK).layer
    brute = compose_planar(angles, DEGREE, LOOK.with_settings({"method": "brute"})).layer

    page.text(
        """This page shows how the paper's method draws a 3-RoSy field with a singularity of index
        +1/3 in the center. The field is split into three vector fields. At each point, V₀ takes the
        member nearest to the guiding angle 0°, and V₁ and V₂ the members nearest to 120° and 240°.
        Together, their LIC images I₀, I₁ and I₂ contain every streak. But all three break along the
        line to the left of the center, where two members are equally near to the guiding angle. The
        second set, I′₀, I′₁ and I′₂, uses the guiding angles 60°, 180° and 300°. It breaks along
        the line to the right."""
    )
    page.picture(
        [_members(first, "I", 0), _members(second, "I′", 60)],
        "LIC images of the three members, for both sets of guiding angles",
        "members",
    )
    page.text(
        """The mean of each set contains every streak. The streaks end where all images of the set
        break, as in the marked squares."""
    )
    means = [
        Panel(_with_closeup(first, -1), "I, the mean of I₀, I₁, I₂, corrected; closeup 3 times"),
        Panel(
            _with_closeup(second, 1), "I′, the mean of I′₀, I′₁, I′₂, corrected; closeup 3 times"
        ),
    ]
    page.picture([means], "The means of both sets, with closeups of the breaking points", "means")
    page.text(
        """The blend weights I by cos²(3θ/2) and I′ by sin²(3θ/2), where θ is the angle of any
        member. So each set contributes where it does not break. The mean of three images has low
        contrast. The page of [Figure 6](figure-06.md) explains the correction."""
    )
    weight = blend_weights(planar_pixel_field(angles, DEGREE), 0.0)[:, None]
    page.picture(
        [
            [
                Panel(gray(_shown(weight, SMALL)), "cos²(3θ/2), the share of I"),
                Panel(gray(_shown(1 - weight, SMALL)), "sin²(3θ/2), the share of I′"),
                Panel(gray(_shown(blend.images.blend, SMALL)), "the blend, not corrected"),
            ]
        ],
        "The weights, and the blend before its contrast is corrected",
        "weights",
    )
    page.text(
        """The result is shown beside brute force. Brute force follows the best of the three members
        at every step, so it has no breaking points."""
    )
    result = [
        Panel(_contrasted(blend.tone, LARGE), "the blend, corrected"),
        Panel(_contrasted(brute.tone, LARGE), "brute force, corrected"),
    ]
    page.picture([result], "The result, and brute force", "result")
    _measure(page, first, second, blend, brute)
    page.write("Figure 5")


def _measure(
    page: Page, first: DegreeLayer, second: DegreeLayer, blend: DegreeLayer, brute: DegreeLayer
) -> None:
    page.text("## Measurements")
    page.text(
        """The table lists the correlation with brute force in three regions: in strips 17 pixels
        high along the line to the left and to the right of the singularity, starting 24 pixels from
        it, and in the rest of the picture."""
    )
    position = points(FIELD_SIZE)
    in_picture = np.maximum(np.abs(position.real), np.abs(position.imag)) < LARGE / 2
    strip = in_picture & (np.abs(position.imag) < 8.5)
    left, right = strip & (position.real < -24), strip & (position.real > 24)
    rest = in_picture & (np.abs(position.imag) > 40)
    tones = {
        name: averaged(layers.images.blend, FIELD_SIZE, SUPERSAMPLING)
        for name, layers in (("I", first), ("I′", second), ("blend", blend), ("brute", brute))
    }
    rows = [
        [
            name,
            *(correlation(tones[name][part], tones["brute"][part]) for part in (left, right, rest)),
        ]
        for name in ("I", "I′", "blend")
    ]
    page.table(["Picture", "Left, where I breaks", "Right, where I′ breaks", "Rest"], rows)
    same = correlation(tones["I"][rest], tones["I′"][rest])
    page.text(
        f"""In the rest of the picture, I and I′ have a correlation of {same:.4f} with each other.
        They are almost the same image, so their blend needs no correction of its own."""
    )


def _set(angles: np.ndarray, guiding_angle: float) -> DegreeLayer:
    """Return one set of member images."""
    look = LOOK.with_settings({"weights": "none", "guiding_angle": guiding_angle})
    return compose_planar(angles, DEGREE, look).layer


def _shown(values: np.ndarray, size: int) -> np.ndarray:
    """Return the (size, size) center of the (P, 1) values of a picture."""
    margin = (FIELD_SIZE - size) // 2
    return averaged(values, FIELD_SIZE, SUPERSAMPLING)[
        margin : margin + size, margin : margin + size
    ]


def _contrasted(values: np.ndarray, size: int) -> np.ndarray:
    return gray(0.5 + GAIN * (_shown(values, size) - 0.5))


def _members(layers: DegreeLayer, name: str, guide: int) -> list[Panel]:
    return [
        Panel(
            _contrasted(image, SMALL),
            f"{name}{'₀₁₂'[index]}, guided by {guide + 120 * index}°",
        )
        for index, image in enumerate(layers.images.members)
    ]


def _with_closeup(layers: DegreeLayer, side: int) -> np.ndarray:
    """Return the mean of a set with an enlarged closeup of its breaking points, on the left or right."""
    picture = _contrasted(layers.tone, LARGE)
    left, top = LARGE // 2 + side * 110 - CLOSEUP // 2, LARGE // 2 - CLOSEUP // 2
    closeup = magnified(picture[top : top + CLOSEUP, left : left + CLOSEUP], TIMES)
    picture = outlined(picture, (left, top, left + CLOSEUP, top + CLOSEUP), RED)
    far_offset = LARGE - CLOSEUP * TIMES - 6
    return inset(picture, closeup, far_offset if side < 0 else 6, far_offset, RED)
