"""Every generator on every awkward mesh, through the command line."""

import numpy as np
import pytest
from awkward import AWKWARD
from command_helpers import facts_of, finished, refusal, write_obj
from field_helpers import bumpy, read_field, write_off
from shapes import torus

from rosy_addon.field.generate import GENERATORS, GeneratorSettings, generate, options_of
from rosy_addon.field.surface import Surface

#: Meshes with closed parts that have no field without singularities.
CURVED = ("cube", "faces_without_area", "pieces")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory):
    """The folder of the .obj files, each with a UV map that is an oblique projection from above."""
    folder = tmp_path_factory.mktemp("awkward")
    for name, make in AWKWARD.items():
        points, faces = make()
        uv = [(x + 0.2 * z, y - 0.3 * z) for x, y, z in points]
        write_obj(folder / f"{name}.obj", points, faces, uv)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", AWKWARD)
@pytest.mark.parametrize("kind", GENERATORS)
def test_every_kind_on_every_mesh(meshes, tmp_path, kind, name):
    mesh, out = meshes / f"{name}.obj", tmp_path / "a.rosy"
    options = ["--uv", "--reach", "0.1"] if kind == "guided" else []
    if kind == "prescribed":
        (tmp_path / "none.sings").write_text("4 0\n")
        options = ["--singularities", tmp_path / "none.sings"]
    command = "field", mesh, "-o", out, "--generate", kind, "--degree", 4, *options
    if kind == "features" and name == "faces_without_area":  # edges around equilateral triangles
        assert "the edges cancel each other" in refusal(*command)
        return
    if kind == "prescribed" and name in CURVED:
        assert "this closed surface needs" in refusal(*command)
        return
    notes, facts = finished(*command).stderr, facts_of(mesh, out)
    assert facts["degree"] == 4 and np.isfinite(facts["energy"])
    low, high = facts["magnitude"]
    assert 0 <= low <= high <= 1 + 1e-6
    assert ("Möbius" in notes) == (name == "moebius")
    degenerate_count = 1000 if name == "faces_without_area" else 0
    is_undefined = facts["undefined_faces"] > degenerate_count
    assert ("gives no direction on any face" in notes) == (high == 0)
    assert ("gives no direction on" in notes) == is_undefined
    assert notes.count("\n") == (name == "moebius") + is_undefined
    if kind in ("form", "smoothest"):
        assert facts["undefined_faces"] == degenerate_count
    assert facts["undefined_faces"] >= degenerate_count


@pytest.mark.parametrize(
    ("kind", "words", "options"),
    [
        ("axis", ["--axis", "-1,0.5,2"], {"axis": (-1.0, 0.5, 2.0)}),
        ("curvature", ["--reach", "0.1"], {"reach": 0.1}),
        ("features", ["--sharp-angle", "10"], {"sharp_angle": np.radians(10)}),
    ],
)
def test_options_of_the_command_line(kind, words, options, tmp_path):
    """They are the settings of these names; angles are in degrees."""
    mesh, out = write_off(tmp_path / "a.off", bumpy(torus(24, 12))), tmp_path / "a.rosy"
    finished("field", mesh, "-o", out, "--generate", kind, *words)
    surface = Surface(mesh)
    expected = generate(surface, GeneratorSettings(kind, **options), 4).vectors
    assert np.array_equal(read_field(out, surface).vectors, expected)
    assert list(options) == options_of(kind)


def test_options_out_of_range_are_refused(error_of):
    for options in ({"reach": -0.1}, {"reach": np.nan}, {"sharp_angle": 4.0}, {"axis": (1.0, 2.0)}):
        (name,) = options
        assert f"setting '{name}' is" in error_of(GeneratorSettings, "curvature", **options)
