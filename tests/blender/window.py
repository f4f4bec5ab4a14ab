"""RoSy in a window: the panel in its three states, a bake that is watched, and bakes that are broken off.

Run by run.py as ``blender --enable-event-simulate -P window.py``. Every step is a generator that
yields while Blender is to go on with its own affairs (`watching`).
"""

from __future__ import annotations

import math
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from conftest import add_camera, contents
from watching import SHOTS, in_view, rosy, until, view, watch

# What the steps are made of


def fresh_scene(size=(320, 240)):
    """Suzanne before a camera, the sidebar open at RoSy's tab."""
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        modifier = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = 2
        bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.3, 0.2))
        camera = add_camera("Camera", (0.0, -4.5, 1.0), (math.radians(78), 0.0, 0.0))
        bpy.context.scene.camera = camera
        bpy.ops.object.select_all(action="DESELECT")
        monkey = bpy.data.objects["Suzanne"]
        monkey.select_set(True)
        bpy.context.view_layer.objects.active = monkey
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = size
    area = view()[1]
    area.spaces.active.show_region_ui = True
    area.spaces.active.shading.type = "SOLID"
    yield 0.5
    view()[3].active_panel_category = "RoSy"
    area.tag_redraw()
    yield 0.5
    view()[3].active_panel_category = "RoSy"
    area.tag_redraw()
    yield 0.3
    with in_view():
        bpy.ops.ed.undo_push(message="fresh scene")


def make_field():
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="curvature", degree=4)


def status():
    return rosy("rosy_addon.ui.job_status")


def bake_records():
    return rosy("rosy_addon.scene.bake_records")


def pixels(image):
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def start_bake(**settings):
    """Start a bake as its button does, and wait until it is on its way."""
    with in_view():
        assert bpy.ops.rosy.bake("INVOKE_DEFAULT", True, **settings) == {"RUNNING_MODAL"}
    yield from until(lambda: status().current is None or status().current.fraction > 0.1)
    assert status().current is not None, "the bake was over before it could be broken off"


def all_is_quiet():
    """No bake runs, and none of what one needs is left."""
    assert status().current is None
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        for handler in handlers if isinstance(handlers, list) else ():
            assert "rosy" not in getattr(handler, "__module__", ""), name


def broken_off(interrupt, *, unchanged=True, photographed=None):
    """Start a long bake, do `interrupt`, and see that it ends and leaves the scene as it was."""
    yield from fresh_scene(size=(1600, 1200))
    make_field()
    bpy.context.scene.rosy.look.method = "brute"
    before = contents()
    yield from start_bake()
    if photographed is not None:
        yield from photograph(photographed, 360)
        assert status().current is not None, "the bake was over before its picture was taken"
    interrupt()
    yield from until(lambda: status().current is None)
    yield 0.5
    all_is_quiet()
    if unchanged:
        assert contents() == before


def photograph(name, height=10_000):
    """Save the upper part of the sidebar as NAME.png, and the window as window-NAME.png."""
    window, area, _, sidebar = view()
    for _ in range(10):  # panels that were opened or have grown glide into place
        area.tag_redraw()
        yield 0.1
    # Blender's own screenshot is black on software OpenGL; the X server knows better.
    whole = SHOTS / f"window-{name}.png"
    subprocess.run(["import", "-window", "root", str(whole)], check=True, timeout=20)
    left, top = sidebar.x, window.height - sidebar.y - sidebar.height
    part = f"{sidebar.width}x{min(height, sidebar.height)}+{left}+{top}"
    path = SHOTS / f"{name}.png"
    subprocess.run(
        ["convert", str(whole), "-crop", part, "+repage", str(path)], check=True, timeout=20
    )
    assert path.stat().st_size > 1000


# The steps


def panel_without_field():
    yield from fresh_scene()
    yield from photograph("panel-1-no-field", 390)


def panel_with_field():
    yield from fresh_scene(size=(640, 480))
    make_field()
    yield from photograph("panel-2-field", 450)


def singularities_as_dots():
    """Dots of both signs while they are shown, and no handler when they are not."""
    overlay = rosy("rosy_addon.ui.overlay")
    yield from fresh_scene()
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
        bpy.ops.view3d.view_selected()
    assert not overlay.has_handlers()
    yield from photograph("panel-5-no-singularities")
    without = dots_in("panel-5-no-singularities")
    with in_view():
        assert bpy.ops.rosy.singularities(show="OVERLAY") == {"FINISHED"}
    yield from photograph("panel-6-singularities", 450)
    orange, blue = dots_in("panel-6-singularities") - without
    assert orange > 200 and blue > 200, (orange, blue)
    with in_view():
        bpy.ops.rosy.singularities(show="NONE")
    assert not overlay.has_handlers()
    yield from photograph("panel-7-hidden")
    assert np.abs(dots_in("panel-7-hidden") - without).max() < 100


def dots_in(name):
    """How many pixels of the 3D view, as it was photographed, are orange and blue as dots are."""
    whole = bpy.data.images.load(str(SHOTS / f"window-{name}.png"))
    seen = pixels(whole)
    bpy.data.images.remove(whole)
    region = view()[2]
    seen = seen[region.y : region.y + region.height, region.x : region.x + region.width // 2]
    red, green, blue = seen[..., 0], seen[..., 1], seen[..., 2]
    return np.array(
        [
            np.count_nonzero((red > 0.8) & (green < 0.5) & (blue < 0.25)),
            np.count_nonzero((blue > 0.8) & (red < 0.3) & (green < 0.5)),
        ]
    )


def bake_with_progress():
    yield from fresh_scene(size=(800, 600))
    make_field()
    bpy.context.scene.rosy.look.method = "brute"  # which takes long enough to be watched
    yield from start_bake()
    seen, longest, start = [], 0.0, time.monotonic()
    last = start
    while status().current is not None:
        seen.append(status().current.fraction)
        yield
        longest, last = max(longest, time.monotonic() - last), time.monotonic()
    assert len(set(seen)) >= 3, seen
    assert seen == sorted(seen), seen
    # On a busy machine all of it takes longer.
    allowed = max(2.0, 0.2 * (last - start))
    assert longest < allowed, f"Blender did not respond for {longest:.1f} s"
    all_is_quiet()
    assert [image for image in bpy.data.images if image.name.lower().startswith("rosy")]


def panel_with_picture():
    view()[1].spaces.active.shading.type = "MATERIAL"
    yield 3.0
    yield from photograph("panel-3-baked", 580)


def panel_out_of_date():
    scene = bpy.context.scene
    scene.camera.location.x += 0.5
    other = add_camera("Another Camera", (0.0, 5.0, 0.0), (math.pi / 2, 0.0, math.pi))
    yield 1.0
    assert [bake.stale_reason for bake in bake_records().list_bakes(scene)] == [
        "camera 'Camera' was changed"
    ]
    scene.camera = other
    with in_view():
        bpy.ops.rosy.bake("EXEC_DEFAULT", True)
    scene.view_settings.view_transform = "Standard"
    view()[1].spaces.active.shading.type = "SOLID"
    yield from photograph("panel-4-out-of-date")


def eevee_shows_the_picture():
    """Rendered by EEVEE, which needs a window on most machines, the picture is what was drawn."""
    yield from fresh_scene(size=(200, 150))
    make_field()
    scene = bpy.context.scene
    scene.rosy.look.shading = 0.0
    scene.view_settings.view_transform = "Standard"
    with in_view():
        bpy.ops.rosy.bake("EXEC_DEFAULT", True)
    engines = scene.render.bl_rna.properties["engine"].enum_items_static.keys()
    scene.render.engine = next(name for name in engines if name.startswith("BLENDER_EEVEE"))
    scene.render.film_transparent, scene.render.filter_size = True, 0.0
    scene.eevee.taa_render_samples = 1
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(SHOTS / "eevee.png")
    bpy.ops.render.render(write_still=True)
    seen = pixels(bpy.data.images.load(scene.render.filepath))
    picture = pixels(scene.rosy.bakes[0].image)
    inside = (seen[..., 3] > 0.99) & (picture[..., 3] > 0.99)
    assert inside.mean() > 0.05
    difference = np.abs(seen - picture)[..., :3][inside].mean()
    assert difference < 0.02, difference


def undo_after_bake():
    yield from fresh_scene(size=(64, 48))
    make_field()
    before = contents()
    with in_view():
        bpy.ops.rosy.bake("INVOKE_DEFAULT", True)
    yield from until(lambda: status().current is None)
    yield 0.3
    after = contents()
    assert after != before
    with in_view():
        bpy.ops.ed.undo()
    yield 0.3
    assert contents() == before
    with in_view():
        bpy.ops.ed.redo()
    yield 0.3
    assert contents() == after


def press_escape():
    window, _, region, _ = view()
    x, y = region.x + region.width // 2, region.y + region.height // 2
    window.event_simulate(type="ESC", value="PRESS", x=x, y=y)
    window.event_simulate(type="ESC", value="RELEASE", x=x, y=y)


def stop_with_escape():
    yield from broken_off(press_escape, photographed="baking")


def turntable(path, pictures):
    """Start a turntable, as its file browser does once a file is chosen."""
    with in_view():
        started = bpy.ops.rosy.turntable(
            "INVOKE_DEFAULT", True, skip_browser=True, filepath=str(path), film=".gif",
            pictures=pictures, width=160, height=120,
        )  # fmt: skip
    assert started == {"RUNNING_MODAL"}
    yield from until(lambda: status().current is None or status().current.fraction > 0.01)
    assert status().current is not None, "it was over before it could be watched"


def turntable_with_progress():
    yield from fresh_scene()
    make_field()
    path = SHOTS / "turntable.gif"
    path.unlink(missing_ok=True)
    yield from turntable(path, 8)
    seen = []
    while status().current is not None:
        seen.append(status().current.fraction)
        yield
    assert len(set(seen)) >= 3 and seen == sorted(seen), seen
    all_is_quiet()
    assert path.stat().st_size > 500


def turntable_stopped_with_escape():
    yield from fresh_scene()
    make_field()
    path = SHOTS / "stopped.gif"
    yield from turntable(path, 60)
    press_escape()
    yield from until(lambda: status().current is None)
    yield 0.5
    all_is_quiet()
    assert not path.exists()


def turntable_from_its_file_browser():
    """The file browser is opened, and once it is confirmed the work goes on as a modal job."""
    yield from fresh_scene()
    make_field()
    path = SHOTS / "browser.gif"
    path.unlink(missing_ok=True)
    with in_view():
        settings = {
            "filepath": str(path),
            "film": ".gif",
            "pictures": 8,
            "width": 160,
            "height": 120,
        }
        started = bpy.ops.rosy.turntable("INVOKE_DEFAULT", True, **settings)
    assert started == {"RUNNING_MODAL"} and status().current is None
    yield 1.0
    browser = bpy.context.window_manager.windows[-1]
    x, y = browser.width // 2, browser.height // 2
    browser.event_simulate(type="RET", value="PRESS", x=x, y=y)
    browser.event_simulate(type="RET", value="RELEASE", x=x, y=y)
    yield from until(lambda: status().current is not None)
    yield from until(lambda: status().current is None)
    yield 0.5
    all_is_quiet()
    assert path.stat().st_size > 500


def stop_when_an_object_is_deleted():
    def delete():
        with in_view():
            bpy.ops.object.delete()

    yield from broken_off(delete, unchanged=False)
    assert not [thing for thing in bpy.data.materials if "rosy" in thing.name.lower()]


def stop_on_undo():
    def undo():
        with in_view():
            bpy.ops.ed.undo()

    yield from broken_off(undo, unchanged=False)
    assert "rosy" not in bpy.data.objects["Suzanne"].data.attributes


def stop_on_a_change_of_scene():
    def change():
        with in_view():
            bpy.ops.scene.new(type="EMPTY")

    yield from broken_off(change, unchanged=False)
    assert not [thing for thing in bpy.data.materials if "rosy" in thing.name.lower()]


def stop_when_switched_off():
    def switch_off():
        module = "bl_ext.user_default.rosy"
        bpy.ops.preferences.addon_disable(module=module)
        bpy.ops.preferences.addon_enable(module=module)

    yield from broken_off(switch_off)


def stop_when_a_file_is_opened():
    def open_file():
        bpy.ops.wm.read_homefile(use_empty=True)

    yield from broken_off(open_file, unchanged=False)


def bake_the_current_view():
    yield from fresh_scene()
    make_field()
    with in_view():
        bpy.ops.rosy.bake("EXEC_DEFAULT", True, camera="VIEW")
    (image,) = [image for image in bpy.data.images if image.name.lower().startswith("rosy")]
    assert tuple(image.size) == (view()[2].width, view()[2].height)


watch(
    panel_without_field,
    panel_with_field,
    singularities_as_dots,
    bake_with_progress,
    panel_with_picture,
    panel_out_of_date,
    eevee_shows_the_picture,
    undo_after_bake,
    stop_with_escape,
    turntable_with_progress,
    turntable_stopped_with_escape,
    turntable_from_its_file_browser,
    stop_when_an_object_is_deleted,
    stop_on_undo,
    stop_on_a_change_of_scene,
    stop_when_switched_off,
    stop_when_a_file_is_opened,
    bake_the_current_view,
)
