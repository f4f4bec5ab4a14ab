"""Declarative settings: dataclass fields with a range, a label and a help text.

A settings class is a frozen dataclass whose fields are made by `number`, `fraction`, `numbers`,
`choice`, `switch` and `color`. Each field is described by a `Setting`: default, range, label, help text,
position in the panels, the stage of rendering that it affects, and when it has an effect. Properties, panels,
validation, command line options, tables of the documentation and cache keys are derived from these
descriptions. Other fields of the class, such as arrays, have no description.
"""

import re
import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import IntEnum
from functools import cache
from types import MappingProxyType
from typing import Any, TypeVar

from .errors import RosyError

#: Texts that are accepted for switches on the command line, and their values.
SWITCH_VALUES = {"true": True, "on": True, "1": True, "false": False, "off": False, "0": False}

Settings = TypeVar("Settings", bound=Any)

#: Smallest and largest allowed value of each number of a tuple, by the name of the number in the interface.
Ranges = Mapping[str, tuple[float, float]]


class Stage(IntEnum):
    """The stages of rendering, in their order.

    If a setting changes, the results of its stage and of all later stages have to be computed again.
    """

    GBUFFER = 0  #: the visible pixels
    LIC = 1  #: the images of line integral convolution
    SHADING = 2  #: contrast, ink, color and light


def always(_settings: Any) -> bool:
    """Return True. This is the predicate `Setting.applies` of settings that always have an effect."""
    return True


@dataclass(frozen=True, kw_only=True)
class Setting:
    """The description of one setting: its default, its texts in the interface, and when it has an effect.

    Attributes
    ----------
    name : str
        Name of the dataclass field. `settings_of` sets it.
    default : object
        Default value.
    text : str
        Help text for the user.
    label : str
        Name in the interface. If it is empty, `settings_of` makes it from the name of the field.
    panel_label : str
        Shorter name for panels in which the label does not fit. If it is empty, the label is used.
    panel : str
        Key of the panel that shows the setting. If it is empty, the panel for advanced settings does.
    panel_before : str
        Name of the setting above which this one is shown. If it is empty, settings are shown in the order of
        the dataclass fields.
    stage : Stage
        First stage of rendering that has to be repeated when the setting changes.
    applies : callable
        Function that returns whether the setting has an effect. It is called with all settings: an object of
        the settings class, or a property group of Blender with the same names.
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

        Only the type is converted. `check` then decides whether the value is allowed.

        Raises
        ------
        ValueError
            If a number is expected and the text is not a number.
        """
        return text

    def _refuse(self, value: Any, expected: str) -> None:
        # `reprlib` keeps the message to one short line, whatever a file holds.
        raise RosyError(f"setting '{self.name}' is {reprlib.repr(value)}, expected {expected}")


@dataclass(frozen=True, kw_only=True)
class Number(Setting):
    """The description of a setting that is a number. It is a whole number if its default is an int.

    Attributes
    ----------
    low, high : float
        Smallest and largest allowed value.
    unit : str
        Unit of the value: "angle" (radians), "length" (Blender units), "size" (fraction of the size of the
        mesh), "pixels" or "spacings" (multiples of the spacing); empty if it has no unit.
    soft_high : float or None
        Upper end of sliders in the interface, if it is lower than `high`.
    is_pixel_length : bool
        Whether the value is a length in pixels that is scaled with the resolution, for example if a frame is
        supersampled.
    preview_low : float
        Smallest value in previews of reduced resolution, if it is higher than `low`.
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
    """The description of a setting that is a tuple of several numbers.

    Attributes
    ----------
    parts : mapping of str to (float, float)
        Smallest and largest allowed value of each number, by the name of the number in the interface.
    """

    parts: Ranges = field(default_factory=dict)

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
        """Convert a text of numbers with commas between them to a tuple."""
        return tuple(float(part) for part in text.split(","))


@dataclass(frozen=True, kw_only=True)
class Choice(Setting):
    """The description of a setting that is one of several options.

    Attributes
    ----------
    options : mapping of str to str
        Help texts of the options by their keys, which are the values of the setting.
    option_labels : mapping of str to str
        Names of options in the interface by their keys. Names of other options are made from their keys.
    """

    options: Mapping[str, str] = field(default_factory=dict)
    option_labels: Mapping[str, str] = field(default_factory=dict)

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not one of the options."""
        if not isinstance(value, str) or value not in self.options:
            self._refuse(value, f"one of {', '.join(self.options)}")


@dataclass(frozen=True, kw_only=True)
class Switch(Setting):
    """The description of a setting that is true or false."""

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not a bool."""
        if not isinstance(value, bool):
            self._refuse(value, "true or false")

    def parse(self, text: str) -> Any:
        """Convert a text to a bool. Return the text itself if it is not one of `SWITCH_VALUES`."""
        return SWITCH_VALUES.get(text.lower(), text)


@dataclass(frozen=True, kw_only=True)
class Color(Setting):
    """The description of a setting that is a color, written as ``#rrggbb`` in display values (sRGB).

    Attributes
    ----------
    has_alpha : bool
        Whether a color with an opacity, ``#rrggbbaa``, is allowed as well.
    """

    has_alpha: bool = False

    def check(self, value: Any) -> None:
        """Raise a `RosyError` if a value is not a color."""
        pattern = "#[0-9a-fA-F]{6}" + "([0-9a-fA-F]{2})?" * self.has_alpha
        if not isinstance(value, str) or not re.fullmatch(pattern, value):
            self._refuse(value, f"a color like #08080d{' or #08080d80' * self.has_alpha}")


def number(default: float, low: float, high: float, text: str, **description: Any) -> Any:
    """Return a dataclass field for a setting that is a number; arguments are attributes of `Number`."""
    return _field(Number(default=default, low=low, high=high, text=text, **description))


def numbers(default: tuple[float, ...], text: str, parts: Ranges, **description: Any) -> Any:
    """Return a dataclass field for a setting of several numbers; arguments are attributes of `Numbers`."""
    return _field(Numbers(default=default, text=text, parts=parts, **description))


def choice(default: str, text: str, options: Mapping[str, str], **description: Any) -> Any:
    """Return a dataclass field for a setting with several options; arguments are attributes of `Choice`."""
    return _field(Choice(default=default, text=text, options=options, **description))


def switch(default: bool, text: str, **description: Any) -> Any:
    """Return a dataclass field for a setting that is true or false; arguments are attributes of `Switch`."""
    return _field(Switch(default=default, text=text, **description))


def color(default: str, text: str, **description: Any) -> Any:
    """Return a dataclass field for a setting that is a color; arguments are attributes of `Color`."""
    return _field(Color(default=default, text=text, **description))


def fraction(default: float, text: str, **description: Any) -> Any:
    """Return a dataclass field for a number from 0 to 1; arguments are other attributes of `Number`."""
    return number(default, 0.0, 1.0, text, **description)


def _field(setting: Setting) -> Any:
    return field(default=setting.default, metadata={"setting": setting})


@cache
def settings_of(cls: type) -> Mapping[str, Setting]:
    """Return the descriptions of all settings in a settings class by name, in the order of its fields."""
    settings = {}
    for entry in fields(cls):
        setting: Setting | None = entry.metadata.get("setting")
        if setting is None:
            continue
        label = setting.label or title(entry.name)
        settings[entry.name] = replace(setting, name=entry.name, label=label)
    return MappingProxyType(settings)


def title(key: str) -> str:
    """Return the label of the interface for a key: for "ink_color", it is "Ink Color"."""
    return key.replace("_", " ").title()


def check_settings(settings: Any) -> None:
    """Check that all values of an object of a settings class are allowed.

    Raises
    ------
    RosyError
        If a value is not allowed.
    """
    for name, setting in settings_of(type(settings)).items():
        setting.check(getattr(settings, name))


def with_settings(settings: Settings, changes: Mapping[str, Any]) -> Settings:
    """Return an object of a settings class with some settings changed.

    Parameters
    ----------
    settings : object
        An object of a settings class, such as a look.
    changes : mapping of str to object
        New values by the names of the settings. Tuples of numbers may be given as lists (from JSON).

    Raises
    ------
    RosyError
        If there is no such setting, or its value is not allowed.
    """
    known, values = settings_of(type(settings)), dict(changes)
    for name, value in changes.items():
        if name not in known:
            raise RosyError(f"unknown setting '{name}': choose {', '.join(known)}")
        if isinstance(known[name], Numbers) and isinstance(value, list):
            values[name] = tuple(value)
    return replace(settings, **values)


def shading_arguments(panel: str, applies: Callable[[Any], bool] = always) -> dict[str, Any]:
    """Return keyword arguments that declare a setting of a look that has no effect on LIC images.

    They are for `number`, `choice` and similar functions of `core.settings`. `panel` and `applies` are
    attributes of `Setting`: where the setting is shown, and when it has an effect.
    """
    return {"panel": panel, "stage": Stage.SHADING, "applies": applies}


def pixel_length(
    default: float, high: float, text: str, low: float = 0.0, **description: Any
) -> Any:
    """Return a dataclass field for a setting that is a length in pixels, scaled with the picture.

    `text` is the help text, `low` and `high` are the range; `description` has further arguments of `number`.
    By default, it is in the panel "streaks".
    """
    description = {"panel": "streaks", **description}
    return number(default, low, high, text, is_pixel_length=True, **description)


def pixel_lengths(cls: type) -> list[Number]:
    """Return the descriptions of settings that are lengths in pixels; see `Number.is_pixel_length`."""
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
