"""`compare`: angles, matched singularities, and the table in text, JSON and LaTeX."""

import json
import re
import sys

import numpy as np
from command_helpers import finished, refusal
from field_helpers import write_off
from shapes import icosphere

import rosy_addon as rf

SPHERE = icosphere(2).with_parts(name="sphere")


def test_rows_of_fields_that_are_turned():
    one = rf.smoothest(SPHERE)
    comparison = rf.compare({"One": one, "turned": one.rotated(0.1), "lines": one.to_degree(2)})
    first, turned, lines = comparison.rows
    assert [row["title"] for row in comparison.rows] == ["One", "turned", "lines"]
    assert first["singularities"] == first["positive"] == 8 and first["negative"] == 0
    assert first["energy"] == one.energy and "mean" not in first and "mean" not in lines
    for name in ("mean", "rms", "p95", "max"):
        assert np.isclose(turned[name], np.degrees(0.1))
    assert turned["matched"] == 8 and turned["matched_distance"] == 0 and turned["compared"] == 1


def test_the_face_of_the_largest_angle():
    one = rf.along_axis(SPHERE, (0, 0, 1), degree=1)
    turn = np.where(np.arange(SPHERE.face_count) == 7, 0.4, 0.1)
    row = rf.compare([one, rf.from_angles(SPHERE, one.angles + turn, degree=1)]).rows[1]
    assert row["worst_face"] == 7 and np.isclose(row["max"], np.degrees(0.4))
    assert np.allclose(row["worst_position"], SPHERE.vertices[SPHERE.faces[7]].mean(axis=0))


def test_singularities_match_within_reach():
    """One of four moves along an edge; in another field, two of them are one of twice the index."""
    start, end = SPHERE.faces[0][:2].tolist()
    edge = np.linalg.norm(SPHERE.vertices[start] - SPHERE.vertices[end])
    first, second, third = 3, 4, 8  # far from the first vertex, and from each other
    one = rf.prescribed(SPHERE, {start: 1, first: 1, second: 1, third: 1}, 2)
    moved = rf.prescribed(SPHERE, {end: 1, first: 1, second: 1, third: 1}, 2)
    merged = rf.prescribed(SPHERE, {start: 2, second: 1, third: 1}, 2)
    wide, narrow = (rf.compare([one, moved, merged], reach=reach).rows for reach in (0.2, 0.01))
    assert [row["matched"] for row in wide[1:]] == [4, 2]
    assert np.isclose(wide[1]["matched_distance"], edge / 4)
    assert [row["matched"] for row in narrow[1:]] == [3, 2]


def test_a_title_is_one_line_of_a_table():
    one = rf.form(SPHERE)
    comparison = rf.compare({"two\nlines\x1b\udcff": one, "b": one})
    lines, latex = str(comparison).splitlines(), comparison.to_latex()
    assert lines[1].startswith(r"two\nlines\x1b\udcff  ") and len(lines) == 4
    assert r"two\textbackslash{}nlines\textbackslash{}x1b\textbackslash{}udcff & 4" in latex
    assert comparison.rows[0]["title"] == "two\nlines\x1b\udcff"


def test_tables():
    one = rf.form(SPHERE)
    comparison = rf.compare({"50 % & more_1": one, "b": one.rotated(0.1)})
    text, latex = str(comparison), comparison.to_latex()
    lines = text.splitlines()
    assert lines[1].startswith("50 % & more_1") and " 5.73 " in lines[2]
    assert len({len(line) for line in lines[:3]}) == 1  # columns of equal width
    assert r"50 \% \& more\_1 & 4" in latex and latex.count(r"\\") == 3
    assert re.search(r"tabular\}\{l(r+)\}", latex)[1] == "r" * latex.splitlines()[2].count("&")
    assert " & -- & -- " in latex and json.loads(comparison.to_json())[1]["title"] == "b"
    assert "<td>50 % &amp; more_1</td>" in comparison._repr_html_()
    assert "matched" not in str(rf.compare([one]))


def test_nothing_to_compare(error_of):
    assert "there is no field" in error_of(rf.compare, [])
    undefined = rf.from_vectors(SPHERE, np.zeros((SPHERE.face_count, 3)), degree=4)
    row = rf.compare([rf.form(SPHERE), undefined]).rows[1]
    assert row["worst_face"] == -1 and row["worst_position"] is None and row["compared"] == 0


def test_the_command(tmp_path):
    mesh, field = write_off(tmp_path / "sphere.off", SPHERE), tmp_path / "turned.rosy"
    rf.smoothest(rf.Surface(mesh), degree=6).rotated(0.05).save(field)
    done = finished("compare", mesh, "Ours=smoothest", field, "--format", "json")
    ours, turned = json.loads(done.stdout)
    assert (ours["title"], turned["title"]) == ("Ours", "turned") and ours["degree"] == 6
    assert np.isclose(turned["mean"], np.degrees(0.05), atol=1e-3)
    for words, message in (
        (["form", "form"], "same title"),
        (["form", "b=curvature", "-o", tmp_path / "a.gif"], ".pdf, .svg, .png"),
        (["nothing.rosy"], "nothing.rosy"),
    ):
        assert message in refusal("compare", mesh, *words)


def test_figures_need_matplotlib(monkeypatch, error_of):
    """Where it cannot be imported, and without the module, as in the extension."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "pip install rosyfields[figures]" in error_of(rf.figure, rf.form(SPHERE))
    monkeypatch.setitem(sys.modules, "rosy_addon.external.matplotlib_figure", None)
    assert "the Python package rosyfields" in error_of(rf.figure, rf.form(SPHERE))
