"""Presets in a window: previews in the panel and in the choice of a preset, and dialogs.

Run by run.py, as window_panel.py is.
"""

import bpy
from extension import rosy, switch_extension
from window_steps import call_in_view, capture, open_tab, press, save_part, view


def library():
    return rosy("rosy_addon.ui.preset_library")


def point_on_preview():
    """Return a point on the preview in the panel, in pixels from the lower left of the window."""
    sidebar = view()[3]
    return sidebar.x + sidebar.width // 2 - 15, sidebar.y + sidebar.height - 360


def wait_for_previews():
    """Wait until the previews, which Blender loads in the background, are on the screen."""
    for _ in range(15):
        view()[1].tag_redraw()
        yield 0.1


def save_screenshot(name):
    """Save the screen as window-NAME.png, and return the (h, w, 3) values of the sidebar."""
    yield from wait_for_previews()
    return capture(f"window-{name}", view()[3])


def preview_tones(sidebar):
    """Return the (h, w) tones of the middle of the active preset's preview in the sidebar."""
    x, y = point_on_preview()
    left, low = x - view()[3].x - 50, y - view()[3].y - 50
    return sidebar[low : low + 100, left : left + 100].mean(axis=2)


def test_panel_with_previews():
    switch_extension(False)
    rosy("rosy_addon.ui.look_panels").VIEW3D_PT_rosy_look.bl_options = set()
    switch_extension(True)
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    yield from open_tab()
    tones = preview_tones((yield from save_screenshot("presets-1-panel")))
    assert tones.std() > 0.1 and 0.2 < tones.mean() < 0.6, (tones.std(), tones.mean())


def move_to(x, y):
    view()[0].event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)


def click(x, y):
    move_to(x, y)
    yield 0.2
    for value in ("PRESS", "RELEASE"):
        view()[0].event_simulate(type="LEFTMOUSE", value=value, x=x, y=y)
        yield 0.1
    yield 0.5


def press_key(key):
    press(key)
    yield 0.5


def test_preset_chosen_by_its_preview():
    call_in_view(bpy.ops.ed.undo_push, message="before")
    x, y = point_on_preview()
    yield from click(x, y)
    yield 1.5
    # The third preview of the first row, which extends to the left below the picture.
    x, y = x - 345, y - 141
    move_to(x, y)
    yield 0.3
    move_to(x + 3, y)
    yield 2.0
    yield from save_screenshot("presets-2-choice")
    bottom = point_on_preview()[1] - 370
    save_part("window-presets-2-choice", "presets", 0, bottom, view()[0].width, 490)
    yield from click(x, y)
    assert bpy.context.scene.rosy.preset_name == "cross-hatch", bpy.context.scene.rosy.preset_name
    assert bpy.context.scene.rosy.look.ink == "hatch"
    move_to(400, 300)
    tones = preview_tones((yield from save_screenshot("presets-3-chosen")))
    assert (tones > 0.95).mean() > 0.25 and (tones < 0.3).mean() > 0.1, "no ink on paper"
    call_in_view(bpy.ops.ed.undo)
    yield 0.3
    assert bpy.context.scene.rosy.preset_name == "default"
    assert bpy.context.scene.rosy.look.ink == "soft"


def test_preset_saved_by_a_dialog():
    settings = bpy.context.scene.rosy
    settings.look.length = 120
    move_to(400, 400)
    call_in_view(bpy.ops.rosy.preset_save, "INVOKE_DEFAULT", name="Mine", sentence="Long streaks")
    yield 1.0
    yield from save_screenshot("presets-4-save")
    yield from press_key("RET")
    assert settings.preset == "mine" and library().user_preset_keys() == ["mine"]
    yield from save_screenshot("presets-5-saved")
    assert not library().is_changed(settings)


def test_preset_deleted_only_if_confirmed():
    for key, remaining in (("ESC", ["mine"]), ("RET", [])):
        call_in_view(bpy.ops.rosy.preset_remove, "INVOKE_DEFAULT")
        yield 1.0
        yield from save_screenshot(f"presets-9-delete-{key.lower()}")
        yield from press_key(key)
        assert library().user_preset_keys() == remaining, key
    yield from save_screenshot("presets-10-deleted")


def test_previews_are_freed_with_the_extension():
    yield from wait_for_previews()
    previews = library()._LIBRARY.previews
    assert len(previews) == len(library().entries())
    switch_extension(False)
    assert not len(previews)
    yield 0.2
    switch_extension(True)
