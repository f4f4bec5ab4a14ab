"""Random options for a command, taken from its parser."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection

from numpy.random import Generator

from rosy_addon.cli.parser import _build_parser
from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import settings_of
from rosy_addon.preset_files.store import preset_keys

from .damage import WORDS
from .preset_files import setting_value

#: Options that `random_options` does not choose: cases give these files and names themselves.
FILE_OPTIONS = {
    *("help", "mesh", "field", "output", "strokes", "guides", "field_mesh", "against", "scene"),
    *(
        "tone_image",
        "tone_picture",
        "tone_values",
        "color_values",
        "uv",
        "object",
        "camera",
        "frames",
    ),
    *("singularities", "all_cameras", "out", "save", "jobs", "scheduler", "array", "step"),
    "fields",
}


def random_options(
    rng: Generator,
    command: str,
    *,
    rate: float = 0.25,
    wild: float = 0.02,
    leave_out: Collection[str] = (),
) -> list[str]:
    """Return options of a command.

    Parameters
    ----------
    rng : Generator
    command : str
    rate : float
        Probability of each option.
    wild : float
        Probability of a value from `damage.WORDS`.
    leave_out : collection of str
        Further destinations that are not chosen.
    """
    words = []
    for action in _actions(command):
        if action.dest in FILE_OPTIONS or action.dest in leave_out or not action.option_strings:
            continue
        for _ in range(rng.integers(1, 4) if action.dest == "set" else 1):
            if rng.random() < rate:
                words += _option(rng, action, wild)
    return words


def _actions(command: str) -> list[argparse.Action]:
    parser = _build_parser("rosy")
    (subparsers,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return subparsers.choices[command]._actions


def _option(rng: Generator, action: argparse.Action, wild: float) -> list[str]:
    name = action.option_strings[rng.integers(len(action.option_strings))]
    if action.nargs == 0:
        return [name]
    if rng.random() < wild:
        value = WORDS[rng.integers(len(WORDS))].replace("\0", "")
    elif action.choices:
        value = str(list(action.choices)[rng.integers(len(action.choices))])
    else:
        value = _VALUES[action.dest](rng)
    return [name, value] if rng.random() < 0.5 else [f"{name}={value}"]


def _number(low: float, high: float, common: tuple[float, ...]) -> Callable[[Generator], str]:
    """Return a function that chooses a common value, or any in a range, or one of its ends."""

    def choose(rng: Generator) -> str:
        kind = rng.random()
        if kind < 0.6:
            return repr(float(rng.choice(common)))
        return repr(float(rng.choice([low, high]) if kind < 0.75 else rng.uniform(low, high)))

    return choose


def _numbers(count: int, spread: float) -> Callable[[Generator], str]:
    def choose(rng: Generator) -> str:
        values = rng.normal(0, spread, count) * (rng.random(count) < 0.8)
        if rng.random() < 0.1:
            values *= 10.0 ** rng.uniform(-300, 300)
        return ",".join(map(repr, values.tolist()))

    return choose


def _size(rng: Generator) -> str:
    if rng.random() < 0.05:
        return ("0x0", "1x1", "16384x1", "1x4000", "99999x99999", "16384x2", "20x-3")[
            rng.integers(7)
        ]
    width, height = rng.integers(1, 120, 2)
    return f"{width}x{height}"


def _degree(rng: Generator) -> str:
    return str(rng.choice([1, 2, 3, 4, 4, 4, 5, 6, 7, 8, 12, 12, 0, 13]))


def _preset(rng: Generator) -> str:
    keys = preset_keys()
    return keys[rng.integers(len(keys))]


def _setting(rng: Generator) -> str:
    settings = list(settings_of(Look).values())
    setting = settings[rng.integers(len(settings))]
    value = setting_value(rng, setting)
    text = ",".join(map(repr, value)) if isinstance(value, tuple) else str(value)
    return f"{setting.name}={text}"


def _colors(rng: Generator) -> str:
    return ("red", "#000,#f00", "", "url(#a)", '"/><script>', "rgb(1,2,3)")[rng.integers(6)]


def _text(rng: Generator) -> str:
    return ("mm", "a caption " * 40, "", "$x_", r"$\frac{1}{$", "two\nlines", "\U0001f600é")[
        rng.integers(7)
    ]


#: A value of each option that takes one.
_VALUES: dict[str, Callable[[Generator], str]] = {
    "degree": _degree,
    "to_degree": _degree,
    "axis": _numbers(3, 1.0),
    "reach": _number(0, 10, (0.0, 0.05, 0.3)),
    "sharp_angle": _number(0, 180, (30.0, 80.0)),
    "view": _numbers(2, 60.0),
    "light_direction": _numbers(3, 1.0),
    "size": _size,
    "margin": lambda rng: str(rng.choice([0, 1, 4, 16, 512, -1])),
    "workers": lambda rng: str(rng.integers(-1, 5)),
    "preset": _preset,
    "set": _setting,
    "pictures": lambda rng: str(rng.integers(1, 5)),
    "rate": _number(0.1, 1000, (24.0, 1.0)),
    "turn": _number(-360, 360, (0.0, 22.5)),
    "smooth": _number(0, 10, (0.0, 0.02, 0.2)),
    "cancel_pairs": _number(0, 10, (0.0, 0.02, 0.2)),
    "spacing": _number(0.5, 512, (4.0, 9.0, 14.0)),
    "distance": _number(1e-6, 1e6, (0.1, 0.3)),
    "layering": _number(0, 1, (0.3,)),
    "swell": _number(0, 1, (0.5, 1.0)),
    "curvature": _number(0, 1, (0.5,)),
    "gaps": _number(0, 4, (0.3,)),
    "taper": _number(0, 50, (3.0,)),
    "arrows": _number(0, 1000, (5.0, 12.0)),
    "overshoot": _number(0, 256, (5.0,)),
    "singularity_size": _number(1, 256, (9.0, 20.0)),
    "width": _number(0.01, 1000, (1.6,)),
    "columns": lambda rng: str(rng.integers(0, 5)),
    "dpi": lambda rng: str(rng.integers(9, 70)),
    "caption": _text,
    "scale_bar": _text,
    "color_label": _text,
    "millimeters": _number(1, 1e5, (200.0,)),
    "colors": _colors,
}
