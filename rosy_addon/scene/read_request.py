"""What the settings of a scene ask of its meshes, apart from their shapes and fields."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..compositor.look import Look
from .color_inputs import color_attribute_of
from .tone_inputs import ToneRequest, make_tone_request


@dataclass(frozen=True)
class ReadRequest:
    """What is read of meshes, and how.

    Attributes
    ----------
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    tone : ToneRequest or None
        The source of the surface tones.
    color_attribute : str or None
        Name of the attribute whose numbers are read for the color map.
    """

    nonfinite: str = "error"
    tone: ToneRequest | None = None
    color_attribute: str | None = None


#: Shapes and fields alone.
FIELDS_ONLY = ReadRequest()


def read_request(scene: bpy.types.Scene, look: Look) -> ReadRequest:
    """Return what a look asks of the meshes of a scene, by the settings of the scene."""
    return ReadRequest(
        nonfinite_policy(scene), make_tone_request(scene, look), color_attribute_of(scene, look)
    )


def nonfinite_policy(scene: bpy.types.Scene) -> str:
    """Return the scene's policy for vectors that are not finite: "zero" or "error"."""
    return "zero" if scene.rosy.undefined else "error"
