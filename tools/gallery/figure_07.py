"""Figures 7 and 8: members on surfaces that are tilted against the view."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from rosy_addon.field.rosy_field import RosyField
from rosy_addon.field.singularities import find_singularities
from tests.harness.planar import DegreeLayer

from .looks import RED, SOLID
from .measure import correlation, local_correlation, orientation_spectrum, peaks
from .page import Page, listed
from .shapes import plane, sphere
from .sheet import Panel, display, magnified, outlined
from .solid import compose_view, frame_of, harmonic_field, layer_in_view, view

SIZE = 402
TILTS, TILTED_SIZE = (0, 60, 78), 262
MEMBER = np.radians(30)

#: View angles at which a corner of the cube is in the center.
VIEW = (45, 35)
_FIXED = SOLID.with_settings({"gain": 3.0})
#: Side of the closeup, its magnification, and its distance from the silhouette.
CLOSEUP, TIMES, MARGIN = 52, 5, 28
LOOKS = {
    "off": _FIXED.with_settings({"view_plane": False}),
    "on": _FIXED,
    "brute": _FIXED.with_settings({"method": "brute"}),
}
NAMES = {"off": "among projections", "on": "in the view plane", "brute": "brute force"}


def write() -> None:
    """Draw and write the page."""
    page = Page("figure-07", "Members on tilted surfaces")
    _write_plane(page)
    _write_sphere(page)
    page.write("Figures 7 and 8")


def _write_plane(page: Page) -> None:
    page.text(
        """This page shows how members look on tilted surfaces. The first field is a constant 4-RoSy
        field on a plane. If the plane is parallel to the view, the members are at right angles in
        the picture too. The more the plane is tilted, the more they deviate from right angles."""
    )
    surface = plane()
    member = [np.cos(MEMBER), np.sin(MEMBER), 0.0]
    field = RosyField(4, np.tile(member, (surface.face_count, 1)))
    look = SOLID.with_settings({"shading": 0.0})
    panels, rows = [], []
    for tilt in TILTS:
        camera = view(surface, (0, 90 - tilt), (TILTED_SIZE,) * 2, look.supersampling, False)
        picture = compose_view(surface, field, look, camera)
        panels.append(Panel(display(picture.rgba), f"tilted by {tilt}°"))
        layers = layer_in_view(surface, field, look, camera)
        side = look.supersampling * TILTED_SIZE
        tone = frame_of(layers.tone[:, 0], layers.pixel, (side, side))
        half_size = 0.45 * side * np.array([np.cos(np.radians(tilt)), 1.0])
        down, across = np.rint(half_size).astype(int)
        middle = side // 2
        patch = tone[middle - down : middle + down, middle - across : middle + across]
        # Drawn at twice the size: each pixel is the mean of 2 x 2.
        measured = peaks(orientation_spectrum(_downsampled(patch), 720))
        angles = MEMBER + np.array([0, np.pi / 2])
        expected = np.degrees(np.arctan2(np.sin(angles) * np.cos(np.radians(tilt)), np.cos(angles)))
        expected = sorted(expected % 180)
        rows.append([f"{tilt}°", listed(expected), listed(measured)])
    page.picture([panels], "A 4-RoSy field on a plane at three tilts", "plane")
    page.text(
        """The table lists the orientations of the projected members, and the peaks of the
        orientation spectrum of the picture, in degrees."""
    )
    page.table(["Tilt", "Projected members", "Measured in the picture"], rows)


def _write_sphere(page: Page) -> None:
    surface = sphere(64)
    field = harmonic_field(surface, 4, np.eye(3))
    _, index = find_singularities(surface, field)
    page.text("## Choosing members in the view plane")
    page.text(
        f"""The second field is a 4-RoSy field on a sphere with the symmetry of a cube: {len(index)}
        singularities of index +1/4 at the corners. On the left, members are chosen among their
        projections, as in the plane. Where the surface turns away, the lines at which the two sets
        of images break come close to each other. The weights do not account for this, and streaks
        break. On the right, the members are first rotated into the view plane, where they are at
        equal angles, and rotated back after the choice. No streak breaks."""
    )
    camera = view(surface, VIEW, (SIZE, SIZE), SOLID.supersampling)
    pictures = {name: compose_view(surface, field, look, camera) for name, look in LOOKS.items()}
    layers = {name: layer_in_view(surface, field, look, camera) for name, look in LOOKS.items()}
    tones = {name: _frame(layer, 0) for name, layer in layers.items()}
    covered_weight = _frame(layers["on"], None)
    local_correlations = {
        name: local_correlation(
            tones[name], tones["brute"], covered_weight, 3.0 * SOLID.supersampling
        )
        for name in ("off", "on")
    }
    left, top, right, bottom = box = _worst_box(
        local_correlations["on"] - local_correlations["off"], covered_weight
    )
    displayed = {name: display(picture.rgba) for name, picture in pictures.items()}
    spheres = [
        Panel(outlined(displayed[name], box, RED), f"members chosen {NAMES[name]}")
        for name in ("off", "on")
    ]
    page.picture([spheres], "A sphere with the field of a cube, drawn with both methods", "sphere")
    closeups = [
        Panel(magnified(displayed[name][top:bottom, left:right], TIMES), f"{label}, {TIMES} times")
        for name, label in NAMES.items()
    ]
    page.picture([closeups], "Closeups of the marked square, and brute force", "closeup")
    page.text(
        """The table lists the correlation with brute force over the sphere and in the marked
        square. It also lists the local correlation around each pixel (Gaussian window with a
        standard deviation of 3 pixels): its 1st percentile, and the part of the sphere where it is
        below 0.9."""
    )
    covered, square = covered_weight > 0, np.zeros(covered_weight.shape, dtype=bool)
    square[_subpixels(SIZE - bottom, SIZE - top), _subpixels(left, right)] = True
    rows = []
    for name, local in local_correlations.items():
        row = [NAMES[name]]
        row += [correlation(tones[name][part], tones["brute"][part]) for part in (covered, square)]
        local = local[covered]
        row += [float(np.nanquantile(local, 0.01)), f"{100 * np.mean(local < 0.9):.2f} %"]
        rows.append(row)
    page.table(
        ["Members chosen", "Whole sphere", "Marked square", "1st percentile", "Below 0.9"], rows
    )


def _frame(layers: DegreeLayer, channel: int | None) -> np.ndarray:
    """Return (H, W): one channel of the uncorrected blend, or 1 at covered pixels if it is None."""
    values = 1.0 if channel is None else layers.images.blend[:, channel]
    return frame_of(values, layers.pixel, (SIZE * SOLID.supersampling,) * 2)


def _subpixels(start: int, stop: int) -> slice:
    """Convert pixels of the finished picture to pixels of the supersampled one."""
    return slice(start * SOLID.supersampling, stop * SOLID.supersampling)


def _worst_box(
    improvement: np.ndarray, covered_weight: np.ndarray, side: int = CLOSEUP
) -> tuple[int, int, int, int]:
    """Return the box (left, top, right, bottom) of the picture where the correlation improves most."""
    supersampling = SOLID.supersampling
    inside = ndimage.binary_erosion(covered_weight > 0, iterations=supersampling * MARGIN)
    mean_improvement = ndimage.uniform_filter(
        np.where(inside, np.nan_to_num(improvement), 0), supersampling * side
    )
    row, column = np.unravel_index(np.argmax(mean_improvement), mean_improvement.shape)
    left = int(np.clip(column // supersampling - side // 2, 0, SIZE - side))
    top = int(np.clip(SIZE - 1 - row // supersampling - side // 2, 0, SIZE - side))
    return left, top, left + side, top + side


def _downsampled(patch: np.ndarray) -> np.ndarray:
    height, width = (side // 2 for side in patch.shape)
    return patch[: 2 * height, : 2 * width].reshape(height, 2, width, 2).mean(axis=(1, 3))
