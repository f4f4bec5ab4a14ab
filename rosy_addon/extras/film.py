"""The command `film`: draw the steps of a simulation, or a series of fields, as a video from one camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .. import api
from ..api.films import MAX_BETWEEN
from ..cli.options import Options, add_subcommand, int_between
from ..cli.pictures import add_rate_option, video_encoder
from ..cli.streams import print_line
from ..core.errors import RosyError
from ..core.file_io import check_readable
from ..external.simulation_files import SUFFIXES, Step, in_order, list_steps
from ..field.array_field import SurfaceArrays, array_field
from ..field.field_io import READ_SUFFIXES
from ..field.formats.polygons import Polygons
from ..field.mesh_arrays import MeshArrays
from ..field.mesh_io import READERS
from ..field.validate import STRICT, VectorPolicy
from ..rendering.turntable import check_video_path


def add_film_command(subparsers: Any) -> None:
    """Add the command `film`."""
    parser = add_subcommand(subparsers, run_film, api.film)
    parser.description += (
        " Files whose names differ only in numbers are shown in the order of the numbers."
    )
    text = (
        f"a file with several steps, or a file for each step: {', '.join(SUFFIXES)}; or a mesh file "
        f"and a field file for each step: {', '.join(READ_SUFFIXES)}"
    )
    parser.add_argument("series", nargs="+", type=Path, metavar="SERIES", help=text)
    parser.add_output_option("OUT.mp4|OUT.gif")
    text = "array that is the field; by default the only one of vectors or tensors"
    parser.add_value("--array", "NAME", text)
    text = "degree of the fields, 1 to 12; by default that of the files, 1 for an array of vectors, or 4"
    parser.add_degree_option(text)
    parser.add_undefined_option()
    text = (
        "pictures between two steps, for which fields and vertices are interpolated (%(default)d); "
        "auto: as many as keep streaks steady"
    )
    parser.add_value("--between", "N|auto", text, _count_or_auto)
    text = "let the first step follow the last one, for films that are shown in a loop"
    parser.add_switch("--loop", text)
    add_rate_option(parser)
    parser.add_direction_options()
    parser.add_size_option()
    parser.add_workers_option()
    parser.add_look_options()


def _count_or_auto(text: str) -> int | None:
    """Return the number of pictures between two steps; None for 'auto'."""
    return None if text == "auto" else int_between(0, MAX_BETWEEN)(text)


def run_film(options: Options) -> None:
    """Draw the steps of a simulation, or a series of fields, under one camera, as a video."""
    options.check_output()
    check_video_path(options.output)
    arguments = options.picture_arguments(api.film, options.series[0])
    encode = video_encoder(options)
    fields = requested_fields(options)
    count, between = len(fields), options.between
    total = ""
    if between is not None:
        total = f" of {(count - (not options.loop)) * (between + 1) + (not options.loop)}"

    def announce(number: int) -> None:
        if between == 0:
            print_line(f"step {number} of {count}{_item_note(fields.items[number - 1])}")
        else:
            print_line(f"picture {number}{total}")

    arguments |= {"encode": encode, "on_picture": announce}
    api.film(fields, options.output, **arguments)


def _item_note(item: Path | Step) -> str:
    """Return what is printed about a field before it is drawn: the name of its file, or the time of its step.

    Empty if the files state no time.
    """
    if isinstance(item, Path):
        return f", {item.name}"
    return "" if item.time is None else f", time {item.time:g}"


def requested_fields(options: Options) -> FieldSeries:
    """Return the fields of the series that the command line names.

    These are the fields of field files on one mesh if there are field files or the first file is a mesh file.
    Otherwise they are arrays of the steps of a simulation. Files are read on access to an item.

    Raises
    ------
    RosyError
        If there is only one step or field, or a file is missing or of another format.
    """
    name, *others = options.series
    degree, policy = options.degree, VectorPolicy(options.nonfinite, options.off_surface)
    has_mesh = name.suffix.lower() in READERS
    if has_mesh or any(path.suffix.lower() in READ_SUFFIXES for path in others):
        if not has_mesh and name.suffix.lower() not in SUFFIXES:
            raise RosyError(
                f"{name}: is not a mesh file: name the mesh first, then the field files"
            )
        if options.array is not None:
            raise RosyError(f"{name}: --array applies only to files of simulations, such as .vtu")
        if len(others) < 2:
            raise RosyError(
                f"{name}: a film needs 2 or more field files after the mesh, not {len(others)}"
            )
        surface = api.Surface(name, up=options.up)
        for path in others:
            check_readable(path)
        keywords = {"surface": surface, "degree": degree, **policy._asdict()}
        return FieldSeries(in_order(others), partial(api.read_field, **keywords))
    steps = list_steps(options.series)
    if len(steps) < 2:
        raise RosyError(f"{name}: has one step only: draw it with the command render")
    read = StepReader(options.array, degree, policy, options.up or "z")
    return FieldSeries(steps, read)


@dataclass(eq=False)
class FieldSeries(Sequence[api.Field]):
    """A sequence of fields. Each access to one reads its files.

    Parameters
    ----------
    items : sequence of Path or Step
        Field files, or steps of a simulation.
    read : function
        Function that returns the field of an item.
    """

    items: Sequence[Any]
    read: Callable[[Any], api.Field]

    def __len__(self) -> int:
        return len(self.items)

    def __getitem__(self, index: Any) -> Any:
        return self.read(self.items[index])


@dataclass(eq=False)
class StepReader:
    """A function that returns the field of a step of a simulation.

    Parameters
    ----------
    array : str or None
        Name of the array of vectors, directions or tensors. None: the only array that can be a field.
    degree : int or None
        N of the field. None: the default for the array.
    policy : VectorPolicy
        What to do about values that are not finite, and about vectors off the surface.
    up : {"y", "z"}
        The upward axis of the meshes.
    """

    array: str | None = None
    degree: int | None = None
    policy: VectorPolicy = STRICT
    up: str = "z"
    _last: tuple[Polygons, api.Surface] | None = None

    def __call__(self, step: Step) -> api.Field:
        mesh = step.read()
        # If the mesh has not changed since the last step that was read, its surface is reused.
        if self._last is None or not all(map(np.array_equal, mesh.polygons, self._last[0])):
            surface = api.Surface(MeshArrays(*mesh.polygons), name=step.name, up=self.up)
            self._last = mesh.polygons, surface
        surface = self._last[1]
        arrays = SurfaceArrays(step.name, surface, mesh.vertex_data or {}, mesh.face_data or {})
        return api.Field.of(surface, array_field(arrays, self.array, self.degree, self.policy))
