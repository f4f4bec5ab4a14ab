"""Screenshots for docs/listing, of a large window: a live field, and its picture.

Run by run.py, only where it is asked for: ``--only-window --windows listing --shots FOLDER``.
"""

import bpy
from conftest import add_suzanne
from extension import preferences, rosy
from window_steps import (
    SHOTS,
    call_in_view,
    capture,
    in_view,
    open_tab,
    save_part,
    turn_view,
    view,
    wait_until,
)

#: Size of the pictures. The view is a little larger.
SIZE = 1920, 1080

#: Seconds to wait for a picture: software draws the large view.
PATIENCE = 360

#: Scale of the interface, so that it can be read when the screenshot is small.
SCALE = 1.5

#: Direction of the view as Euler angles, its distance, and its displacement to the left of the sidebar.
VIEW, DISTANCE, SIDEBAR = (1.36, 0.0, 0.42), 4.6, 0.55


def save_view(name):
    """Save the 3D view as NAME.png. The bar above it shows Blender's logo, which pages must not."""
    yield 1.5
    _, area, region, _ = view()
    assert area.width >= SIZE[0] and area.height >= SIZE[1], (area.width, area.height)
    capture(f"screen-{name}", region)
    bottom = area.y + area.height - SIZE[1]
    save_part(f"screen-{name}", name, area.x, bottom, *SIZE)
    (SHOTS / f"screen-{name}.png").unlink()


def test_live():
    """Suzanne with a live field."""
    preferences().live_first_field = True
    bpy.context.preferences.view.ui_scale = SCALE
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    call_in_view(bpy.ops.screen.screen_full_area)
    yield 1.0
    with in_view():
        add_suzanne(3)
        bpy.ops.object.shade_smooth()
    yield from open_tab()
    call_in_view(bpy.ops.rosy.field_generate, "EXEC_DEFAULT", True, kind="form", degree=4)
    turn_view(VIEW, DISTANCE, SIDEBAR)
    session = rosy("rosy_addon.viewport.session")
    yield 2.0
    yield from wait_until(lambda: not session.messages(view()[1]), PATIENCE)
    yield 4.0
    yield from save_view("window-live")


def test_baked():
    """The same mesh with a picture in ink, on its paper."""
    call_in_view(bpy.ops.rosy.preset_apply, preset="engraving")
    scene = bpy.context.scene
    scene.rosy.camera = "VIEW"
    scene.view_settings.view_transform = "Standard"
    call_in_view(bpy.ops.rosy.bake, "INVOKE_DEFAULT")
    yield from wait_until(lambda: len(scene.rosy.bakes), PATIENCE)
    call_in_view(bpy.ops.rosy.show_here)
    yield 10.0
    yield from save_view("window-baked")
