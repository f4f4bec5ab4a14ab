"""Draw figures 7 and 8: members of fields on surfaces that are tilted against the view direction."""

import numpy as np
from scipy import ndimage

from rosy_addon.field.rosy_field import RosyField
from tests.harness.planar import DegreeLayer
from tests.harness.streaks import correlation, local_correlation, orientation_spectrum, peaks

from .looks import RED, SOLID
from .page import fill_tables, listed, picture
from .shapes import plane, sphere
from .sheet import Panel, display, magnified, outlined
from .solid import compose_view, frame_of, harmonic_field, layer_in_view, view

SIZE, TILTED_SIZE = 402, 262

#: Tilts of the plane in degrees, and angle of a member on the plane in radians.
TILTS, MEMBER = (0, 60, 78), np.radians(30)

#: Azimuth and elevation of the view, in degrees: a corner of the cube is in the center of the picture.
VIEW = (45, 35)

#: Side of the closeup in pixels, its magnification, and its least distance from the silhouette in pixels.
CLOSEUP, TIMES, MARGIN = 52, 5, 28

#: Samples along each side of a pixel.
SAMPLES = SOLID.supersampling

#: Looks of the sphere, by how the members are chosen that are drawn together in one LIC image.
LOOKS = {
    "among projections": SOLID.with_settings({"gain": 3.0, "view_plane": False}),
    "in the view plane": SOLID.with_settings({"gain": 3.0}),
    "brute force": SOLID.with_settings({"gain": 3.0, "method": "brute"}),
}


def write() -> None:
    """Draw the pictures and measure the tables."""
    fill_tables("figure-07", _tilted_planes(), _sphere())


def _tilted_planes() -> list[list[str]]:
    """Draw a 4-RoSy field on tilted planes. Return rows with its directions and the peaks of the spectrum."""
    surface = plane()
    member = [np.cos(MEMBER), np.sin(MEMBER), 0.0]
    field = RosyField(4, np.tile(member, (surface.face_count, 1)))
    look = SOLID.with_settings({"shading": 0.0})
    side = SAMPLES * TILTED_SIZE
    panels, rows = [], []
    for tilt in TILTS:
        camera = view(surface, (0, 90 - tilt), (TILTED_SIZE,) * 2, SAMPLES, False)
        shown = compose_view(surface, field, look, camera)
        panels.append(Panel(display(shown.rgba), f"tilted by {tilt}°"))
        layer = layer_in_view(surface, field, look, camera)
        tone = frame_of(layer.tone[:, 0], layer.pixel, (side, side))
        foreshortening = np.cos(np.radians(tilt))
        down, across = np.rint(0.45 * side * np.array([foreshortening, 1.0])).astype(int)
        middle = side // 2
        patch = tone[middle - down : middle + down, middle - across : middle + across]
        # The tone has 2 x 2 samples per pixel, which are averaged.
        height, width = (length // 2 for length in patch.shape)
        patch = patch[: 2 * height, : 2 * width].reshape(height, 2, width, 2).mean(axis=(1, 3))
        angles = MEMBER + np.array([0, np.pi / 2])
        expected = np.degrees(np.arctan2(np.sin(angles) * foreshortening, np.cos(angles))) % 180
        measured = peaks(orientation_spectrum(patch, 720))
        rows.append([f"{tilt}°", listed(sorted(expected)), listed(measured)])
    picture("figure-07-plane", panels)
    return rows


def _sphere() -> list[list[object]]:
    """Draw a field with the symmetry of a cube on a sphere, for both ways to choose members.

    Return rows with the correlations of the pictures with brute force.
    """
    surface = sphere(64)
    field = harmonic_field(surface, 4, np.eye(3))
    camera = view(surface, VIEW, (SIZE, SIZE), SAMPLES)
    layers = {name: layer_in_view(surface, field, look, camera) for name, look in LOOKS.items()}
    shown = {
        name: display(compose_view(surface, field, look, camera).rgba)
        for name, look in LOOKS.items()
    }
    among, in_plane, brute = LOOKS
    tones = {name: _frame(layer, layer.images.blend[:, 0]) for name, layer in layers.items()}
    covered = _frame(layers[in_plane], 1.0)
    local = {
        name: local_correlation(tones[name], tones[brute], covered, 3.0 * SAMPLES)
        for name in (among, in_plane)
    }
    left, top, right, bottom = box = _worst_box(local[in_plane] - local[among], covered)
    spheres = [
        Panel(outlined(shown[name], box, RED), f"members chosen {name}")
        for name in (among, in_plane)
    ]
    picture("figure-07-sphere", spheres)
    closeups = [
        Panel(magnified(shown[name][top:bottom, left:right], TIMES), f"{name}, {TIMES} times")
        for name in LOOKS
    ]
    picture("figure-07-closeup", closeups)
    square = np.zeros(covered.shape, dtype=bool)
    rows, columns = np.array([[SIZE - bottom, SIZE - top], [left, right]]) * SAMPLES
    square[slice(*rows), slice(*columns)] = True
    table: list[list[object]] = []
    for name, values in local.items():
        whole, part = (
            correlation(tones[name][mask], tones[brute][mask]) for mask in (covered > 0, square)
        )
        values = values[covered > 0]
        below = f"{100 * np.mean(values < 0.9):.2f} %"
        table.append([name, whole, part, float(np.nanquantile(values, 0.01)), below])
    return table


def _frame(layer: DegreeLayer, values: np.ndarray | float) -> np.ndarray:
    """Return the (P,) values of the pixels of a layer as an (H, W) image, 0 elsewhere."""
    return frame_of(values, layer.pixel, (SIZE * SAMPLES,) * 2)


def _worst_box(improvement: np.ndarray, covered: np.ndarray) -> tuple[int, int, int, int]:
    """Return the box (left, top, right, bottom) in the picture in which the correlation improves most."""
    inside = ndimage.binary_erosion(covered > 0, iterations=SAMPLES * MARGIN)
    improvement = np.where(inside, np.nan_to_num(improvement), 0)
    mean = ndimage.uniform_filter(improvement, SAMPLES * CLOSEUP)
    row, column = np.unravel_index(np.argmax(mean), mean.shape)
    left = int(np.clip(column // SAMPLES - CLOSEUP // 2, 0, SIZE - CLOSEUP))
    top = int(np.clip(SIZE - 1 - row // SAMPLES - CLOSEUP // 2, 0, SIZE - CLOSEUP))
    return left, top, left + CLOSEUP, top + CLOSEUP
