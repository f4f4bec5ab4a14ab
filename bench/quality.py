"""Compare the quality of the pictures of the method sheets with brute force.

Measures are the ratio of the larger to the smaller standard deviation, the same for sharpness, and the
largest difference of autocorrelations. Meshes and fields of others are read from a folder:
--data FOLDER.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from harness.planar import lic, planar_pixel_field
from scipy import ndimage

from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.lic_images import LicImages
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.pixel_field import (
    PixelField,
    nearest_member,
    surface_pixel_field,
)
from rosy_addon.field.field_io import load_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.mesh_io import read_mesh
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project
from tools.gallery.measure import mean_spectrum, persistence

from . import cases
from .timing import Case, main

#: Lags of the autocorrelation along and across the field, in pixels.
ALONG, ACROSS = (1, 2, 4, 8, 16, 32), (1, 2, 3, 4, 6)

#: Width of the border in pixels that is left out, because windows would extend over it.
BORDER = 34

SEEDS = (0, 1, 2, 3)

#: Angles of uniform fields in radians, one for each seed.
ANGLES = (0.05, 0.37, 0.8, 1.1)


#: White noise with half of the cells bright, as in the paper, which is the harder test.
PAPER_LOOK = replace(cases.LOOK, density=0.5, high_pass=0.0)


@dataclass(frozen=True)
class Measurements:
    """The measurements of the images of one method.

    Attributes
    ----------
    deviation : (2,) ndarray
        Standard deviations of the images of members and of their blend.
    along, across : ndarray
        Autocorrelations of the images of members.
    sharpness : float
        In a uniform field, the mean height of the peaks of the orientation spectrum of the blend,
        whose mean is 1. In other fields, the fraction of the variance of the gradients of members'
        images that is perpendicular to the members.
    """

    deviation: np.ndarray
    along: np.ndarray
    across: np.ndarray
    sharpness: float


def measure(runs: int, data: Path | None = None) -> Iterator[Case]:
    """Compare all fields. `runs` is ignored, because pictures do not vary."""
    del runs
    for name, make in _fields(data).items():
        fields = make()
        for look_name, look in (("paper's noise", PAPER_LOOK), ("default noise", cases.LOOK)):
            sheets, brute = (
                _measure_fields(fields, replace(look, method=m)) for m in ("sheets", "brute")
            )
            yield from _compare_methods(f"{name}, {look_name}", sheets, brute)


def _compare_methods(name: str, sheets: Measurements, brute: Measurements) -> Iterator[Case]:
    deviation_ratio = sheets.deviation / brute.deviation
    deviation_ratio = np.maximum(deviation_ratio, 1 / deviation_ratio).max()
    correlation = max(
        np.abs(sheets.along - brute.along).max(), np.abs(sheets.across - brute.across).max()
    )
    sharpness_ratio = max(sheets.sharpness / brute.sharpness, brute.sharpness / sheets.sharpness)
    for quantity, value, target, amounts in (
        ("deviation", deviation_ratio, 1.02, (sheets.deviation[1], brute.deviation[1])),
        ("autocorrelation", correlation, 0.03, (sheets.across[0], brute.across[0])),
        ("sharpness", sharpness_ratio, 1.05, (sheets.sharpness, brute.sharpness)),
    ):
        value = float(value)
        amounts = float(amounts[0]), float(amounts[1])
        case = Case(f"{name}: {quantity}", value, value, value, target, False, amounts, "")
        print(case.line(), flush=True)
        yield case


def _measure_fields(fields: Sequence[PixelField], look: Look) -> Measurements:
    """Return means over several seeds, or over several fields with one seed each."""
    measurements = []
    for seed, field in zip(SEEDS, fields * len(SEEDS) if len(fields) == 1 else fields, strict=True):
        noise = look_noise(field, pixel_look(replace(look, seed=seed)))
        measurements.append(_measure_images(field, lic(field, look, noise)))
    return Measurements(
        *(
            np.mean([getattr(measured, name) for measured in measurements], axis=0)
            for name in Measurements.__annotations__
        )
    )


def _measure_images(field: PixelField, images: LicImages) -> Measurements:
    """Measure the images of one field, away from its borders and from undefined pixels."""
    shape = field.height, field.width
    inside = np.zeros(field.height * field.width, dtype=bool)
    inside[field.pixel] = field.representation != 0
    inside = np.pad(inside.reshape(shape), 1)
    inside = ndimage.distance_transform_edt(inside)[1:-1, 1:-1] > BORDER
    chosen = inside.ravel()[field.pixel]
    first = nearest_member(field, 0.0)
    along, across, lengthwise, crosswise = [], [], 0.0, 0.0
    for index, member in enumerate(images.members[:, :, 0]):
        screen_direction = _on_screen(field, first * np.exp(2j * np.pi * index / field.degree))
        direction = _frame(screen_direction, field)
        image = _frame(member, field)
        along.append(persistence(image, direction, inside, max(ALONG))[list(ALONG)])
        across.append(persistence(image, 1j * direction, inside, max(ACROSS))[list(ACROSS)])
        slope = ndimage.sobel(image, 1) + 1j * ndimage.sobel(image, 0)
        rotated = (slope * direction.conj())[inside]
        lengthwise, crosswise = lengthwise + rotated.real.var(), crosswise + rotated.imag.var()
    sharpness = crosswise / (crosswise + lengthwise)
    if np.ptp(field.representation[chosen]) == 0:
        blend = _frame(images.blend[:, 0], field)[BORDER:-BORDER, BORDER:-BORDER]
        lines = field.degree if field.degree % 2 else field.degree // 2
        spectrum = ndimage.gaussian_filter1d(mean_spectrum(blend, 256), 1.0, mode="wrap")
        orientation = np.degrees(np.angle(first[0])) + 180 / lines * np.arange(lines)
        sharpness = spectrum[np.rint(orientation - 0.5).astype(int) % 180].mean()
    deviation = np.array([images.members[:, chosen].std(), images.blend[chosen].std()])
    return Measurements(deviation, np.mean(along, axis=0), np.mean(across, axis=0), sharpness)


def _on_screen(field: PixelField, member: np.ndarray) -> np.ndarray:
    """Return (P,) complex: the unit directions on the screen of members in the view plane."""
    member = field.screen_jacobian[:, 0] * member.real + field.screen_jacobian[:, 1] * member.imag
    return member / np.maximum(np.abs(member), 1e-12)


def _frame(values: np.ndarray, field: PixelField) -> np.ndarray:
    frame = np.zeros(field.height * field.width, dtype=values.dtype)
    frame[field.pixel] = values
    return frame.reshape(field.height, field.width)


# --- fields ----------------------------------------------------------------------------------------


def _fields(data: Path | None) -> dict[str, Callable[[], list[PixelField]]]:
    fields: dict[str, Callable[[], list[PixelField]]] = {}
    for degree in (2, 3, 4, 6):
        fields[f"uniform, N = {degree}"] = partial(_uniform, degree)
        fields[f"singularities, N = {degree}"] = lambda degree=degree: [cases.plane(degree)[0]]
    for degree in (4, 6):
        fields[f"sphere, N = {degree}"] = partial(_on_sphere, degree)
        fields[f"torus, N = {degree}"] = partial(_on_torus, degree)
    if data is not None:
        fields["bunny, N = 4"] = partial(_on_bunny, data)
        for degree in (2, 4, 7):
            fields[f"vase, N = {degree}"] = partial(_on_vase, data, degree)
    return fields


def _uniform(degree: int) -> list[PixelField]:
    """Return uniform fields at several angles, because at one angle streamlines alias with the grid."""
    shape = cases.SIZE, cases.SIZE
    return [planar_pixel_field(np.full(shape, angle), degree) for angle in ANGLES]


def _on_sphere(degree: int) -> list[PixelField]:
    surface = cases.ball(20_000, bumps=0.0)
    return _pixel_fields_of(surface, axis_field(surface, degree, (0.3, 0.2, 1.0)))


def _on_torus(degree: int) -> list[PixelField]:
    surface = cases.torus(20_000)
    return _pixel_fields_of(surface, axis_field(surface, degree, (0.0, 0.0, 1.0)))


def _on_bunny(data: Path) -> list[PixelField]:
    surface = read_mesh(data / "meshes" / "stanford-bunny.obj")
    return _pixel_fields_of(surface, generate(surface, "curvature", 4))


def _on_vase(data: Path, degree: int) -> list[PixelField]:
    surface = read_mesh(data / "meshes" / "vase.off")
    return _pixel_fields_of(
        surface, load_field(data / "fields" / f"vase-{degree}.rawfield", surface).field
    )


def _pixel_fields_of(surface: Surface, field: RosyField) -> list[PixelField]:
    """Return the field as a camera sees it, in a list of one."""
    camera = orbit_camera(surface.vertices, 30, 25, cases.SIZE, cases.SIZE, margin=0.02)
    gbuffer = project([MeshInstance(surface, np.eye(4), field)], camera)
    return [surface_pixel_field(gbuffer, field.degree, cases.LOOK.crease_angle)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--data", type=Path)
    options, rest = parser.parse_known_args()
    sys.exit(main(__doc__, partial(measure, data=options.data), rest))
