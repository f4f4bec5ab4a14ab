"""RoSy in a window: the panel in its states, jobs with progress, and jobs that are interrupted.

Run by run.py, through run_window.py. Every step is a generator that yields to let Blender handle its
events (`window_steps`).
"""

import math
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from conftest import add_camera, baked_images, contents, pixels, render_image
from extension import preferences, rosy, switch_extension
from monkey_checks import handlers
from window_steps import (
    SHOTS,
    call_in_view,
    capture,
    fresh_scene,
    in_view,
    press,
    save_part,
    scene_with_field,
    start_long_bake,
    status,
    view,
    wait_until,
)


def job_ends():
    """Wait until no job runs, and check that no handler is left but those of live views and panels."""
    yield from wait_until(lambda: status().current is None)
    yield 0.3
    assert not handlers()


def save_screenshot(name, height=10_000):
    """Save the upper part of the sidebar as NAME.png, and the window as window-NAME.png."""
    _, area, _, sidebar = view()
    for _ in range(10):  # panels that have opened or grown are animated
        area.tag_redraw()
        yield 0.1
    capture(f"window-{name}", sidebar)
    height = min(height, sidebar.height)
    part = sidebar.x, sidebar.y + sidebar.height - height, sidebar.width, height
    save_part(f"window-{name}", name, *part, colors=None)
    assert (SHOTS / f"{name}.png").stat().st_size > 1000


# The steps


def test_panel_without_field():
    yield from fresh_scene()
    yield from save_screenshot("panel-1-no-field")


def test_panel_with_field():
    yield from scene_with_field(size=(640, 480))
    yield from save_screenshot("panel-2-field")


def test_singularities_as_dots():
    """Dots of both signs are drawn while they are shown; otherwise there is no handler."""
    overlay = rosy("rosy_addon.ui.overlay")
    yield from fresh_scene()
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
        bpy.ops.view3d.view_selected()
    assert not overlay.DRAW_HANDLERS
    yield from save_screenshot("panel-5-no-singularities")
    without = count_dots("panel-5-no-singularities")
    assert call_in_view(bpy.ops.rosy.singularities, show="OVERLAY") == {"FINISHED"}
    yield from save_screenshot("panel-6-singularities", 450)
    orange, blue = count_dots("panel-6-singularities") - without
    assert orange > 200 and blue > 200, (orange, blue)
    call_in_view(bpy.ops.rosy.singularities, show="NONE")
    assert not overlay.DRAW_HANDLERS
    yield from save_screenshot("panel-7-hidden")
    assert np.abs(count_dots("panel-7-hidden") - without).max() < 100


def count_dots(name):
    """Return how many pixels in the left half of the 3D view are orange and blue like dots."""
    screen = capture(f"window-{name}", view()[2])
    red, green, blue = screen[:, : screen.shape[1] // 2].transpose(2, 0, 1)
    orange = (red > 0.8) & (green < 0.5) & (blue < 0.25)
    is_blue = (blue > 0.8) & (red < 0.3) & (green < 0.5)
    return np.array([np.count_nonzero(orange), np.count_nonzero(is_blue)])


def test_bake_with_progress():
    yield from scene_with_field(size=(800, 600))
    yield from start_long_bake()  # slow enough to observe the progress
    fractions = []
    while status().current is not None:
        fractions.append(status().current.fraction)
        yield
    assert len(set(fractions)) >= 3, fractions
    assert fractions == sorted(fractions), fractions
    yield from job_ends()
    assert baked_images()


def test_panel_with_picture():
    view()[1].spaces.active.shading.type = "MATERIAL"
    yield 3.0
    yield from save_screenshot("panel-3-baked")


def test_panel_out_of_date():
    scene = bpy.context.scene
    scene.camera.location.x += 0.5
    other = add_camera("Another Camera", (0.0, 5.0, 0.0), (math.pi / 2, 0.0, math.pi))
    yield 1.0
    (info,) = rosy("rosy_addon.scene.bake_records").list_bakes(scene)
    assert info.stale_reason == "camera 'Camera' was changed"
    scene.camera = other
    call_in_view(bpy.ops.rosy.bake, "EXEC_DEFAULT", True)
    scene.view_settings.view_transform = "Standard"
    view()[1].spaces.active.shading.type = "SOLID"
    yield from save_screenshot("panel-4-out-of-date")


def test_eevee_shows_the_picture():
    """A render by EEVEE, which needs a window on most machines, shows the picture."""
    yield from scene_with_field(size=(200, 150))
    scene = bpy.context.scene
    scene.rosy.look.shading = 0.0
    scene.view_settings.view_transform = "Standard"
    call_in_view(bpy.ops.rosy.bake, "EXEC_DEFAULT", True)
    engines = scene.render.bl_rna.properties["engine"].enum_items_static.keys()
    eevee = next(name for name in engines if name.startswith("BLENDER_EEVEE"))
    scene.render.filter_size, scene.eevee.taa_render_samples = 0.0, 1
    rendered = render_image(scene, SHOTS / "eevee.png", eevee)
    picture = pixels(scene.rosy.bakes[0].image)
    inside = (rendered[..., 3] > 0.99) & (picture[..., 3] > 0.99)
    assert inside.mean() > 0.05
    difference = np.abs(rendered - picture)[..., :3][inside].mean()
    assert difference < 0.02, difference


def test_undo_after_bake():
    """Undo and redo restore the file, with all pixels, as it was before and after each of two bakes."""

    def state():
        return contents(), [pixels(image).tobytes() for image in bpy.data.images]

    yield from scene_with_field(size=(64, 48))
    states = [state()]
    for seed in (1, 2):
        bpy.context.scene.rosy.look.seed = seed
        call_in_view(bpy.ops.rosy.bake, "INVOKE_DEFAULT", True)
        yield from wait_until(lambda: status().current is None)
        yield 0.3
        states.append(state())
    assert states[0] != states[1] != states[2]
    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    for operator, expected in ((undo, 1), (undo, 0), (redo, 1), (redo, 2)):
        call_in_view(operator)
        yield 0.3
        assert state() == states[expected], expected


def interrupt(action):
    """Start a long bake, call an action, and check that the bake ends and leaves nothing."""
    yield from scene_with_field(size=(1600, 1200))
    yield from start_long_bake()
    action()
    yield from job_ends()
    assert not [material for material in bpy.data.materials if "rosy" in material.name.lower()]


def test_stop_when_the_scene_changes():
    """An object is deleted, the field undone, the scene changed, a file opened; RoSy is switched off."""

    def switch_off():
        switch_extension(False)
        switch_extension(True)
        preferences().live_first_field = False

    actions = [bpy.ops.object.delete, bpy.ops.ed.undo, partial(bpy.ops.scene.new, type="EMPTY")]
    for action in (*actions, switch_off):
        yield from interrupt(partial(call_in_view, action))
    yield from interrupt(partial(bpy.ops.wm.read_homefile, use_empty=True))


def test_export_and_import_from_the_file_browser():
    """The file browser opens; after its confirmation the operators run as modal jobs."""
    yield from scene_with_field()
    path = SHOTS / "browser.rosy"
    path.unlink(missing_ok=True)
    attributes = bpy.context.object.rosy.field_mesh.attributes
    for operator, is_done in (
        (bpy.ops.rosy.field_export, path.is_file),
        (bpy.ops.rosy.field_import, lambda: "rosy" in attributes),
    ):
        assert call_in_view(operator, "INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
        yield 1.0
        params = browser_params()
        params.directory, params.filename = str(SHOTS).encode(), path.name
        if operator.idname_py() == "rosy.field_import":
            attributes.remove(attributes["rosy"])
        yield 0.5
        press("RET")
        yield from wait_until(lambda is_done=is_done: is_done() and status().current is None)
        yield 0.2
        yield from job_ends()


def test_turntable_encoded_by_another_blender():
    """Another Blender encodes an .mp4, and this one handles its events."""
    yield from scene_with_field()
    path = SHOTS / "encoded.mp4"
    with in_view():
        started = bpy.ops.rosy.turntable(
            "INVOKE_DEFAULT", True, skip_browser=True, filepath=str(path), film=".mp4",
            pictures=3, width=160, height=120,
        )  # fmt: skip
    assert started == {"RUNNING_MODAL"}
    ticks = 0
    while status().current is not None or not ticks:
        ticks += status().current is not None and status().current.label == "encoding the video"
        yield
    assert ticks > 3 and path.stat().st_size > 500


def browser_params():
    """Return the settings of the open file browser."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "FILE_BROWSER":
                return area.spaces.active.params
    raise AssertionError("there is no file browser")


def test_animation_asks_for_a_folder():
    """In a file that was never saved, Animation opens a file browser for the folder."""
    yield from scene_with_field(size=(64, 48))
    folder = SHOTS / "frames"
    folder.mkdir(exist_ok=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 3, 4
    assert call_in_view(bpy.ops.rosy.bake_animation, "INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield 1.0
    browser_params().directory = str(folder).encode()
    yield 0.5
    press("RET")
    yield from wait_until(lambda: scene.rosy.bakes and status().current is None)
    yield from job_ends()
    assert len(list(folder.glob("*.png"))) == 2
    assert Path(scene.rosy.directory) == folder


def settled(name):
    """Return the 3D view, once two captures in a row are the same."""
    before = capture(name, view()[2])
    for _ in range(20):
        yield 2.0
        picture = capture(name, view()[2])
        if np.abs(picture - before).mean() < 1e-3:
            break
        before = picture
    return picture


def test_relit_pictures_are_shown_in_the_lights_of_the_scene():
    """The view then follows the light, without a new bake."""
    yield from scene_with_field()
    call_in_view(bpy.ops.rosy.preset_apply, preset="engraving")
    bpy.context.scene.rosy.relight = True
    call_in_view(bpy.ops.rosy.bake, "EXEC_DEFAULT", True)
    view()[1].spaces.active.region_3d.view_perspective = "CAMERA"
    call_in_view(bpy.ops.rosy.show_here)
    pictures = []
    for angle in (-1.2, 1.2):  # the sun is at the left, then at the right
        bpy.data.objects["Sun"].rotation_euler = 0.6, angle, 0.0
        yield 3.0  # for the shaders of the view
        pictures.append((yield from settled(f"relit-{angle:g}")))
    assert (np.abs(pictures[0] - pictures[1]).mean(axis=2) > 0.1).mean() > 0.01


def test_bake_the_current_view():
    yield from scene_with_field()
    call_in_view(bpy.ops.rosy.bake, "EXEC_DEFAULT", True, camera="VIEW")
    (image,) = baked_images()
    assert tuple(image.size) == (view()[2].width, view()[2].height)
