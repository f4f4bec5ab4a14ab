"""Ambient occlusion as a tone for pictures."""

import numpy as np

import rosy_addon as rf

CUBE = (
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    [[3, 2, 1, 0], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]],
)


def test_outer_faces_see_the_sky_and_inner_ones_do_not():
    vertices, faces = CUBE
    outside = rf.Surface(vertices, faces)
    inside = rf.Surface(vertices, [face[::-1] for face in faces])
    np.testing.assert_allclose(rf.ambient_occlusion(outside, 32), 1, atol=0.02)
    np.testing.assert_allclose(rf.ambient_occlusion(inside, 32), 0, atol=0.02)


def test_tones_of_corners_and_of_vertices_draw_the_same_picture():
    surface = rf.Surface(*CUBE)
    tones = np.linspace(0, 1, 8)
    options = {"preset": "pen-and-ink", "size": (64, 64)}
    by_vertex = rf.render(surface, tone_values=tones, **options)
    by_corner = rf.render(surface, tone_values=tones[surface.faces.ravel()], **options)
    np.testing.assert_array_equal(by_vertex, by_corner)


def test_other_numbers_of_tones_are_refused(error_of):
    surface = rf.Surface(*CUBE)
    message = error_of(rf.render, surface, tone_values=np.ones(6), preset="engraving")
    assert "8 numbers, one for each vertex, or 24 numbers, one for each corner" in message
