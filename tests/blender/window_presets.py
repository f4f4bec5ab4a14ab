"""Presets in a window: their pictures in the panel and where one is chosen, and dialogs that ask.

Run by run.py as window.py is.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from watching import captured, in_view, rosy, view, watch

EXTENSION = "bl_ext.user_default.rosy"


def library():
    return rosy("rosy_addon.ui.preset_library")


def picture_in_panel():
    """A place on the picture in the panel, from the lower left of the window."""
    sidebar = view()[3]
    return sidebar.x + sidebar.width // 2 - 15, sidebar.y + sidebar.height - 360


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


def settled():
    """Wait until what was asked for is on the screen; pictures are read beside other work."""
    for _ in range(15):
        view()[1].tag_redraw()
        yield 0.1


def photograph(name):
    """Keep the screen as window-NAME.png; the sidebar's (h, w, 3) values from the bottom."""
    yield from settled()
    return captured(f"window-{name}", view()[3])


def seen_picture(sidebar):
    """(h, w) tones of the middle of the picture of the chosen preset."""
    x, y = picture_in_panel()
    left, low = x - view()[3].x - 50, y - view()[3].y - 50
    return sidebar[low : low + 100, left : left + 100].mean(axis=2)


def panel_with_pictures():
    bpy.ops.preferences.addon_disable(module=EXTENSION)
    rosy("rosy_addon.ui.look_panels").VIEW3D_PT_rosy_look.bl_options = set()
    bpy.ops.preferences.addon_enable(module=EXTENSION)
    yield from open_look()
    seen = seen_picture((yield from photograph("presets-1-panel")))
    assert seen.std() > 0.1 and 0.2 < seen.mean() < 0.6, (seen.std(), seen.mean())


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
    seen = seen_picture((yield from photograph("presets-3-chosen")))
    assert (seen > 0.95).mean() > 0.25 and (seen < 0.3).mean() > 0.1, "no ink on paper"
    with in_view():
        bpy.ops.ed.undo()
    yield 0.3
    assert bpy.context.scene.rosy.preset_name == "default"
    assert bpy.context.scene.rosy.look.ink == "soft"


def saved_by_a_dialog():
    settings = bpy.context.scene.rosy
    settings.look.length = 120
    move_to(400, 400)
    with in_view():
        bpy.ops.rosy.preset_save("INVOKE_DEFAULT", name="Mine", sentence="Long streaks")
    yield 1.0
    yield from photograph("presets-4-save")
    yield from press("RET")
    assert settings.preset == "mine" and library().user_preset_keys() == ["mine"]
    yield from photograph("presets-5-saved")
    assert not library().is_changed(settings)


def replaced_only_if_asked():
    """The dialog's button refuses, as long as its box is not ticked; then the picture is new."""
    settings = bpy.context.scene.rosy
    before = seen_picture((yield from photograph("presets-5-saved")))
    settings.look.ink = "hatch"
    with in_view():
        bpy.ops.rosy.preset_save("INVOKE_DEFAULT")
    yield 1.0
    yield from photograph("presets-6-replace")
    yield from press("RET")
    yield from press("ESC")  # what is said about it
    assert library().active_entry(settings).preset.look.ink == "soft" and library().is_changed(
        settings
    )
    yield 1.0  # Blender tells pictures of files apart by the second
    with in_view():
        bpy.ops.rosy.preset_save(name="Mine", sentence="Ink", replace=True)
    after = seen_picture((yield from photograph("presets-7-replaced")))
    assert after.mean() > before.mean() + 0.15, (after.mean(), before.mean())


def menu_and_a_file_that_cannot_be_read():
    folder = Path(bpy.utils.extension_path_user(EXTENSION, path="presets"))
    (folder / "broken.json").write_text("{")
    with in_view():
        bpy.ops.wm.call_menu(name="VIEW3D_MT_rosy_presets")
    yield 1.0
    yield from photograph("presets-8-menu")
    yield from press("ESC")
    (folder / "broken.json").unlink()


def deleted_only_if_confirmed():
    for key, left in (("ESC", ["mine"]), ("RET", [])):
        with in_view():
            bpy.ops.rosy.preset_remove("INVOKE_DEFAULT")
        yield 1.0
        yield from photograph(f"presets-9-delete-{key.lower()}")
        yield from press(key)
        assert library().user_preset_keys() == left, key
    yield from photograph("presets-10-deleted")


def pictures_go_with_the_extension():
    for _ in range(3):
        yield from settled()
        pictures = library()._LIBRARY.previews
        assert len(pictures) == len(library().entries())
        bpy.ops.preferences.addon_disable(module=EXTENSION)
        assert not len(pictures)
        yield 0.2
        bpy.ops.preferences.addon_enable(module=EXTENSION)
        yield from settled()
        view()[3].active_panel_category = "RoSy"


watch(
    panel_with_pictures,
    chosen_by_its_picture,
    saved_by_a_dialog,
    replaced_only_if_asked,
    menu_and_a_file_that_cannot_be_read,
    deleted_only_if_confirmed,
    pictures_go_with_the_extension,
)
