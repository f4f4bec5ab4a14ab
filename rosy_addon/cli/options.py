"""`CommandParser` and `Options`: the parser of a command, with options that several commands share."""

import argparse
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from ..api.pictures import DEFAULT_VIEW, TONE_SOURCES, VERTEX_COLOR, picture_look
from ..compositor.look import Look
from ..core.errors import RosyError
from ..core.file_io import add_input, check_writable
from ..core.settings import Number, Numbers, Setting, Switch, settings_of
from ..field.rosy_field import check_degree
from ..field.up_axis import UP_AXIS_MATRIX
from ..field.validate import OFF_SURFACE
from ..preset_files.store import default_user_folder, find_preset_file, preset_keys, read_preset
from ..projection.camera import check_size
from .streams import print_line

#: A function that converts the text of an argument to a value.
Parse = Callable[[str], Any]


class CommandParser(argparse.ArgumentParser):
    """A parser of a command, with methods that add the options that several commands share.

    Control characters in its messages are escaped. Files may be named before, between and after options.
    """

    _is_intermixed = False

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse arguments. Return the options and the unknown arguments, as `argparse` does."""
        if self._is_intermixed or self._subparsers is not None:
            return super().parse_known_args(args, namespace)
        self._is_intermixed = True  # parse_known_intermixed_args calls this method
        try:
            return self.parse_known_intermixed_args(args, namespace)
        finally:
            self._is_intermixed = False

    def _print_message(self, message: str, file: TextIO | None = None) -> None:
        print_line(message.removesuffix("\n"), sys.stderr if file is None else file)

    def add_value(
        self, option: str, metavar: str, text: str, parse: Parse | None = None, **keywords: Any
    ) -> None:
        """Add an option with a value.

        Parameters
        ----------
        option : str
            Name of the option, such as "--size".
        metavar : str
            Placeholder for the value in the help.
        text : str
            Help text, in which %(default)s stands for the default.
        parse : function, optional
            Function that returns the value for the text after the option. By default, the value is the text.
        **keywords
            More keyword arguments of `argparse.ArgumentParser.add_argument`.
        """
        self.add_argument(option, metavar=metavar, help=text, type=parse, **keywords)

    def add_switch(self, option: str, text: str) -> None:
        """Add an option without a value, which is False by default."""
        self.add_argument(option, action="store_true", help=text)

    def add_toggle(self, option: str, text: str, **keywords: Any) -> None:
        """Add an option with the value True, and its negation (``--no-...``) with the value False."""
        self.add_argument(option, help=text, action=argparse.BooleanOptionalAction, **keywords)

    def add_output_option(self, metavar: str, text: str | None = None, **keywords: Any) -> None:
        """Add the option -o, the path of the output, which is required unless `keywords` say otherwise."""
        keywords = {"required": True, "metavar": metavar, "help": text} | keywords
        self.add_argument("-o", "--output", type=Path, **keywords)

    def add_object_option(self, text: str) -> None:
        """Add the option --object with one or more names, which may be repeated.

        A name with a dash at its start is given as ``--object=-x``.
        """
        self.add_value("--object", "NAME", text, nargs="+", action="extend")

    def add_setting_option(self, setting: Setting, note: str) -> None:
        """Add an option for a setting, with the range, help text and default of the setting.

        If the option is not given, `Options` has no attribute for it. Angles are in degrees on the command
        line, and are converted to radians. `note` is added to the help text.
        """
        option = f"--{setting.name.replace('_', '-')}"
        text = setting.text[0].lower() + setting.text[1:] + note
        add = partial(self.add_argument, option, default=argparse.SUPPRESS)
        match setting:
            case Switch():
                self.add_toggle(option, text, default=argparse.SUPPRESS)
            case Numbers(parts=parts, default=default):
                names, values = ",".join(parts), ",".join(f"{value:g}" for value in default)
                add(type=float_tuple(len(parts), names), metavar=names, help=f"{text} ({values})")
            case Number(low=low, high=high, unit="angle", default=default):
                parse = degrees_between(low, high)
                add(type=parse, metavar="DEGREES", help=f"{text} ({np.degrees(default):g})")
            case Number(low=low, high=high, unit="size", default=default):
                add(type=float_between(low, high), metavar="SHARE", help=f"{text} ({default:g})")
            case _:
                raise TypeError(f"setting '{setting.name}' has no option")

    def add_set_option(self, settings_class: type, text: str) -> None:
        """Add the option --set, which may be repeated. `Options.requested_settings` returns the settings."""
        self.set_defaults(settings_class=settings_class)
        names = ", ".join(settings_of(settings_class))
        self.add_value("--set", "NAME=VALUE", f"{text}: {names}", action="append", default=[])

    def add_workers_option(self) -> None:
        """Add the option --workers, the number of processes that draw a picture."""
        text = (
            "number of processes that draw a large picture together; 0 is one for each core "
            "(%(default)d). The picture is the same for any number"
        )
        self.add_value("--workers", "N", text, int_between(0, 256), default=0)

    @contextmanager
    def only_for(self, kind: str) -> Iterator[None]:
        """Context manager: note that the options added in its block are only for one kind of file.

        `kind` is the name of these files in messages, such as ".svg files". With other files,
        `Options.check_only_for` raises an error if one of these options is given.
        """
        first = len(self._actions)
        yield
        kinds = self.get_default("kinds") or {}
        self.set_defaults(kinds={**kinds, kind: self._actions[first:]})

    def add_size_option(self) -> None:
        """Add the option --size, the size of a picture."""
        self.add_value("--size", "WxH", "size in pixels", parse_size)

    def add_direction_options(self) -> None:
        """Add the options --view, --up and --ortho, which set the camera."""
        text = "azimuth and elevation in degrees: 0,0 is from the front, 90,0 from the right, 0,90 from above"
        self.add_value("--view", "AZ,EL", text, float_tuple(2, "AZ,EL"), default=DEFAULT_VIEW)
        text = "upward axis of the file; by default y for .obj, .off, .om and glTF, otherwise z"
        self.add_argument("--up", choices=list(UP_AXIS_MATRIX), help=text)
        text = "orthographic projection, or with --no-ortho perspective"
        self.add_toggle("--ortho", text, dest="orthographic")

    def add_look_options(self) -> None:
        """Add the options --preset and --set."""
        self.add_preset_option("preset of the look")
        self.add_set_option(Look, "one setting of the look, after the preset")

    def add_preset_option(self, text: str) -> None:
        """Add the option --preset. `text` says what it is for."""
        names = ", ".join(preset_keys())
        text = f"{text}: {names}, one of your own, or a .json file; `presets` lists them"
        self.add_value("--preset", "NAME", text)

    def add_degree_option(self, text: str) -> None:
        """Add the option --degree, the degree of a field, with a help text."""
        self.add_value("--degree", "N", text, int, action=_CheckedDegree)

    def add_undefined_option(self) -> None:
        """Add the options --undefined and --off-surface: arguments of `api.read_field`.

        --undefined sets `nonfinite` to "zero".
        """
        text = "treat NaN and infinite vectors as undefined"
        keywords = {"action": "store_const", "const": "zero", "default": "error"}
        self.add_argument("--undefined", dest="nonfinite", help=text, **keywords)
        text = (
            "what to do about vectors off the surface: report an error if they are more than 1 in 100, rotate "
            "them into the surface, or treat them as undefined (%(default)s)"
        )
        self.add_argument("--off-surface", choices=OFF_SURFACE, default="error", help=text)

    def add_picture_options(self) -> None:
        """Add the options of a picture of a mesh: view, look, values for colors, source of the tone."""
        self.add_direction_options()
        self.add_size_option()
        self.add_workers_option()
        self.add_look_options()
        text = (
            "color the lines by the numbers of a property of the faces or vertices, such as a vertex "
            "property of a .ply file"
        )
        self.add_value("--color-values", "NAME", text)
        text = f"take the tone from a vertex property of a .ply file, or from the vertex colors: '{VERTEX_COLOR}'"
        self.add_value("--tone-attribute", "NAME", text, dest="tone_values")
        text = "take the tone from an image on the UV map of an .obj file"
        self.add_value("--tone-image", "IMAGE.png", text, Path)


class _CheckedDegree(argparse.Action):
    """Store the degree of a field, or raise a `RosyError` if there can be no field of this degree."""

    def __call__(self, _parser: Any, options: Any, degree: Any, _option: Any = None) -> None:
        setattr(options, self.dest, check_degree(degree))


class Options(argparse.Namespace):
    """The options of a command, as parsed by a `CommandParser`."""

    def check_output(self, suffix: str = "") -> None:
        """Check that the file of the option -o can be written, before its contents are computed.

        Parameters
        ----------
        suffix : str
            The extension that the name of the file must have. By default, any is allowed.

        Raises
        ------
        RosyError
            If the name has another extension, the file cannot be written, or another option names it as
            an input.
        """
        for name, value in vars(self).items():
            for path in value if isinstance(value, list) else [value]:
                if name != "output" and isinstance(path, (str, os.PathLike)):
                    add_input(path)
                    add_input(str(path).partition("=")[2])  # of TITLE=FIELD
        check_writable(self.output, follow_links=True)
        if suffix and self.output.suffix.lower() != suffix:
            raise RosyError(f"{self.output}: the name of the file must end in {suffix}")

    def check_only_for(self, kind: str, file: Path | str) -> None:
        """Raise an error if an option of `CommandParser.only_for` is given for a file of another kind.

        Parameters
        ----------
        kind : str
            The kind of file that the options are for.
        file : Path or str
            The file of this command, which is of another kind.
        """
        for action in self.kinds[kind]:
            if getattr(self, action.dest, action.default) != action.default:
                name = action.option_strings[0] if action.option_strings else action.metavar
                raise RosyError(f"{file}: {name} applies only to {kind}")

    def requested_preset(self) -> Path | None:
        """Return the file of the preset of the option --preset. None if the option is not given."""
        return find_preset_file(self.preset, user_presets_folder()) if self.preset else None

    def requested_settings(self) -> dict[str, Any]:
        """Return the settings of the options --set, by name."""
        return dict(_parse_setting(text, settings_of(self.settings_class)) for text in self.set)

    def requested_look(self, default: Look) -> Look:
        """Return the look of the option --preset (by default `default`), changed by the options --set."""
        preset = self.requested_preset()
        look = default if preset is None else read_preset(preset).look
        return look.with_settings(self.requested_settings())

    def api_arguments(self, function: Callable[..., Any], **others: Any) -> dict[str, Any]:
        """Return keyword arguments for a function of `api`, from the options of the command.

        These are the values of all options whose names are keyword parameters of the function, and the
        settings of the options --set.

        Parameters
        ----------
        function : function
            The function of `api` that is going to be called.
        **others
            Further arguments. They take precedence over options of the same name.
        """
        names = inspect.getfullargspec(function).kwonlyargs
        arguments = {name: value for name, value in vars(self).items() if name in names}
        return arguments | {"preset": self.requested_preset()} | others | self.requested_settings()

    def picture_arguments(self, function: Callable[..., Any], path: Path) -> dict[str, Any]:
        """Return keyword arguments (see `api_arguments`) for a function of `api` that draws pictures.

        The options are checked here, so that their errors are reported before the files are read.

        Parameters
        ----------
        function : function
            The function of `api`, such as `render`.
        path : Path
            The file that is drawn, for messages.

        Raises
        ------
        RosyError
            If the options of the look, the tone or the size are invalid.
        """
        values = {name: getattr(self, name, None) for name in ("color_values", *TONE_SOURCES)}
        picture_look(str(path), self.requested_preset(), self.requested_settings(), **values)
        arguments = self.api_arguments(function)
        if "size" in arguments:
            check_size(*self.size)
        return arguments


def add_subcommand(
    subparsers: Any, run: Callable[[Options], None], function: Callable[..., Any] | None = None
) -> CommandParser:
    """Add a command, and return its parser.

    Parameters
    ----------
    subparsers : argparse action
    run : function
        Function that runs the command: ``run_NAME``, where NAME is the name of the command. The first line of
        its docstring is the help of the command.
    function : function, optional
        A function of `api` that the command calls with its options; see `api_arguments`. The defaults of its
        keyword parameters are the defaults of the options.
    """
    # With `python -OO` there are no docstrings: the help of the command is then empty.
    name, text = run.__name__.removeprefix("run_"), (run.__doc__ or "").partition("\n")[0]
    parser = subparsers.add_parser(name, help=text, description=text)
    if function is not None:
        parser.set_defaults(**inspect.getfullargspec(function).kwonlydefaults)
    parser.set_defaults(run=run)
    return parser


def parse_size(text: str) -> tuple[int, int]:
    """Return the width and height from a text such as 640x480."""
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not a size such as 640x480")
    return int(match[1]), int(match[2])


def float_tuple(count: int, metavar: str) -> Callable[[str], tuple[float, ...]]:
    """Return a function that parses `count` numbers, separated by commas."""

    def parse(text: str) -> tuple[float, ...]:
        values: tuple[float, ...] = ()
        with suppress(ValueError):
            values = tuple(map(float, text.split(",")))
        if len(values) != count:
            raise argparse.ArgumentTypeError(f"{text!r} is not {metavar}")
        return values

    return parse


def float_between(low: float, high: float) -> Callable[[str], float]:
    """Return a function that parses a number in the closed interval from `low` to `high`."""

    def parse(text: str) -> float:
        value = np.nan
        with suppress(ValueError):
            value = float(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number from {low:g} to {high:g}")
        return value

    return parse


def degrees_between(low: float, high: float) -> Callable[[str], float]:
    """Return a function that parses an angle in degrees and returns radians. Limits are in radians."""
    parse = float_between(np.degrees(low), np.degrees(high))
    return lambda text: float(np.radians(parse(text)))


def int_between(low: int, high: int) -> Callable[[str], int]:
    """Return a function that parses an integer in the closed interval from `low` to `high`."""

    def parse(text: str) -> int:
        if not re.fullmatch(r"[+-]?\d{1,18}", text) or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {low} to {high}")
        return int(text)

    return parse


def _parse_setting(text: str, settings: Mapping[str, Setting]) -> tuple[str, Any]:
    """Return the name and the value of NAME=VALUE, converted to the type of the setting."""
    name, separator, value = text.partition("=")
    if not separator:
        raise RosyError(f"--set {text}: expected NAME=VALUE")
    if name not in settings:
        raise RosyError(f"--set {text}: unknown setting '{name}': choose {', '.join(settings)}")
    try:
        return name, settings[name].parse(value)
    except ValueError:
        expected = "a whole number" if isinstance(settings[name].default, int) else "a number"
        if isinstance(settings[name], Numbers):
            expected = "numbers with commas between them"
        raise RosyError(f"--set {text}: expected {expected}") from None


def user_presets_folder() -> Path:
    """Return the folder of the user's presets. In Blender it is the folder of the extension."""
    if sys.modules.get("bpy") is None:
        return default_user_folder()
    from ..scene.files import user_presets_folder

    return user_presets_folder()
