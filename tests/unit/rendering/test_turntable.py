"""Turntable videos, and GIF files against Pillow's decoder."""

import io
import tempfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from listeners import CancelledError, cancel_at
from PIL import Image, ImageSequence
from shapes import icosphere, instance_of, placed, torus

from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import Light
from rosy_addon.core.cache import Cache
from rosy_addon.core.progress import listening
from rosy_addon.external.ffmpeg import find_encoder
from rosy_addon.image_io.gif import gif_bytes, lzw_compress
from rosy_addon.line_drawing.visibility import project_to_pixels
from rosy_addon.rendering.draw import draw_picture
from rosy_addon.rendering.turntable import (
    check_still,
    check_video_path,
    draw_next,
    turntable,
    turntable_views,
)

QUICK = Look(length=8)
BALL = instance_of(icosphere(2), 2, "axis")


def decode_frames(data):
    gif = Image.open(io.BytesIO(data))
    return gif, [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(gif)]


@settings(max_examples=40)
@given(st.integers(1, 3), st.integers(1, 90), st.integers(1, 70), st.integers(0, 10**6))
def test_gray_frames_are_stored_exactly(count, width, height, seed):
    random = np.random.default_rng(seed)
    top = random.integers(1, 257)
    gray = [random.integers(0, top, (height, width, 1), dtype=np.uint8) for _ in range(count)]
    frames = [np.repeat(frame, 3, axis=2) for frame in gray]
    _, actual = decode_frames(gif_bytes(frames, 25))
    assert len(actual) == count or all((a == frames[0]).all() for a in frames)
    for decoded, original in zip(actual, frames, strict=False):
        assert np.array_equal(decoded, original)


def test_the_table_of_codes_is_reset_when_full(tmp_path):
    """After 4096 codes the table starts again."""
    noise = np.random.default_rng(0).integers(0, 256, (300, 400, 1), dtype=np.uint8)
    ((_, (actual,)),) = [decode_frames(gif_bytes([np.repeat(noise, 3, axis=2)], 10))]
    assert np.array_equal(actual[..., :1], noise) and len(lzw_compress(bytes(100_000))) < 1500


def test_dithered_colors_are_right_on_average():
    color = np.full((64, 64, 3), (200, 90, 30), dtype=np.uint8)
    _, (actual,) = decode_frames(gif_bytes([color], 10))
    assert np.abs(actual.mean(axis=(0, 1)) - (200, 90, 30)).max() < 3


def test_rate_and_repetition():
    frames = [np.full((4, 4, 3), value, dtype=np.uint8) for value in (0, 90, 200)]
    gif, _ = decode_frames(gif_bytes(frames, 20))
    assert gif.info["duration"] == 50 and gif.info["loop"] == 0


def test_the_object_stays_in_the_frame_in_all_views():
    matrix = placed(np.diag((1.0, 2.0, 1.5)), (5.0, -2.0, 1.0))
    instance = instance_of(torus(48, 24), 2, "axis", matrix)
    for view in turntable_views(instance, QUICK, 5, (80, 60), (10.0, 25.0)):
        pixels, _ = project_to_pixels(instance.world_points(), view.camera)
        assert (pixels > 0).all() and (pixels < (80, 60)).all()
        assert (np.ptp(pixels, axis=0) > (30, 20)).all()


def test_a_video_has_all_frames(tmp_path, error_of):
    path = tmp_path / "film.gif"
    views = turntable_views(BALL, QUICK, 3, (32, 32), (0.0, 0.0))
    assert turntable(draw_picture, views, 3, path, 12) == path
    gif, actual = decode_frames(path.read_bytes())
    assert len(actual) == 3 and gif.size == (32, 32)
    assert (actual[0][0, 0] == 255).all(), "on white paper"
    assert "must end in .mp4 or .gif" in error_of(check_video_path, tmp_path / "film.avi")


def test_streaks_drift_before_a_still_camera_in_whole_cycles(error_of):
    instance = instance_of(BALL.surface, 1, "axis")
    look = Look(length=8, flow=1.5)
    cache = Cache()
    views = turntable_views(instance, look, 12, (64, 64), (0.0, 0.0), still=True)
    pictures = [draw_next(view, cache).rgba[..., 0] for view in views]
    assert len(pictures) == 12 and len(cache) < 12
    # 12 frames of 1.5 pixels are three cycles of 6 pixels.
    assert len({picture.tobytes() for picture in pictures}) == 4
    assert error_of(check_still, Look(), True, "ball").startswith("ball: nothing moves")


def test_lights_stay_fixed_while_the_camera_orbits():
    """A sun from +y lights the far side in the first view and the near side in the second."""
    look = Look(length=8, shading=1.0, light="scene")
    sun = Light("sun", np.array([0.0, 1.0, 0.0]), np.ones(3), 1.0)
    views = turntable_views(BALL, look, 2, (64, 64), (0.0, 0.0), lights=[sun])
    dark, lit = (draw_picture(view).rgba[20:44, 20:44, :3].mean() for view in views)
    assert dark < 0.05 < 0.2 < lit


def test_a_cancelled_video_leaves_no_file(tmp_path):
    views = turntable_views(BALL, QUICK, 3, (32, 32), (0.0, 0.0))

    with listening(cancel_at(10)), pytest.raises(CancelledError):
        turntable(draw_picture, views, 3, tmp_path / "film.gif", 12)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_an_mp4_with_ffmpeg(tmp_path, monkeypatch):
    """As many pictures as drawn come back, and their colors. The temporary folder has a name like a pattern."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "100%d%%"))
    (tmp_path / "100%d%%").mkdir()
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    views = turntable_views(BALL, QUICK, 4, (64, 48), (0.0, 0.0))
    path = tmp_path / "film.mp4"
    turntable(draw_picture, views, 4, path, 12, find_encoder())
    facts, *pictures = imageio_ffmpeg.read_frames(str(path))
    assert facts["fps"] == 12 and facts["codec"] == "h264" and facts["source_size"] == (64, 48)
    assert len(pictures) == 4
    for picture in pictures:
        assert np.frombuffer(picture, np.uint8).reshape(48, 64, 3)[0, 0].min() > 250  # paper


def test_an_mp4_needs_an_encoder(tmp_path, error_of):
    message = error_of(turntable, draw_picture, iter(()), 3, tmp_path / "film.mp4", 12)
    assert "film.mp4: an .mp4 needs ffmpeg or Blender" in message
