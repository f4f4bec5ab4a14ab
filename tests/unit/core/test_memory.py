"""Memory: how much is free, the refusal of what needs more, and how close the bound is."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from conftest import ROOT

from bench import cases
from rosy_addon.compositor import image_noise, streak_statistics
from rosy_addon.compositor.look import Look
from rosy_addon.core import memory
from rosy_addon.core.cache import Cache
from rosy_addon.core.errors import RosyError
from rosy_addon.field.field_io import load_field
from rosy_addon.field.generate import generate
from rosy_addon.field.surface import Surface
from rosy_addon.line_drawing.pipeline import draw_instances
from rosy_addon.line_drawing.style import StrokeStyle
from rosy_addon.rendering.draw import draw_picture, picture_groups, picture_memory
from rosy_addon.rendering.turntable import turntable, turntable_views
from rosy_addon.rendering.view_input import ViewInput


def ball_view(width: int = 512, height: int = 512, degree: int = 4, **settings) -> ViewInput:
    """Return a view of a ball that covers most of the frame."""
    ball = cases.instance(1000, degree)
    return ViewInput((ball,), cases.camera(width, height), Look(**settings))


def limit_memory(monkeypatch, free: float) -> None:
    """Let the process believe that this many bytes are free."""
    monkeypatch.setattr(memory, "available_memory", lambda: int(free))


# --- what is free ---------------------------------------------------------------------------------


def test_limits_of_control_groups(tmp_path):
    """Of the group and of the one around it; files that are only cached are free."""
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text("0::/outer/inner\n7:memory:/box\n2:cpu:/\n")
    mount = tmp_path / "sys/fs/cgroup"
    for folder, limit, names in (
        (mount / "outer/inner", "max", ("memory.max", "memory.current", "inactive_file")),
        (mount / "outer", "5000", ("memory.max", "memory.current", "inactive_file")),
        # In a container, the path of its group does not exist.
        (
            mount / "memory",
            "7000",
            ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
        ),
    ):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / names[0]).write_text(f"{limit}\n")
        (folder / names[1]).write_text("1000\n")
        (folder / "memory.stat").write_text(f"anon 600\n{names[2]} 300\n")
    assert memory._control_group_memory(tmp_path) == [4300, 6300]


def test_unknown_memory_is_none(monkeypatch, tmp_path):
    """A source that fails does not hide the others, and nothing is refused without any."""

    def fail():
        raise OSError

    sources = ("_system_memory", "_control_group_memory", "_address_space")
    for name in sources:
        monkeypatch.setattr(memory, name, fail)
    assert memory.available_memory() is None
    memory.check_memory(1e30, "a picture", "choose a smaller size")
    monkeypatch.setattr(memory, "_address_space", lambda: [-5])
    assert memory.available_memory() == 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the limit holds on Linux")
def test_a_limit_of_the_address_space_refuses_a_picture(tmp_path):
    """Before memory is taken: in less time than the picture takes, and no file is written."""
    mesh, picture = tmp_path / "quad.obj", tmp_path / "a.png"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    limits = "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30)); "
    command = "from rosy_addon.cli.parser import main; sys.exit(main(prog='rosy'))"
    completed = subprocess.run(
        [sys.executable, "-c", limits + command]
        + ["render", mesh, "--view", "0,0", "--size", "8000x8000", "-o", picture],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert completed.returncode == 2
    (line,) = completed.stderr.splitlines()[-1:]
    assert "a picture of 8000 x 8000 pixels" in line
    assert " GB of memory, " in line
    assert "choose a smaller size" in line
    assert not picture.exists()


# --- the bound of a picture ------------------------------------------------------------------------------------


def traced_peak(work) -> int:
    """Return the largest number of bytes that are allocated at once, as in a new process."""
    for cache in (image_noise.TILE_CACHE, streak_statistics.STATISTICS_CACHE):
        cache.clear()
    image_noise.streak_moments.cache_clear()
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_picture_in_strips_needs_less_than_a_whole_one():
    """And more processes need more."""
    view = ball_view(4000, 4000)
    groups = picture_groups(view, 2)
    strips = [strip for group in groups for strip in group]
    whole, two, one = (
        picture_memory(view, groups, workers)
        for groups, workers in (([strips], 2), (groups, 2), (groups, 1))
    )
    assert one < 0.5 * whole
    assert one < two < whole


# --- refusals -------------------------------------------------------------------------------------


def test_pictures_are_refused_before_they_are_drawn(monkeypatch, error_of):
    view = ball_view(1600, 1200, supersampling=2)
    needed = picture_memory(view, picture_groups(view, 1), 1)
    limit_memory(monkeypatch, 0.9 * needed)

    def draw():
        return draw_picture(view)

    peak = traced_peak(lambda: error_of(draw))
    assert peak < 0.02 * needed
    assert error_of(draw).startswith(
        f"a picture of 1600 x 1200 pixels with 2 x 2 samples each needs about "
        f"{memory.format_bytes(needed)} of memory, {memory.format_bytes(int(0.9 * needed))} are free: "
    )


@pytest.mark.slow
def test_the_cache_gives_its_memory_back(monkeypatch):
    """It is emptied only if there is not enough without."""
    view, cache = ball_view(), Cache()
    cache.put("an earlier picture", np.zeros(3))
    limit_memory(monkeypatch, 1e12)
    draw_picture(view, cache, keep_gbuffers=False)
    assert cache.get("an earlier picture") is not None
    limit_memory(monkeypatch, 1e6)
    with pytest.raises(RosyError):
        draw_picture(view, cache)
    assert not len(cache)


def test_meshes_and_fields_are_refused_by_the_size_of_the_file(tmp_path, monkeypatch, error_of):
    rows = "".join(f"v {x} {x % 7} {x % 3}\n" for x in range(3000))
    faces = "".join(f"f {x} {x + 1} {x + 2}\n" for x in range(1, 2998))
    (tmp_path / "a.obj").write_text(rows + faces)
    peak = traced_peak(lambda: Surface(tmp_path / "a.obj"))
    limit_memory(monkeypatch, 2 * peak)
    surface = Surface(tmp_path / "a.obj")
    limit_memory(monkeypatch, 0.5 * peak)
    assert "a.obj: a file of 0 MB needs about" in error_of(Surface, tmp_path / "a.obj")
    limit_memory(monkeypatch, 1000)
    np.save(tmp_path / "a.npy", np.ones((surface.face_count, 3)))
    assert "a.npy: a file of 0 MB needs" in error_of(load_field, tmp_path / "a.npy", surface)
    assert "a field on 2,997 faces needs about" in error_of(generate, surface, "smoothest", 4)


def test_a_header_with_more_numbers_than_the_file(tmp_path, error_of):
    surface = cases.ball(100)
    np.save(tmp_path / "a.npy", np.ones((surface.face_count, 3)))
    shape = b"(%d, 3)" % surface.face_count
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(
        data.replace(shape + b", }" + b" " * 9, b"(%d, 3), }" % 10**11)
    )
    assert traced_peak(lambda: error_of(load_field, tmp_path / "a.npy", surface)) < 1 << 20
    assert "which is more than it contains" in error_of(load_field, tmp_path / "a.npy", surface)


def test_a_gif_is_refused_before_its_first_picture(tmp_path, monkeypatch, error_of):
    limit_memory(monkeypatch, 2e9)
    ball = cases.instance(1000, 4)
    views = turntable_views(ball, Look(), 500, (1000, 1000), (0, 0))
    assert "a .gif of 500 pictures of 1000 x 1000 pixels needs about 2.2 GB" in error_of(
        turntable, draw_picture, views, 500, tmp_path / "a.gif", 24
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_strokes_are_refused_by_their_spacing(monkeypatch, error_of):
    ball, camera = cases.instance(1000, 4), cases.camera(256)
    limit_memory(monkeypatch, 50e6)
    message = error_of(draw_instances, [ball], camera, StrokeStyle(spacing=4.0))
    assert "a drawing of strokes with this spacing needs about" in message
    draw_instances([ball], camera, StrokeStyle(spacing=30.0))


@pytest.mark.parametrize(
    ("command", "step"),
    [
        (["render", "--view", "0,0", "--size", "32x32"], "rosy_addon.rendering.draw.compose"),
        (["strokes", "--view", "0,0"], "rosy_addon.line_drawing.pipeline.trace_on_mesh"),
        (["field", "--generate", "smoothest"], "rosy_addon.field.generate.smoothest_field"),
    ],
    ids=["render", "strokes", "field"],
)
def test_lack_of_memory_is_one_line(command, step, monkeypatch, capsys, tmp_path):
    """If the system says so only when the memory is taken."""
    from rosy_addon.cli import parser

    def fail(*_, **__):
        raise MemoryError

    (tmp_path / "quad.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    monkeypatch.setattr(step, fail)
    suffix = {"render": ".png", "strokes": ".svg", "field": ".rosy"}[command[0]]
    output = tmp_path / f"out{suffix}"
    arguments = [command[0], str(tmp_path / "quad.obj"), *command[1:], "-o", str(output)]
    assert parser.main(arguments) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "there is not enough memory: choose a smaller size" in line
    assert not output.exists()
