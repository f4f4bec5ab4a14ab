"""Films of fields that change with time."""

import numpy as np
import pytest
from PIL import Image
from shapes import plane

import rosy_addon as rf
from rosy_addon.api.films import Film
from rosy_addon.compositor.flow import drift_at
from rosy_addon.compositor.look import Look
from rosy_addon.field.carry import vectors_on_rest_shape
from rosy_addon.field.representation import face_representation

SQUARE = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
LOOK = Look(length=8)


SHEET = plane().with_parts(name="square")


def series(surface, count, degrees=1.0, degree=4):
    field = rf.along_axis(surface, (1, 0, 0), degree)
    return [field.rotated(np.radians(degrees) * step) for step in range(count)]


def views_of(fields, look=LOOK, **options):
    film = Film(fields, look, (0.0, 90.0, 48, 48), **options)
    views = list(film.views())
    assert len(views) == film.picture_count
    return views


def turns(views):
    """Angles in degrees between the fields of the views and that of the first one."""
    shown = [view.instances[0] for view in views]
    z = [face_representation(each.surface, each.field)[0] for each in shown]
    return [np.degrees(np.angle(value / z[0]) / 4) for value in z]


def test_pictures_between_fields():
    """The field turns evenly; in a loop, it turns back from the last field to the first."""
    fields = series(SHEET, 3, degrees=3)
    assert turns(views_of(fields)) == pytest.approx([0, 3, 6])
    assert turns(views_of(fields, between=2)) == pytest.approx([0, 1, 2, 3, 4, 5, 6], abs=0.01)
    looped = turns(views_of(fields, between=1, loop=True))
    assert looped == pytest.approx([0, 1.5, 3, 4.5, 6, 3], abs=0.01)


def test_streaks_drift_and_loops_close():
    look = Look(length=8, flow=1.0)
    fields = series(SHEET, 3)
    drifts = [view.drift for view in views_of(fields, look, between=1)]
    assert drifts == [drift_at(look, number) for number in range(5)]
    drifts = [view.drift for view in views_of(fields, look, between=1, loop=True)]
    assert drifts == [drift_at(look, number, 6) for number in range(6)]
    assert len({each.phase for each in drifts}) == 6 and drift_at(look, 6, 6) == drifts[0]


def test_noise_moves_with_the_mesh():
    """Noise is in the rest shape of the first mesh, as long as the meshes differ."""
    bent = SHEET.vertices * (1, 0.8, 1) + np.outer(SHEET.vertices[:, 0] ** 2, (0, 0, 0.5))
    other = rf.Surface(bent, SHEET.faces)
    fields = [rf.along_axis(each, (1, 0, 0), 4) for each in (SHEET, other)]
    views = views_of(fields)
    assert {view.look.anchor for view in views} == {"surface"}
    (instance,) = views[1].instances
    assert np.array_equal(instance.surface.rest_vertices, SHEET.vertices)
    on_rest_shape = vectors_on_rest_shape(other, SHEET.vertices, fields[1].vectors)
    assert instance.field.vectors == pytest.approx(on_rest_shape, abs=1e-5)
    half = views_of(fields, between=1)[1].instances[0].surface
    assert half.vertices == pytest.approx((SHEET.vertices + bent) / 2)
    assert {view.look.anchor for view in views_of(fields, keeps_anchor=True)} == {"picture"}
    assert {view.look.anchor for view in views_of(series(SHEET, 2))} == {"picture"}


def test_fast_turns_are_noted(tmp_path):
    """With as many pictures between two fields as the note says, there is no note."""
    fields = series(SHEET, 2, degrees=10)
    options = {"size": (32, 32), "workers": 1}
    with pytest.warns(rf.RosyWarning, match=r"turns by up to 10\.0 degrees .*: 23 pictures"):
        rf.film(fields, tmp_path / "a.gif", **options)
    for between in (23, None):
        film = Film(fields, Look(), (0.0, 90.0, 32, 32), between=between)
        assert film.picture_count == 25
        next(film.views())
        assert not film.advice
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 2


def test_errors(tmp_path, error_of):
    fields, other = series(SHEET, 2), rf.Surface(SQUARE, [[0, 1, 2, 3]], name="other")
    path, form = tmp_path / "a.gif", rf.form(SHEET, 2)
    for arguments, options, message in (
        ((fields[:1], path), {}, "a.gif: a film needs 2 fields or more"),
        ((fields, tmp_path / "a.avi"), {}, "must end in .mp4 or .gif"),
        ((fields, path), {"rate": 0}, "a rate above 0"),
        ((fields, path), {"between": -1}, "between must be from 0 to 1000, not -1"),
        (([*fields, form], path), {}, "field 3 of 3 has degree 2, but the one before it 4"),
        (([*fields, rf.form(other)], path), {"between": 1}, "field 3 of 3 has other polygons"),
    ):
        assert message in error_of(rf.film, *arguments, **options) and not path.exists()
