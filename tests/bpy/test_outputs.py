"""Files that are written from Blender: whole or untouched, never an input, and no links of others."""

import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import pytest
from objects import add_uv, link, load
from rosy.rosy_addon.core.file_io import check_writable
from rosy.rosy_addon.jobs.animation import bake_animation
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.jobs.bake_texture import bake_texture
from rosy.rosy_addon.jobs.draw_strokes import draw_strokes
from rosy.rosy_addon.scene.blender_images import new_image, new_tiled_image, write_images
from scenes import expect_error

OLD = b"the previous contents"


@pytest.fixture
def out(scene, tmp_path):
    """The folder in which the scene stores its pictures."""
    folder = tmp_path / "out"
    folder.mkdir()
    scene.rosy.store, scene.rosy.directory = "SAVED", str(folder)
    scene.render.resolution_x = scene.render.resolution_y = scene.rosy.texture_size = 32
    return folder


def bake_udim(scene, wall) -> None:
    scene.rosy.texture_udim = True
    for corner in wall.data.uv_layers[0].uv:
        corner.vector.x *= 1.9
    bake_texture(scene, [wall])


#: A name that RoSy derives, and what writes a file of this name.
DERIVED = [
    ("RoSy_Camera.png", lambda scene, wall: bake(scene)),
    ("RoSy_Scene_0001.png", lambda scene, wall: bake_animation(scene, [1])),
    ("RoSy_Scene_0001.png.rosy.txt", lambda scene, wall: bake_animation(scene, [1])),
    ("RoSy_Wall_texture.png", lambda scene, wall: bake_texture(scene, [wall])),
    ("RoSy_Wall_texture.1002.png", bake_udim),
]


@pytest.mark.parametrize("as_float", [False, True])
@pytest.mark.parametrize(("name", "write"), DERIVED)
def test_no_link_leads_out_of_the_folder(name, write, as_float, scene, wall, out):
    scene.rosy.image_format = "FLOAT" if as_float else "BYTE"
    name = name.replace(".png", ".exr") if as_float else name
    wall.name = "Wall"
    add_uv(wall.data)
    victim = out.parent / "victim"
    victim.write_bytes(OLD)
    (out / name).symlink_to(victim)
    write(scene, wall)
    assert victim.read_bytes() == OLD
    assert (out / name).is_file() and not (out / name).is_symlink()
    assert not list(out.glob(".*"))


def test_links_are_followed_for_the_path_that_is_given(scene, wall, tmp_path):
    """But not for the one that the file stores, which may come from somebody else."""
    link, target = tmp_path / "a.svg", tmp_path / "b.svg"
    target.write_bytes(OLD)
    link.symlink_to(target)
    draw_strokes(scene, kind="FILE", path=link)
    assert link.is_symlink() and target.read_bytes().startswith(b"<?xml")
    target.write_bytes(OLD)
    scene.rosy.strokes.filepath = str(link)
    draw_strokes(scene, kind="FILE")
    assert target.read_bytes() == OLD and link.read_bytes().startswith(b"<?xml")


def test_all_files_that_drawing_reads_are_inputs(scene, wall, tmp_path):
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"), copy=True)
    load(tmp_path / "library.blend", wall.name, link=True)
    names = ("tone.png", "render_0001.png", "cache.abc", "volume.vdb")
    for name in names:
        (tmp_path / name).write_bytes(OLD)
    wall.rosy.tone_image = bpy.data.images.new("tone", 8, 8)
    wall.rosy.tone_image.source, wall.rosy.tone_image.filepath = "FILE", "//tone.png"
    scene.rosy.tone_picture = "//render_####.png"
    bpy.ops.cachefile.open(filepath=str(tmp_path / "cache.abc"))
    bpy.data.volumes.new("volume").filepath = "//volume.vdb"
    for name in ("saved.blend", "library.blend", *names):
        link = tmp_path / f"link-{name}"
        link.symlink_to(name)
        expect_error("is also an input", check_writable, tmp_path / name)
        expect_error("is also an input", check_writable, link, follow_links=True)
    (tmp_path / "other.png").write_bytes(OLD)
    check_writable(tmp_path / "other.png")
    (tmp_path / "a.svg").symlink_to("saved.blend")
    expect_error("is also an input", draw_strokes, scene, kind="FILE", path=tmp_path / "a.svg")


def test_a_picture_does_not_replace_the_render_it_is_drawn_from(scene, wall, out):
    bake(scene)
    path = out / "RoSy_Camera.png"
    before = path.read_bytes()
    scene.rosy.tone_picture = str(path)
    expect_error("RoSy_Camera.png: is also an input", bake, scene)
    assert path.read_bytes() == before


def test_all_tiles_are_checked_first(scene, wall, out):
    """Also before the texture of another object is replaced."""
    wall.name = "Wall"
    add_uv(wall.data)
    other = link(bpy.data.objects.new("Before", wall.data.copy()))
    (out / "RoSy_Wall_texture.1002.png").mkdir()
    for name in ("RoSy_Wall_texture.1001.png", "RoSy_Before_texture.1001.png"):
        (out / name).write_bytes(OLD)
    scene.rosy.texture_udim = True
    expect_error("texture.1002.png: .* it is a folder", bake_texture, scene, [other, wall])
    tiles = {1001: np.ones((8, 8, 4), np.float32), 1002: np.ones((8, 8, 4), np.float32)}
    (out / "tile.1001.exr").write_bytes(OLD)
    (out / "tile.1002.exr").mkdir()
    expect_error("tile.1002.exr: .* it is a folder", new_tiled_image, "a", tiles, stem=out / "tile")
    assert {path.read_bytes() for path in out.iterdir() if path.is_file()} == {OLD}


def noise(size):
    return np.random.default_rng(0).random((size, size, 4), dtype=np.float32)


#: Functions that write two .exr files: full floats, half floats and tiles.
EXR_WRITERS = {
    "picture": lambda path: new_image("a", noise(64), stem=path.with_suffix("")),
    "frame": lambda path: write_images({path: noise(64)}),
    "tiles": lambda path: new_tiled_image(
        "a", {1001: noise(8), 1002: noise(64)}, stem=path.with_suffix("")
    ),
}


@pytest.mark.parametrize("kind", EXR_WRITERS)
@pytest.mark.parametrize("missing", [1, 200, 20_000])
def test_a_full_disk_leaves_the_old_picture(kind, missing, tmp_path):
    """The largest size of a file stands for the disk. The last byte, or nearly all of them do not fit."""
    path = tmp_path / "a.exr"
    EXR_WRITERS[kind](path)
    written = sorted(tmp_path.iterdir())
    limit = max(path.stat().st_size for path in written) - missing
    for path in written:
        path.write_bytes(OLD)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        expect_error(r"\.exr: cannot be written by Blender", EXR_WRITERS[kind], tmp_path / "a.exr")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert sorted(tmp_path.iterdir()) == written
    assert {path.read_bytes() for path in written} == {OLD}


KILLED = """
import sys
from pathlib import Path
tests = Path(sys.argv[1])
sys.path[:0] = map(str, (tests, tests.parent, tests.parent / "unit"))
import conftest
from test_outputs import new_image, noise
pixels = noise(2048)
print("begin", flush=True)
new_image("a", pixels, stem=Path(sys.argv[2]))
"""


def test_a_killed_process_leaves_the_old_picture(tmp_path):
    path = tmp_path / "a.exr"
    path.write_bytes(OLD)
    command = [sys.executable, "-c", KILLED, Path(__file__).parent, path.with_suffix("")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "begin\n"
        while sum(file.stat().st_size for file in tmp_path.iterdir()) < 1_000_000:
            assert process.poll() is None
            time.sleep(0.001)
        process.send_signal(signal.SIGKILL)
    assert path.read_bytes() == OLD
    EXR_WRITERS["picture"](path)  # deletes what the killed process has left
    assert list(tmp_path.iterdir()) == [path]
