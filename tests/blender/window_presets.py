"""Presets in a window: their pictures in the panel and where one is chosen, and dialogs that ask.

Run by run.py as window.py is.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from watching import SHOTS, in_view, rosy, view, watch

EXTENSION = "bl_ext.user_default.rosy"


def shelf():
    return rosy("rosy_addon.ui.shelf")


def open_look():
    """The sidebar at RoSy's tab with the section of looks open, as few other things as can be."""
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    area = view()[1]
    area.spaces.active.show_region_ui = True
    yield 0.5
    for _ in range(3):
        view()[3].active_panel_category = "RoSy"
        area.tag_redraw()
        yield 0.3


def photograph(name):
    for _ in range(10):
        view()[1].tag_redraw()
        yield 0.1
    path = SHOTS / f"window-{name}.png"
    subprocess.run(["import", "-window", "root", str(path)], check=True, timeout=20)


def panel_with_pictures():
    bpy.ops.preferences.addon_disable(module=EXTENSION)
    rosy("rosy_addon.ui.panels").VIEW3D_PT_rosy_look.bl_options = set()
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    yield from open_look()
    yield 2.0
    yield from photograph("presets-1-panel")


def move_to(x, y):
    view()[0].event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)


def click(x, y):
    move_to(x, y)
    yield 0.2
    for value in ("PRESS", "RELEASE"):
        view()[0].event_simulate(type="LEFTMOUSE", value=value, x=x, y=y)
        yield 0.1
    yield 0.5


def press(kind):
    for value in ("PRESS", "RELEASE"):
        view()[0].event_simulate(type=kind, value=value, x=400, y=300)
    yield 0.5


def picture_in_panel():
    """A place on the picture in the panel, from the lower left of the window."""
    sidebar = view()[3]
    return sidebar.x + sidebar.width // 2 - 15, sidebar.y + sidebar.height - 360


def chosen_by_its_picture():
    with in_view():
        bpy.ops.ed.undo_push(message="before")
    x, y = picture_in_panel()
    yield from click(x, y)
    yield 1.5
    # The third of the first row, which begins under the picture and reaches to its left.
    x, y = x - 345, y - 141
    move_to(x, y)
    yield 0.3
    move_to(x + 3, y)
    yield 2.0
    yield from photograph("presets-2-choice")
    yield from click(x, y)
    assert bpy.context.scene.rosy.preset_name == "cross-hatch", bpy.context.scene.rosy.preset_name
    assert bpy.context.scene.rosy.look.ink == "hatch"
    move_to(400, 300)
    yield from photograph("presets-3-chosen")
    with in_view():
        bpy.ops.ed.undo()
    yield 0.3
    assert bpy.context.scene.rosy.preset_name == "default"
    assert bpy.context.scene.rosy.look.ink == "soft"


def dialog_to_save():
    bpy.context.scene.rosy.look.length = 120
    move_to(400, 400)
    with in_view():
        bpy.ops.rosy.preset_save("INVOKE_DEFAULT")
    yield 1.0
    yield from photograph("presets-4-save")
    yield from press("ESC")
    with in_view():
        bpy.ops.rosy.preset_save(name="Mine", sentence="Long streaks, for tests of windows")
    yield 1.0
    with in_view():
        bpy.ops.rosy.preset_save("INVOKE_DEFAULT")
    yield 1.0
    yield from photograph("presets-5-replace")
    yield from press("ESC")
    with in_view():
        bpy.ops.wm.call_menu(name="VIEW3D_MT_rosy_presets")
    yield 1.0
    yield from photograph("presets-6-menu")
    yield from press("ESC")
    with in_view():
        bpy.ops.rosy.preset_remove("INVOKE_DEFAULT")
    yield 1.0
    yield from photograph("presets-7-delete")
    yield from press("ESC")


watch(panel_with_pictures, chosen_by_its_picture, dialog_to_save)
