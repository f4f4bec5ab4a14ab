"""Everything that can be chosen about a picture, as one settings object."""

from __future__ import annotations

import re
import reprlib
from dataclasses import dataclass, field, fields, replace
from typing import Any

from ..errors import RosyError


def _number(default: float, low: float, high: float, text: str, unit: str = "") -> Any:
    """In radians if its unit is "angle", in Blender units if it is "length": the panel shows others."""
    rules = {"low": low, "high": high, "text": text, "unit": unit}
    return field(default=default, metadata=rules)


def _choice(default: str, text: str, **options: str) -> Any:
    return field(default=default, metadata={"options": options, "text": text})


def _switch(default: bool, text: str) -> Any:
    return field(default=default, metadata={"text": text})


def _colour(default: str, text: str) -> Any:
    """Display values (sRGB) as ``#rrggbb``."""
    return field(default=default, metadata={"colour": True, "text": text})


@dataclass(frozen=True)
class Look:
    """How a field is drawn: what a preset holds, and what the panel shows.

    Lengths are in pixels of the finished picture, or of as many Blender units as `unit_size` says. Each field's metadata says its range or options
    and what it does, in words a user meets; the panel's properties are made from it.
    """

    method: str = _choice(
        "sheets",
        "How the N directions become one picture",
        sheets="Each streamline of the covering surface once: fast, without breaking points",
        members="The paper's decomposition into member vector fields, an image of each",
        brute="Follow the best of N directions at every step: slow, the yardstick",
    )
    weights: str = _choice(
        "cosine",
        "How the two sets of images of the members method are blended, so that breaking points do "
        "not show",
        cosine="Smoothly, by the squared cosine and sine of N t / 2",
        binary="Each pixel from one set or the other",
        none="The first set alone: shows the breaking points",
    )
    view_plane: bool = _switch(
        True,
        "Rotate the field into the view plane before the members method decomposes it (off: the "
        "paper's Figure 8)",
    )
    display: str = _choice(
        "smooth",
        "How the values of the faces become values of pixels",
        smooth="Averaged at the corners and interpolated",
        flat="Each face as it is",
    )
    unit: str = _choice(
        "pixels",
        "What lengths are counted in",
        pixels="Pixels of the picture: lines are as wide from near as from afar",
        world="Blender units: lines belong to the object, as if engraved, and are wider from near",
    )
    unit_size: float = _number(
        0.01,
        1e-6,
        1e6,
        "Blender units that stand for a pixel where lengths are counted in these",
        "length",
    )
    length: int = _number(40, 1, 8000, "Steps of a streamline each way")
    taper: bool = _switch(
        False,
        "Let streaks fade toward their ends, so that lines end in points and stay more like "
        "themselves as one comes nearer",
    )
    step: float = _number(1.0, 0.05, 1.0, "Length of a step, in pixels")
    grain: float = _number(1.5, 0.5, 256.0, "Size of a cell of the noise, in pixels")
    density: float = _number(
        0.1,
        0.001,
        0.999,
        "Share of the noise's cells that are bright: few leave single streaks, which tell many "
        "directions apart",
    )
    high_pass: float = _number(
        16.0,
        0.0,
        1024.0,
        "Take variations broader than this, in pixels, out of the noise, so that crossing streaks "
        "do not gather into clouds; 0 keeps them, as the paper does",
    )
    noise: str = _choice(
        "grey",
        "Colour of the noise, and so of the streaks",
        grey="One channel",
        colour="Three channels, drawn separately: a plaid",
    )
    anchor: str = _choice(
        "picture",
        "What the noise, and so the streaks, stay with when something moves",
        picture="The picture: still pictures, as the paper's",
        surface="The surface: streaks move with it, bend with it and keep their width, for "
        "hatching and animations",
    )
    hue: str = _choice(
        "one",
        "Whether families of directions differ in hue",
        one="All the same",
        families="A hue for each line that the field tells apart: of tensors the major and the "
        "minor, of dir0, dir1 ... each, if they are the same lines all over the mesh. Hatched, "
        "those of other fields have an ink each, too, by how near they are to the guiding angle",
    )
    seed: int = _number(0, 0, 2**31 - 1, "Which noise")
    gain: float = _number(2.5, 0.0, 16.0, "Contrast on top of the statistical correction")
    guiding_angle: float = _number(
        0.0,
        -3.1416,
        3.1416,
        "Direction in the picture nearest to which the first member is chosen",
        "angle",
    )
    foreshorten: bool = _switch(
        False, "Let streaks shorten where the surface turns away, instead of keeping their length"
    )
    cross_creases: bool = _switch(False, "Let streaks run across sharp creases")
    crease_angle: float = _number(
        0.7,
        0.0,
        3.1416,
        "Angle between neighbouring pixels' normals that is a sharp crease",
        "angle",
    )
    magnitude: str = _choice(
        "none",
        "What the magnitude of the field drives",
        none="Nothing",
        colour="The colour, through a colour map",
        length="The length of the streaks",
        both="Colour and length",
    )
    magnitude_range: float = _number(
        0.0,
        0.0,
        1e9,
        "Magnitude at the top of the colour map and at full length; 0: the largest seen",
    )
    colour_map: str = _choice(
        "viridis",
        "Colours that stand for the magnitude, all of even perceptual steps",
        viridis="Dark blue through green to yellow",
        magma="Black through red to pale yellow",
        grey="Black to white",
    )
    shading: float = _number(0.7, 0.0, 1.0, "Strength of the diffuse shading in the picture itself")
    light: str = _choice(
        "headlight",
        "Where the light of that shading comes from",
        headlight="The eye",
        lamp="A lamp over the left shoulder, as draughtsmen like it",
        scene="The lights of the scene",
    )
    shadows: bool = _switch(
        False, "Let things cast shadows in that light; the eye's own light casts none"
    )
    tone: str = _choice(
        "light",
        "Where it is to be light and where dark",
        light="Where the light falls",
        attribute="As painted or computed: a number or a colour on the mesh",
        image="As an image says that lies on the mesh by its UV map",
        picture="As in a picture of the scene through its camera, such as a render",
    )
    tone_lit: bool = _switch(
        False, "Let the light fall on such a tone as well, instead of taking it as it is"
    )
    tone_black: float = _number(0.0, -1e6, 1e6, "What of the tone is black")
    tone_white: float = _number(
        1.0, -1e6, 1e6, "What of the tone is white; below that of black, light and dark change over"
    )
    tone_gamma: float = _number(
        1.0, 0.05, 20.0, "Of the tones between: above 1 they get lighter, below darker"
    )
    ink: str = _choice(
        "soft",
        "What streaks are made of",
        soft="Brighter and darker light around the mean, the surface shaded",
        hatch="Lines of ink on paper, as many and as wide as the light asks for",
    )
    ink_colour: str = _colour("#08080d", "Colour of the ink")
    ink_ramp: bool = _switch(
        False, "Let the ink's colour go over into another one from the shadows to the lights"
    )
    ink_colour_light: str = _colour("#b06a3c", "Colour of the ink in the lights")
    ink_middle: float = _number(
        0.0,
        0.0,
        0.99,
        "Tone at which the ink has a third colour on its way from the shadows to the lights; 0: none",
    )
    ink_colour_middle: str = _colour("#6f2d4f", "Colour of the ink at that tone")
    paper_colour: str = _colour("#ffffff", "Colour of the paper")
    clear_paper: bool = _switch(False, "Leave the paper transparent, so that there is only ink")
    crispness: float = _number(0.7, 0.0, 1.0, "From soft grey streaks to lines with sharp borders")
    layers: int = _number(3, 1, 12, "Families of lines that may cross in the darkest tones")
    layering: float = _number(
        0.3, 0.0, 1.0, "Darkness between the tone at which one family begins and the next"
    )
    breaks: float = _number(
        0.0, 0.0, 1.0, "How much lines are broken along their length, first where it is light"
    )
    overshoot: float = _number(
        0.0,
        0.0,
        256.0,
        "How far lines run on past the borders of tones, thinning out, some farther than others, in "
        "pixels",
    )
    wobble: float = _number(
        0.0, 0.0, 1.0, "How much lines waver in course and width, as drawn by hand"
    )
    paper_grain: float = _number(
        0.0,
        0.0,
        1.0,
        "How much the ink catches on the tooth of the paper, as pencil and charcoal do",
    )
    outline: float = _number(
        0.0,
        0.0,
        64.0,
        "Width of lines of ink along silhouettes, borders and sharp creases, in pixels; 0: none",
    )
    supersampling: int = _number(1, 1, 4, "Samples of a pixel along each side")

    def __post_init__(self) -> None:
        for entry in fields(self):
            _check_setting(entry.name, getattr(self, entry.name), entry.default, entry.metadata)

    def with_settings(self, settings: dict[str, Any]) -> Look:
        """A look with some settings changed.

        Raises
        ------
        RosyError
            If there is no such setting, or its value is not allowed.
        """
        known = {entry.name for entry in fields(self)}
        for name in settings:
            if name not in known:
                raise RosyError(f"a look has no setting '{name}'")
        return replace(self, **settings)


def _check_setting(name: str, value: Any, default: Any, rules: Any) -> None:
    said = reprlib.repr(value)  # one short line, whatever a file holds
    if "colour" in rules:
        if not isinstance(value, str) or not re.fullmatch("#[0-9a-fA-F]{6}", value):
            raise RosyError(f"setting '{name}' is {said}, not a colour like #08080d")
    elif "options" in rules:
        if not isinstance(value, str) or value not in rules["options"]:
            wanted = ", ".join(rules["options"])
            raise RosyError(f"setting '{name}' is {said}, not one of {wanted}")
    elif "low" in rules:
        whole = isinstance(default, int)
        kind = int if whole else (int, float)
        if isinstance(value, bool) or not isinstance(value, kind):
            raise RosyError(f"setting '{name}' is {said}, not a {'whole ' * whole}number")
        if not rules["low"] <= value <= rules["high"]:
            raise RosyError(
                f"setting '{name}' is {said}, not from {rules['low']} to {rules['high']}"
            )
    elif not isinstance(value, bool):
        raise RosyError(f"setting '{name}' is {said}, not true or false")
