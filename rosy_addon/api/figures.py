"""`figure`: draw fields side by side, with keys (legends), with matplotlib."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..annotation.figure_parts import ColorBar
from ..annotation.round_numbers import round_below
from ..annotation.singularity_settings import shows_singularities
from ..compositor.color_values import value_ends, value_ranges
from ..compositor.look import Look, colors_magnitude, colors_values, magnitude_range, uses_magnitude
from ..compositor.look_units import scaled_look
from ..core.color import color_stops
from ..core.errors import RosyError, counted
from ..core.file_io import write_bytes
from ..field.analysis import DEFAULT_REACH
from ..field.field import Field
from ..projection.camera import Camera, orbit_basis, orbit_camera
from ..projection.gbuffer import MeshInstance
from .comparison import Comparison, compare, titled_fields
from .figure_panels import Studio
from .pictures import DEFAULT_VIEW, picture_look, upright_instance

if TYPE_CHECKING:
    from ..external.matplotlib_figure import Figure

#: The parts that a figure may have, from top to bottom.
PARTS = ("fields", "differences", "table")

#: Field whose lines are drawn over a difference: the other field, the first field, or both.
LINES = ("other", "first", "both")

#: The resolution at which lengths of the look are in pixels of the figure. At other resolutions they are
#: scaled, so lines have the same width in print.
LENGTH_DPI = 150

#: Smallest and largest value of each numeric argument. Widths are in inches, angles in degrees.
LIMITS = {"width": (0.5, 100.0), "dpi": (10, 2400), "largest_angle": (0.0, 360.0)}

#: Limits of the height of a panel, relative to its width.
MIN_ASPECT, MAX_ASPECT = 0.4, 1.6

#: Smallest width of a panel in inches, which has room for the letter in front of its title.
MIN_PANEL_WIDTH = 0.2

#: Default of the largest number of panels side by side. Width of the empty border of a panel, as a fraction
#: of the panel.
MAX_COLUMNS, MARGIN = 3, 0.02

#: Suffixes of the files of figures.
FIGURE_SUFFIXES = (".pdf", ".svg", ".png")


def figure(
    fields: Field | Sequence[Field] | Mapping[str, Field] | Comparison,
    *,
    parts: Sequence[str] = ("fields",),
    columns: int | None = None,
    width: float = 7.0,
    dpi: int = 300,
    view: tuple[float, float] = DEFAULT_VIEW,
    orthographic: bool = True,
    preset: str | os.PathLike[str] | None = None,
    color_values: str | Sequence[str | ArrayLike] | None = None,
    color_label: str | None = None,
    largest_angle: float = 0.0,
    lines: str = "other",
    reach: float = DEFAULT_REACH,
    scale_bar: str | None = None,
    caption: str = "",
    workers: int = 0,
    **settings: Any,
) -> Figure:
    """Draw fields side by side, with keys (legends), as a figure of matplotlib for papers and talks.

    All panels have one camera, one light and one range of colors. Titles, keys and singularities are
    text and vectors. Singularities are shown unless ``singularity_dots="none"``.

    Parameters
    ----------
    fields : Field, sequence of Field, mapping of str to Field, or Comparison
        The keys of a mapping are the titles. Fields may be on different surfaces. A `Comparison` is used as
        it is.
    parts : sequence of {"fields", "differences", "table"}
        What to draw. "fields" are pictures of the fields. "differences" show the angle between each field
        and the first one as a color, from 0 to 180/N degrees, with a cross at the largest angle and the
        singularities of both fields. "table" is the table of `compare`.
    columns : int, optional
        Number of panels side by side; by default at most 3.
    width : float
        Width of the figure in inches. The height follows from the contents.
    dpi : int
        Resolution of the pictures. Lines do not get thinner with it: lengths of the look are in
        pixels at 150 dpi.
    view : (float, float)
        Azimuth and elevation of the camera in degrees: (0, 0) is from the front, (0, 90) from above.
    orthographic : bool
        Whether the projection is orthographic. A scale bar needs this.
    preset : str or path-like, optional
        Name of a preset of the look, or a ``.json`` file; see `list_presets`.
    color_values : str, or sequence of str or array_like, optional
        Values for the color map, at faces, vertices or corners, for each field; or the name of an array for
        all fields. See `render`.
    color_label : str, optional
        Label of the color bar of the fields: a quantity and its unit. By default the name of the array of
        values, or "magnitude" if the colors show magnitudes.
    largest_angle : float
        Angle at the top of the color map of differences, in degrees. 0 means 180/N.
    lines : {"other", "first", "both"}
        Field whose lines are drawn over a difference: the other field, the first field, or both.
    reach : float
        Largest distance of singularities that match, as a fraction of the longest side of the mesh; see
        `compare`.
    scale_bar : str, optional
        Unit of the coordinates, such as "mm", or "" if they have none. By default, no scale bar is drawn.
    caption : str
        Text below everything else.
    workers : int
        Number of processes that draw a large picture together. 0 means one for each processor core.
    **settings
        Settings of the look, after the preset: ``length=120, seed=3``.

    Returns
    -------
    matplotlib.figure.Figure
        ``savefig`` writes it as ``.pdf``, ``.svg`` or ``.png``. It is drawn with the defaults of matplotlib:
        a ``matplotlibrc`` and ``rcParams`` do not apply. To change a figure, set properties of its parts:
        ``for text in page.findobj(Text): text.set_fontfamily("serif")``.

    Raises
    ------
    RosyError
        If matplotlib is not installed, there is no field or nothing to compare, the panels are too narrow,
        or for the same reasons as `render`.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> methods = {"Form": rf.form(torus), "Smoothest": rf.smoothest(torus)}
    >>> page = rf.figure(methods, parts=("fields", "differences", "table"), dpi=60)  # doctest: +SKIP
    >>> page.savefig("torus.pdf")  # doctest: +SKIP
    """
    drawing = load_drawing()
    parts = (parts,) if isinstance(parts, str) else tuple(parts)
    comparison = _comparison_of(fields, parts, reach)
    name = next(iter(comparison.fields.values())).surface.name
    _check_parts(comparison, parts, lines)
    _check_numbers(name, width=width, dpi=dpi, largest_angle=largest_angle)
    if not (orthographic or scale_bar is None):
        raise RosyError(f"{name}: a scale bar needs the orthographic projection")
    shown = {"singularity_dots": "visible", **settings}
    look = picture_look(name, preset, shown, color_values=color_values)
    instances = _instances(name, comparison.fields, color_values)
    look = _figure_look(look, comparison.fields, instances.values(), dpi)
    if color_label is None:
        color_label = color_values if isinstance(color_values, str) else ""
        color_label = "magnitude" if colors_magnitude(look) else color_label
    color_bar = None
    if colors_magnitude(look) or colors_values(look):
        color_bar = ColorBar(color_label, *look.color_range, color_stops(look.color_map))
    columns = min(len(instances), MAX_COLUMNS) if columns is None else max(columns, 1)
    has_key = shows_singularities(look) or color_bar is not None or "differences" in parts
    points = np.concatenate([instance.face_points() for instance in instances.values()])
    pixels = drawing.panel_width(width, columns, has_key, dpi)
    if pixels < MIN_PANEL_WIDTH * dpi and set(parts) != {"table"}:
        room = f"a width of {width:g} inches has no room for {counted(columns, 'column')} of panels"
        raise RosyError(f"{name}: {room}: choose a larger width, or fewer columns")
    camera = _panel_camera(points, view, pixels, perspective=not orthographic)
    studio = Studio(comparison, instances, camera, look, workers)
    rows = []
    if "fields" in parts:
        titles = [""] if isinstance(fields, Field) else list(instances)
        rows.append(studio.field_row(titles, color_bar))
    if "differences" in parts:
        rows.append(studio.difference_row(lines, largest_angle))
    table = comparison.cells() if "table" in parts else []
    bar = None if scale_bar is None else _scale_bar(camera, scale_bar, drawing.SCALE_BAR_SHARE)
    page: Figure = drawing.Page(rows, table, caption, bar, width, columns, dpi).draw()
    return page


_Fields = Field | Sequence[Field] | Mapping[str, Field] | Comparison


def _comparison_of(fields: _Fields, parts: Sequence[str], reach: float) -> Comparison:
    """Return the comparison of fields. It has no differences if none of the `parts` of the figure shows any.

    `reach` is the largest distance of singularities that match, as a fraction of the size of the mesh.
    """
    if isinstance(fields, Comparison):
        return fields
    titled = {fields.surface.name: fields} if isinstance(fields, Field) else fields
    if "differences" in parts or "table" in parts:
        return compare(titled, reach=reach)
    return Comparison(titled_fields(titled), {}, {})


def save_figures(path: str | os.PathLike[str], figures: Figure | Sequence[Figure]) -> None:
    """Write figures to a file, with embedded fonts and text as text.

    A `RosyWarning` names letters that the font of matplotlib lacks. A ``.pdf`` or ``.png`` has placeholders for
    them. In an ``.svg``, only formulas have placeholders: the viewer draws other texts with its own fonts.

    Parameters
    ----------
    path : path-like
        ``.pdf``, with a page for each figure; or ``.svg`` or ``.png`` for a single one.
    figures : matplotlib.figure.Figure, or sequence of them

    Raises
    ------
    RosyError
        If the format cannot hold them, or the file cannot be written.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> fields = {"Form": rf.form(torus), "Smoothest": rf.smoothest(torus)}
    >>> pages = [rf.figure(fields, dpi=60), rf.figure(fields, parts=("differences", "table"), dpi=60)]  # doctest: +SKIP
    >>> rf.save_figures("methods.pdf", pages)  # doctest: +SKIP
    """
    pages = list(figures) if isinstance(figures, Sequence) else [figures]
    check_figure_path(Path(path), len(pages))
    contents = load_drawing().encode_figures(pages, Path(path).suffix.lower())
    write_bytes(path, contents, follow_links=True)


def check_figure_path(path: Path, count: int = 1) -> None:
    """Check that a file format can hold this many figures.

    Raises
    ------
    RosyError
        If the suffix is unknown, or the format cannot hold them.
    """
    if path.suffix.lower() not in FIGURE_SUFFIXES:
        raise RosyError(f"{path}: the name of the file must end in {', '.join(FIGURE_SUFFIXES)}")
    if not count:
        raise RosyError(f"{path}: there is no figure to write")
    if count > 1 and path.suffix.lower() != ".pdf":
        raise RosyError(f"{path}: only a .pdf can hold {count} figures")


def load_drawing() -> ModuleType:
    """Return the module that draws figures.

    Raises
    ------
    RosyError
        If matplotlib is not installed, or this is the extension for Blender.
    """
    try:
        from ..external import matplotlib_figure
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.startswith("matplotlib"):
            from ..external import MATPLOTLIB_MISSING

            raise RosyError(MATPLOTLIB_MISSING) from None
        raise RosyError("figures need the Python package rosyfields, with matplotlib") from None
    return matplotlib_figure


def _check_parts(comparison: Comparison, parts: Sequence[str], lines: str) -> None:
    """Check the parts of a figure and the lines over differences.

    Raises
    ------
    RosyError
        If a part or the lines are unknown, or there is nothing to compare.
    """
    for part in parts:
        if part not in PARTS:
            raise RosyError(f"a figure has no part {part!r}: choose {', '.join(PARTS)}")
    if not parts:
        raise RosyError(f"a figure needs parts: choose {', '.join(PARTS)}")
    if lines not in LINES:
        raise RosyError(f"lines is {lines!r}: choose {', '.join(LINES)}")
    if "differences" in parts and not comparison.differences:
        name = next(iter(comparison.fields))
        raise RosyError(
            f"'{name}': there is no other field of its degree on its surface to compare"
        )


def _check_numbers(name: str, **numbers: float) -> None:
    """Check that numeric arguments are within their `LIMITS`.

    Raises
    ------
    RosyError
        If a number is outside its limits. The message begins with `name`.
    """
    for key, value in numbers.items():
        low, high = LIMITS[key]
        if not low <= value <= high:
            raise RosyError(
                f"{name}: {key} is {value:g}: it must be a number from {low:g} to {high:g}"
            )


def _instances(
    name: str, fields: Mapping[str, Field], color_values: str | Sequence[str | ArrayLike] | None
) -> dict[str, MeshInstance]:
    """Return the fields in world space as mesh instances by title, with their values for the color map.

    `color_values` has an array of values, or the name of an array, for each field. Or it is one name for all
    fields, or None.

    Raises
    ------
    RosyError
        If there is not one array of values for each field (the message begins with `name`), or for the same
        reasons as `render`.
    """
    if color_values is None or isinstance(color_values, str):
        values: Sequence[str | ArrayLike | None] = [color_values] * len(fields)
    else:
        values = list(color_values)
    if len(values) != len(fields):
        arrays, count = counted(len(values), "array"), counted(len(fields), "field")
        raise RosyError(f"{name}: color_values has {arrays} for {count}")
    return {
        title: upright_instance(field.surface, field, array)
        for (title, field), array in zip(fields.items(), values, strict=True)
    }


def _figure_look(
    look: Look, fields: Mapping[str, Field], instances: Iterable[MeshInstance], dpi: float
) -> Look:
    """Return the look of all panels: lengths fit the resolution, the color range covers all fields."""
    scale = dpi / LENGTH_DPI
    is_print = look.unit == "millimeters"
    look = replace(look, dpi=dpi) if is_print else scaled_look(look, scale)
    look = replace(look, singularity_size=float(np.clip(look.singularity_size * scale, 1, 256)))
    if colors_values(look):
        return replace(look, color_range=value_ends(look, value_ranges(instances)))
    if uses_magnitude(look) and magnitude_range(look) is None:
        largest = max(float(field.magnitude.max()) for field in fields.values())
        look = replace(look, color_range=(0.0, largest or 1.0))
    return look


def _panel_camera(
    points: NDArray[np.float64], view: tuple[float, float], width: int, *, perspective: bool
) -> Camera:
    """Return the camera of all panels, which shows (n, 3) points in world space.

    Its picture has a given width in pixels. The height fits the points.
    """
    right, up, _ = orbit_basis(*view) @ points.T
    aspect = np.clip(np.ptp(up) / max(float(np.ptp(right)), 1e-30), MIN_ASPECT, MAX_ASPECT)
    height = max(round(width * float(aspect)), 1)
    return orbit_camera(points, *view, width, height, perspective=perspective, margin=MARGIN)


def _scale_bar(camera: Camera, unit: str, share: float) -> tuple[float, str]:
    """Return the length of a scale bar in pixels, and its text.

    The length is 1, 2 or 5 times a power of ten in units of the coordinates, and at most the fraction `share`
    of the width of a panel.
    """
    length = round_below(share * camera.width / camera.pixels_per_unit)
    return length * camera.pixels_per_unit, f"{length:g} {unit}".strip()
