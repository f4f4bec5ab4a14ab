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
from scipy import ndimage

from rosy_addon.compositor.lic import METHODS, look_noise
from rosy_addon.compositor.lic_images import LicImages
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.pixel_field import (
    PixelField,
    nearest_member,
    planar_pixel_field,
    surface_pixel_field,
)
from rosy_addon.field.field_io import read_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.mesh_io import read_mesh
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.progress import run_to_completion
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
PAPER = replace(cases.LOOK, density=0.5, high_pass=0.0)


@dataclass(frozen=True)
class Measured:
    """The measurements of the images of one method.

    Attributes
    ----------
    deviation : (2,) ndarray
        Of the members' images and of their mean.
    along, across : ndarray
        Autocorrelations of members' images.
    sharpness : float
        In a uniform field, the peaks of the blend's spectrum over orientations, whose mean is 1.
        Elsewhere, the share of the members' slopes that stands across them.
    """

    deviation: np.ndarray
    along: np.ndarray
    across: np.ndarray
    sharpness: float


def measure(runs: int, data: Path | None = None) -> Iterator[Case]:
    """Compare all fields. `runs` is ignored, because pictures do not vary."""
    del runs
    for name, make in _fields(data).items():
        flows = make()
        for look_name, look in (("paper's noise", PAPER), ("default noise", cases.LOOK)):
            sheets, brute = (_measured(flows, replace(look, method=m)) for m in ("sheets", "brute"))
            yield from _compared(f"{name}, {look_name}", sheets, brute)


def _compared(name: str, sheets: Measured, brute: Measured) -> Iterator[Case]:
    apart = sheets.deviation / brute.deviation
    apart = np.maximum(apart, 1 / apart).max()
    correlation = max(
        np.abs(sheets.along - brute.along).max(), np.abs(sheets.across - brute.across).max()
    )
    sharper = max(sheets.sharpness / brute.sharpness, brute.sharpness / sheets.sharpness)
    for what, value, target, amounts in (
        ("deviation", apart, 1.02, (sheets.deviation[1], brute.deviation[1])),
        ("autocorrelation", correlation, 0.03, (sheets.across[0], brute.across[0])),
        ("sharpness", sharper, 1.05, (sheets.sharpness, brute.sharpness)),
    ):
        value = float(value)
        amounts = float(amounts[0]), float(amounts[1])
        case = Case(f"{name}: {what}", value, value, value, target, False, amounts, "")
        print(case.line(), flush=True)
        yield case


def _measured(flows: Sequence[PixelField], look: Look) -> Measured:
    """Return means over several seeds, or over several fields with one seed each."""
    found = []
    for seed, flow in zip(SEEDS, flows * len(SEEDS) if len(flows) == 1 else flows, strict=True):
        noise = look_noise(flow, replace(look, seed=seed))
        found.append(_measured_in(flow, run_to_completion(METHODS[look.method](flow, look, noise))))
    return Measured(
        *(
            np.mean([getattr(one, part) for one in found], axis=0)
            for part in Measured.__annotations__
        )
    )


def _measured_in(flow: PixelField, images: LicImages) -> Measured:
    shape = flow.height, flow.width
    inside = np.zeros(flow.height * flow.width, dtype=bool)
    inside[flow.pixel] = flow.representation != 0
    inside = np.pad(inside.reshape(shape), 1)
    inside = ndimage.distance_transform_edt(inside)[1:-1, 1:-1] > BORDER
    chosen = inside.ravel()[flow.pixel]
    first = nearest_member(flow, 0.0)
    along, across, lengthwise, crosswise = [], [], 0.0, 0.0
    for number, member in enumerate(images.members[:, :, 0]):
        ahead = _on_screen(flow, first * np.exp(2j * np.pi * number / flow.degree))
        direction = _frame(ahead, flow)
        image = _frame(member, flow)
        along.append(persistence(image, direction, inside, max(ALONG))[list(ALONG)])
        across.append(persistence(image, 1j * direction, inside, max(ACROSS))[list(ACROSS)])
        slope = ndimage.sobel(image, 1) + 1j * ndimage.sobel(image, 0)
        turned = (slope * direction.conj())[inside]
        lengthwise, crosswise = lengthwise + turned.real.var(), crosswise + turned.imag.var()
    sharpness = crosswise / (crosswise + lengthwise)
    if np.ptp(flow.representation[chosen]) == 0:
        blend = _frame(images.blend[:, 0], flow)[BORDER:-BORDER, BORDER:-BORDER]
        lines = flow.degree if flow.degree % 2 else flow.degree // 2
        spectrum = ndimage.gaussian_filter1d(mean_spectrum(blend, 256), 1.0, mode="wrap")
        place = np.degrees(np.angle(first[0])) + 180 / lines * np.arange(lines)
        sharpness = spectrum[np.rint(place - 0.5).astype(int) % 180].mean()
    deviation = np.array([images.members[:, chosen].std(), images.blend[chosen].std()])
    return Measured(deviation, np.mean(along, axis=0), np.mean(across, axis=0), sharpness)


def _on_screen(flow: PixelField, member: np.ndarray) -> np.ndarray:
    """(P,) unit directions on the screen of members in the view plane."""
    if flow.screen_jacobian is not None:
        member = flow.screen_jacobian[:, 0] * member.real + flow.screen_jacobian[:, 1] * member.imag
    return member / np.maximum(np.abs(member), 1e-12)


def _frame(values: np.ndarray, flow: PixelField) -> np.ndarray:
    frame = np.zeros(flow.height * flow.width, dtype=values.dtype)
    frame[flow.pixel] = values
    return frame.reshape(flow.height, flow.width)


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
    return _seen(surface, axis_field(surface, degree, (0.3, 0.2, 1.0)))


def _on_torus(degree: int) -> list[PixelField]:
    surface = cases.torus(20_000)
    return _seen(surface, axis_field(surface, degree, (0.0, 0.0, 1.0)))


def _on_bunny(data: Path) -> list[PixelField]:
    surface = read_mesh(data / "meshes" / "stanford-bunny.obj")
    return _seen(surface, generate(surface, "curvature", 4))


def _on_vase(data: Path, degree: int) -> list[PixelField]:
    surface = read_mesh(data / "meshes" / "vase.off")
    return _seen(surface, read_field(data / "fields" / f"vase-{degree}.rawfield", surface))


def _seen(surface: Surface, field: RosyField) -> list[PixelField]:
    camera = orbit_camera(surface, 30, 25, cases.SIZE, cases.SIZE, margin=0.02)
    gbuffer = project([MeshInstance(surface, np.eye(4), field)], camera)
    return [surface_pixel_field(gbuffer, field.degree, cases.LOOK.crease_angle, False)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--data", type=Path)
    given, rest = parser.parse_known_args()
    sys.exit(main(__doc__, partial(measure, data=given.data), rest))
