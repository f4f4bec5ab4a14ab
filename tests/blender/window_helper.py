"""RoSy in a window: jobs whose calls a helper process makes, and helpers that end.

Run by run.py, as window_panel.py is. The last step kills Blender, and run.py checks that no process is left.
"""

import json
import os
import re
import signal
import time
from unittest.mock import patch

import bpy
from conftest import baked_images, contents, pixels
from extension import preferences, rosy, switch_extension
from harness.processes import is_running
from monkey_checks import changes, fingerprint, handlers
from window_steps import (
    RESULTS,
    call_in_view,
    in_view,
    press,
    scene_with_field,
    start_long_bake,
    status,
    view,
    wait_until,
)

#: Seconds within which ESC stops a job and ends the helper.
STOP_SECONDS = 0.2

#: Longest time without a reaction, relative to that of a bake. Windows are drawn in software here.
LARGEST_PAUSE = 0.4


def helper_id():
    """Return the number of the helper process; None if there is none."""
    process = rosy("rosy_addon.worker.helper").HELPER._process
    return None if process is None else process.pid


def start_bake():
    assert call_in_view(bpy.ops.rosy.bake, "INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}


def baked_pixels():
    """Return the pixels of the only baked picture."""
    return pixels(*baked_images())


def wait_for_job():
    """Wait until no job runs, and return how long Blender has not reacted at most before the end."""
    longest, last = 0.0, time.monotonic()
    while status().current is not None:
        yield 0.01
        now = time.monotonic()
        if status().current is not None and status().current.fraction < 0.97:
            longest = max(longest, now - last)
        last = now
        assert longest < 60
    return longest


def test_picture_from_the_helper():
    """Blender reacts while the helper draws."""
    yield from scene_with_field((1280, 960))
    first = helper_id()
    assert first is not None, "the panel has not started the helper"
    start = time.monotonic()
    start_bake()
    longest = yield from wait_for_job()
    seconds = time.monotonic() - start
    assert longest < LARGEST_PAUSE * seconds, (longest, seconds)
    assert helper_id() == first and is_running(first)
    assert baked_pixels().shape == (960, 1280, 4)


def test_escape_ends_the_helper_at_once():
    yield from scene_with_field((1600, 1200))
    before = contents()
    yield from start_long_bake()
    first, job_class, stopped = helper_id(), rosy("operators.modal_job").Job, []
    stop = job_class.stop

    def timed_stop(job, reason):
        start = time.monotonic()
        stop(job, reason)
        stopped.append((reason, time.monotonic() - start, is_running(first)))

    with patch.object(job_class, "stop", timed_stop):
        press("ESC")
        yield from wait_until(lambda: status().current is None)
    ((reason, seconds, is_left),) = stopped
    assert reason == "cancelled" and seconds < STOP_SECONDS and not is_left, stopped
    assert contents() == before
    yield 0.3
    assert helper_id() not in (None, first), "there is no helper for the next job"
    assert not handlers()


def test_a_helper_that_is_killed():
    """Another helper draws the picture. If that is killed as well, there is one message."""
    yield from scene_with_field((800, 600))
    yield from start_long_bake()
    first = helper_id()
    os.kill(first, signal.SIGKILL)
    yield from wait_for_job()
    assert helper_id() not in (None, first) and baked_pixels().shape == (600, 800, 4)
    yield from scene_with_field((1600, 1200))
    before = contents()
    yield from start_long_bake()
    first = helper_id()
    os.kill(first, signal.SIGKILL)
    yield from wait_until(lambda: helper_id() not in (None, first))
    helper = rosy("rosy_addon.worker.helper").HELPER
    yield from wait_until(lambda: helper._is_ready)
    os.kill(helper_id(), signal.SIGKILL)
    yield from wait_for_job()
    assert contents() == before
    assert_reported("has ended twice")


#: Operators that change what is selected, with settings.
CHANGES = {
    "field_generate": {"kind": "smoothest", "degree": 6},
    "field_convert": {"degree": 8},
    "field_store": {"form": "ANGLE"},
    "field_singularities": {"source": 3, "target": 20, "index": 1},
    "field_comb": {
        "stroke": [{"name": "", "location": (1, 0, 0), "pressure": 1, "is_start": True}]
    },
    "bake_texture": {"unwrap": True},
}


def test_a_job_keeps_to_the_object_that_was_selected():
    """Another selection changes nothing. If the object is deleted, the job ends with one line."""
    for operator, settings in CHANGES.items():
        for is_deleted in (False, True):
            yield from two_spheres()
            before, report_count = fingerprint(), len(report_texts())
            start = getattr(bpy.ops.rosy, operator)
            assert call_in_view(start, "INVOKE_DEFAULT", True, **settings) == {"RUNNING_MODAL"}
            select("Second")
            if is_deleted:
                bpy.data.objects.remove(bpy.data.objects["First"])
            yield from wait_for_job()
            assert_only_first_changed(before)
            reports = report_texts()[report_count:]
            assert not any("Error" in report for report in reports), reports
            assert any("'First' was deleted" in report for report in reports) == is_deleted, reports


def test_a_dialog_keeps_to_the_object_that_was_selected():
    """The user selects another object while a dialog is open, and then confirms it."""
    path = str(RESULTS.with_suffix(".rosy"))
    for operator, settings in (("bake_texture", {}), ("field_import", {"filepath": path})):
        yield from two_spheres()
        mesh = bpy.data.meshes["First"]
        mesh.uv_layers.remove(mesh.uv_layers[0])
        call_in_view(bpy.ops.rosy.field_export, "EXEC_DEFAULT", filepath=path)
        mesh.attributes["rosy"].data[0].vector *= 2.0
        before = fingerprint()
        start = getattr(bpy.ops.rosy, operator)
        assert call_in_view(start, "INVOKE_DEFAULT", True, **settings) == {"RUNNING_MODAL"}
        yield 0.5
        select("Second")
        press("RET")
        yield 0.5
        yield from wait_for_job()
        assert_only_first_changed(before)


def assert_only_first_changed(before):
    """Check that only the object or mesh First is different from a fingerprint, beside RoSy's own data."""
    differences = changes(before, fingerprint(), ("context", "owned/*", "scenes/*"))
    assert {re.split("[/:]", path)[1] for path in differences} == {"First"}, differences


def two_spheres():
    """Create a scene of two spheres with fields. The first one is selected."""
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.2
    bpy.context.scene.rosy.texture_size = 64
    with in_view():
        for name in ("Second", "First"):
            bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3)
            bpy.context.object.name = bpy.context.object.data.name = name
            bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=4)


def select(name):
    """Select an object alone."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == name)
    bpy.context.view_layer.objects.active = bpy.data.objects[name]


def test_without_a_helper():
    """Blender waits for the picture if no process can be started, or the user wants none."""
    helper = rosy("rosy_addon.worker.helper")
    yield from scene_with_field()
    helper.HELPER.close()
    with patch.object(helper, "start_module", side_effect=OSError("too many processes")):
        for _ in range(2):
            start_bake()
            yield from wait_for_job()
            assert baked_pixels().shape == (240, 320, 4)
    assert_reported("Blender waits while RoSy computes")
    preferences().use_helper = False
    try:
        start_bake()
        yield from wait_for_job()
    finally:
        preferences().use_helper = True
    assert helper_id() is None


def assert_reported(text):
    """Check that a line is among the reports of Blender, once."""
    reports = report_texts()
    assert sum(text in report for report in reports) == 1, reports


def report_texts():
    """Return the reports of Blender in the order in which they came."""
    window, area, _, _ = view()
    kind = area.ui_type
    area.ui_type = "INFO"
    try:
        with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
            bpy.ops.info.select_all(action="SELECT")
            bpy.ops.info.report_copy()
    finally:
        area.ui_type = kind
    return bpy.context.window_manager.clipboard.splitlines()


def test_switched_off():
    """The helper ends with the extension."""
    yield from scene_with_field()
    start_bake()
    yield from wait_for_job()
    first = helper_id()
    switch_extension(False)
    assert not is_running(first)
    switch_extension(True)
    yield 0.2


def test_blender_is_killed():
    """All processes end, while they draw a large picture together."""
    yield from scene_with_field((1920, 1440))
    bpy.context.scene.rosy.look.supersampling = 2
    yield from start_long_bake()
    assert is_running(helper_id())
    results = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    results |= {"blender is killed": ["", 0.0], "the end": ["", 0.0]}
    RESULTS.write_text(json.dumps(results))
    os.kill(os.getpid(), signal.SIGKILL)
