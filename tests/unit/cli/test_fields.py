"""Fields that the command line makes, converts, describes and compares."""

import numpy as np
import pytest
from command_helpers import facts_of, finished, refusal, write_obj
from field_helpers import write_off
from shapes import torus

import rosy_addon as rf


@pytest.mark.slow
def test_field_makes_converts_and_info_reads(sphere, tmp_path):
    raw, rosy_file, again = (tmp_path / name for name in ("a.rawfield", "a.rosy", "b.rawfield"))
    finished("field", sphere, "-o", raw, "--degree", 6)
    finished("field", sphere, raw, "-o", rosy_file)
    finished("field", sphere, rosy_file, "-o", again)
    assert raw.read_bytes() == again.read_bytes()
    facts = facts_of(sphere, rosy_file)
    assert (facts["degree"], facts["faces"], facts["vertices"]) == (6, 1280, 642)
    assert facts["euler_characteristic"] == 2
    assert sum(index for _, index in facts["singularities"]) == 6 * 2
    assert all(isinstance(part, int) for pair in facts["singularities"] for part in pair)
    printed = finished("info", sphere, rosy_file).stdout
    assert "degree 6" in printed and "1,280 faces" in printed


def test_the_default_generator_follows_the_form(tmp_path):
    ring = write_off(tmp_path / "torus.off", torus(24, 12))
    default, chosen = tmp_path / "a.rosy", tmp_path / "b.rosy"
    finished("field", ring, "-o", default)
    finished("field", ring, "-o", chosen, "--generate", "form")
    assert default.read_bytes() == chosen.read_bytes()


@pytest.mark.slow
def test_undefined_vectors_on_request(sphere, tmp_path):
    path = tmp_path / "a.rosy"
    finished("field", sphere, "-o", path)
    lines = path.read_text().splitlines()
    lines[2 + 7] = "nan nan nan"
    path.write_text("\n".join(lines))
    expected = "1 of 1280 vectors are not finite, the first on face 7"
    assert expected in refusal("info", sphere, path)
    assert facts_of(sphere, path, "--undefined")["undefined_faces"] >= 1
    for option in ("--guides", "--against"):  # in every field file
        finished("info", sphere, option, path, "--undefined")


@pytest.mark.slow
def test_vectors_off_the_surface_on_request(sphere, tmp_path):
    path = tmp_path / "a.npy"
    finished("field", sphere, "-o", path, "--degree", 1)
    vectors = np.load(path)
    vectors[::20] = rf.Surface(sphere).face_normal[::20] * 0.9 + vectors[::20] * 0.1
    np.save(path, vectors)
    words = sphere, path, "--degree", 1
    assert "64 of 1280 vectors are not tangent" in refusal("info", *words)
    assert facts_of(*words, "--off-surface", "undefined")["undefined_faces"] == 64
    assert facts_of(*words, "--off-surface", "project")["undefined_faces"] == 0


@pytest.mark.slow
def test_field_converts(sphere, tmp_path):
    made = tmp_path / "a.rosy"
    finished("field", sphere, "-o", made, "--generate", "smoothest")
    convert = "field", sphere, made, "-o", tmp_path / "b.npy", "--to-degree"
    finished(*convert, 8, "--turn", 10, "--smooth", 0.05, "--magnitude", "unit")
    facts = facts_of(sphere, tmp_path / "b.npy")
    assert facts["degree"] == 8 and np.allclose(facts["magnitude"], 1)


@pytest.mark.slow
def test_info_compares(sphere, tmp_path):
    made, turned, sings = (tmp_path / name for name in ("a.rosy", "b.rawfield", "a.sings"))
    finished("field", sphere, "-o", made, "--generate", "smoothest")
    finished("field", sphere, made, "-o", turned, "--turn", 5)
    finished("field", sphere, made, "-o", sings)
    facts = facts_of(sphere, made, "--against", turned)
    assert np.isclose(facts["against"]["mean"], 5) and np.isclose(facts["against"]["max"], 5)
    assert facts["is_rosy"] and facts["energy"] > 4 * np.pi * 4
    (_, total), *others = facts_of(sphere, made, "--cluster", 10)["singularities"]
    assert total == 8 and not others
    facts = facts_of(sphere, turned, "--against", sings)
    assert facts["against"] == {"same": 8, "only_here": [], "only_there": []}
    printed = finished("info", sphere, made, "--against", turned).stdout
    assert "off by 5 degrees on average" in printed


@pytest.mark.slow
def test_strokes_and_guides(sphere, tmp_path):
    angle = np.linspace(0, 1.0, 30)
    arc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    rows = "\n".join(" ".join(map(str, point)) for point in arc)
    (tmp_path / "strokes.txt").write_text(f"# one\n{rows}\n\n{rows}\n")
    out, again = tmp_path / "a.rosy", tmp_path / "b.rosy"
    finished("field", sphere, "-o", out, "--strokes", tmp_path / "strokes.txt", "--degree", 2)
    guided = "field", sphere, "-o", again, "--guides", out, "--degree", 2
    finished(*guided, "--reach", 0.01)
    assert facts_of(sphere, again, "--against", out)["against"]["mean"] < 3
    finished(*guided, "--firmness")
    (tmp_path / "none.txt").write_text("1 2 3\n\n4 5 6\n")
    to_file = "field", sphere, "-o", out
    assert "contains no stroke" in refusal(*to_file, "--strokes", tmp_path / "none.txt")
    assert "has no UV map" in refusal(*to_file, "--generate", "uv")


def test_info_says_that_borders_coincide(tmp_path):
    """A tube of quads whose first and last column are two rows of vertices at the same positions."""
    angle, height = np.meshgrid(np.linspace(0, 2 * np.pi, 9), [0.0, 1.0, 2.0], indexing="ij")
    points = np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3)
    quads = [(k, k + 1, k + 4, k + 3) for k in range(24) if k % 3 < 2]
    tube = write_obj(tmp_path / "tube.obj", points, quads)
    printed = finished("info", tube, "--generate", "axis").stdout
    assert "Euler characteristic 1\n3 vertices on borders coincide" in printed
    joined = finished("info", tube, "--generate", "axis", "--join")
    assert "Euler characteristic 0\nmagnitude" in joined.stdout and "were joined" in joined.stderr
