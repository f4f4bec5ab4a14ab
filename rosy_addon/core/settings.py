"""Declarative settings: dataclass fields with a range, a label and a help text.

A settings class is a frozen dataclass whose fields are made by `number`, `numbers`, `choice`,
`switch` and `color`. Each field has a `Setting`: its default, range, label, help text, place in the panels,
the stage of rendering that it affects and when it applies. Properties, panels, validation, command
line options, tables of the documentation and cache keys are derived from these descriptions. Other
fields of the class, such as arrays, have no description.
"""

from __future__ import annotations

import re
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cache
from types import MappingProxyType
from typing import Any

from .errors import RosyError

#: Values of switches on the command line.
SWITCH_VALUES = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}


class Stage(IntEnum):
    """Stages of rendering, in their order. A changed setting invalidates its stage and all later."""

    GBUFFER = 0  #: the visible pixels
    LIC = 1  #: the images of line integral convolution
    SHADING = 2  #: contrast, ink, color and light


def always(_settings: Any) -> bool:
    """Return True: the predicate of a setting that applies whatever the others are."""
    return True


@dataclass(frozen=True, kw_only=True)
class Setting:
    """The description of one setting.

    Attributes
    ----------
    name : str
        The stored key. `settings_of` fills it in.
    default : object
    text : str
        Help text for the user.
    label : str
        Name in the interface; made from the key if empty.
    panel_label : str
        A shorter name, for panels in which the label does not fit.
    panel : str
        Key of the panel that shows the setting. Empty: the panel for advanced settings.
    panel_before : str
        Setting above which this one is shown. Empty: panels follow the order of the fields.
    stage : Stage
        First stage of rendering that has to be repeated when the setting changes.
    applies : callable
        Whether the setting has an effect, given all settings: an object of the settings class, or
        Blender's property group of the same names.
    """

    name: str = ""
    default: Any = None
    text: str = ""
    label: str = ""
    panel_label: str = ""
    panel: str = ""
    panel_before: str = ""
    stage: Stage = Stage.LIC
    applies: Callable[[Any], bool] = always

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not allowed."""
        raise NotImplementedError

    def parse(self, text: str) -> Any:
        """Convert a text from the command line to a value of this setting.

        Only the type is converted; `check` tells whether the value is allowed.

        Raises
        ------
        ValueError
            If the text is not a number where one is expected.
        """
        return text

    def _refuse(self, value: Any, expected: str) -> None:
        # `reprlib` keeps the message to one short line, whatever a file holds.
        raise RosyError(f"setting '{self.name}' is {reprlib.repr(value)}, expected {expected}")


@dataclass(frozen=True, kw_only=True)
class Number(Setting):
    """A number: whole if its default is an int.

    Attributes
    ----------
    low, high : float
        The range, both ends included.
    unit : str
        "angle" (radians), "length" (Blender units), "size" (fraction of the size of the mesh), "pixels" or
        "spacings"; empty if it has none.
    soft_high : float or None
        Upper end of sliders, if lower than `high`.
    is_pixel_length : bool
        Whether the value is a length that depends on the resolution. Such lengths are multiplied
        when the frame has more pixels, as with supersampling.
    preview_low : float
        Lower end of the range in previews of reduced resolution, if higher than `low`.
    """

    low: float = 0.0
    high: float = 1.0
    soft_high: float | None = None
    unit: str = ""
    is_pixel_length: bool = False
    preview_low: float = 0.0

    @property
    def is_integer(self) -> bool:
        """Whether only whole numbers are allowed."""
        return isinstance(self.default, int)

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not a number within the range."""
        types = int if self.is_integer else (int, float)
        if isinstance(value, bool) or not isinstance(value, types):
            self._refuse(value, f"a {'whole ' * self.is_integer}number")
        if not self.low <= value <= self.high:
            self._refuse(value, f"a number from {self.low} to {self.high}")

    def parse(self, text: str) -> Any:
        """Convert a text to a number."""
        return type(self.default)(text)


@dataclass(frozen=True, kw_only=True)
class Numbers(Setting):
    """Several numbers that belong together, as a tuple.

    Attributes
    ----------
    parts : mapping of str to (float, float)
        The range of each number, both ends included, by its name in the interface.
    """

    parts: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not a tuple of numbers within their ranges."""
        names = ", ".join(self.parts).lower()
        if not isinstance(value, tuple) or len(value) != len(self.parts):
            self._refuse(value, f"{len(self.parts)} numbers: {names}")
        for (name, (low, high)), part in zip(self.parts.items(), value, strict=True):
            if isinstance(part, bool) or not isinstance(part, (int, float)):
                self._refuse(value, f"{len(self.parts)} numbers: {names}")
            if not low <= part <= high:
                self._refuse(value, f"{name.lower()} from {low} to {high}")

    def parse(self, text: str) -> Any:
        """Convert numbers with commas between them."""
        return tuple(float(part) for part in text.split(","))


@dataclass(frozen=True, kw_only=True)
class Choice(Setting):
    """One of several options.

    Attributes
    ----------
    options : mapping of str to str
        Help texts of the options by their stored keys.
    option_labels : mapping of str to str
        Names in the interface of the options that are not named after their keys.
    """

    options: Mapping[str, str] = field(default_factory=dict)
    option_labels: Mapping[str, str] = field(default_factory=dict)

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not one of the options."""
        if not isinstance(value, str) or value not in self.options:
            self._refuse(value, f"one of {', '.join(self.options)}")


@dataclass(frozen=True, kw_only=True)
class Switch(Setting):
    """True or false."""

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not a bool."""
        if not isinstance(value, bool):
            self._refuse(value, "true or false")

    def parse(self, text: str) -> Any:
        """Convert a text to a bool. Return the text itself if it is not one of `SWITCH_VALUES`."""
        return SWITCH_VALUES.get(text.lower(), text)


@dataclass(frozen=True, kw_only=True)
class Color(Setting):
    """A color in display values (sRGB), as ``#rrggbb``.

    Attributes
    ----------
    has_alpha : bool
        Whether ``#rrggbbaa`` is allowed as well, with an opacity.
    """

    has_alpha: bool = False

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not a color."""
        pattern = "#[0-9a-fA-F]{6}" + "([0-9a-fA-F]{2})?" * self.has_alpha
        if not isinstance(value, str) or not re.fullmatch(pattern, value):
            self._refuse(value, f"a color like #08080d{' or #08080d80' * self.has_alpha}")


def number(default: float, low: float, high: float, text: str, **description: Any) -> Any:
    """Return a dataclass field for a `Number`."""
    return _field(Number(default=default, low=low, high=high, text=text, **description))


def numbers(
    default: tuple[float, ...],
    text: str,
    parts: Mapping[str, tuple[float, float]],
    **description: Any,
) -> Any:
    """Return a dataclass field for `Numbers`."""
    return _field(Numbers(default=default, text=text, parts=parts, **description))


def choice(default: str, text: str, options: Mapping[str, str], **description: Any) -> Any:
    """Return a dataclass field for a `Choice`."""
    return _field(Choice(default=default, text=text, options=options, **description))


def switch(default: bool, text: str, **description: Any) -> Any:
    """Return a dataclass field for a `Switch`."""
    return _field(Switch(default=default, text=text, **description))


def color(default: str, text: str, **description: Any) -> Any:
    """Return a dataclass field for a `Color`."""
    return _field(Color(default=default, text=text, **description))


def _field(setting: Setting) -> Any:
    return field(default=setting.default, metadata={"setting": setting})


@cache
def settings_of(cls: type) -> Mapping[str, Setting]:
    """Return the descriptions of a settings class by name, in the order of its fields."""
    settings = {}
    for entry in fields(cls):
        setting: Setting | None = entry.metadata.get("setting")
        if setting is None:
            continue
        label = setting.label or title(entry.name)
        settings[entry.name] = replace(setting, name=entry.name, label=label)
    return MappingProxyType(settings)


def title(key: str) -> str:
    """Return a key as a label of the interface: "ink_color" is "Ink Color"."""
    return key.replace("_", " ").title()


def check_settings(settings: Any) -> None:
    """Check all values of an object of a settings class.

    Raises
    ------
    RosyError
        If a value is not allowed.
    """
    for name, setting in settings_of(type(settings)).items():
        setting.check(getattr(settings, name))


def pixel_lengths(cls: type) -> list[Number]:
    """Return the settings of a class that are lengths in pixels."""
    described = settings_of(cls).values()
    return [item for item in described if isinstance(item, Number) and item.is_pixel_length]


def panel_settings(cls: type, panel: str) -> tuple[str, ...]:
    """Return the names of the settings that a panel shows, from top to bottom."""
    shown = {name: item for name, item in settings_of(cls).items() if item.panel == panel}
    names = [name for name, setting in shown.items() if not setting.panel_before]
    for name, setting in shown.items():
        if setting.panel_before:
            names.insert(names.index(setting.panel_before), name)
    return tuple(names)
