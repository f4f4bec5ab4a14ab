"""Pictures and fields with another version of numpy: they differ as docs/reliability.md says.

The other interpreter makes them with ``python test_numpy_versions.py FILE.npz``.
"""

import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT
from harness.planar import compose_planar
from planar_fields import pair_angle, pixel_centers
from shapes import icosphere, instance_of, torus

from rosy_addon.compositor.compose import compose
from rosy_addon.compositor.flow import Drift
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.image_io.png import to_srgb_uint8
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_camera
from rosy_addon.projection.project import project

pytestmark = pytest.mark.slow

#: Largest angles between the directions of generated fields, in degrees.
MAX_DEGREES = {"form": 1e-3, "smoothest": 1e-5, "curvature": 1e-5, "features": 1e-5}


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
        "magnitude": (icosphere(3), "axis", 3, Look(hue="magnitude", magnitude_length=True)),
    }
    for name, (surface, kind, degree, shape_look) in shapes.items():
        size = 112 * shape_look.supersampling
        camera = orbit_camera(surface.vertices, -25, 30, size, size)
        instance = instance_of(surface, degree, kind)
        pictures[name] = compose(project([instance], camera), shape_look, drift=Drift(0.3))
    return {name: to_srgb_uint8(picture.rgba) for name, picture in pictures.items()}


def fields() -> dict[str, np.ndarray]:
    """Generate fields; return (F, 3) vectors by kind."""
    surface, noise = torus(60, 30), np.random.default_rng(0).normal(0.0, 0.01, (1800, 3))
    # Rounded, so that both versions of numpy have the same mesh.
    rough = surface.with_parts(vertices=np.round(surface.vertices + noise, 6))
    return {kind: generate(rough, kind, 4).vectors for kind in MAX_DEGREES}


if __name__ == "__main__":
    np.savez(sys.argv[1], **draw(), **fields())
    sys.exit()


@pytest.fixture(scope="module")
def other_arrays(tmp_path_factory):
    """The arrays that the other interpreter makes."""
    other = os.environ.get("ROSY_OTHER_PYTHON")
    if not other:
        pytest.skip("ROSY_OTHER_PYTHON names no other interpreter")
    file = tmp_path_factory.mktemp("numpy") / "arrays.npz"
    folders = ROOT, ROOT / "tests", ROOT / "tests" / "unit"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))}
    subprocess.run([other, __file__, file], env=environment, check=True)
    code = "import numpy; print(numpy.__version__, end='')"
    assert subprocess.check_output([other, "-c", code], text=True) != np.__version__
    return np.load(file)


def test_generated_fields_hardly_differ(other_arrays):
    for kind, vectors in fields().items():
        sine = np.linalg.norm(np.cross(vectors, other_arrays[kind]), axis=1)
        sine /= np.maximum((vectors**2).sum(axis=1), 1e-30)
        assert np.degrees(sine.max()) <= MAX_DEGREES[kind], kind
        assert ((vectors == 0) == (other_arrays[kind] == 0)).all(), kind


def test_another_numpy_version_draws_the_same(other_arrays):
    for name, picture in draw().items():
        difference = np.abs(picture.astype(int) - other_arrays[name]).max(axis=2)
        assert difference.max() <= 1, name
        assert (difference > 0).mean() <= 1e-3, name
