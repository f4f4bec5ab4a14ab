"""RoSy in a window: the panel in its states, jobs with progress, and jobs that are interrupted.

Run by run.py as ``blender --enable-event-simulate -P window_panel.py``. Every step is a generator
that yields to let Blender handle its events (`window_steps`).
"""

from __future__ import annotations

import math
import subprocess
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).parent))
from conftest import add_camera, contents
from window_steps import (
    MANY,
    SHOTS,
    descendants,
    in_view,
    is_running,
    preferences,
    redraw_view,
    rosy,
    run_steps,
    view,
    wait_until,
)

# Helpers of the steps


def fresh_scene(size=(320, 240)):
    """Create a scene with Suzanne and a camera, and open RoSy's tab of the sidebar."""
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


def start_job(operator, **settings):
    """Start a job as its button does, and wait until it has made progress."""
    with in_view():
        assert operator("INVOKE_DEFAULT", True, **settings) == {"RUNNING_MODAL"}
    yield from wait_until(lambda: status().current is None or status().current.fraction > 0.1)
    assert status().current is not None, "the job ended before it could be interrupted"


def start_bake(**settings):
    yield from start_job(bpy.ops.rosy.bake, **settings)


#: Modules with handlers for longer than a job: they remember live views, and note what makes pictures out
#: of date.
LASTING_HANDLERS = (".ui.live_views", ".scene.staleness")


def check_idle():
    """Check that no job runs, and that no handler is left but those of live views and panels."""
    assert status().current is None
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        for handler in handlers if isinstance(handlers, list) else ():
            module = getattr(handler, "__module__", "")
            assert "rosy" not in module or module.endswith(LASTING_HANDLERS), name


def check_interruption(interrupt, start=start_bake, *, unchanged=True, screenshot=None):
    """Start a long job, call `interrupt`, and check that it ends and changes nothing."""
    yield from fresh_scene(size=(1600, 1200))
    make_field()
    bpy.context.scene.rosy.look.method = "brute"
    before = contents()
    yield from start()
    if screenshot is not None:
        yield from save_screenshot(screenshot, 360)
        assert status().current is not None, "the job ended before the screenshot"
    interrupt()
    yield from wait_until(lambda: status().current is None)
    yield 0.5
    check_idle()
    if unchanged:
        assert contents() == before


def save_screenshot(name, height=10_000):
    """Save the upper part of the sidebar as NAME.png, and the window as window-NAME.png."""
    _, area, _, sidebar = view()
    for _ in range(10):  # panels that have opened or grown are animated
        area.tag_redraw()
        yield 0.1
    # From the X server: Blender's own screenshot is black on software OpenGL.
    window_path = SHOTS / f"window-{name}.png"
    subprocess.run(["import", "-window", "root", str(window_path)], check=True, timeout=20)
    # The window is in the lower left corner of the screen.
    height = min(height, sidebar.height)
    bottom = sidebar.y + sidebar.height - height
    crop = f"{sidebar.width}x{height}+{sidebar.x}+{bottom}"
    path = SHOTS / f"{name}.png"
    command = ["convert", str(window_path), "-gravity", "SouthWest", "-crop", crop, "+repage"]
    subprocess.run([*command, str(path)], check=True, timeout=20)
    assert path.stat().st_size > 1000


# The steps


def panel_without_field():
    yield from fresh_scene()
    yield from save_screenshot("panel-1-no-field")


def panel_with_field():
    yield from fresh_scene(size=(640, 480))
    make_field()
    yield from save_screenshot("panel-2-field")


def singularities_as_dots():
    """Dots of both signs are drawn while they are shown; otherwise there is no handler."""
    overlay = rosy("rosy_addon.ui.overlay")
    yield from fresh_scene()
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
        bpy.ops.view3d.view_selected()
    assert not overlay.DRAW_HANDLERS
    yield from save_screenshot("panel-5-no-singularities")
    without = count_dots("panel-5-no-singularities")
    with in_view():
        assert bpy.ops.rosy.singularities(show="OVERLAY") == {"FINISHED"}
    yield from save_screenshot("panel-6-singularities", 450)
    orange, blue = count_dots("panel-6-singularities") - without
    assert orange > 200 and blue > 200, (orange, blue)
    with in_view():
        bpy.ops.rosy.singularities(show="NONE")
    assert not overlay.DRAW_HANDLERS
    yield from save_screenshot("panel-7-hidden")
    assert np.abs(count_dots("panel-7-hidden") - without).max() < 100


def no_singularities_to_show():
    """The overlay of a field without singularities draws nothing, and prints no error."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.mesh.primitive_plane_add()
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=4, axis=(1, 0, 0))
        assert bpy.ops.rosy.singularities(show="OVERLAY") == {"FINISHED"}
    overlay = rosy("rosy_addon.ui.overlay")
    shown = overlay.is_shown(bpy.context.object.name)
    yield from save_screenshot("panel-8-none")
    assert shown


def count_dots(name):
    """Return how many pixels of the 3D view in a screenshot are orange and blue like dots."""
    image = bpy.data.images.load(str(SHOTS / f"window-{name}.png"))
    screen = pixels(image)
    bpy.data.images.remove(image)
    region = view()[2]
    screen = screen[region.y : region.y + region.height, region.x : region.x + region.width // 2]
    red, green, blue = screen[..., 0], screen[..., 1], screen[..., 2]
    return np.array(
        [
            np.count_nonzero((red > 0.8) & (green < 0.5) & (blue < 0.25)),
            np.count_nonzero((blue > 0.8) & (red < 0.3) & (green < 0.5)),
        ]
    )


def bake_with_progress():
    yield from fresh_scene(size=(800, 600))
    make_field()
    bpy.context.scene.rosy.look.method = "brute"  # slow enough to observe the progress
    yield from start_bake()
    fractions, longest_pause, start = [], 0.0, time.monotonic()
    last_time = start
    while status().current is not None:
        fractions.append(status().current.fraction)
        yield
        longest_pause, last_time = (
            max(longest_pause, time.monotonic() - last_time),
            time.monotonic(),
        )
    assert len(set(fractions)) >= 3, fractions
    assert fractions == sorted(fractions), fractions
    # On a busy machine everything takes longer.
    limit = max(2.0, 0.2 * (last_time - start))
    assert longest_pause < limit, f"Blender did not respond for {longest_pause:.1f} s"
    check_idle()
    assert [image for image in bpy.data.images if image.name.lower().startswith("rosy")]


def panel_with_picture():
    view()[1].spaces.active.shading.type = "MATERIAL"
    yield 3.0
    yield from save_screenshot("panel-3-baked")


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
    yield from save_screenshot("panel-4-out-of-date")


def eevee_shows_the_picture():
    """A render by EEVEE, which needs a window on most machines, shows the picture."""
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
    rendered = pixels(bpy.data.images.load(scene.render.filepath))
    picture = pixels(scene.rosy.bakes[0].image)
    inside = (rendered[..., 3] > 0.99) & (picture[..., 3] > 0.99)
    assert inside.mean() > 0.05
    difference = np.abs(rendered - picture)[..., :3][inside].mean()
    assert difference < 0.02, difference


def undo_after_bake():
    yield from fresh_scene(size=(64, 48))
    make_field()
    before = contents()
    with in_view():
        bpy.ops.rosy.bake("INVOKE_DEFAULT", True)
    yield from wait_until(lambda: status().current is None)
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
    yield from check_interruption(press_escape, screenshot="baking")


def start_texture():
    bpy.context.scene.rosy.texture_size = 2048
    yield from start_job(bpy.ops.rosy.bake_texture)


def texture_stopped_with_escape():
    yield from check_interruption(press_escape, start_texture)


def texture_with_progress():
    """The view shows the texture with its light, also from a side that no camera sees."""
    yield from fresh_scene()
    make_field()
    bpy.context.scene.rosy.texture_size = 512
    yield from start_job(bpy.ops.rosy.bake_texture)
    yield from wait_until(lambda: status().current is None, 60.0)
    check_idle()
    (bake,) = bake_records().list_bakes(bpy.context.scene)
    assert bake.is_texture and bake.is_shown and not bake.stale_reason
    view()[1].spaces.active.shading.type = "MATERIAL"
    yield 3.0
    yield from save_screenshot("panel-7-texture")


def large_picture_stopped_with_escape():
    """The processes that draw a large picture together end, but for the helper of the next job."""
    drawing = []

    def start():
        scene = bpy.context.scene
        scene.rosy.look.method = "sheets"
        scene.rosy.look.supersampling = 2
        scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
        preferences().workers = 2
        yield from start_bake()
        drawing.extend(descendants())

    try:
        yield from check_interruption(press_escape, start)
    finally:
        preferences().workers = 0
    assert len(drawing) >= 2
    yield from wait_until(lambda: not any(map(is_running, drawing)), 5.0)


def strokes_stopped_with_escape():
    def start():
        yield from start_job(bpy.ops.rosy.strokes, kind="PENCIL")

    yield from check_interruption(press_escape, start)


def field_stopped_with_escape():
    before = {}

    def start():
        with in_view():
            bpy.context.object.modifiers["Subdivision"].levels = 4
            bpy.ops.object.modifier_apply(modifier="Subdivision")
            bpy.ops.ed.undo_push(message="subdivided")
        before.update(contents())
        yield from start_job(bpy.ops.rosy.field_generate, kind="smoothest", degree=6)

    yield from check_interruption(press_escape, start, unchanged=False)
    assert contents() == before and bpy.context.object.data.rosy.degree == 4


def start_exchange(operator, path):
    """Return a function that starts the import or the export of a field with many faces."""

    def start():
        with in_view():
            bpy.context.object.modifiers["Subdivision"].levels = 4
            bpy.ops.object.modifier_apply(modifier="Subdivision")
            if operator.idname_py() == "rosy.field_import":
                bpy.ops.rosy.field_export("EXEC_DEFAULT", filepath=str(path))
                mesh = bpy.context.object.data
                mesh.attributes.remove(mesh.attributes["rosy"])
            bpy.ops.ed.undo_push(message="subdivided")
        yield from start_job(operator, filepath=str(path), skip_browser=True)

    return start


def import_stopped_with_escape():
    start = start_exchange(bpy.ops.rosy.field_import, SHOTS / "import.txt")
    yield from check_interruption(press_escape, start, unchanged=False)
    assert "rosy" not in bpy.context.object.data.attributes


def export_stopped_with_escape():
    path = SHOTS / "export.txt"
    path.write_bytes(b"old")
    before = sorted(SHOTS.iterdir())
    start = start_exchange(bpy.ops.rosy.field_export, path)
    yield from check_interruption(press_escape, start, unchanged=False)
    assert path.read_bytes() == b"old" and sorted(SHOTS.iterdir()) == before


def export_and_import_from_the_file_browser():
    """The file browser opens; after its confirmation the operators run as modal jobs."""
    yield from fresh_scene()
    make_field()
    path = SHOTS / "browser.rosy"
    path.unlink(missing_ok=True)
    attributes = bpy.context.object.data.attributes
    for operator, is_done in (
        (bpy.ops.rosy.field_export, path.is_file),
        (bpy.ops.rosy.field_import, lambda: "rosy" in attributes),
    ):
        with in_view():
            assert operator("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
        yield 1.0
        params = browser_params()
        params.directory, params.filename = str(SHOTS).encode(), path.name
        if operator.idname_py() == "rosy.field_import":
            attributes.remove(attributes["rosy"])
        yield 0.5
        press_return()
        yield from wait_until(lambda is_done=is_done: is_done() and status().current is None)
        yield 0.2
        check_idle()


def start_turntable(name, pictures, size=(160, 120)):
    """Start a turntable in a fresh scene, as after the choice of a file. Return its path."""
    yield from fresh_scene()
    make_field()
    path = SHOTS / name
    path.unlink(missing_ok=True)
    with in_view():
        started = bpy.ops.rosy.turntable(
            "INVOKE_DEFAULT", True, skip_browser=True, filepath=str(path), film=path.suffix,
            pictures=pictures, width=size[0], height=size[1],
        )  # fmt: skip
    assert started == {"RUNNING_MODAL"}
    yield from wait_until(lambda: status().current is None or status().current.fraction > 0.01)
    assert status().current is not None, "the turntable ended before its progress could be observed"
    return path


def turntable_with_progress():
    path = yield from start_turntable("turntable.gif", 8)
    fractions = []
    while status().current is not None:
        fractions.append(status().current.fraction)
        yield
    assert len(set(fractions)) >= 3 and fractions == sorted(fractions), fractions
    check_idle()
    assert path.stat().st_size > 500


def turntable_stopped_with_escape():
    path = yield from start_turntable("stopped.gif", 20, (1920, 1080))
    start = time.monotonic()
    press_escape()
    yield from wait_until(lambda: status().current is None)
    seconds = time.monotonic() - start
    print(f"stopped a turntable of 1920 x 1080 pixels in {seconds:.2f} s")
    assert seconds < 3.0  # a step takes up to half a second on an idle machine
    yield 0.5
    check_idle()
    assert not path.exists()


def turntable_encoded_by_another_blender():
    """Another Blender encodes an .mp4, and this one handles its events."""
    path = yield from start_turntable("encoded.mp4", 3)
    ticks = 0
    while status().current is not None:
        ticks += status().current.label == "encoding the video"
        yield
    check_idle()
    assert ticks > 3 and path.stat().st_size > 500


def turntable_from_its_file_browser():
    """The file browser opens; after its confirmation the turntable runs as a modal job."""
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
    yield from wait_until(lambda: status().current is not None)
    yield from wait_until(lambda: status().current is None)
    yield 0.5
    check_idle()
    assert path.stat().st_size > 500


def press_return():
    """Press Return in the file browser or the dialog that has opened last."""
    window = bpy.context.window_manager.windows[-1]
    x, y = window.width // 2, window.height // 2
    window.event_simulate(type="RET", value="PRESS", x=x, y=y)
    window.event_simulate(type="RET", value="RELEASE", x=x, y=y)


def browser_params():
    """Return the settings of the open file browser."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "FILE_BROWSER":
                return area.spaces.active.params
    raise AssertionError("there is no file browser")


def strokes_from_their_file_browser():
    """Draw Strokes asks for the name of an .svg file, and remembers it."""
    yield from fresh_scene()
    make_field()
    path = SHOTS / "strokes.svg"
    path.unlink(missing_ok=True)
    settings = bpy.context.scene.rosy.strokes
    settings.kind, settings.spacing = "FILE", 30.0
    with in_view():
        assert bpy.ops.rosy.strokes("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield 1.0
    params = browser_params()
    assert params.filename == "strokes.svg"
    params.directory = str(SHOTS).encode()
    yield 0.5
    press_return()
    yield from wait_until(lambda: path.is_file() and status().current is None)
    check_idle()
    assert path.read_text().startswith("<?xml")
    assert bpy.context.scene.rosy.strokes.filepath == str(path)


def animation_asks_for_a_folder():
    """In a file that was never saved, Animation opens a file browser for the folder."""
    yield from fresh_scene(size=(64, 48))
    make_field()
    folder = SHOTS / "frames"
    folder.mkdir(exist_ok=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 3, 4
    with in_view():
        assert bpy.ops.rosy.bake_animation("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield 1.0
    browser_params().directory = str(folder).encode()
    yield 0.5
    press_return()
    yield from wait_until(lambda: scene.rosy.bakes and status().current is None)
    check_idle()
    assert len(list(folder.glob("*.png"))) == 2
    assert Path(scene.rosy.directory) == folder


def edited_strokes_are_replaced_on_request():
    """Draw Strokes asks first; without an edit it does not."""
    yield from fresh_scene()
    make_field()
    bpy.context.scene.rosy.strokes.spacing = 30.0

    def draw():
        with in_view():
            bpy.ops.rosy.strokes("INVOKE_DEFAULT", True)

    draw()
    yield from wait_until(lambda: bpy.context.scene.rosy.strokes.made and status().current is None)
    obj = bpy.context.scene.rosy.strokes.made[0].thing
    assert bpy.data.objects["Suzanne"].users_collection == obj.users_collection
    first = obj.data
    draw()
    yield from wait_until(lambda: obj.data != first and status().current is None)
    edited = obj.data
    drawings = [layer.frames[0].drawing for layer in edited.layers]
    drawing = next(drawing for drawing in drawings if len(drawing.strokes))
    drawing.attributes["position"].data[0].vector.x += 1
    draw()
    yield 0.5
    assert obj.data == edited and status().current is None
    yield from save_screenshot("edited-strokes")
    press_return()
    yield from wait_until(lambda: obj.data != edited and status().current is None)
    check_idle()


def annotations_guide_a_field():
    """A stroke of the Annotate tool across the middle of a sphere, drawn on its surface."""
    yield from fresh_scene()
    scene = bpy.context.scene
    with in_view():
        bpy.ops.object.delete()
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(0.5, 0.0, 0.0))
        bpy.ops.view3d.view_axis(type="FRONT")
    view()[1].spaces.active.region_3d.view_distance = 5.0
    view()[1].spaces.active.region_3d.view_perspective = "ORTHO"
    yield 0.5
    scene.tool_settings.annotation_stroke_placement_view3d = "SURFACE"
    region = view()[2]
    region_3d = view()[1].spaces.active.region_3d
    ends = np.linspace((0.0, -1.0, -0.5), (1.0, -1.0, 0.5), 30)
    points = [
        {
            "name": "",
            "location": (0.0, 0.0, 0.0),
            "mouse": location_3d_to_region_2d(region, region_3d, point),
            "mouse_event": (0.0, 0.0),
            "pressure": 1.0,
            "size": 1.0,
            "pen_flip": False,
            "x_tilt": 0.0,
            "y_tilt": 0.0,
            "time": 0.1 * index,
            "is_start": index == 0,
        }
        for index, point in enumerate(ends)
    ]
    # Blender asks for all properties of its version, and for no others.
    names = bpy.types.OperatorStrokeElement.bl_rna.properties.keys()
    stroke = [{name: point[name] for name in point if name in names} for point in points]
    with in_view():
        bpy.ops.gpencil.annotate("EXEC_DEFAULT", mode="DRAW", stroke=stroke, wait_for_input=False)
        bpy.ops.rosy.field_generate(
            "EXEC_DEFAULT", True, kind="guided", degree=2, guides={"ANNOTATIONS"}
        )
    yield from save_screenshot("annotations")
    mesh = bpy.context.object.data
    vectors = np.empty(3 * len(mesh.polygons), dtype=np.float32)
    mesh.attributes["rosy"].data.foreach_get("vector", vectors)
    center = np.array([face.center for face in mesh.polygons])
    x, y, z = center.T
    near = (np.abs(x - z) < 0.05) & (np.abs(x) < 0.4) & (y < 0.0)
    assert near.sum() > 5
    direction = vectors.reshape(-1, 3)[near]
    angle = np.degrees(np.arctan2(direction[:, 2], direction[:, 0])) % 180.0
    assert np.abs(angle - 45.0).max() < 5.0, angle


def stop_when_an_object_is_deleted():
    def delete():
        with in_view():
            bpy.ops.object.delete()

    yield from check_interruption(delete, unchanged=False)
    assert not [material for material in bpy.data.materials if "rosy" in material.name.lower()]


def stop_on_undo():
    def undo():
        with in_view():
            bpy.ops.ed.undo()

    yield from check_interruption(undo, unchanged=False)
    assert "rosy" not in bpy.data.objects["Suzanne"].data.attributes


def stop_on_a_change_of_scene():
    def change():
        with in_view():
            bpy.ops.scene.new(type="EMPTY")

    yield from check_interruption(change, unchanged=False)
    assert not [material for material in bpy.data.materials if "rosy" in material.name.lower()]


def stop_when_switched_off():
    def switch_off():
        module = "bl_ext.user_default.rosy"
        bpy.ops.preferences.addon_disable(module=module)
        bpy.ops.preferences.addon_enable(module=module)

    yield from check_interruption(switch_off)


def stop_when_a_file_is_opened():
    def open_file():
        bpy.ops.wm.read_homefile(use_empty=True)

    yield from check_interruption(open_file, unchanged=False)


def singularities_dragged_with_the_tool():
    """Move one, undo that, and drag a new pair apart with Ctrl."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
        # Four singularities are around the middle of the view. The smoothest field has them anywhere, as
        # Blender orders the faces differently each time: also below the sidebar or the navigation gizmo.
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=4, axis=(0, 1, 0))
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_selected()
        bpy.ops.wm.tool_set_by_id(name="rosy.singularities_tool")
        tool = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT")
        tool.operator_properties("rosy.drag_singularity").reach = 0.3
    overlay = rosy("rosy_addon.ui.overlay")
    yield from redraw_view()
    yield from move_mouse((0.0, -1.0, 0.0))
    yield from wait_until(lambda: overlay.shown("Sphere") is not None)
    before = shown_singularities()
    points = {vertex: bpy.context.object.data.vertices[vertex].co.copy() for vertex in before}
    source = min(points, key=lambda vertex: (points[vertex] - Vector((0.2, -1.0, 0.0))).length)
    start = points[source]
    assert 0.1 < start.x < 0.2 and start.y < -0.9, start
    yield from drag(start, (0.1, -0.9, 0.3))
    yield from wait_until(lambda: shown_singularities() != before)
    moved = shown_singularities()
    assert math.isclose(bpy.context.window_manager.operators[-1].reach, 0.3, rel_tol=1e-6)
    assert source not in moved and len(moved) == len(before)
    with in_view():
        bpy.ops.ed.undo()
    yield 0.3
    assert shown_singularities() == before
    yield from drag((-1.15, -0.9, 0.0), (0.2, -0.9, -0.3))  # beside them: selects
    yield 0.5
    assert bpy.context.object.location.length == 0 and bpy.context.selected_objects
    assert shown_singularities() == before
    yield from drag((-0.4, -0.8, -0.4), (0.4, -0.8, -0.4), ctrl=True)
    yield from wait_until(lambda: shown_singularities() != before)
    added = dict(shown_singularities().items() - before.items())
    assert sorted(added.values()) == [-1, 1]
    with in_view():
        bpy.ops.wm.tool_set_by_id(name="builtin.select_box")


def field_combed_with_the_tool():
    """Comb with modifiers, undo, redo, replay the stroke from a script; in Object Mode and in Sculpt Mode."""
    for mode in ("OBJECT", "SCULPT"):
        yield from fresh_scene()
        with in_view():
            bpy.ops.object.select_all(action="SELECT")
            bpy.ops.object.delete()
            bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
            bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
            bpy.context.object.modifiers.new("Wave", "CAST").factor = -0.2
            bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
            bpy.ops.object.mode_set(mode=mode)
            bpy.ops.view3d.view_axis(type="FRONT")
            bpy.ops.view3d.view_selected()
            name = "rosy.comb_tool" if mode == "OBJECT" else "rosy.comb_sculpt_tool"
            bpy.ops.wm.tool_set_by_id(name=name)
            bpy.ops.ed.undo_push(message="Before the stroke")
        yield from redraw_view()
        before = field_bytes()
        yield from drag((-0.4, -0.9, 0.2), (0.4, -0.8, 0.3))
        yield from wait_until(lambda: "rosy_guides" in bpy.context.object.data.attributes)
        combed = field_bytes()
        assert combed != before
        operator = bpy.context.window_manager.operators[-1]
        assert operator.bl_idname == "ROSY_OT_field_comb", operator.bl_idname
        stroke = [
            {
                "name": "",
                "location": tuple(point.location),
                "pressure": point.pressure,
                "is_start": point.is_start,
            }
            for point in operator.stroke
        ]
        settings = {"radius": operator.radius, "strength": operator.strength}
        with in_view():
            bpy.ops.ed.undo()
        yield 0.3
        assert field_bytes() == before
        assert "rosy_guides" not in bpy.context.object.data.attributes
        with in_view():
            bpy.ops.ed.redo()
        yield 0.3
        assert field_bytes() == combed
        with in_view():
            bpy.ops.ed.undo()
            yield 0.3
        with in_view():
            bpy.ops.rosy.field_comb("EXEC_DEFAULT", True, stroke=stroke, **settings)
        assert field_bytes() == combed
        # ESC takes a stroke back.
        yield from move_mouse((-0.4, -0.9, -0.2), "LEFTMOUSE", "PRESS")
        yield from move_mouse((0.3, -0.9, -0.3))
        assert field_bytes() != combed
        yield from move_mouse((0.3, -0.9, -0.3), "ESC", "PRESS")
        assert field_bytes() == combed
        # A stroke may begin beside the mesh.
        yield from drag((-1.15, -0.9, 0.0), (0.2, -0.9, -0.3))
        yield from wait_until(lambda old=combed: field_bytes() != old)
        assert bpy.context.object.location.length == 0
        if mode == "OBJECT":
            yield from drag((-1.15, -0.9, 0.3), (-1.15, -0.9, -0.3))
            yield 0.3
            assert bpy.context.selected_objects
            yield from drag((-1.15, -0.9, 0.0), (-1.15, -0.9, 0.0))
            yield from wait_until(lambda: not bpy.context.selected_objects)
        with in_view():
            bpy.ops.wm.tool_set_by_id(
                name="builtin.select_box" if mode == "OBJECT" else "builtin.brush"
            )
            bpy.ops.object.mode_set(mode="OBJECT")


def field_bytes():
    """Return the vectors of the active object's field."""
    attribute = bpy.context.object.data.attributes["rosy"]
    vectors = np.empty(3 * len(attribute.data), dtype=np.float32)
    attribute.data.foreach_get("vector", vectors)
    return vectors.tobytes()


def shown_singularities():
    """Return the indices of the sphere's singularities that the overlay shows, by their vertices."""
    shown = rosy("rosy_addon.ui.overlay").shown("Sphere")
    return dict(zip(shown.vertex.tolist(), shown.index.tolist(), strict=True))


def move_mouse(point, kind="MOUSEMOVE", value="NOTHING", **keys):
    """Move the mouse to a point of the scene, and let another event happen there."""
    window, _, region, _ = view()
    place = location_3d_to_region_2d(region, view()[1].spaces.active.region_3d, Vector(point))
    x, y = region.x + round(place.x), region.y + round(place.y)
    window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y, **keys)
    yield 0.1
    if kind != "MOUSEMOVE":
        window.event_simulate(type=kind, value=value, x=x, y=y, **keys)
        yield 0.1


def drag(start, end, **keys):
    """Drag from a point of the scene to another one."""
    yield from move_mouse(start, "LEFTMOUSE", "PRESS", **keys)
    yield from move_mouse((Vector(start) + Vector(end)) / 2, **keys)
    yield from move_mouse(end, "LEFTMOUSE", "RELEASE")


def bake_the_current_view():
    yield from fresh_scene()
    make_field()
    with in_view():
        bpy.ops.rosy.bake("EXEC_DEFAULT", True, camera="VIEW")
    (image,) = [image for image in bpy.data.images if image.name.lower().startswith("rosy")]
    assert tuple(image.size) == (view()[2].width, view()[2].height)


run_steps(
    panel_without_field,
    panel_with_field,
    singularities_as_dots,
    no_singularities_to_show,
    singularities_dragged_with_the_tool,
    field_combed_with_the_tool,
    bake_with_progress,
    panel_with_picture,
    panel_out_of_date,
    eevee_shows_the_picture,
    undo_after_bake,
    stop_with_escape,
    texture_stopped_with_escape,
    texture_with_progress,
    large_picture_stopped_with_escape,
    strokes_stopped_with_escape,
    field_stopped_with_escape,
    *([import_stopped_with_escape, export_stopped_with_escape] if MANY else []),
    export_and_import_from_the_file_browser,
    turntable_with_progress,
    *([turntable_stopped_with_escape, turntable_from_its_file_browser] if MANY else []),
    turntable_encoded_by_another_blender,
    strokes_from_their_file_browser,
    animation_asks_for_a_folder,
    edited_strokes_are_replaced_on_request,
    annotations_guide_a_field,
    stop_when_an_object_is_deleted,
    stop_on_undo,
    stop_on_a_change_of_scene,
    stop_when_switched_off,
    stop_when_a_file_is_opened,
    bake_the_current_view,
)
