"""Memory: how much is free, the refusal of what needs more, and how close the bound is."""

import sys

import numpy as np
import pytest
from command_helpers import python, refusal
from conftest import traced_peak
from field_helpers import write_off
from shapes import plane

from bench import cases
from rosy_addon.compositor.look import Look
from rosy_addon.core import memory
from rosy_addon.core.cache import Cache
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
    return ViewInput((cases.instance(1000, degree),), cases.camera(width, height), Look(**settings))


def limit_memory(monkeypatch, free: float) -> None:
    """Let the process believe that this many bytes are free."""
    monkeypatch.setattr(memory, "available_memory", lambda: int(free))


# --- what is free ---------------------------------------------------------------------------------


def test_limits_of_control_groups(tmp_path):
    """Of both versions, of the group and the one around it; files that are only cached are free."""
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/self/cgroup").write_text("0::/outer/inner\n7:memory:/box\n2:cpu:/\n")
    mount = tmp_path / "sys/fs/cgroup"
    first = "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"
    second = "memory.max", "memory.current", "inactive_file"
    for folder, limit, names in (
        (mount / "outer/inner", "max", second),
        (mount / "outer", "5000", second),
        # In a container, the path of its group does not exist.
        (mount / "memory", "7000", first),
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

    for name in ("_system_memory", "_control_group_memory", "_address_space"):
        monkeypatch.setattr(memory, name, fail)
    assert memory.available_memory() is None
    memory.check_memory(1e30, "a picture", "choose a smaller size")
    monkeypatch.setattr(memory, "_address_space", lambda: [-5])
    assert memory.available_memory() == 0


@pytest.mark.skipif(sys.platform != "linux", reason="the limit holds on Linux")
def test_a_limit_of_the_address_space():
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30));"
        "from rosy_addon.core.memory import available_memory; print(available_memory())"
    )
    assert (1 << 28) < int(python("-c", code).stdout) < (1 << 30)


# --- the bound of a picture ------------------------------------------------------------------------------------


def test_a_picture_in_strips_needs_less_than_a_whole_one():
    """And more processes need more."""
    view = ball_view(4000, 4000)
    groups = picture_groups(view, 2)
    strips = [strip for group in groups for strip in group]
    one, two = (picture_memory(view, groups, workers) for workers in (1, 2))
    whole = picture_memory(view, [strips], 2)
    assert one < 0.5 * whole and one < two < whole


# --- refusals -------------------------------------------------------------------------------------


def test_pictures_are_refused_before_they_are_drawn(monkeypatch, error_of):
    view = ball_view(1600, 1200, supersampling=2)
    needed = picture_memory(view, picture_groups(view, 1), 1)
    limit_memory(monkeypatch, 0.9 * needed)

    assert traced_peak(lambda: error_of(draw_picture, view)) < 0.02 * needed
    assert error_of(draw_picture, view).startswith(
        f"a picture of 1600 x 1200 pixels with 2 x 2 samples each needs about "
        f"{memory.format_bytes(needed)} of memory, {memory.format_bytes(int(0.9 * needed))} are free: "
    )


@pytest.mark.slow
def test_the_cache_gives_its_memory_back(monkeypatch, error_of):
    """It is emptied only if there is not enough without."""
    view, cache = ball_view(), Cache()
    cache.put("an earlier picture", np.zeros(3))
    limit_memory(monkeypatch, 1e12)
    draw_picture(view, cache, keep_gbuffers=False)
    assert cache.get("an earlier picture") is not None
    limit_memory(monkeypatch, 1e6)
    error_of(draw_picture, view, cache)
    assert not len(cache)


def test_meshes_and_fields_are_refused_by_the_size_of_the_file(tmp_path, monkeypatch, error_of):
    path = write_off(tmp_path / "a.off", plane(50, 50))
    peak = traced_peak(lambda: Surface(path))
    limit_memory(monkeypatch, 2 * peak)
    surface = Surface(path)
    limit_memory(monkeypatch, 0.5 * peak)
    assert "a.off: a file of 0 MB needs about" in error_of(Surface, path)
    limit_memory(monkeypatch, 1000)
    np.save(tmp_path / "a.npy", np.ones((surface.face_count, 3)))
    assert "a.npy: a file of 0 MB needs" in error_of(load_field, tmp_path / "a.npy", surface)
    assert "a field on 2,500 faces needs about" in error_of(generate, surface, "smoothest", 4)


def test_a_gif_is_refused_before_its_first_picture(tmp_path, monkeypatch, error_of):
    limit_memory(monkeypatch, 2e9)
    views = turntable_views(cases.instance(1000, 4), Look(), 500, (1000, 1000), (0, 0))
    message = error_of(turntable, draw_picture, views, 500, tmp_path / "a.gif", 24)
    assert "a .gif of 500 pictures of 1000 x 1000 pixels needs about 2.2 GB" in message
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_strokes_are_refused_by_their_spacing(monkeypatch, error_of):
    ball, camera = cases.instance(1000, 4), cases.camera(256)
    limit_memory(monkeypatch, 50e6)
    message = error_of(draw_instances, [ball], camera, StrokeStyle(spacing=4.0))
    assert "a drawing of strokes with this spacing needs about" in message
    draw_instances([ball], camera, StrokeStyle(spacing=60.0))


def test_lack_of_memory_is_one_line(monkeypatch, tmp_path):
    """If the system says so only when the memory is taken."""

    def fail(*_, **__):
        raise MemoryError

    monkeypatch.setattr("rosy_addon.field.generate.smoothest_field", fail)
    mesh, output = write_off(tmp_path / "quad.off", plane(1, 1)), tmp_path / "out.rosy"
    message = refusal("field", mesh, "-o", output, "--generate", "smoothest")
    assert "there is not enough memory: choose a smaller size" in message and not output.exists()
