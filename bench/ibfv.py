"""Time of image based flow visualization relative to streaks of the method sheets: pictures and frames.

A frame of an animation is one after others of the same mesh and camera, whose streaks drift. Directions on
meshes of others, read from a folder, are compared as well: --data FOLDER.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from harness.planar import lic
from scipy import ndimage

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.flow import flow_at
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.pixel_field import PixelField, nearest_member
from rosy_addon.core.cache import Cache
from rosy_addon.field.generate import generate
from rosy_addon.field.mesh_io import read_mesh
from rosy_addon.projection.gbuffer import GBuffer
from rosy_addon.projection.project import project

from . import cases
from .quality import frame_of, on_screen, seen_field
from .timing import Bench, main

TRIANGLES, DEGREES = 12_000, (1, 4, 6)

#: Standard deviation in pixels of the window in which a direction is measured, and the distance in pixels
#: of these windows from where streamlines end.
WINDOW, BORDER = 5.0, 12


def measure(bench: Bench, data: Path | None) -> None:
    """Time pictures and frames, and compare directions."""
    for degree in DEGREES:
        gbuffer = project([cases.instance(TRIANGLES, degree)], cases.camera())
        picture, still = _picture(gbuffer, "ibfv"), _picture(gbuffer, "sheets")
        frame, drifting = _next_frame(gbuffer, "ibfv"), _next_frame(gbuffer, "sheets")
        bench.compare(f"ibfv / sheets, picture, N = {degree}", picture, still)
        bench.compare(f"ibfv / sheets, frame whose streaks drift, N = {degree}", frame, drifting)
        name = f"frame of ibfv whose streaks drift / picture of sheets, N = {degree}"
        bench.compare(name, frame, still)
    for path in sorted((data / "meshes").iterdir()) if data else ():
        surface = read_mesh(path)
        for degree in DEGREES:
            field = seen_field(surface, generate(surface, "smoothest", degree))
            errors = [_direction_errors(field, Look(method=name)) for name in ("ibfv", "sheets")]
            for quantity, percentile in (("median", 50), ("95 %", 95)):
                ibfv, sheets = (np.percentile(error, percentile) for error in errors)
                name = f"{path.stem}, N = {degree}: {quantity} of the errors of directions"
                bench.add(name, ibfv / sheets, (ibfv, sheets), "degrees")


def _picture(gbuffer: GBuffer, method: str) -> Callable[[], object]:
    """Return the work of a picture: from the G-buffer, with nothing in a cache."""
    return lambda: compose(gbuffer, replace(cases.LOOK, method=method))


def _next_frame(gbuffer: GBuffer, method: str) -> Callable[[], object]:
    """Return the work of a frame after others, in which streaks drift by a pixel."""
    look, cache, numbers = replace(cases.LOOK, method=method, flow=1.0), Cache(), itertools.count()

    def draw() -> None:
        compose(gbuffer, flow_at(look, next(numbers)), cache=cache)
        cache.evict_unused()

    return draw


def _direction_errors(field: PixelField, look: Look) -> np.ndarray:
    """Return (n,) angles in degrees between streaks and members, by the structure tensor."""
    is_open = frame_of(field.neighbor_mask == 0b111_111_111, field)
    inside = ndimage.binary_erosion(is_open, iterations=BORDER)
    first, errors = nearest_member(field, 0.0), []
    for line, image in enumerate(lic(field, look).members[:, :, 0]):
        direction = on_screen(field, first * np.exp(2j * np.pi * line / field.degree))
        image = frame_of(image, field)
        across, upward = (ndimage.gaussian_filter(image, 1.0, order=o) for o in ((0, 1), (1, 0)))
        squared = ((across + 1j * upward) * frame_of(direction, field).conj()) ** 2
        mean = [ndimage.gaussian_filter(part, WINDOW) for part in (squared.real, squared.imag)]
        errors.append(np.degrees(np.abs(0.5 * np.angle(-(mean[0] + 1j * mean[1])[inside]))))
    return np.concatenate(errors)


if __name__ == "__main__":
    main(__doc__, measure, takes_data=True)
