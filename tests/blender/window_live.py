"""The live view in a window: the screen, compared with a bake of the same view.

Run by run.py, as window_panel.py is. With its option --many it compares more views and frames, and
toggles, opens files and undoes often enough to show a leak. This takes ten minutes.
"""

from __future__ import annotations

import gc
import math
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Vector

sys.path.insert(0, str(Path(__file__).parent))
from conftest import add_camera
from window_steps import (
    MANY,
    SHOTS,
    capture,
    in_view,
    preferences,
    rosy,
    run_steps,
    view,
    wait_until,
)

#: Seconds for which a window at rest is measured, and CPU seconds that it may take in each of them:
#: it looks for closed views, and draws no pixel.
REST_SECONDS, REST_LOAD = (5.0, 0.04) if MANY else (0.8, 0.08)

#: Seconds of the main thread that a redraw may take at the start of a live view, drawn in software.
#: The longest step takes 0.4 s.
MAX_STEP_SECONDS = 0.9

#: Views that are compared, all around, and frames of an animation.
VIEWS, FRAMES = (24, 24) if MANY else (3, 3)


def session_module():
    return rosy("rosy_addon.viewport.session")


def messages():
    """Return what the live view says."""
    return session_module().messages(view()[1])


def switch(show, **options):
    with in_view():
        assert bpy.ops.rosy.viewport(show=show, **options) == {"FINISHED"}


def bare_view():
    """Hide everything in the 3D view but the scene, and return its space."""
    _, area, _, _ = view()
    space = area.spaces.active
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_header = space.show_region_tool_header = False
    space.show_region_toolbar = space.show_region_ui = False
    space.shading.type = "SOLID"
    return space


def fresh_scene(levels=2, kind="smoothest", degree=4):
    """Create a scene with Suzanne and a field, in a bare view."""
    session_module().stop()
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    with in_view():
        bpy.ops.mesh.primitive_monkey_add()
        modifier = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = levels
        bpy.ops.object.shade_smooth()
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind=kind, degree=degree)
        bpy.ops.object.select_all(action="DESELECT")
    space = bare_view()
    space.region_3d.view_distance = 7.0
    space.region_3d.view_perspective = "PERSP"
    look_from(0.3, -0.3)
    yield 0.5


def look_from(azimuth, elevation):
    region_3d = bare_view().region_3d
    rotation = Euler((math.pi / 2 + elevation, 0.0, azimuth)).to_quaternion()
    region_3d.view_rotation = rotation
    view()[1].tag_redraw()


def wait_for_final_pictures():
    """Wait until all views have drawn their final pictures."""
    redraws = []
    handler = bpy.types.SpaceView3D.draw_handler_add(
        lambda: redraws.append(1), (), "WINDOW", "POST_PIXEL"
    )

    def rests():
        view()[1].tag_redraw()
        if len(redraws) < 3:
            return False
        session = session_module()._session
        final_downscale = session.progressive.renderer.downscale_factors[1]
        views = session.progressive.views.values()
        return views and all(
            view_state.texture_key == view_state.requested_key
            and view_state.downscale == final_downscale
            and view_state.requested_key is not None
            for view_state in views
        )

    try:
        yield from wait_until(rests)
        redraws.clear()
        yield from wait_until(rests)
    finally:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    yield 0.2


def bake_of_view(space=None, region=None, method="brute"):
    """Return the picture that a bake draws of the view, (h, w, 4) display values."""
    space = space or view()[1].spaces.active
    region = region or view()[2]
    camera = rosy("rosy_addon.scene.cameras").camera_of_view(region, space.region_3d)
    scene = bpy.context.scene
    look = replace(rosy("rosy_addon.scene.look_properties").read_look(scene.rosy), method=method)
    depsgraph, tones = bpy.context.evaluated_depsgraph_get(), rosy("rosy_addon.scene.tone_inputs")
    request = rosy("rosy_addon.scene.read_request").read_request(scene, look)
    instances = rosy("rosy_addon.scene.scene_reader").read_scene(depsgraph, None, request).instances
    lights = rosy("rosy_addon.scene.lights").read_lights(depsgraph, camera.view)
    reference = tones.load_reference(scene, depsgraph, scene.camera, look)
    gbuffer = rosy("rosy_addon.projection.project").project(instances, camera, look.display)
    compose = rosy("rosy_addon.compositor.compose").compose
    picture = compose(gbuffer, look, lights, reference).rgba.copy()
    picture[..., :3] = rosy("rosy_addon.core.color").to_display(picture[..., :3])
    return picture


def check_is_bake(name, min_correlation=0.98, max_difference=0.01):
    """Check that the screen shows the picture that a bake draws."""
    yield from wait_for_final_pictures()
    seen, drawn = capture(name, view()[2]), bake_of_view()
    check_agreement(name, seen, drawn, min_correlation, max_difference)


def check_agreement(name, seen, drawn, min_correlation=0.98, max_difference=0.01):
    """Check that the screen agrees with a picture where it covers, and return the correlation."""
    covered = drawn[..., 3] > 0
    # Blender may draw slightly different borders.
    interior = covered.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            interior &= np.roll(covered, step, axis)
    seen_tones, drawn_tones = seen[interior].mean(axis=1), drawn[interior][:, :3].mean(axis=1)
    correlation = np.corrcoef(seen_tones, drawn_tones)[0, 1]
    assert correlation >= min_correlation, f"{name}: correlation {correlation:.4f}"
    assert abs(seen_tones.mean() - drawn_tones.mean()) < max_difference, (
        f"{name}: {seen_tones.mean():.3f} {drawn_tones.mean():.3f}"
    )
    return correlation


# The steps


def every_view_is_a_bake():
    """From all sides, perspective and orthographic."""
    yield from fresh_scene()
    switch("ON")
    correlations = []
    for index in range(VIEWS):
        look_from(2 * math.pi * index / VIEWS, -0.6 + 1.2 * (index * 7 % VIEWS) / VIEWS)
        view()[1].spaces.active.region_3d.view_perspective = "ORTHO" if index % 3 == 2 else "PERSP"
        yield from wait_for_final_pictures()
        name = f"live-view-{index:02d}"
        correlations.append(check_agreement(name, capture(name, view()[2]), bake_of_view()))
    print(f"{VIEWS} views: correlation {min(correlations):.4f} to {max(correlations):.4f}")
    switch("OFF")
    check_nothing_is_left()


def off_restores_the_view():
    """Switched on and off again, the view is the same as before, pixel for pixel."""
    yield from fresh_scene()
    # Blender's own antialiasing continues over many redraws, and its result varies.
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield 1.0
    before = capture("live-0-off", view()[2])
    switch("ON")
    yield from wait_for_final_pictures()
    assert (capture("live-1-on", view()[2]) != before).any()
    switch("OFF")
    yield 1.0
    bpy.context.preferences.system.viewport_aa = "8"
    after = capture("live-2-off", view()[2])
    assert (after == before).all(), f"{(after != before).any(axis=2).sum()} pixels differ"
    check_nothing_is_left()


def check_nothing_is_left():
    assert session_module()._session is None
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        for handler in handlers if isinstance(handlers, list) else ():
            assert "viewport" not in getattr(handler, "__module__", ""), name


def screenshot_for_the_documentation():
    """The screenshot for the documentation: the whole view, with the panel."""
    yield from fresh_scene()
    _, area, region, sidebar = view()
    space = area.spaces.active
    space.show_region_header = space.show_region_ui = True
    space.overlay.show_overlays = space.show_gizmo = True
    space.region_3d.view_distance = 4.2
    rotation = Euler((math.pi / 2 - 0.25, 0.0, 0.35)).to_quaternion()
    space.region_3d.view_rotation = rotation
    bpy.context.view_layer.objects.active = bpy.data.objects["Suzanne"]
    yield 0.5
    sidebar.active_panel_category = "RoSy"
    switch("ON")
    yield from wait_for_final_pictures()
    capture("live-window", region)
    switch("OFF")
    yield 0.3


def surfaces_in_front_occlude():
    """An opaque cube covers the field; what the cube hides is not drawn over it."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0.7, -2.0, 0.2))
        bpy.ops.object.select_all(action="DESELECT")
    yield 1.0
    before = capture("live-cube-off", view()[2])
    switch("ON")
    yield from wait_for_final_pictures()
    seen, drawn = capture("live-cube-on", view()[2]), bake_of_view()
    check_agreement("cube", seen, drawn, 0.95)
    bpy.data.objects["Suzanne"].rosy.include = False
    uncovered = ~(drawn[..., 3] > 0)
    interior = uncovered.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            interior &= np.roll(uncovered, step, axis)
    # Blender refines its own borders over several redraws.
    changed = (np.abs(seen[interior] - before[interior]) > 0.1).any(axis=1).mean()
    assert changed < 1e-4, f"{changed:.2%} of what is not the field has changed"


def paper_is_behind_everything():
    """The backdrop of a hatching: the whole view, the frame of a camera, nothing if it is off."""
    yield from fresh_scene(levels=0)
    scene, space = bpy.context.scene, view()[1].spaces.active
    bpy.ops.rosy.preset_apply(preset="cross-hatch")
    scene.rosy.look.paper_color = (0.8, 0.6, 0.3, 1.0)
    hex_color = rosy("rosy_addon.scene.look_properties").read_look(scene.rosy).paper_color
    paper = np.array(list(bytes.fromhex(hex_color[1:]))) / 255
    scene.render.resolution_x = scene.render.resolution_y = 400
    scene.camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
    with in_view():
        bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0.0, -2.0, 0.3))
    objects = set(bpy.data.objects)
    switch("ON")

    def shows_paper(name):
        seen = capture(name, view()[2])
        return (np.abs(seen - paper) < 0.02).all(axis=2)

    for device, perspective, backdrop in (
        ("AUTO", "PERSP", False),
        ("AUTO", "PERSP", True),
        *([("AUTO", "ORTHO", True)] if MANY else []),
        ("AUTO", "CAMERA", True),
        ("CPU", "PERSP", True),
    ):
        scene.rosy.backdrop = backdrop
        if device == "CPU":
            switch("OFF")
            switch("ON", device=device)
        space.region_3d.view_perspective = perspective
        yield from wait_for_final_pictures()
        is_paper = shows_paper(f"paper-{backdrop}-{device}-{perspective}".lower())
        corners = is_paper[[60, 60, -60, -60], [60, -60, 60, -60]]
        center = is_paper[is_paper.shape[0] // 2, is_paper.shape[1] // 2]
        assert corners.all() == (backdrop and perspective != "CAMERA"), perspective
        assert not backdrop or is_paper.mean() > 0.05, perspective
        assert perspective != "CAMERA" or not corners.any(), "the paper leaves the frame"
        assert perspective != "CAMERA" or not center, "the paper covers the cube"
    assert set(bpy.data.objects) == objects
    switch("OFF")
    check_nothing_is_left()


def even_lines_are_those_of_a_bake():
    """The preset Engraving, also after a zoom, which needs other lines."""
    yield from fresh_scene()
    bpy.ops.rosy.preset_apply(preset="engraving")
    bpy.context.scene.rosy.look.supersampling = 1
    switch("ON")
    yield from wait_for_final_pictures()
    yield from check_is_bake("live-engraving", 0.97)
    view()[1].spaces.active.region_3d.view_distance *= 1.5
    yield from wait_for_final_pictures()
    yield from check_is_bake("live-engraving-far", 0.97)
    switch("OFF")
    check_nothing_is_left()


def methods_that_the_card_lacks_are_named():
    """The view then draws another method, and says so as long as it does."""
    yield from fresh_scene(levels=0)
    switch("ON")
    yield from wait_for_final_pictures()
    look = bpy.context.scene.rosy.look
    for method, drawn in (("ibfv", "sheets"), ("members", "brute")):
        look.method = method
        view()[1].tag_redraw()
        yield from wait_for_final_pictures()
        assert len(messages()) == 1 and f"'{drawn}' instead of '{method}'" in messages()[0]
    look.method = "sheets"
    view()[1].tag_redraw()
    yield from wait_for_final_pictures()
    assert not messages()
    switch("OFF")
    check_nothing_is_left()


def only_visible_objects_are_drawn():
    """Hidden objects, local view, bounds and wireframe; the frame of a camera; a clipped region."""
    yield from fresh_scene()
    monkey, space = bpy.data.objects["Suzanne"], view()[1].spaces.active
    yield 0.5
    switch("ON")
    yield from wait_for_final_pictures()
    with in_view():
        bpy.ops.mesh.primitive_torus_add(location=(2.5, 0, 0))
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=2)
        bpy.ops.object.select_all(action="DESELECT")
    yield from check_is_bake("live-two-degrees")
    monkey.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    with in_view():
        bpy.ops.view3d.localview(frame_selected=False)
    yield from wait_for_final_pictures()
    torus = bpy.data.objects["Torus"]
    assert [entry.owner for entry in visible_instances()] == [monkey]
    with in_view():
        bpy.ops.view3d.localview(frame_selected=False)
    monkey.select_set(False)
    torus.hide_set(True)
    yield from wait_for_final_pictures()
    assert [entry.owner for entry in visible_instances()] == [monkey]
    torus.hide_set(False)
    torus.display_type = "WIRE"
    yield from wait_for_final_pictures()
    assert [entry.owner for entry in visible_instances()] == [monkey]
    bpy.data.objects.remove(torus)
    yield from check_is_bake("live-one-again")
    camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
    camera.data.shift_x = 0.1
    bpy.context.scene.camera = camera
    space.region_3d.view_perspective = "CAMERA"
    yield from check_is_bake("live-camera")
    space.region_3d.view_perspective = "PERSP"
    yield 0.5
    switch("OFF")
    yield 0.5


def visible_instances():
    """Return the instances that the live view draws now."""
    session = session_module()._session
    (layer,) = session.layers._layers.values()
    space = view()[1].spaces.active
    depsgraph = bpy.context.evaluated_depsgraph_get()
    is_visible = rosy("rosy_addon.viewport.view3d").is_visible
    return [
        entry for entry in layer.instances if is_visible(entry.visibility_object, depsgraph, space)
    ]


def clipped_region():
    """The side that Blender's clipping region cuts away is not drawn."""
    yield from fresh_scene()
    region = view()[2]
    middle = region.width // 2
    with in_view():
        bpy.ops.view3d.clip_border(
            xmin=middle, xmax=region.width - 5, ymin=5, ymax=region.height - 5
        )
    region.tag_redraw()
    yield 0.7
    off = capture("live-clipped-off", region)
    switch("ON")
    yield from wait_for_final_pictures()
    on = capture("live-clipped-on", region)
    changed = (on != off).any(axis=2)
    assert changed[:, middle + 5 :].sum() > 2000
    assert changed[:, : middle - 5].sum() == 0
    switch("OFF")
    with in_view():
        bpy.ops.view3d.clip_border()
    yield 0.5


def tones_are_those_of_a_bake():
    """A painted attribute, the shadow of an occluder, and a reference picture."""
    yield from fresh_scene()
    scene, monkey = bpy.context.scene, bpy.data.objects["Suzanne"]
    look, mesh = scene.rosy.look, monkey.data
    look.ink, look.line_width, look.light, look.shading = "hatch", 3.0, "scene", 0.9
    max_difference = 0.03  # lines are sharp, and the mean of display values is not that of light
    switch("ON")
    yield from wait_for_final_pictures()
    ink = mesh.attributes.new("Ink", "FLOAT", "POINT")
    positions = np.array([vertex.co for vertex in mesh.vertices])
    ink.data.foreach_set("value", (0.5 + 0.4 * np.sin(4 * positions[:, 0])).astype(np.float32))
    mesh.update()
    scene.rosy.tone_attribute, look.tone = "Ink", "attribute"
    yield from check_is_bake("live-tone-attribute", 0.97, max_difference)
    scene.rosy.tone_attribute = "Pencil"
    view()[1].tag_redraw()
    yield from wait_until(messages)
    assert "'Pencil'" in messages()[0] and "'Ink'" in messages()[0]
    look.tone, look.shadows = "light", True
    with in_view():
        bpy.ops.object.light_add(type="SUN", location=(0, 0, 5), rotation=(0.9, 0.3, 0.0))
        bpy.context.object.data.energy = 3.5
        bpy.ops.mesh.primitive_cube_add(size=0.7, location=(0.9, -2.0, 2.4))
        bpy.ops.object.select_all(action="DESELECT")
    yield from check_is_bake("live-tone-shadows", 0.97, max_difference)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    look.shadows = False
    scene.camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
    scene.render.resolution_x = scene.render.resolution_y = 64
    image = bpy.data.images.new("aside", 64, 64)
    rows = np.ones((64, 64, 4), dtype=np.float32)
    rows[..., :3] = np.linspace(0.1, 0.95, 64)[:, None]
    image.pixels.foreach_set(rows.ravel())
    path = str(SHOTS / "tone.png")
    image.filepath_raw, image.file_format = path, "PNG"
    image.save()
    bpy.data.images.remove(image)
    scene.rosy.tone_picture, look.tone = path, "picture"
    yield from check_is_bake("live-tone-picture", 0.97, max_difference)
    os.remove(path)
    switch("OFF")
    yield 0.5
    check_nothing_is_left()


def quad_view():
    """Four views in one, each from its own side."""
    yield from fresh_scene()
    switch("ON")
    with in_view():
        bpy.ops.screen.region_quadview()
    yield 0.5
    yield from wait_for_final_pictures()
    area = view()[1]
    regions = [region for region in area.regions if region.type == "WINDOW"]
    assert len(regions) == 4
    assert len(session_module()._session.progressive.views) >= 4
    space = area.spaces.active
    views = [*space.region_quadviews]
    camera_of_view = rosy("rosy_addon.scene.cameras").camera_of_view
    checked = 0
    for region, region_3d in zip(regions, views, strict=True):
        seen = capture("live-quad", region)
        drawn = _bake_of_region(region, region_3d, camera_of_view)
        check_agreement("quad", seen, drawn, 0.97)
        checked += 1
    assert checked == 4
    with in_view():
        bpy.ops.screen.region_quadview()
    switch("OFF")
    yield 0.5


def _bake_of_region(region, region_3d, camera_of_view):
    class Space:
        pass

    space = Space()
    space.region_3d = region_3d
    return bake_of_view(space, region)


def edits_are_followed():
    """The look, the transform, modifiers, edit mode, sculpting and undo."""
    yield from fresh_scene()
    monkey, scene = bpy.data.objects["Suzanne"], bpy.context.scene
    bpy.context.view_layer.objects.active = monkey
    switch("ON")
    yield from wait_for_final_pictures()
    scene.rosy.look.gain = 1.2
    scene.rosy.look.hue = "noise"
    yield from check_is_bake("live-look")
    with in_view():
        bpy.ops.ed.undo_push(message="look")
    monkey.location.x, monkey.rotation_euler.z, monkey.scale.y = 0.4, 0.5, 1.5
    yield from check_is_bake("live-moved")
    cast = monkey.modifiers.new("Cast", "CAST")
    cast.factor = 0.7
    yield from check_is_bake("live-deformed")
    monkey.modifiers.remove(monkey.modifiers["Subdivision"])
    yield from check_is_bake("live-fewer-faces")
    monkey.modifiers.remove(cast)
    yield from check_is_bake("live-bare-mesh")
    with in_view():
        bpy.ops.ed.undo_push(message="bare")
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.resize(value=(1.0, 1.0, 1.08))
    yield from wait_for_final_pictures()
    edited = capture("live-edited", view()[2])
    with in_view():
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from check_is_bake("live-after-edit")
    assert np.corrcoef(edited.ravel(), capture("live-x", view()[2]).ravel())[0, 1] > 0.5
    if bpy.app.version >= (5, 0):  # before, Blender crashes on this operator in a script
        with in_view():
            bpy.ops.object.mode_set(mode="SCULPT")
            bpy.ops.sculpt.mesh_filter(type="SCALE", strength=0.1)
            bpy.ops.object.mode_set(mode="OBJECT")
        yield from check_is_bake("live-sculpted")
    with in_view():
        bpy.ops.ed.undo_push(message="sculpted")
        bpy.ops.ed.undo()
    yield 0.5
    yield from check_is_bake("live-undone")
    switch("OFF")
    yield 0.5


def every_frame_is_drawn():
    """Every frame of an armature's animation shows the mesh of that frame."""
    session_module().stop()
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    with in_view():
        bpy.ops.mesh.primitive_cylinder_add(vertices=250, radius=0.5, depth=3.0)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.delete(type="ONLY_FACE")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.ops.object.delete()
    tube = _tube(250, 100)
    frames = FRAMES
    _bend(tube, frames)
    space = bare_view()
    space.region_3d.view_distance, space.region_3d.view_perspective = 8.0, "PERSP"
    look_from(0.2, -0.2)
    yield 0.5
    switch("ON")
    yield from wait_for_final_pictures()
    assert sum(len(e.instance.surface.triangles) for e in visible_instances()) == 50_000
    correlations = []
    for frame in range(1, frames + 1):
        bpy.context.scene.frame_set(frame)
        yield from wait_for_final_pictures()
        name = f"live-frame-{frame:02d}"
        correlations.append(check_agreement(name, capture(name, view()[2]), bake_of_view()))
    print(f"{frames} frames of 50,000 triangles: correlation from {min(correlations):.4f}")
    # During playback, each redraw shows the current frame, possibly as a preview.
    steps = []

    def record(*_):
        session = session_module()._session
        keys = {view_state.requested_key for view_state in session.progressive.views.values()}
        steps.append(
            (
                bpy.context.scene.frame_current,
                all(
                    view_state.texture_key == view_state.requested_key
                    for view_state in session.progressive.views.values()
                ),
                keys,
            )
        )

    handler = bpy.types.SpaceView3D.draw_handler_add(record, (), "WINDOW", "POST_PIXEL")
    with in_view():
        bpy.ops.screen.animation_play()
    start = time.monotonic()
    yield from wait_until(lambda: len({frame for frame, _, _ in steps}) >= 3 and len(steps) > 20)
    with in_view():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    played = {frame for frame, _, _ in steps}
    assert len(played) >= 3, f"{len(played)} frames were drawn"
    assert all(shows for _, shows, _ in steps)
    print(
        f"played: {len(steps)} redraws of {len(played)} frames in {time.monotonic() - start:.1f} s"
    )
    switch("OFF")
    yield 0.5


def _tube(around, along):
    """Add a tube of 2 x around x along triangles, with a field along its axis."""
    angle = np.arange(around) * 2 * np.pi / around
    height = np.linspace(-1.5, 1.5, along + 1)
    points = np.stack(
        [
            np.tile(0.5 * np.cos(angle), along + 1),
            np.tile(0.5 * np.sin(angle), along + 1),
            np.repeat(height, around),
        ],
        axis=1,
    )
    vertex = np.arange(along)[:, None] * around + np.arange(around)
    next_vertex = np.roll(vertex, -1, axis=1)
    faces = np.concatenate(
        [
            np.stack([vertex, next_vertex, next_vertex + around], axis=-1).reshape(-1, 3),
            np.stack([vertex, next_vertex + around, vertex + around], axis=-1).reshape(-1, 3),
        ]
    )
    mesh = bpy.data.meshes.new("Tube")
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    mesh.shade_smooth()
    obj = bpy.data.objects.new("Tube", mesh)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=4)
    obj.select_set(False)
    return obj


def _bend(obj, frames):
    """Add animated bones that bend an object in the middle."""
    data = bpy.data.armatures.new("Bones")
    bones = bpy.data.objects.new("Bones", data)
    bpy.context.scene.collection.objects.link(bones)
    bpy.context.view_layer.objects.active = bones
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
    lower, upper = data.edit_bones.new("lower"), data.edit_bones.new("upper")
    lower.head, lower.tail = Vector((0, 0, -1.5)), Vector((0, 0, 0))
    upper.head, upper.tail, upper.parent = Vector((0, 0, 0)), Vector((0, 0, 1.5)), lower
    with in_view():
        bpy.ops.object.mode_set(mode="OBJECT")
    height = np.array([vertex.co.z for vertex in obj.data.vertices])
    share = np.clip(0.5 + height, 0, 1)
    for name, weights in (("lower", 1 - share), ("upper", share)):
        group = obj.vertex_groups.new(name=name)
        for index, weight in enumerate(weights.tolist()):
            group.add([index], weight, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = bones
    pose_bone = bones.pose.bones["upper"]
    pose_bone.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (frames, 1.3)):
        pose_bone.rotation_euler = (0.0, 0.0, angle * 0.3)
        pose_bone.rotation_euler.x = angle
        pose_bone.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_end = frames


def fallback_to_the_processor():
    """If the driver rejects a shader, the processor draws, and a message says so."""
    yield from fresh_scene()
    sources = rosy("rosy_addon.gpu.passes").ComputePass
    original_source = sources.source
    rosy("rosy_addon.gpu.device").release()
    sources.source = property(lambda self: "void main() { this is not GLSL; }")
    try:
        switch("ON")
        session = session_module()._session
        yield from wait_until(lambda: session.fallback_reason)
        assert type(session.progressive.renderer).__name__ == "CpuViewportRenderer"
        assert "cannot compile the shader" in session.fallback_reason
        yield from wait_for_final_pictures()
        seen, drawn = capture("live-processor", view()[2]), bake_of_view(method="sheets")
        # The picture has another size, and so another noise, whose mean differs a little.
        check_agreement("processor", seen, drawn, -1.0, max_difference=0.02)
        assert seen[drawn[..., 3] > 0].std() > 0.08
        look_from(0.9, 0.1)
        yield from wait_for_final_pictures()
        seen, drawn = capture("live-processor-turned", view()[2]), bake_of_view(method="sheets")
        check_agreement("processor", seen, drawn, -1.0, max_difference=0.02)
        helper = session._helper
        assert helper.connection is not None, "no other process has drawn"
        switch("OFF")
        assert helper.connection is None
    finally:
        sources.source = original_source
        rosy("rosy_addon.gpu.device").release()
    yield 0.5
    check_nothing_is_left()


def bad_fields_are_named():
    """A field that cannot be drawn is named in the view, and the others are drawn."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.mesh.primitive_cube_add(location=(2.5, 0, 0))
    cube = bpy.data.objects["Cube"]
    cube.data.attributes.new("rosy", "FLOAT_COLOR", "POINT")
    cube.select_set(False)
    switch("ON")
    yield from wait_for_final_pictures()
    (layer,) = session_module()._session.layers._layers.values()
    assert "Cube" in layer.reader.errors and "FLOAT_COLOR" in str(layer.reader.errors["Cube"])
    capture("live-error", view()[2])
    bpy.data.objects.remove(cube)
    yield from check_is_bake("live-no-error")
    assert not layer.reader.errors
    switch("OFF")
    yield 0.5


def _remeshed(monkey):
    modifier = monkey.modifiers.new("Rebuild", "REMESH")
    modifier.mode, modifier.voxel_size = "VOXEL", 0.1
    yield
    monkey.modifiers.remove(modifier)


def _skinned(monkey):
    modifier = monkey.modifiers.new("Skin", "SKIN")
    yield
    monkey.modifiers.remove(modifier)


def _new_geometry(monkey):
    group = bpy.data.node_groups.new("New", "GeometryNodeTree")
    group.interface.new_socket("Mesh", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    cube, target = group.nodes.new("GeometryNodeMeshCube"), group.nodes.new("NodeGroupOutput")
    group.links.new(cube.outputs[0], target.inputs[0])
    modifier = monkey.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    yield
    monkey.modifiers.remove(modifier)
    bpy.data.node_groups.remove(group)


def _masked(monkey):
    group = monkey.vertex_groups.new(name="None")
    modifier = monkey.modifiers.new("Hide All", "MASK")
    modifier.vertex_group = group.name
    yield
    monkey.modifiers.remove(modifier)
    monkey.vertex_groups.remove(group)


def _not_finite(monkey):
    attribute = monkey.data.attributes["rosy"]
    vector = attribute.data[7].vector.copy()
    attribute.data[7].vector = (math.nan, 0.0, 0.0)
    monkey.data.update()
    yield
    attribute = monkey.data.attributes["rosy"]
    attribute.data[7].vector = vector
    monkey.data.update()


def _wrong_attribute(monkey):
    monkey.data.attributes.new("weights", "FLOAT", "POINT")
    monkey.data.rosy.attribute = "weights"
    monkey.data.update()
    yield
    monkey.data.rosy.attribute = "rosy"
    monkey.data.update()


def _missing_picture(monkey):
    rosy_settings = bpy.context.scene.rosy
    bpy.context.scene.camera = add_camera("Camera", (0.0, -6.0, 1.0), (1.4, 0.0, 0.0))
    rosy_settings.look.ink, rosy_settings.look.tone = "hatch", "picture"
    rosy_settings.tone_picture = str(SHOTS / "no such.png")
    yield
    rosy_settings.look.ink, rosy_settings.look.tone = "soft", "light"
    bpy.data.objects.remove(bpy.context.scene.camera)


def _edit_mode(monkey):
    attributes = monkey.data.attributes
    attributes.new("painted", "FLOAT_VECTOR", "POINT")
    monkey.data.rosy.attribute = "painted"
    bpy.context.view_layer.objects.active = monkey
    with in_view():
        bpy.ops.object.mode_set(mode="EDIT")
    yield
    with in_view():
        bpy.ops.object.mode_set(mode="OBJECT")
    monkey.data.rosy.attribute = "rosy"
    attributes.remove(attributes["painted"])
    monkey.select_set(False)


def _wireframe(monkey):
    view()[1].spaces.active.shading.type = "WIREFRAME"
    yield
    view()[1].spaces.active.shading.type = "SOLID"


def _no_field(monkey):
    monkey.rosy.include = False
    monkey.update_tag()
    yield
    monkey.rosy.include = True
    monkey.update_tag()


def _raises(name, error):
    """Return a cause: a method of the renderer raises an error."""

    def cause(monkey):
        renderer = type(session_module()._session.progressive.renderer)
        original = getattr(renderer, name)

        def fail(*_, **__):
            raise error

        setattr(renderer, name, fail)
        bpy.context.scene.rosy.look.seed += 1
        yield
        setattr(renderer, name, original)
        bpy.context.scene.rosy.look.seed += 1

    return cause


#: Causes of a view that shows no field, and words of the message.
CAUSES = {
    "remesh": (_remeshed, ("'Suzanne'", "Rebuild", "no attribute 'rosy'")),
    "skin": (_skinned, ("'Suzanne'", "Skin", "no attribute 'rosy'")),
    "new geometry": (_new_geometry, ("'Suzanne'", "Nodes", "no attribute 'rosy'")),
    "mask": (_masked, ("'Suzanne'", "Hide All", "no faces")),
    "not finite": (_not_finite, ("'Suzanne'", "not finite")),
    "wrong attribute": (_wrong_attribute, ("'Suzanne'", "'weights'", "found FLOAT on POINT")),
    "missing picture": (_missing_picture, ("no such.png",)),
    "edit mode": (_edit_mode, ("'Suzanne'", "edit mode")),
    "wireframe": (_wireframe, ("wireframe",)),
    "no field": (_no_field, ("no object with a field",)),
    "no memory": (_raises("texture_steps", MemoryError()), ("not enough memory",)),
    "no memory to upload": (_raises("upload", MemoryError()), ("not enough memory",)),
}

#: One of each kind: of a modifier, an attribute, a mode, and an error.
COMMON_CAUSES = ("remesh", "not finite", "edit mode", "no memory")


def load_at_rest():
    """Wait until the window rests, and return the CPU seconds that it takes in each second."""
    yield 0.7
    start = time.process_time()
    yield REST_SECONDS
    return (time.process_time() - start) / REST_SECONDS


def a_view_without_a_field_says_why_and_rests():
    """Each cause is named in the view and in the panel; nothing is done; later the field is back."""
    yield from fresh_scene(levels=0)
    view()[1].spaces.active.show_region_ui = True
    yield 0.5
    view()[3].active_panel_category = "RoSy"
    # Blender's own antialiasing continues over many redraws.
    bpy.context.preferences.system.viewport_aa = "OFF"
    print(f"at rest without a live view: {100 * (yield from load_at_rest()):.1f} %")
    switch("ON")
    yield from wait_for_final_pictures()
    print(f"at rest with a live view: {100 * (yield from load_at_rest()):.1f} %")
    monkey = bpy.data.objects["Suzanne"]
    shown = {}
    causes = CAUSES if MANY else {name: CAUSES[name] for name in COMMON_CAUSES}
    for name, (cause, words) in causes.items():
        steps = cause(monkey)
        next(steps)
        view()[1].tag_redraw()
        yield from wait_until(messages)
        assert len(messages()) == 1 and all(word in messages()[0] for word in words), (
            f"{name}: {messages()}"
        )
        load = yield from load_at_rest()
        print(f"{name}: {100 * load:.1f} %, {messages()[0]}")
        shown[name] = load
        if MANY or name == "remesh":
            capture(f"live-cause-{name.replace(' ', '-')}", view()[2])
        next(steps, None)
        view()[1].tag_redraw()
        yield from wait_until(lambda: not messages())
        assert [entry.owner for entry in visible_instances()] == [monkey], name
    yield from wait_for_final_pictures()
    assert max(shown.values()) < REST_LOAD, shown
    bpy.context.preferences.system.viewport_aa = "8"
    switch("OFF")
    yield 0.5
    check_nothing_is_left()


def changes_before_a_resolving_are_noted():
    """Meshes are read in a timer, which evaluates the scene. A change just before must not be lost."""
    yield from fresh_scene(levels=0)
    switch("ON")
    yield from wait_for_final_pictures()
    steps = _remeshed(bpy.data.objects["Suzanne"])
    next(steps)
    session_module()._session._resolve_topologies()
    yield from wait_until(messages)
    next(steps, None)
    session_module()._session._resolve_topologies()
    yield from wait_until(lambda: not messages())
    switch("OFF")
    yield 0.3


def two_windows_with_two_scenes_rest():
    """Two scenes share a mesh with modifiers, and have reference pictures of their own."""
    yield from fresh_scene(levels=1)
    bpy.context.preferences.system.viewport_aa = "OFF"
    first_scene, monkey = bpy.context.scene, bpy.data.objects["Suzanne"]
    second_scene = bpy.data.scenes.new("Second")
    second_scene.collection.objects.link(monkey)
    image = bpy.data.images.new("gray", 8, 8)
    for scene in (first_scene, second_scene):
        scene.camera = None
        scene.render.resolution_x = scene.render.resolution_y = 64
        camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
        if camera.name not in scene.objects:
            scene.collection.objects.link(camera)
        scene.camera = camera
        path = str(SHOTS / f"tone {scene.name}.png")
        image.filepath_raw, image.file_format = path, "PNG"
        image.save()
        scene.rosy.look.ink, scene.rosy.look.tone = "hatch", "picture"
        scene.rosy.tone_picture = path
    switch("ON")
    with in_view():
        bpy.ops.wm.window_new_main()
    yield 0.5
    window = bpy.context.window_manager.windows[-1]
    window.scene = second_scene
    area = max(window.screen.areas, key=lambda area: area.width * area.height)
    area.type = "VIEW_3D"
    yield 0.3
    session_module().start(area.spaces.active)
    yield from wait_for_final_pictures()
    yield 1.0
    load = yield from load_at_rest()
    print(f"two windows at rest: {100 * load:.1f} %")
    layers = session_module()._session.layers._layers
    drawn = {key[0]: [entry.owner for entry in layer.instances] for key, layer in layers.items()}
    assert drawn == {first_scene.name: [monkey], "Second": [monkey]}, drawn
    assert load < REST_LOAD
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    for scene in (first_scene, second_scene):
        os.remove(scene.rosy.tone_picture)
    bpy.context.preferences.system.viewport_aa = "8"
    session_module().stop()
    yield 0.5
    check_nothing_is_left()


def every_long_step_is_named_before_it_begins():
    """The start of a live view is done in short redraws, and the view says what is being done."""
    yield from fresh_scene(levels=4)
    bpy.ops.rosy.preset_apply(preset="cross-hatch")
    rosy("rosy_addon.gpu.device").release()
    session_class = session_module().ViewportSession
    original_draw, original_resolve = session_class._draw, session_class._resolve_topologies
    seconds, lines = [], []

    def timed(function):
        def run(self):
            start = time.thread_time()
            result = function(self)
            seconds.append((time.thread_time() - start, (lines or [None])[-1]))
            return result

        return run

    def note_lines():
        lines.extend(line for line in messages() if line not in lines)

    session_class._draw = timed(original_draw)
    session_class._resolve_topologies = timed(original_resolve)
    handler = bpy.types.SpaceView3D.draw_handler_add(note_lines, (), "WINDOW", "POST_PIXEL")
    try:
        switch("ON")
        yield from wait_for_final_pictures()
    finally:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
        session_class._draw, session_class._resolve_topologies = original_draw, original_resolve
    slowest = sorted(seconds, key=lambda step: step[0])[-4:]
    print(f"{len(seconds)} steps, the longest {slowest}, {lines}")
    for words in ("reading the meshes", "compiling shaders", "preparing the mesh", "tracing"):
        assert any(words in line for line in lines), f"'{words}' was not shown: {lines}"
    assert slowest[-1][0] < MAX_STEP_SECONDS, slowest
    assert not messages()
    switch("OFF")
    yield 0.5
    check_nothing_is_left()


def is_live():
    return session_module().is_live(view()[1].spaces.active)


def the_first_field_is_shown():
    """Make Field makes its view live once, unless the user or the preferences do not want that."""
    session_module().stop()
    preferences().live_first_field = True

    def make_field(name, how="EXEC_DEFAULT"):
        bpy.ops.mesh.primitive_ico_sphere_add()
        bpy.context.object.name = name
        bpy.ops.rosy.field_generate(how, True, kind="axis", degree=2)

    try:
        for wanted, how in (
            (True, "INVOKE_DEFAULT"),
            (True, "EXEC_DEFAULT"),
            (False, "EXEC_DEFAULT"),
        ):
            bpy.ops.wm.read_homefile(use_empty=True)
            yield 0.5
            preferences().live_first_field = wanted
            with in_view():
                make_field("First", how)
            if wanted:
                yield from wait_until(is_live)
            else:
                yield 0.5
                assert not is_live()
        preferences().live_first_field = True
        with in_view():
            make_field("Second")
        assert not is_live(), "the second field came on"
        bpy.ops.wm.read_homefile(use_empty=True)
        yield 0.5
        assert bpy.context.area is None
        make_field("Script")
        assert not is_live(), "a script without a view made one live"
        bpy.ops.wm.read_homefile(use_empty=True)
        yield 0.5
        with in_view():
            make_field("First")
        assert is_live()
        switch("OFF")
        with in_view():
            bpy.ops.object.delete()
            make_field("First Again")
        assert not is_live(), "it came on again although the user had switched it off"
    finally:
        preferences().live_first_field = False
    yield 0.3
    check_nothing_is_left()


def live_views_are_remembered():
    """A file shows its live views again if the scene says so, and only then."""
    yield from fresh_scene(levels=0)
    path = str(SHOTS / "remembered.blend")
    for remember, live, expected in (
        (False, True, False),
        (True, True, True),
        (True, False, False),
    ):
        bpy.context.scene.rosy.remember_live = remember
        switch("ON" if live else "OFF")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_empty=True)
        yield 0.3
        assert session_module()._session is None
        bpy.ops.wm.open_mainfile(filepath=path)
        yield 0.5
        assert is_live() == expected, (remember, live)
    os.remove(path)
    switch("OFF")
    yield 0.3
    check_nothing_is_left()


def shown_phases():
    """Return how far the streaks in the views have drifted."""
    views = session_module()._session.progressive.views.values()
    return [view_state.texture_key[5].phase for view_state in views]


def streaks_drift_while_they_are_played():
    """Streaks drift by the button and with the frames of the scene; nothing runs on afterwards."""
    yield from fresh_scene(levels=0)
    scene = bpy.context.scene
    scene.rosy.look.flow = 1.5
    with in_view():
        assert not bpy.ops.rosy.flow_play.poll()
    switch("ON")
    yield from wait_for_final_pictures()
    assert shown_phases() == [0.0]
    session = session_module()._session

    def play_or_pause():
        with in_view():
            assert bpy.ops.rosy.flow_play() == {"FINISHED"}

    def has_timers():
        return any(map(bpy.app.timers.is_registered, session._timers.values()))

    play_or_pause()
    phases, downscales = [], set()

    def drifts():
        for view_state in session.progressive.views.values():
            downscales.add(view_state.downscale)
        phases.extend(phase for phase in shown_phases() if phase not in phases)
        return len(phases) > 4

    yield from wait_until(drifts)
    assert downscales == {session.progressive.renderer.downscale_factors[1]}, "previews flash"
    play_or_pause()
    yield from wait_for_final_pictures()
    paused, frames = shown_phases(), session.flow_clock.frames
    assert paused != [0.0]
    yield 0.5
    view()[1].tag_redraw()
    yield from wait_for_final_pictures()
    assert shown_phases() == paused and session.flow_clock.frames == frames
    scene.frame_set(scene.frame_start + 4)
    yield from wait_for_final_pictures()
    # The frame range is a loop of whole cycles.
    drift = 1.5 * (scene.frame_end - scene.frame_start + 1)
    cycles = math.ceil(drift / scene.rosy.look.length)
    cycle = (4 + frames) * 1.5 / (drift / cycles)
    assert abs((shown_phases()[0] - cycle + 0.5) % 1 - 0.5) < 1e-4
    play_or_pause()
    yield 0.3
    switch("OFF")
    yield 0.3
    assert not has_timers()
    check_nothing_is_left()
    switch("ON")
    yield from wait_for_final_pictures()
    session = session_module()._session
    assert shown_phases() != paused and not session.flow_clock.is_playing
    play_or_pause()
    yield 0.3
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.3
    assert not has_timers()
    check_nothing_is_left()


def nothing_leaks():
    """After toggles, undo steps and opened files, the textures and the memory are freed."""
    # A few show textures that are not freed; a leak of memory shows only after many.
    first_toggles, toggles, loads, undos = (4, 500, 200, 100) if MANY else (1, 2, 2, 2)
    yield from fresh_scene(levels=1)
    # On software OpenGL, textures are in the memory of the process, where a leak is visible.
    renderers = []

    def count_held(renderer):
        held = renderer.resources
        return len(held._meshes) + len(held._images) + len(held._lookup_textures)

    def count():
        gc.collect()
        return sum(map(count_held, renderers)), resident_memory()

    def toggle():
        switch("ON")
        renderers[:] = [*renderers[-9:], session_module()._session.progressive.renderer]
        view()[1].tag_redraw()
        yield from wait_until(lambda: count_held(renderers[-1]) > 8)
        switch("OFF")
        yield 0.02

    for _ in range(first_toggles):
        yield from toggle()
    start = count()
    for _ in range(toggles):
        yield from toggle()
    yield 0.5
    check_nothing_is_left()
    toggled = count()
    switch("ON")
    yield from wait_for_final_pictures()
    for index in range(undos):
        with in_view():
            bpy.data.objects["Suzanne"].location.z = 0.01 * (index % 5)
            bpy.ops.ed.undo_push(message="move")
            bpy.ops.ed.undo()
        yield 0.1
        assert session_module()._session is not None, f"switched off by undo {index}"
    switch("OFF")
    yield 0.5
    undone = count()
    path = str(SHOTS / "leak.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for index in range(loads):
        switch("ON")
        view()[1].tag_redraw()
        yield 0.1
        bpy.ops.wm.open_mainfile(filepath=path)
        yield 0.1
        assert session_module()._session is None
        if index == min(3, loads - 1):
            opened_first = count()
    opened = count()
    print(
        f"textures and MiB: {start}, {toggled} toggled, {undone} undone, "
        f"{opened_first} and {opened} opened"
    )
    os.remove(path)
    assert start[0] == toggled[0] == undone[0] == opened[0] == 0
    leaks = (toggled[1] - start[1]) / toggles, (opened[1] - opened_first[1]) / max(loads - 4, 1)
    if MANY:
        assert max(leaks) < 0.1, f"MiB a toggle and a file: {leaks}"
    check_nothing_is_left()


def resident_memory():
    """Return the resident memory of this process in MiB."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return 0.0


def disabled_with_the_extension():
    """Disabling the extension stops the live view, within seconds."""
    yield from fresh_scene(levels=1)
    switch("ON")
    yield from wait_for_final_pictures()
    start = time.monotonic()
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.rosy")
    yield 0.5
    assert time.monotonic() - start < 20
    assert session_module()._session is None


STEPS = (
    every_view_is_a_bake,
    off_restores_the_view,
    *([screenshot_for_the_documentation] if MANY else []),
    surfaces_in_front_occlude,
    paper_is_behind_everything,
    even_lines_are_those_of_a_bake,
    methods_that_the_card_lacks_are_named,
    only_visible_objects_are_drawn,
    clipped_region,
    tones_are_those_of_a_bake,
    quad_view,
    edits_are_followed,
    every_frame_is_drawn,
    fallback_to_the_processor,
    bad_fields_are_named,
    a_view_without_a_field_says_why_and_rests,
    changes_before_a_resolving_are_noted,
    two_windows_with_two_scenes_rest,
    every_long_step_is_named_before_it_begins,
    the_first_field_is_shown,
    live_views_are_remembered,
    streaks_drift_while_they_are_played,
    nothing_leaks,
    disabled_with_the_extension,
)

run_steps(*STEPS)
