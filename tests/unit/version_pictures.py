"""Draw pictures to compare between versions of numpy: ``python version_pictures.py FILE.npz``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

if __name__ == "__main__":  # started by another interpreter, without pytest's search path
    sys.path[:0] = [str(folder) for folder in Path(__file__).resolve().parents[1:3]]

from harness.planar import compose_planar
from planar_fields import pair_angle, pixel_centers
from shapes import icosphere, torus

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.flow import Drift
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.image_io.png import to_srgb_uint8
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.gbuffer import MeshInstance
from rosy_addon.projection.project import project


def draw() -> dict[str, np.ndarray]:
    """Draw the pictures; return (H, W, 3) or (H, W, 4) uint8 arrays by name."""
    look = Look()
    pictures = {"plane": compose_planar(pair_angle(*pixel_centers(96), 96, 4), 4, look)}
    shapes = {
        "torus": (torus(), "curvature", 4, look),
        "sphere": (icosphere(3), "axis", 6, Look(method="brute", hue="noise")),
        "drift": (torus(), "curvature", 4, Look(method="ibfv", flow=1.0)),
        "engraving": (torus(), "curvature", 4, load_preset("engraving").look),
        "charcoal": (torus(40, 20), "curvature", 4, load_preset("charcoal").look),
        "magnitude": (
            icosphere(3),
            "axis",
            3,
            Look(hue="magnitude", magnitude_length=True, supersampling=2),
        ),
    }
    for name, (surface, kind, degree, shape_look) in shapes.items():
        size = 160 * shape_look.supersampling
        camera = orbit_camera(surface.vertices, -25, 30, size, size)
        instance = MeshInstance(surface, np.eye(4), generate(surface, kind, degree))
        pictures[name] = compose(project([instance], camera), shape_look, drift=Drift(0.3))
    return {name: to_srgb_uint8(picture.rgba) for name, picture in pictures.items()}


if __name__ == "__main__":
    np.savez(sys.argv[1], **draw())
