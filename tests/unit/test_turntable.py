"""Films from all around, against another decoder."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from shapes import icosphere, torus

from rosy_addon.compositor.gif import BAYER, LEVELS, compressed, gif_bytes
from rosy_addon.compositor.look import Look
from rosy_addon.errors import RosyError
from rosy_addon.field.generate import axis_field
from rosy_addon.projection.gbuffer import Body
from rosy_addon.turntable import check_film, pictures, write_film

QUICK = Look(length=8)


def frames_of(data):
    film = Image.open(io.BytesIO(data))
    found = []
    for number in range(film.n_frames):
        film.seek(number)
        found.append(np.asarray(film.convert("RGB")))
    return film, found


@settings(max_examples=40)
@given(st.integers(1, 3), st.integers(1, 90), st.integers(1, 70), st.integers(0, 10**6))
def test_grey_pictures_come_back_as_they_are(count, width, height, seed):
    random = np.random.default_rng(seed)
    top = random.integers(1, 257)
    frames = [
        np.repeat(random.integers(0, top, (height, width, 1), dtype=np.uint8), 3, axis=2)
        for _ in range(count)
    ]
    _, found = frames_of(gif_bytes(frames, 25))
    assert len(found) == count or all((a == frames[0]).all() for a in frames)
    for one, other in zip(found, frames, strict=False):
        assert np.array_equal(one, other)


def test_long_runs_of_codes(tmp_path):
    """Past 4096 codes the table is begun anew."""
    noise = np.random.default_rng(0).integers(0, 256, (300, 400, 1), dtype=np.uint8)
    ((_, (found,)),) = [frames_of(gif_bytes([np.repeat(noise, 3, axis=2)], 10))]
    assert np.array_equal(found[..., :1], noise)
    assert len(compressed(bytes(100_000))) < 1500


def test_colours_are_right_on_average():
    ramp = np.zeros((64, 64, 3), dtype=np.uint8)
    ramp[...] = (200, 90, 30)
    _, (found,) = frames_of(gif_bytes([ramp], 10))
    assert np.abs(found.mean(axis=(0, 1)) - (200, 90, 30)).max() < 3
    assert BAYER.shape == (4, 4) and np.prod(LEVELS) <= 256


def test_rate_and_repetition():
    frames = [np.full((4, 4, 3), value, dtype=np.uint8) for value in (0, 90, 200)]
    film, _ = frames_of(gif_bytes(frames, 20))
    assert film.info["duration"] == 50 and film.info["loop"] == 0


def test_all_of_it_is_in_the_frame_all_the_way_round():
    surface = torus(48, 24)
    matrix = np.diag((1.0, 2.0, 1.5, 1.0))
    matrix[:3, 3] = (5.0, -2.0, 1.0)
    body = Body(surface, matrix, axis_field(surface, 2))
    covered = []
    for rgba in pictures(body, QUICK, 5, (80, 60), (10.0, 25.0)):
        assert rgba.shape == (60, 80, 4)
        seen = rgba[..., 3] > 0
        assert not (seen[0].any() or seen[-1].any() or seen[:, 0].any() or seen[:, -1].any())
        covered.append(seen.mean())
    assert min(covered) > 0.1


def test_a_film_is_written_whole(tmp_path):
    surface = icosphere(2)
    body = Body(surface, np.eye(4), axis_field(surface, 2))
    path = tmp_path / "film.gif"
    write_film(path, pictures(body, QUICK, 3, (32, 32), (0.0, 0.0)), 12)
    film, found = frames_of(path.read_bytes())
    assert len(found) == 3 and film.size == (32, 32)
    assert (found[0][0, 0] == 255).all(), "on white paper"
    with pytest.raises(RosyError, match=r"films are written to .mp4 and .gif"):
        check_film(tmp_path / "film.avi")
