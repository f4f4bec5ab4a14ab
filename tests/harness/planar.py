"""Pictures of planar fields, and the layers that pictures are composed of."""

from typing import NamedTuple
from unittest import mock

import numpy as np

import rosy_addon.compositor.compose as compose_module
from rosy_addon.compositor.compose import colorize, compose, streak_tone
from rosy_addon.compositor.flow import NO_DRIFT, Drift
from rosy_addon.compositor.hatching import HatchedLines
from rosy_addon.compositor.lic import lic_lengths, look_noise
from rosy_addon.compositor.lic_images import LicImages
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.look_units import PixelLook, pixel_look
from rosy_addon.compositor.paper_grain import picture_paper_grain
from rosy_addon.compositor.pixel_field import PixelField, without_undefined_neighbors
from rosy_addon.compositor.streak_statistics import break_steps
from rosy_addon.compositor.strips import Strip
from rosy_addon.compositor.undirected import undirected_texture
from rosy_addon.core.deterministic_trig import unit_phasor
from rosy_addon.projection.gbuffer import GBuffer


class DegreeLayer(NamedTuple):
    """Images of the fields of one degree, at the resolution of the supersampled frame.

    Attributes
    ----------
    degree : int
    pixel : (P,) int32 ndarray
        Flat indices into the supersampled frame.
    images : LicImages
        LIC images before contrast correction, with values around 0.5.
    tone : (P, K) float32 ndarray
        The blend after contrast correction and gain. Display values, not clipped.
    """

    degree: int
    pixel: np.ndarray
    images: LicImages
    tone: np.ndarray


class PlanarPicture(NamedTuple):
    """A picture of a planar field: (H, W, 4) linear colors, and the layer that they show."""

    rgba: np.ndarray
    layer: DegreeLayer


def degree_layers(gbuffer: GBuffer, look: Look) -> list[DegreeLayer]:
    """Return the layers of a picture without ink, one per visible degree, in ascending order."""
    layers = []

    def recorded(field: PixelField, look: PixelLook, images: LicImages) -> np.ndarray:
        tone = streak_tone(field, look, images)
        layers.append(DegreeLayer(field.degree, field.pixel, images, tone))
        return tone

    height = gbuffer.camera.height
    with mock.patch.object(compose_module, "streak_tone", recorded):
        compose(gbuffer, look, strips=[Strip(0, height, height)])
    return layers


def lic(
    field: PixelField, look: Look, noise: np.ndarray | None = None, drift: Drift = NO_DRIFT
) -> LicImages:
    """Average noise, by default that of the look, along the streamlines of each member."""
    pixels = pixel_look(look, drift=drift)
    (images,) = lic_lengths(field, [pixels], look_noise(field, pixels) if noise is None else noise)
    return images


def planar_pixel_field(
    angles: np.ndarray, degree: int, magnitude: np.ndarray | float = 1.0
) -> PixelField:
    """Make the pixel field of a field in the plane, given the angle of a member at each pixel.

    Parameters
    ----------
    angles : (H, W) ndarray
        Radians, counter-clockwise from the direction of the rows. Rows from the bottom. The field
        is undefined where the angle is not finite or the magnitude is not above 0.
    degree : int
    magnitude : (H, W) ndarray or float
        rho.
    """
    angles = np.asarray(angles, dtype=np.float64)
    height, width = angles.shape
    rho = np.broadcast_to(np.float32(magnitude), angles.shape)
    defined = np.isfinite(angles) & (rho > 0)
    z = unit_phasor(np.where(defined, degree * angles, 0.0).ravel())
    z *= np.where(defined, rho, 0).astype(np.float32).ravel()
    pixel = np.arange(height * width, dtype=np.int32)
    field = PixelField(
        degree=degree,
        width=width,
        height=height,
        pixel=pixel,
        representation=z,
        screen_jacobian=np.tile(np.array([1, 1j], dtype=np.complex64), (len(pixel), 1)),
        neighbor_mask=np.full(len(pixel), 0b111_111_111, dtype=np.uint16),
    )
    return without_undefined_neighbors(field)


def planar_lines(
    angles: np.ndarray, degree: int, look: PixelLook
) -> tuple[PixelField, HatchedLines]:
    """Make a field in the plane, given as for `planar_pixel_field`, and the lines of hatching along it."""
    field = planar_pixel_field(angles, degree)
    noise = look_noise(field, look)
    images, breaks = lic_lengths(field, [look, look.with_length(break_steps(look))], noise)
    grain = None
    if look.paper_grain:
        grain = picture_paper_grain(
            field.pixel, field.width, look.line_width, look.seed, 1, field.line_count
        )
    undirected = undirected_texture(field, noise, look.line_width)
    has_breaks = look.breaks > 0 or look.wobble > 0
    breaks = breaks if has_breaks else None
    return field, HatchedLines(look, images, breaks, grain, undirected=undirected)


def compose_planar(
    angles: np.ndarray,
    degree: int,
    look: Look,
    magnitude: np.ndarray | float = 1.0,
    noise: np.ndarray | None = None,
    drift: Drift = NO_DRIFT,
) -> PlanarPicture:
    """Draw a field in the plane, without mesh, camera, light and supersampling.

    Parameters
    ----------
    angles, degree, magnitude
        As for `planar_pixel_field`.
    look : Look
        Lengths are in pixels.
    noise : (H, W) or (H, W, 3) ndarray, optional
        Values from 0 to 1. By default the noise of the look in image space.
    drift : Drift
    """
    pixels = planar_pixel_field(angles, degree, magnitude)
    if noise is not None:
        noise = np.asarray(noise, dtype=np.float32).reshape(len(pixels.pixel), -1)
    drawn = pixel_look(look, drift=drift).for_symmetry(pixels.symmetry)
    noise = look_noise(pixels, drawn) if noise is None else noise
    (images,) = lic_lengths(pixels, [drawn], noise)
    tone = streak_tone(pixels, drawn, images)
    rgba = np.ones((*np.shape(angles), 4), dtype=np.float32)
    rgba[..., :3] = colorize(pixels, images, tone, drawn).reshape(*rgba.shape[:2], -1)
    return PlanarPicture(rgba, DegreeLayer(degree, pixels.pixel, images, tone))
