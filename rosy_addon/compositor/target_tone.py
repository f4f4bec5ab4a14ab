"""The target tone of each pixel, from light, an attribute, an image, or a reference render."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..core.cache import Cache
from ..core.errors import RosyError
from ..projection.camera import Camera
from ..projection.gbuffer import GBuffer
from ..projection.pixel_blocks import reported_blocks
from ..projection.surface_sampling import surface_tones
from ..projection.surface_tone import MipMap
from .look import Look
from .shading import Light, diffuse, light_visibility

#: Minimum difference between the tones that become white and black.
MIN_TONE_RANGE = 1e-3

#: Maximum relative difference between the aspect ratios of a reference render and its camera.
ASPECT_TOLERANCE = 0.01


@dataclass(frozen=True, eq=False)
class ReferenceRender:
    """A picture of the scene made by another renderer, used as the source of the tone.

    Attributes
    ----------
    luminance : (H, W) float32 ndarray
        Linear, rows from the bottom.
    camera : Camera
        Camera of the picture. It may have another resolution, with the same aspect ratio.
    name : str
        Name of the picture in error messages.

    Raises
    ------
    RosyError
        If the aspect ratios of the picture and of the camera differ.
    """

    luminance: np.ndarray
    camera: Camera
    name: str = "picture"

    def __post_init__(self) -> None:
        height, width = self.luminance.shape
        ratio = width / height * self.camera.height / self.camera.width
        if not 1 - ASPECT_TOLERANCE <= ratio <= 1 + ASPECT_TOLERANCE:
            raise RosyError(
                f"{self.name}: has {width} x {height} pixels, but camera '{self.camera.name}' has "
                f"{self.camera.width} x {self.camera.height}: the aspect ratios must be equal"
            )

    @cached_property
    def mip_map(self) -> MipMap:
        """Mip map of the luminance."""
        return MipMap(self.luminance)

    def mip_level(self, camera: Camera) -> float:
        """Return the (fractional) level of the mip map at which a pixel is as large as a pixel of `camera`.

        Pixels are compared at the same distance from the camera.
        """
        height, width = self.luminance.shape
        pixels_per_unit = self.camera.resized(width, height).pixels_per_unit
        return max(float(np.log2(pixels_per_unit / camera.pixels_per_unit)), 0.0)

    def sample(self, gbuffer: GBuffer) -> np.ndarray:
        """Return the (P,) float32 luminance at the surface points of a G-buffer.

        Points outside of the picture have the luminance of its border.
        """
        reprojection = self.reprojection(gbuffer.camera)
        clip = gbuffer.position @ reprojection[[0, 1, 3], :3].T + reprojection[[0, 1, 3], 3]
        u, v = clip[:, :2].T / np.maximum(clip[:, 2], 1e-12) * 0.5 + 0.5
        level = np.full(len(clip), self.mip_level(gbuffer.camera))
        return self.mip_map.sample(u, v, level, repeat=False)

    def reprojection(self, camera: Camera) -> np.ndarray:
        """Return the (4, 4) float64 matrix from the view space of `camera` to clip space of the picture."""
        return self.camera.projection @ self.camera.view @ camera.to_world


def target_tone(
    gbuffer: GBuffer,
    look: Look,
    lights: Sequence[Light] = (),
    reference: ReferenceRender | None = None,
    cache: Cache | None = None,
) -> np.ndarray:
    """Compute the target tone of each pixel.

    Parameters
    ----------
    gbuffer : GBuffer
    look : Look
        Its settings of light, and those whose names begin with `tone`, are used.
    lights : sequence of Light
        Lights of the scene in camera space. Used if the light of the look is "scene".
    reference : ReferenceRender, optional
        Another render of the scene, whose luminance is the tone. Required if the tone of the look is
        "picture".
    cache : Cache, optional
        Stores the shadows of lights.

    Returns
    -------
    (P, 3) float32 ndarray
        Linear factors, at least 0. Where the source has no value, the diffuse light is used.

    Raises
    ------
    RosyError
        If the source of the tone does not exist: the reference render, or an attribute or image of a mesh.
    """
    if look.tone != "light":
        check_tone(look, [instance.tone for instance in gbuffer.instances], reference)
    visibility = light_visibility(gbuffer, look, lights, cache)
    tone = np.empty((len(gbuffer.pixel), 3), dtype=np.float32)
    for block in reported_blocks(len(tone), "finding tones"):
        part, part_visibility = gbuffer.part(block), [of_light[block] for of_light in visibility]
        if look.tone == "light":
            light = diffuse(part, look, lights, part_visibility)
            tone[block] = apply_tone_curve(light, look)
            continue
        source_tone = reference.sample(part) if look.tone == "picture" else surface_tones(part)
        tone[block] = apply_tone_curve(source_tone, look)[:, None]
        missing = np.isnan(source_tone)
        if look.tone_lit or missing.any():
            light = diffuse(part, look, lights, part_visibility)
            if look.tone_lit:
                tone[block] *= light
            tone[block][missing] = light[missing]
    return tone


def check_tone(
    look: Look, instance_tones: Sequence[object], reference: ReferenceRender | None
) -> None:
    """Check that the source of a look's tone exists.

    Parameters
    ----------
    look : Look
    instance_tones : sequence of SurfaceTone or None
        Tones of the mesh instances.
    reference : ReferenceRender or None

    Raises
    ------
    RosyError
        If the tone is "picture" and there is no reference render, or if it is "attribute" or
        "image" and no mesh instance has a tone.
    """
    if look.tone == "picture" and reference is None:
        raise RosyError("tone 'picture' needs a picture, but none is given")
    if look.tone in ("attribute", "image") and all(tone is None for tone in instance_tones):
        raise RosyError(f"tone '{look.tone}' needs an {look.tone}, but no object has one")


def apply_tone_curve(tone: np.ndarray, look: Look) -> np.ndarray:
    """Apply the black point, white point and gamma of a look to tones.

    Parameters
    ----------
    tone : ndarray
        Tones, of any shape.
    look : Look
        Its `tone_levels` are the black point, the white point and the gamma. The black point becomes 0 and
        the white point 1; the gamma is applied after that.

    Returns
    -------
    float32 ndarray
        Tones of the same shape. At least 0; values beyond the white point are above 1.
    """
    scale, black = tone_curve(look)
    stretched = np.maximum((tone - np.float32(black)) * np.float32(scale), 0)
    gamma = look.tone_levels[2]
    if gamma != 1:
        stretched = stretched ** np.float32(1 / gamma)
    return stretched.astype(np.float32, copy=False)


def tone_curve(look: Look) -> tuple[float, float]:
    """Return (scale, black): a look maps a tone to (tone - black) * scale, and then applies the gamma."""
    black, white, _ = look.tone_levels
    tone_range = float(np.copysign(max(abs(white - black), MIN_TONE_RANGE), white - black))
    return 1 / tone_range, black
