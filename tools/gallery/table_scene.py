"""The scene in which docs/hatching.md shows tones: Suzanne and a ball on a table."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from rosy_addon.field.generate import axis_field, generate
from rosy_addon.field.surface import Surface
from rosy_addon.projection.ambient_occlusion import ambient_occlusion
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.surface_tone import SurfaceTone

from .shapes import plane, sphere, suzanne
from .solid import even_curvature


@lru_cache
def instances(tone: str = "") -> list[MeshInstance]:
    """Return the meshes of the scene, with `tone` as their surface tone.

    "occlusion" is ambient occlusion. "bands" are dark and light bands, which the table does not get.
    """
    monkey, ball, table = suzanne(), sphere(), plane(24)
    bare = [
        MeshInstance(monkey, _placement(0, 0, 0.985), even_curvature(monkey, 4)),
        MeshInstance(ball, _placement(1.55, -0.75, 0.5, 0.5), generate(ball, "smoothest", 4)),
        MeshInstance(table, _placement(0, 0, 0, 7.0), axis_field(table, 4, (1.0, 0.25, 0.0))),
    ]
    if tone == "occlusion":
        tones = [SurfaceTone(ambient_occlusion(bare, number)[:, None]) for number in range(3)]
    elif tone == "bands":
        tones = [_banded(monkey), _banded(ball), None]
    else:
        return bare
    return [
        instance if tone is None else replace(instance, tone=tone)
        for instance, tone in zip(bare, tones, strict=True)
    ]


def _placement(x: float, y: float, z: float, scale: float = 1.0) -> np.ndarray:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def _banded(surface: Surface) -> SurfaceTone:
    """Return a tone of dark and light bands, mapped to a surface from bottom to top."""
    rows = np.arange(512)[:, None] / 512
    image = np.where(rows * 6 % 1 < 0.5, 0.45, 0.95) + np.zeros(512)
    x, _, z = surface.vertices[surface.corner_vertex].T
    uv = np.stack([x / 3 + 0.5, z / 2.4 + 0.5 + 0.04 * np.sin(5 * x)], axis=1)
    return SurfaceTone(uv.astype(np.float32), image.astype(np.float32))
