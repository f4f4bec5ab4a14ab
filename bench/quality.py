"""Compare the quality of LIC images of the method "sheets" with those of brute force.

Three measures are compared: the standard deviation and the sharpness (as the ratio of the larger to the
smaller value), and the autocorrelation (as the largest difference). With --data FOLDER, downloaded meshes and
fields are compared, too.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from harness.planar import lic, planar_pixel_field
from harness.streaks import mean_spectrum, persistence
from scipy import ndimage

from rosy_addon.compositor.lic import look_noise
from rosy_addon.compositor.lic_images import LicImages
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import pixel_look
from rosy_addon.compositor.pixel_field import PixelField, nearest_member, surface_pixel_field
from rosy_addon.field.field_io import load_field
from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.surface import Surface
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project

from . import cases
from .timing import Bench, main

#: Lags of the autocorrelation along and across the field, in pixels.
ALONG, ACROSS = (1, 2, 4, 8, 16, 32), (1, 2, 3, 4, 6)

#: Width of the border of images that is left out, in pixels, because windows would extend past it.
BORDER = 34

#: Seeds of the noise, and for each seed the angle of the uniform field in radians.
SEEDS, ANGLES = (0, 1, 2, 3), (0.05, 0.37, 0.8, 1.1)

#: Looks that are compared. White noise with half of the cells bright, as in the paper, is the harder test.
LOOKS = {
    "paper's noise": replace(cases.LOOK, density=0.5, high_pass=0.0),
    "default noise": cases.LOOK,
}


@dataclass(frozen=True)
class Measurements:
    """Measurements of the LIC images of one method.

    Attributes
    ----------
    deviation : (2,) ndarray
        Standard deviation of the images of members, and that of their blend.
    along, across : ndarray
        Autocorrelations of the images of members along and across the members, at the lags `ALONG` and
        `ACROSS`.
    sharpness : float
        For a uniform field, the orientation spectrum of the blend is scaled to a mean of 1, and the mean
        height of its peaks is taken. For other fields, it is the fraction of the variance of the gradients of
        members' images that is perpendicular to the members.
    """

    deviation: np.ndarray
    along: np.ndarray
    across: np.ndarray
    sharpness: float


def measure(bench: Bench, data: Path | None) -> None:
    """Compare all fields."""
    for name, make in _fields(data).items():
        pixel_fields = make()
        for look_name, look in LOOKS.items():
            sheets, brute = (
                _measure_fields(pixel_fields, replace(look, method=method))
                for method in ("sheets", "brute")
            )
            _compare_methods(bench, f"{name}, {look_name}", sheets, brute)


def _compare_methods(bench: Bench, name: str, sheets: Measurements, brute: Measurements) -> None:
    ratio = sheets.deviation / brute.deviation
    ratio = np.maximum(ratio, 1 / ratio).max()
    amounts = sheets.deviation[1], brute.deviation[1]
    bench.add(f"{name}: deviation", ratio, amounts, "", at_most=1.02)
    along, across = np.abs(sheets.along - brute.along), np.abs(sheets.across - brute.across)
    amounts = sheets.across[0], brute.across[0]
    largest = max(along.max(), across.max())
    bench.add(f"{name}: autocorrelation", largest, amounts, "", at_most=0.03)
    ratio = sheets.sharpness / brute.sharpness
    amounts = sheets.sharpness, brute.sharpness
    bench.add(f"{name}: sharpness", max(ratio, 1 / ratio), amounts, "", at_most=1.05)


def _measure_fields(pixel_fields: Sequence[PixelField], look: Look) -> Measurements:
    """Return mean measurements: of one field with several seeds, or of several fields with one seed each."""
    repeated = pixel_fields * len(SEEDS) if len(pixel_fields) == 1 else pixel_fields
    measurements = []
    for seed, field in zip(SEEDS, repeated, strict=True):
        noise = look_noise(field, pixel_look(replace(look, seed=seed)))
        measurements.append(_measure_images(field, lic(field, look, noise)))
    names = [entry.name for entry in fields(Measurements)]
    means = [np.mean([getattr(each, name) for each in measurements], axis=0) for name in names]
    return Measurements(*means)


def _measure_images(field: PixelField, images: LicImages) -> Measurements:
    """Measure the images of one field, away from its borders and from undefined pixels."""
    inside = np.pad(_frame(field.representation != 0, field), 1)
    inside = ndimage.distance_transform_edt(inside)[1:-1, 1:-1] > BORDER
    chosen = inside.ravel()[field.pixel]
    first = nearest_member(field, 0.0)
    along, across, lengthwise, crosswise = [], [], 0.0, 0.0
    for index, member in enumerate(images.members[:, :, 0]):
        turned = _on_screen(field, first * np.exp(2j * np.pi * index / field.degree))
        direction, image = _frame(turned, field), _frame(member, field)
        along.append(persistence(image, direction, inside, max(ALONG))[list(ALONG)])
        across.append(persistence(image, 1j * direction, inside, max(ACROSS))[list(ACROSS)])
        slope = ndimage.sobel(image, 1) + 1j * ndimage.sobel(image, 0)
        rotated = (slope * direction.conj())[inside]
        lengthwise, crosswise = lengthwise + rotated.real.var(), crosswise + rotated.imag.var()
    sharpness = crosswise / (crosswise + lengthwise)
    if np.ptp(field.representation[chosen]) == 0:
        sharpness = _peak_height(field, images, np.degrees(np.angle(first[0])))
    deviation = np.array([images.members[:, chosen].std(), images.blend[chosen].std()])
    return Measurements(deviation, np.mean(along, axis=0), np.mean(across, axis=0), sharpness)


def _peak_height(field: PixelField, images: LicImages, orientation: float) -> float:
    """Return the mean of the orientation spectrum of the blend at the directions of a uniform field."""
    blend = _frame(images.blend[:, 0], field)[BORDER:-BORDER, BORDER:-BORDER]
    lines = field.degree if field.degree % 2 else field.degree // 2
    spectrum = ndimage.gaussian_filter1d(mean_spectrum(blend, 256), 1.0, mode="wrap")
    orientations = orientation + 180 / lines * np.arange(lines)
    return spectrum[np.rint(orientations - 0.5).astype(int) % 180].mean()


def _on_screen(field: PixelField, member: np.ndarray) -> np.ndarray:
    """Return the (P,) complex unit directions of members on the screen, given members in the view plane."""
    member = field.screen_jacobian[:, 0] * member.real + field.screen_jacobian[:, 1] * member.imag
    return member / np.maximum(np.abs(member), 1e-12)


def _frame(values: np.ndarray, field: PixelField) -> np.ndarray:
    """Return the (P,) values of the pixels of a field as an (H, W) image, 0 elsewhere."""
    frame = np.zeros(field.height * field.width, dtype=values.dtype)
    frame[field.pixel] = values
    return frame.reshape(field.height, field.width)


def _seen(surface: Surface, field: RosyField) -> PixelField:
    """Return a field of a surface in the pixels of a camera."""
    camera = orbit_camera(surface.vertices, 30, 25, cases.SIZE, cases.SIZE, margin=0.02)
    gbuffer = project([MeshInstance(surface, np.eye(4), field)], camera)
    return surface_pixel_field(gbuffer, field.degree, cases.LOOK.crease_angle)


def _fields(data: Path | None) -> dict[str, Callable[[], list[PixelField]]]:
    """Return functions that make the fields to compare, by name."""
    made: dict[str, Callable[[], list[PixelField]]] = {}
    shape = cases.SIZE, cases.SIZE
    for n in (2, 3, 4, 6):
        # Several angles, because at one angle streamlines alias with the grid.
        made[f"uniform, N = {n}"] = lambda n=n: [
            planar_pixel_field(np.full(shape, angle), n) for angle in ANGLES
        ]
        made[f"singularities, N = {n}"] = lambda n=n: [cases.plane(n)[0]]
    ball, ring = cases.ball(20_000, bumps=0.0), cases.torus(20_000)
    for n in (4, 6):
        for name, surface, axis in (("sphere", ball, (0.3, 0.2, 1.0)), ("torus", ring, (0, 0, 1))):
            made[f"{name}, N = {n}"] = lambda n=n, surface=surface, axis=axis: [
                _seen(surface, axis_field(surface, n, axis))
            ]
    if data is not None:
        bunny = Surface(data / "meshes" / "stanford-bunny.obj")
        vase = Surface(data / "meshes" / "vase.off")
        made["bunny, N = 4"] = lambda: [_seen(bunny, generate(bunny, "curvature", 4))]
        for n in (2, 4, 7):
            file = data / "fields" / f"vase-{n}.rawfield"
            made[f"vase, N = {n}"] = lambda f=file: [_seen(vase, load_field(f, vase).field)]
    return made


if __name__ == "__main__":
    main(__doc__, measure, data={"type": Path, "help": "folder of meshes and fields of others"})
