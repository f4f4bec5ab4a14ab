"""The five steps of the README in a window, done with the mouse: on the default cube and on Suzanne.

Run by run.py, as window_panel.py is, but with real events: xdotool moves the mouse. With its option --many,
a picture of the 3D view is saved after each step. Those of the cube, and the last one of Suzanne, are in
docs/images, and so is that of a live view.
"""

import subprocess

import bpy
import window_steps
from conftest import add_suzanne
from extension import preferences, rosy
from live_views import is_live
from window_steps import MANY, capture, in_view, save_part, view, wait_until

#: Distances from the top of the 3D view to buttons of the panel, in pixels. They differ between
#: versions of Blender by less than half the height of a button.
MAKE_FIELD = 205
BAKE = 380
SHOW_HERE = 562
STANDARD = 546
REMOVE = 489

#: Steps of the wheel that enlarge what the camera sees.
ZOOM_STEPS = 2

#: Distance to the camera among the buttons in the view, from its top and from the sidebar.
CAMERA_BUTTON = 228, 33


def xdotool(*command):
    command = ["xdotool", *map(str, command)]
    return subprocess.run(command, check=True, timeout=20, capture_output=True, text=True).stdout


def move(x, y):
    """Move the mouse to a point in pixels from the upper left of the screen."""
    xdotool("mousemove", x, y)
    yield 0.4


def click(x, y):
    yield from move(x, y)
    xdotool("mousedown", 1)
    yield 0.15
    xdotool("mouseup", 1)
    yield 0.6


def press(key):
    xdotool("key", key)
    yield 0.6


def view_corner():
    """Return the upper left of the 3D view, in pixels from the upper left of the screen."""
    _, area, _, _ = view()
    # The window is in the lower left corner of the screen.
    height = int(xdotool("getdisplaygeometry").split()[1])
    return area.x, height - area.y - area.height


def move_into_view():
    left, top = view_corner()
    yield from move(left + 200, top + 400)


def click_in_panel(distance):
    """Click a button of the panel by its distance from the top of the 3D view. Leave the panel."""
    sidebar = view()[3]
    yield from click(sidebar.x + sidebar.width // 2, view_corner()[1] + distance)
    yield from move_into_view()


def save_picture(name):
    """Save the 3D view as NAME.png, for the documentation."""
    if not MANY:
        return
    yield 1.0
    _, area, region, _ = view()
    capture(f"window-{name}", region)
    save_part(f"window-{name}", name, area.x, area.y, area.width, area.height)


def wait_for_live_view():
    """Wait until the live view has drawn the field and says nothing more."""
    session = rosy("rosy_addon.viewport.session")
    assert is_live()
    yield 1.0
    yield from wait_until(lambda: not session.messages(view()[1]))
    yield 3.0 if MANY else 0.5


def open_tab(name):
    """Do the first step: open the tab of RoSy in the sidebar, below the tabs of Blender."""
    sidebar = view()[3]
    if sidebar.width <= 1:
        yield from move_into_view()
        yield from press("n")
    sidebar, top = view()[3], view_corner()[1]
    for distance in range(150, 350, 25):
        if sidebar.active_panel_category == "RoSy":
            break
        yield from click(sidebar.x + sidebar.width - 12, top + distance)
    assert sidebar.active_panel_category == "RoSy"
    yield from move_into_view()
    yield 1.5  # panels that open are animated
    yield from save_picture(f"{name}-1-tab")


def follow_steps(name):
    """Do the steps, with the first field of the scene live."""
    preferences().live_first_field = True
    yield from open_tab(name)

    yield from click_in_panel(MAKE_FIELD)
    yield from wait_until(lambda: "rosy" in bpy.context.object.data.attributes)
    yield from wait_for_live_view()
    yield from save_picture(f"{name}-2-field")

    distance, gap = CAMERA_BUTTON
    yield from click(view()[3].x - gap, view_corner()[1] + distance)
    yield from move_into_view()
    for _ in range(ZOOM_STEPS):
        xdotool("click", 4)  # the wheel
        yield 0.3
    yield from wait_for_live_view()
    assert view()[1].spaces.active.region_3d.view_perspective == "CAMERA"
    yield from save_picture(f"{name}-3-camera")

    yield from click_in_panel(BAKE)
    yield from wait_until(lambda: len(bpy.context.scene.rosy.bakes))
    yield from save_picture(f"{name}-4-baked")

    yield from click_in_panel(SHOW_HERE)
    assert not is_live() and view()[1].spaces.active.shading.type == "MATERIAL"
    yield from click_in_panel(STANDARD)
    assert bpy.context.scene.view_settings.view_transform == "Standard"
    yield 8.0 if MANY else 0.5  # for the shaders of the view
    yield from save_picture(f"{name}-5-shown")

    yield from click_in_panel(REMOVE)
    yield from wait_until(lambda: not bpy.context.scene.rosy.bakes)
    assert not bpy.context.object.modifiers


def test_default_cube():
    yield from follow_steps("first-bake")


def suzanne():
    """The same steps after the cube is replaced with Suzanne, in a new file."""
    bpy.ops.wm.read_homefile(use_factory_startup=False)
    yield 1.0
    yield from move_into_view()
    yield from press("Delete")
    assert not [obj for obj in bpy.data.objects if obj.type == "MESH"]
    yield from press("shift+a")
    for letter in "monkey":
        xdotool("key", letter)
    yield 1.0
    yield from press("Return")
    assert bpy.context.object.name == "Suzanne"
    yield from follow_steps("first-bake-suzanne")


def live_suzanne():
    """A subdivided Suzanne with a live field, for the documentation of live views."""
    preferences().live_first_field = True
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 1.0
    yield from window_steps.open_tab()
    with in_view():
        add_suzanne(2)
        bpy.ops.object.shade_smooth()
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
        bpy.ops.object.select_all(action="DESELECT")
    # The sidebar covers the right third of the view.
    window_steps.turn_view((1.3, 0.0, 0.4), 4.3, 0.75)
    yield from wait_for_live_view()
    yield from save_picture("live")


if MANY:
    test_suzanne, test_live_suzanne = suzanne, live_suzanne
