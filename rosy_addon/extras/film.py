"""The command `film`: draw the steps of a simulation, or a series of fields, as a video from one camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .. import api
from ..api.films import MAX_BETWEEN
from ..api.pictures import picture_look
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
from ..field.rosy_field import check_degree
from ..rendering.turntable import check_video_path


def add_film_command(subparsers: Any) -> None:
    """Add the command `film`."""
    parser = add_subcommand(subparsers, "film", run_film, api.film)
    parser.description += (
        " Files whose names differ only in numbers are shown in the order of the numbers."
    )
    parser.add_argument(
        "series",
        nargs="+",
        type=Path,
        metavar="SERIES",
        help=f"a file with several steps, or a file for each step: {', '.join(SUFFIXES)}; or a mesh file and a "
        f"field file for each step: {', '.join(READ_SUFFIXES)}",
    )
    parser.add_output_option("OUT.mp4|OUT.gif")
    parser.add_value(
        "--array", "NAME", "array that is the field; by default the only one of vectors or tensors"
    )
    parser.add_degree_option(
        "degree of the fields, 1 to 12; by default that of the files, 1 for an array of vectors, or 4"
    )
    parser.add_undefined_option()
    parser.add_value(
        "--between",
        "N|auto",
        "pictures between two steps, for which fields and vertices are interpolated (%(default)d); auto: as "
        "many as keep streaks steady",
        _count_or_auto,
    )
    parser.add_switch(
        "--loop", "let the first step follow the last one, for films that are shown in a loop"
    )
    add_rate_option(parser)
    parser.add_view_options()
    parser.add_workers_option()
    parser.add_look_options()


def _count_or_auto(text: str) -> int | None:
    """Return the number of pictures between two steps; None for 'auto'."""
    return None if text == "auto" else int_between(0, MAX_BETWEEN)(text)


def run_film(options: Options) -> None:
    """Draw the steps of a simulation, or a series of fields, under one camera, as a video."""
    options.check_output()
    check_video_path(options.output)
    if options.degree is not None:
        check_degree(options.degree)
    preset, settings = options.requested_preset(), options.requested_settings()
    # Mistakes are reported before the files are read.
    picture_look(str(options.series[0]), preset, settings, {})
    encode = video_encoder(options)
    fields = requested_fields(options)
    count, between = len(fields), options.between
    total = ""
    if between is not None:
        total = f" of {(count - (not options.loop)) * (between + 1) + (not options.loop)}"

    def announce(number: int) -> None:
        if between == 0:
            print_line(f"step {number} of {count}{fields.time_text(number - 1)}")
        else:
            print_line(f"picture {number}{total}")

    arguments = options.api_arguments(api.film, encode=encode, on_picture=announce)
    api.film(fields, options.output, **arguments)


def requested_fields(options: Options) -> SimulationFields | FieldFiles:
    """Return the fields of the series that the command line names.

    These are the fields of field files on one mesh if there are field files or the first file is a mesh file.
    Otherwise they are arrays of the steps of a simulation. Files are read on access to an item.

    Raises
    ------
    RosyError
        If there is only one step or field, or a file is missing or of another format.
    """
    name, *others = options.series
    nonfinite = "zero" if options.undefined else "error"
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
        return FieldFiles(in_order(others), surface, options.degree, nonfinite)
    steps = list_steps(options.series)
    if len(steps) < 2:
        raise RosyError(f"{name}: has one step only: draw it with the command render")
    return SimulationFields(steps, options.array, options.degree, nonfinite, options.up or "z")


@dataclass(eq=False)
class FieldFiles(Sequence[api.Field]):
    """A sequence of fields from field files, all on one surface. Each access to an item reads its file.

    Parameters
    ----------
    paths : sequence of Path
    surface : Surface
    degree, nonfinite
        See `api.read_field`.
    """

    paths: Sequence[Path]
    surface: api.Surface
    degree: int | None = None
    nonfinite: str = "error"

    def __len__(self) -> int:
        return len(self.paths)

    def __getitem__(self, index: Any) -> Any:
        path = self.paths[index]
        return api.read_field(path, self.surface, self.degree, nonfinite=self.nonfinite)

    def time_text(self, index: int) -> str:
        """Return the name of a file, for the line that is printed before its field is drawn."""
        return f", {self.paths[index].name}"


@dataclass(eq=False)
class SimulationFields(Sequence[api.Field]):
    """A sequence of fields from the steps of a simulation. Each access to an item reads its files.

    Parameters
    ----------
    steps : sequence of Step
    array, degree, nonfinite
        See `field.array_field.array_field`.
    up : {"y", "z"}
        The upward axis of the meshes.
    """

    steps: Sequence[Step]
    array: str | None = None
    degree: int | None = None
    nonfinite: str = "error"
    up: str = "z"
    _last: tuple[Polygons, api.Surface] | None = None

    def __len__(self) -> int:
        return len(self.steps)

    def __getitem__(self, index: Any) -> Any:
        name, mesh = self.steps[index].name, self.steps[index].read()
        # If the mesh has not changed since the last step that was read, its surface is reused.
        if self._last is None or not all(map(np.array_equal, mesh.polygons, self._last[0])):
            surface = api.Surface(MeshArrays(*mesh.polygons), name=name, up=self.up)
            self._last = mesh.polygons, surface
        surface = self._last[1]
        arrays = SurfaceArrays(name, surface, mesh.vertex_data or {}, mesh.face_data or {})
        field = array_field(arrays, self.array, self.degree, self.nonfinite)
        return api.Field.of(surface, field)

    def time_text(self, index: int) -> str:
        """Return the time of a step, for the line that is printed before it is drawn.

        Empty if the files state no time.
        """
        time = self.steps[index].time
        return "" if time is None else f", time {time:g}"
