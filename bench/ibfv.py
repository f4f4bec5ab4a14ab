"""Time of image based flow visualization relative to streaks of the method sheets: pictures and frames.

A frame of an animation is one after others of the same mesh and camera, whose streaks drift. Directions on
meshes of others, read from a folder, are compared as well: --data FOLDER.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from harness.planar import lic
from scipy import ndimage

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.flow import drift_at
from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.pixel_field import PixelField, nearest_member, surface_pixel_field
from rosy_addon.core.cache import Cache
from rosy_addon.field.generate import generate
from rosy_addon.field.mesh_io import read_mesh
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import GBuffer, MeshInstance
from rosy_addon.projection.project import project

from . import cases
from .quality import _frame, _on_screen
from .timing import Case, compare, main

TRIANGLES = 12_000

#: Pixels that streaks drift per frame.
FLOW = 1.0

#: Standard deviation in pixels of the window in which a direction is measured, and the distance in pixels
#: of these windows from where streamlines end.
WINDOW, BORDER = 5.0, 12

DEGREES = (1, 4, 6)


def measure(runs: int, data: Path | None = None) -> Iterator[Case]:
    """Time pictures and frames, and compare directions."""
    for degree in DEGREES:
        gbuffer = project([cases.instance(TRIANGLES, degree)], cases.camera())
        yield compare(
            f"ibfv / sheets, picture, N = {degree}",
            _still(gbuffer, "ibfv"),
            _still(gbuffer, "sheets"),
            runs=runs,
        )
        frame = _next_frame(gbuffer, "ibfv")
        for other, name in (
            (_next_frame(gbuffer, "sheets"), "ibfv / sheets, frame whose streaks drift"),
            (_still(gbuffer, "sheets"), "frame of ibfv whose streaks drift / picture of sheets"),
        ):
            yield compare(f"{name}, N = {degree}", frame, other, higher_is_better=False, runs=runs)
    for path in sorted((data / "meshes").iterdir()) if data else ():
        for degree in DEGREES:
            field = _seen_field(path, degree)
            errors = [_direction_errors(field, method) for method in ("ibfv", "sheets")]
            for quantity, percentile in (("median", 50), ("95 %", 95)):
                ibfv, sheets = (float(np.percentile(error, percentile)) for error in errors)
                name = f"{path.stem}, N = {degree}: {quantity} of the errors of directions"
                ratio = ibfv / sheets
                case = Case(name, ratio, ratio, ratio, None, False, (ibfv, sheets), "degrees")
                print(case.line(), flush=True)
                yield case


def _still(gbuffer: GBuffer, method: str) -> Callable[[], object]:
    """Return the work of a picture: from the G-buffer, with nothing in a cache."""
    return lambda: compose(gbuffer, replace(cases.LOOK, method=method))


def _next_frame(gbuffer: GBuffer, method: str) -> Callable[[], object]:
    """Return the work of a frame after others."""
    look, cache, numbers = replace(cases.LOOK, method=method, flow=FLOW), Cache(), itertools.count()

    def draw() -> None:
        compose(gbuffer, look, cache=cache, drift=drift_at(look, next(numbers)))
        cache.evict_unused()

    return draw


def _seen_field(path: Path, degree: int) -> PixelField:
    """Return the smoothest field of a mesh, as a camera sees it."""
    surface = read_mesh(path)
    instance = MeshInstance(surface, np.eye(4), generate(surface, "smoothest", degree))
    gbuffer = project(
        [instance], orbit_camera(surface.vertices, 30, 25, cases.SIZE, cases.SIZE, margin=0.02)
    )
    return surface_pixel_field(gbuffer, degree, cases.LOOK.crease_angle)


def _direction_errors(field: PixelField, method: str) -> np.ndarray:
    """(n,) angles in degrees between streaks and the members of a field, by the structure tensor."""
    look = Look(method=method)
    images = lic(field, replace(look, method=method), look_noise(field, pixel_look(look)))
    is_open = _frame(field.neighbor_mask == 0b111_111_111, field)
    inside = ndimage.binary_erosion(is_open, iterations=BORDER)
    first, errors = nearest_member(field, 0.0), []
    for line, image in enumerate(images.members[:, :, 0]):
        member = first * np.exp(2j * np.pi * line / field.degree)
        image = _frame(image, field)
        slope = ndimage.gaussian_filter(image, 1.0, order=(0, 1)) + 1j * ndimage.gaussian_filter(
            image, 1.0, order=(1, 0)
        )
        squared = (slope * _frame(_on_screen(field, member), field).conj()) ** 2
        mean = ndimage.gaussian_filter(squared.real, WINDOW) + 1j * ndimage.gaussian_filter(
            squared.imag, WINDOW
        )
        errors.append(np.degrees(np.abs(0.5 * np.angle(-mean[inside]))))
    return np.concatenate(errors)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--data", type=Path)
    options, rest = parser.parse_known_args()
    sys.exit(main(__doc__, partial(measure, data=options.data), rest))
