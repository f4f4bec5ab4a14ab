"""The command `film`: the steps of a simulation as a video, under one camera."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..api.pictures import DEFAULT_VIDEO_SIZE, picture_look
from ..cli.look import add_look_options, requested_preset, requested_settings
from ..cli.options import add_subcommand, add_workers_option, check_output
from ..cli.render import add_rate_option, video_encoder
from ..cli.streams import print_line
from ..cli.view import add_view_options, requested_size
from ..compositor.look import Look
from ..errors import RosyError
from ..external.simulation_files import SUFFIXES, SimulationMesh, Step, build_surface, list_steps
from ..field.array_field import SurfaceArrays, array_field
from ..field.rosy_field import RosyField, check_degree
from ..field.surface import Surface
from ..progress import run_to_completion
from ..projection.camera import framing_points, orbit_camera
from ..projection.gbuffer import MeshInstance
from ..rendering.band_workers import BandWorkers
from ..rendering.cpu import CpuRenderer
from ..rendering.mesh_view import mesh_instance
from ..rendering.view_input import ViewInput
from ..turntable_video import check_video_path, turntable_task


def add_film_command(subparsers: Any) -> None:
    """Add the command `film`."""
    parser = add_subcommand(subparsers, "film", run_film)
    parser.description += (
        " Files whose names differ only in numbers are shown in the order of the numbers."
    )
    parser.add_argument(
        "series",
        nargs="+",
        type=Path,
        metavar="SERIES",
        help=f"a file with several steps, or a file for each step: {', '.join(SUFFIXES)}",
    )
    parser.add_argument("-o", "--output", required=True, type=Path, metavar="OUT.mp4|OUT.gif")
    parser.add_argument(
        "--array",
        metavar="NAME",
        help="array that is the field; by default the only one of vectors or tensors",
    )
    parser.add_argument(
        "--degree",
        type=int,
        metavar="N",
        help="degree of a field of vectors, 1 to 12; by default 1",
    )
    parser.add_argument(
        "--undefined", action="store_true", help="treat NaN and infinite vectors as undefined"
    )
    add_rate_option(parser)
    add_view_options(parser, DEFAULT_VIDEO_SIZE)
    add_workers_option(parser)
    add_look_options(parser)


def run_film(options: argparse.Namespace) -> None:
    """Draw the steps of a simulation under one camera, as a video."""
    check_output(options)
    check_video_path(options.output)
    if options.degree is not None:
        check_degree(options.degree)
    encode = video_encoder(options)
    name = str(options.series[0])
    look = picture_look(name, requested_preset(options), requested_settings(options), {})
    steps = list_steps(options.series)
    if len(steps) < 2:
        raise RosyError(f"{name}: has one step only: draw it with the command render")
    film = Film(
        steps,
        look,
        options.view,
        requested_size(options),
        array=options.array,
        degree=options.degree,
        nonfinite="zero" if options.undefined else "error",
        up=options.up or "z",
        perspective=not options.ortho,
    )
    with BandWorkers(options.workers) as pool:
        task = turntable_task(
            CpuRenderer(workers=pool),
            film.views(),
            len(steps),
            options.output,
            options.rate,
            encode,
        )
        run_to_completion(task)


class Film:
    """The views of the steps of a series, under one camera that frames all of them.

    The steps are read twice: first for the camera and the range of magnitudes, then to be drawn. One
    is in memory at a time, with the polygons of the step before it.

    Parameters
    ----------
    steps : sequence of Step
    look : Look
        If it shows magnitudes and has no range of its own, their range is that of all steps.
    view_angles : (float, float)
        Azimuth and elevation in degrees, see `orbit_camera`.
    size : (int, int)
        Pixels.
    array, degree, nonfinite
        See `field.array_field.array_field_task`.
    up : {"y", "z"}
        The upward axis of the meshes.
    perspective : bool
    """

    def __init__(
        self,
        steps: Sequence[Step],
        look: Look,
        view_angles: tuple[float, float],
        size: tuple[int, int],
        *,
        array: str | None = None,
        degree: int | None = None,
        nonfinite: str = "error",
        up: str = "z",
        perspective: bool = True,
    ) -> None:
        self._steps, self._look, self._up = steps, look, up
        self._framing = (*view_angles, *size)
        self._perspective = perspective
        self._field_options = (array, degree, nonfinite)
        self._last: tuple[SimulationMesh, Surface] | None = None

    def views(self) -> Iterator[ViewInput]:
        """Yield the view of each step, and print a line before it is drawn.

        Raises
        ------
        RosyError
            If a step cannot be read, or has no such field. This is found before the first view.
        """
        points, look = self._survey()
        camera = orbit_camera(points, *self._framing, perspective=self._perspective)
        for number, step in enumerate(self._steps, 1):
            instance = self._instance(step)
            time = "" if step.time is None else f", time {step.time:g}"
            print_line(f"step {number} of {len(self._steps)}{time}")
            yield ViewInput((instance,), camera, look)

    def _survey(self) -> tuple[np.ndarray, Look]:
        """Return points that determine the camera, and the look with the range of magnitudes."""
        shows_magnitude = self._look.magnitude != "none" and not self._look.magnitude_range
        points, top = np.zeros((0, 3)), 0.0
        for step in self._steps:
            instance = self._instance(step)
            top = max(top, float(instance.field.magnitude.max()))
            points = np.concatenate([points, instance.face_points()])
            points = framing_points(points, *self._framing, perspective=self._perspective)
        return points, replace(self._look, magnitude_range=top) if shows_magnitude else self._look

    def _instance(self, step: Step) -> MeshInstance:
        """Read a step."""
        surface, field = self._read(step)
        return mesh_instance(surface, field, self._up)

    def _read(self, step: Step) -> tuple[Surface, RosyField]:
        """Read a step. If the mesh is that of the last step, the surface is used again."""
        mesh = step.read()
        if self._last is not None and _have_same_polygons(mesh, self._last[0]):
            surface = self._last[1]
        else:
            surface = build_surface(mesh)
        self._last = replace(mesh, point_arrays={}, cell_arrays={}), surface
        arrays = SurfaceArrays(mesh.name, surface, mesh.point_arrays, mesh.cell_arrays)
        return surface, array_field(arrays, *self._field_options)


def _have_same_polygons(first: SimulationMesh, second: SimulationMesh) -> bool:
    """Return whether two meshes have the same vertices and faces."""
    return all(map(np.array_equal, first.polygons, second.polygons))
