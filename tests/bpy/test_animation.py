"""Frames of animations: which are drawn, in which processes, and what an interruption leaves."""

import os
import signal
import subprocess
import sys
import time
import unicodedata
from pathlib import Path

import bpy
import numpy as np
import pytest
from objects import add_camera, animate, link
from rosy.rosy_addon.cli.parser import main
from rosy.rosy_addon.core.color import to_linear
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.scene.bake_records import list_bakes, remove_bakes
from rosy.rosy_addon.scene.cameras import frame_camera
from rosy.rosy_addon.scene.files import picture_stem
from rosy.rosy_addon.scene.pictures import OutputSettings
from scenes import contents, expect_error, pixels, render

ROOT = Path(__file__).parents[2]


@pytest.fixture
def moving(scene, camera, monkey):
    """A scene with Suzanne, who turns and is deformed, and a moving camera."""
    scene.render.resolution_x, scene.render.resolution_y = 96, 72
    animate(monkey, "rotation_euler", {1: (0.0, 0.0, 0.0), 20: (0.0, 0.0, 1.0)})
    monkey.shape_key_add(name="Basis")
    key = monkey.shape_key_add(name="Open")
    for point in key.data[:200]:
        point.co.z -= 0.2
    animate(key, "value", {1: 0.0, 20: 1.0})
    animate(camera, "location", {1: (0.0, -5.0, 0.5), 20: (1.0, -5.0, 0.5)})
    scene.frame_set(3)
    return scene


def frames_of(folder):
    """Return the bytes of the pictures by name."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.png"))}


def test_streaks_drift_from_frame_to_frame(moving, tmp_path):
    """A frame shows the same streaks, whether it is drawn with others, alone, or as a still."""
    moving.rosy.look.flow, moving.frame_end = 2.0, 20
    settings = OutputSettings(folder=tmp_path)
    bake_animation(moving, range(8, 10), settings=settings)
    together = frames_of(tmp_path)
    frame = pixels(bpy.data.images.load(str(tmp_path / "RoSy_Scene_0009.png")))
    (again,) = bake_animation(moving, [9], settings=settings)
    assert again.skipped == (9,) and frames_of(tmp_path) == together
    moving.frame_set(9)
    (single,) = bake(moving)
    np.testing.assert_allclose(pixels(single.image), frame, atol=1 / 255)
    moving.rosy.look.flow = 0.0
    (again,) = bake_animation(moving, [9], settings=settings)
    assert again.rendered == (9,) and frames_of(tmp_path) != together


def test_the_frame_and_the_camera_are_restored(moving, tmp_path):
    moving.timeline_markers.new("Other", frame=4).camera = add_camera("Other")
    moving.frame_set(-5, subframe=0.5)
    moving.camera = None
    before = moving.frame_current, moving.frame_subframe
    bake_animation(moving, [5], settings=OutputSettings(folder=tmp_path))
    assert (moving.frame_current, moving.frame_subframe) == before and moving.camera is None


def test_frames_that_are_up_to_date_are_skipped(moving, tmp_path):
    def rendered(*frames):
        (result,) = bake_animation(moving, frames, settings=OutputSettings(folder=tmp_path))
        assert sorted(result.rendered + result.skipped) == [*frames]
        return result.rendered

    assert rendered(1, 2) == (1, 2)
    before = frames_of(tmp_path)
    assert len(before) == 2
    assert rendered(1, 2, 3) == (3,)
    # Frames that a change affects are drawn again, and missing pictures.
    (tmp_path / "RoSy_Scene_0002.png").unlink()
    assert rendered(1, 2, 3) == (2,)
    moving.rosy.look.gain = 1.0
    assert rendered(1, 2, 3) == (1, 2, 3)
    moving.rosy.look.gain = 2.5
    rendered(1, 2, 3)
    assert {**frames_of(tmp_path), **before} == frames_of(tmp_path)


def test_damaged_frames_are_drawn_again(moving, tmp_path):
    settings = OutputSettings(folder=tmp_path)
    bake_animation(moving, range(1, 6), settings=settings)
    whole = frames_of(tmp_path)
    first, second, third, fourth, _ = (tmp_path / name for name in whole)
    first.write_bytes(b"")
    second.write_bytes(second.read_bytes()[:-1])
    third.write_bytes(b"garbage")
    fourth.write_bytes(first.with_name("RoSy_Scene_0005.png").read_bytes())
    (again,) = bake_animation(moving, range(1, 6), settings=settings)
    assert again.rendered == (1, 2, 3, 4) and again.skipped == (5,)
    assert frames_of(tmp_path) == whole


def test_a_folder_in_place_of_a_sidecar_file_is_named(moving, tmp_path):
    (tmp_path / "RoSy_Scene_0001.png.rosy.txt").mkdir()
    settings, message = OutputSettings(folder=tmp_path), r"frame 1: .*0001.png.rosy.txt: .* folder"
    expect_error(message, bake_animation, moving, [1], settings=settings)


def test_cameras_and_scenes_have_files_of_their_own(moving, tmp_path):
    """Names that differ only in characters that file systems change, or in case."""
    moving.name = "Cam A"
    names = ["Cam.A", "Cam A", "Cam_A", "cam.a"]
    cameras = [add_camera(name, (0.0, -5.0, 0.2 * i)) for i, name in enumerate(names)]
    settings = OutputSettings(folder=tmp_path)
    for sources in (cameras, None):
        results = bake_animation(moving, [1], cameras=sources, settings=settings)
        assert all(result.rendered == (1,) for result in results)
    files = frames_of(tmp_path)
    assert len({name.casefold() for name in files}) == 5 and "RoSy_Cam_A_0001.png" in files
    # One camera alone has the same file as among others.
    (again,) = bake_animation(moving, [1], cameras=cameras[:1], settings=settings)
    assert (again.camera, again.skipped) == (names[0], (1,))
    stills = tmp_path / "stills"
    for camera in cameras:
        bake(moving, cameras=[camera], settings=OutputSettings(folder=stills))
    assert len({path.name.casefold() for path in stills.iterdir()}) == 4


def test_names_of_files_are_short_and_differ_on_every_file_system(scene):
    names = ["\u1ebf", "e\u0302\u0301", "x" * 254 + "a", "x" * 254 + "b", "\u65e5" * 85]
    cameras = [add_camera(name) for name in names]  # Blender 4.2 cuts names to 63 bytes
    stems = [picture_stem(name) for name in (*names, *(camera.name for camera in cameras))]
    assert all(len(stem.encode()) <= 200 for stem in stems)
    keys = {unicodedata.normalize("NFC", picture_stem(camera.name)) for camera in cameras}
    assert len(keys) == len(names)


def test_markers_choose_the_camera(moving, tmp_path):
    other = link(bpy.data.objects.new("Other", bpy.data.cameras.new("Other")))
    other.matrix_world = moving.camera.matrix_world.copy()
    other.location.z += 1.5
    for name, frame, camera in (("a", 1, moving.camera), ("b", 4, other)):
        moving.timeline_markers.new(name, frame=frame).camera = camera
    assert [frame for frame in (0, 1, 3, 4, 9) if frame_camera(moving, frame) == other] == [4, 9]
    (result,) = bake_animation(moving, range(3, 5), settings=OutputSettings(folder=tmp_path))
    moving.timeline_markers.clear()
    moving.camera = other
    moving.frame_set(4)
    (single,) = bake(moving)
    frame = pixels(bpy.data.images.load(str(tmp_path / "RoSy_Scene_0004.png")))
    np.testing.assert_allclose(pixels(single.image), frame, atol=1 / 255)
    assert result.rendered == (3, 4)


def test_materials_play_the_frames(moving, tmp_path):
    before = contents()
    bake_animation(moving, range(4, 8), settings=OutputSettings(folder=tmp_path / "frames"))
    (bake_info,) = list_bakes(moving)
    assert bake_info.frame_range == "4 to 7" and not bake_info.stale_reason
    moving.view_settings.view_transform = "Standard"
    moving.rosy.look.shading = 0.0
    for frame in (4, 6):
        moving.frame_set(frame)
        rendered = render(moving, tmp_path / f"seen{frame}.exr", samples=1)
        path = tmp_path / "frames" / f"RoSy_Scene_{frame:04d}.png"
        image = bpy.data.images.load(str(path))
        stored = pixels(image)
        linear = to_linear(stored)
        inside = (rendered[..., 3] > 0.99) & (stored[..., 3] > 0.99)
        assert inside.mean() > 0.05
        assert np.abs(rendered[..., :3] - linear[..., :3])[inside].mean() < 0.01, frame
        bpy.data.images.remove(image)
    moving.frame_set(3)
    remove_bakes(moving)
    assert len(frames_of(tmp_path / "frames")) == 4
    after = contents()
    for name in ("images", "materials", "node_groups"):
        assert all(x in before[name] or "Render" in x for x in after[name])


def test_half_floats(moving, tmp_path):
    before = sorted(scene.name for scene in bpy.data.scenes)
    settings = OutputSettings(folder=tmp_path, as_float=True)
    bake_animation(moving, [2], settings=settings)
    path = tmp_path / "RoSy_Scene_0002.exr"
    image = bpy.data.images.load(str(path))
    assert image.is_float
    channels = path.read_bytes().split(b"chlist\0", 1)[1][4:]
    name, _, kind = channels.partition(b"\0")
    assert name == b"A" and kind[:4] == b"\1\0\0\0"  # half
    bake_animation(moving, [2], settings=OutputSettings(folder=tmp_path))
    linear = to_linear(pixels(bpy.data.images.load(str(tmp_path / "RoSy_Scene_0002.png"))))
    np.testing.assert_allclose(pixels(image)[..., :3], linear[..., :3], atol=0.01)
    assert sorted(scene.name for scene in bpy.data.scenes) == before


def test_errors_name_the_frame(moving, tmp_path):
    expect_error("need a folder", bake_animation, moving, [1])
    animate(bpy.data.objects["Suzanne"], "location", {1: (0, 0, 0), 2: (500, 0, 0)})
    settings, message = OutputSettings(folder=tmp_path), r"frame 2: .* outside the frame"
    expect_error(message, bake_animation, moving, range(1, 4), settings=settings)
    assert len(frames_of(tmp_path)) == 1 and moving.frame_current == 3


# --- processes -------------------------------------------------------------------------------


@pytest.fixture
def file(moving, tmp_path):
    path = tmp_path / "scene.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def start(file, folder, *options):
    command = ["-m", "rosy_addon", "bake", str(file), "--out", str(folder), *options]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen([sys.executable, *command], cwd=ROOT, env=environment, **streams)


def wait_for(process):
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err


def test_processes_share_the_frames(file, tmp_path):
    """Two commands in one folder, one of which uses two processes."""
    bake_animation(bpy.context.scene, range(1, 7), settings=OutputSettings(folder=tmp_path / "one"))
    words = file, tmp_path / "both", "--frames", "1-6"
    for process in (start(*words), start(*words, "--jobs", "2", "--save")):
        wait_for(process)
    assert frames_of(tmp_path / "both") == frames_of(tmp_path / "one")
    assert not [path for path in (tmp_path / "both").iterdir() if path.name.startswith(".")]
    bpy.ops.wm.open_mainfile(filepath=str(file))
    (bake_info,) = list_bakes(bpy.context.scene)
    assert bake_info.frame_range == "1 to 6"


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("PYTHONPATH", str(ROOT))  # so that workers find the package
        with distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster:
            yield cluster


def test_a_cluster_renders_all_frames(file, tmp_path, cluster):
    settings = OutputSettings(folder=tmp_path / "one")
    bake_animation(bpy.context.scene, range(1, 11), settings=settings)
    address = cluster.scheduler_address
    process = start(file, tmp_path / "two", "--frames", "1-10", "--scheduler", address)
    deadline = time.monotonic() + 60
    while len(list((tmp_path / "two").glob("[!.]*.png"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    victim = next(iter(cluster.workers.values()))
    os.kill(victim.pid, signal.SIGKILL)
    wait_for(process)
    assert frames_of(tmp_path / "two") == frames_of(tmp_path / "one")


def test_a_cluster_that_does_not_answer(file, tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "1s")
    address = "tcp://127.0.0.1:1"
    process = start(file, tmp_path / "out", "--frames", "1-3", "--scheduler", address)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 2 and "--scheduler" in err, err


# --- turntables ------------------------------------------------------------------------------


def test_a_video_encoded_by_blender(tmp_path, capsys):
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    video = tmp_path / "film.mp4"
    options = ["--pictures", "3", "--size", "65x33", "--generate", "axis", "--workers", "1"]
    assert main(["turntable", str(mesh), "-o", str(video), *options]) == 0, capsys.readouterr().err
    clip = bpy.data.movieclips.load(str(video))
    assert clip.frame_duration == 3 and tuple(clip.size) == (64, 32)
