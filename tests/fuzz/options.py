"""Random options of a command, from its parser: the values are texts that the parser accepts."""

import argparse
from collections.abc import Collection
from functools import cache
from typing import Any

from numpy.random import Generator

from rosy_addon.cli.parser import _build_parser
from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import Choice, Color, Numbers, Setting, Switch, settings_of
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.preset_files.store import preset_keys

from .damage import random_word

#: Options that `random_options` does not choose: cases give these files and names themselves.
_FILES = "mesh field fields output strokes guides field_mesh against singularities tone_image tone_picture edges"
_OTHERS = "help scene tone_values color_values uv object camera frames all_cameras out save jobs"
FILE_OPTIONS = frozenset(f"{_FILES} {_OTHERS} scheduler array step".split())

#: Texts that are tried as the value of an option.
_NUMBERS = "1 2 3 4 4 4 6 12 0 0.02 0.05 0.3 0.5 9.5 14.0 30.0 80.0 -22.5 100 512 1e-6 1e4"
_TUPLES = "1,0,0 1,2,3 -1,0.3,2 0,0,0 1e-30,2,1e30 30,20 -90,400 64x48 30x30 7x90 1x1 1x4000"
_TEXTS = "red #000,#f00 url(#a) rgb(1,2,3) mm $x_ \U0001f600é"
CANDIDATES = (
    *f"{_NUMBERS} {_TUPLES} {_TEXTS}".split(),
    *('"/><script>', "a caption " * 40, "", "two\nlines", r"$\frac{1}{$"),
)

#: Largest values of options that would take minutes.
LIMITS = {"pictures": 4, "workers": 4, "dpi": 80, "columns": 4, "width": 30}


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
        if action.dest in leave_out:
            continue
        for _ in range(rng.integers(1, 4) if action.dest == "set" else 1):
            if rng.random() >= rate:
                continue
            name = action.option_strings[rng.integers(len(action.option_strings))]
            if action.nargs == 0:
                words.append(name)
                continue
            is_wild = rng.random() < wild
            value = random_word(rng).replace("\0", "") if is_wild else _value(rng, action, command)
            words += [name, value] if rng.random() < 0.5 else [f"{name}={value}"]
    return words


@cache
def _actions(command: str) -> list[argparse.Action]:
    """Return the options of a command that can be chosen at random."""
    parser = _build_parser("rosy")
    (subparsers,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    actions = subparsers.choices[command]._actions
    return [a for a in actions if a.option_strings and a.dest not in FILE_OPTIONS]


def _value(rng: Generator, action: argparse.Action, command: str) -> str:
    if action.dest == "set":
        settings = list(settings_of(StrokeStyle if command == "strokes" else Look).values())
        setting = settings[rng.integers(len(settings))]
        value = setting_value(rng, setting)
        return f"{setting.name}={','.join(map(str, value)) if isinstance(value, list) else value}"
    values = list(action.choices or (preset_keys() if action.dest == "preset" else ()))
    values = values or [text for text in CANDIDATES if _accepts(action, text)]
    return str(values[rng.integers(len(values))])


def _accepts(action: argparse.Action, text: str) -> bool:
    try:
        value = text if action.type is None else action.type(text)
    except (argparse.ArgumentTypeError, ValueError, TypeError):
        return False
    return action.dest not in LIMITS or value <= LIMITS[action.dest]


def setting_value(rng: Generator, setting: Setting) -> Any:
    """Return a value of a setting: an end of its range, any in it, or one near the default."""
    if isinstance(setting, Switch):
        return bool(rng.random() < 0.5)
    if isinstance(setting, Choice):
        return list(setting.options)[rng.integers(len(setting.options))]
    if isinstance(setting, Color):
        return f"#{rng.integers(1 << 24):06x}"
    if isinstance(setting, Numbers):
        return [float(rng.uniform(low, high)) for low, high in setting.parts.values()]
    low, high, default = setting.low, setting.high, setting.default
    near = min(max(default * 10.0 ** rng.uniform(-1, 1), low), high)
    value = (low, high, rng.uniform(low, high), near, near, near)[rng.integers(6)]
    return round(value) if isinstance(default, int) else float(value)
