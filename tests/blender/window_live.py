"""The live view in a window: the screen, compared with a bake of the same view.

Run by run.py, as window_panel.py is.
"""

import math
import os
from dataclasses import replace
from unittest.mock import patch

import bpy
import numpy as np
from conftest import add_camera
from extension import preferences, rosy, switch_extension
from live_views import (
    CAUSES,
    REST_LOAD,
    bare_view,
    check_is_bake,
    check_nothing_is_left,
    eroded,
    fresh_scene,
    is_live,
    live,
    load_at_rest,
    look_from,
    messages,
    session_module,
    switch,
    visible_owners,
    wait_for_final_pictures,
)
from window_steps import SHOTS, call_in_view, capture, in_view, redraws, view, wait_until


@live()
def test_every_view_is_a_bake(monkey):
    """From several sides, perspective and orthographic."""
    views = ((0.0, -0.6, "PERSP"), (2.1, 0.2, "PERSP"), (4.2, -0.2, "ORTHO"))
    for azimuth, elevation, perspective in views:
        look_from(azimuth, elevation)
        view()[1].spaces.active.region_3d.view_perspective = perspective
        yield from check_is_bake(f"live-view-{azimuth}")


@live()
def test_a_camera_view_is_the_drawing_of_the_picture(monkey):
    """With lengths in percent, lines are as wide as in a picture of three times the size, also when zoomed."""
    scene, region_3d = bpy.context.scene, view()[1].spaces.active.region_3d
    scene.render.resolution_x, scene.render.resolution_y = 1800, 1200
    scene.camera = add_camera("Camera", (0.6, -5.0, 1.2), (1.35, 0.0, 0.1))
    look = rosy("rosy_addon.preset_files.store").load_preset("engraving").look
    rosy("rosy_addon.scene.look_properties").apply_look(
        scene.rosy, replace(look, unit="percent", line_distance=24.0, light="lamp")
    )
    camera = rosy("rosy_addon.scene.cameras").camera_of_object
    bare_view()
    region_3d.view_perspective, region_3d.view_camera_zoom = "CAMERA", 20.0
    for zoom in (20.0, -5.0):
        region_3d.view_camera_zoom = zoom
        yield from wait_for_final_pictures()
        seen = capture(f"live-percent-{zoom:g}", view()[2])
        depsgraph = bpy.context.evaluated_depsgraph_get()
        (drawn,), _ = rosy("rosy_addon.scene.read_view").read_views(
            scene, depsgraph, [camera(scene, depsgraph, scene.camera)], look_of(scene)
        )
        picture = rosy("rosy_addon.rendering.draw").draw_picture(drawn).rgba
        paper = rosy("rosy_addon.core.color").from_hex(look.paper_color)
        shown = rosy("rosy_addon.core.color").to_display(picture[..., :3])
        picture = np.where(picture[..., 3:] > 0, shown, paper).mean(axis=2)
        with in_view():
            view_camera = rosy("rosy_addon.scene.cameras").camera_of_view(view()[2], region_3d)
            frame = rosy("rosy_addon.viewport.view3d").camera_frame(bpy.context, view_camera)
        low, high = ((np.array(end) + 1) / 2 * seen.shape[1::-1] for end in frame)
        seen = in_grid(seen.mean(axis=2), *low, *high)
        correlation = np.corrcoef(seen.ravel(), in_grid(picture).ravel())[0, 1]
        assert correlation > 0.9, f"zoom {zoom}: {correlation:.3f}"


def look_of(scene):
    return rosy("rosy_addon.scene.look_properties").read_look(scene.rosy)


def in_grid(tones, left=0.0, low=0.0, right=None, high=None):
    """Return the mean tones in the (120, 180) cells of a rectangle of a picture."""
    rows, columns = tones.shape
    ends = (
        (low, rows if high is None else high, 120),
        (left, columns if right is None else right, 180),
    )
    for axis, (start, stop, count) in enumerate(ends):
        total = np.insert(np.cumsum(tones, axis=axis), 0, 0.0, axis=axis)
        place = np.linspace(start, stop, count + 1)
        at = np.clip(np.floor(place).astype(int), 0, tones.shape[axis] - 1)
        part = np.expand_dims(place - at, 1 - axis)
        total = np.take(total, at, axis) + part * np.take(tones, at, axis)
        tones = np.diff(total, axis=axis) / (place[1] - place[0])
    return tones


@live(is_on=False)
def test_off_restores_the_view(monkey):
    """Switched on and off again, the view is the same as before, pixel for pixel."""
    yield 1.0
    before = capture("live-0-off", view()[2])
    switch("ON")
    yield from wait_for_final_pictures()
    assert (capture("live-1-on", view()[2]) != before).any()
    switch("OFF")
    yield 1.0
    after = capture("live-2-off", view()[2])
    assert (after == before).all(), f"{(after != before).any(axis=2).sum()} pixels differ"


@live(is_on=False)
def test_surfaces_in_front_occlude(monkey):
    """An opaque cube covers the field; what the cube hides is not drawn over it."""
    with in_view():
        bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0.7, -2.0, 0.2))
        bpy.ops.object.select_all(action="DESELECT")
    yield 1.0
    before = capture("live-cube-off", view()[2])
    switch("ON")
    seen, drawn = yield from check_is_bake("live-cube-on", 0.95)
    # Blender refines its own borders over several redraws.
    outside = eroded(drawn[..., 3] == 0)
    changed = (np.abs(seen[outside] - before[outside]) > 0.1).any(axis=1).mean()
    assert changed < 1e-4, f"{changed:.2%} of what is not the field has changed"


@live(levels=0)
def test_paper_is_behind_everything(monkey):
    """The backdrop of a hatching: the whole view, the frame of a camera, nothing if it is off."""
    scene, space = bpy.context.scene, view()[1].spaces.active
    bpy.ops.rosy.preset_apply(preset="cross-hatch")
    scene.rosy.look.paper_color = (0.8, 0.6, 0.3, 1.0)
    hex_color = rosy("rosy_addon.scene.look_properties").read_look(scene.rosy).paper_color
    paper = np.array(list(bytes.fromhex(hex_color[1:]))) / 255
    scene.render.resolution_x = scene.render.resolution_y = 400
    scene.camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
    call_in_view(bpy.ops.mesh.primitive_cube_add, size=0.8, location=(0.0, -2.0, 0.3))

    def shows_paper(name):
        seen = capture(name, view()[2])
        return (np.abs(seen - paper) < 0.02).all(axis=2)

    for device, perspective, backdrop in (
        ("AUTO", "PERSP", False),
        ("AUTO", "PERSP", True),
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


@live()
def test_only_visible_objects_are_drawn(monkey):
    """Hidden objects, local view and wireframe; the frame of a camera."""
    space = view()[1].spaces.active
    with in_view():
        bpy.ops.mesh.primitive_torus_add(location=(2.5, 0, 0))
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=2)
        bpy.ops.object.select_all(action="DESELECT")
    yield from check_is_bake("live-two-degrees")
    monkey.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    call_in_view(bpy.ops.view3d.localview, frame_selected=False)
    yield from wait_for_final_pictures()
    torus = bpy.data.objects["Torus"]
    assert visible_owners() == [monkey]
    call_in_view(bpy.ops.view3d.localview, frame_selected=False)
    monkey.select_set(False)
    torus.hide_set(True)
    yield from wait_for_final_pictures()
    assert visible_owners() == [monkey]
    torus.hide_set(False)
    torus.display_type = "WIRE"
    yield from wait_for_final_pictures()
    assert visible_owners() == [monkey]
    bpy.data.objects.remove(torus)
    camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
    camera.data.shift_x = 0.1
    bpy.context.scene.camera = camera
    space.region_3d.view_perspective = "CAMERA"
    yield from check_is_bake("live-camera")
    space.region_3d.view_perspective = "PERSP"


@live(is_on=False)
def test_clipped_region(monkey):
    """The side that Blender's clipping region cuts away is not drawn."""
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
    call_in_view(bpy.ops.view3d.clip_border)


@live()
def test_quad_view(monkey):
    """Four views in one, each from its own side."""
    call_in_view(bpy.ops.screen.region_quadview)
    yield 0.5
    _, area, _, _ = view()
    regions = [region for region in area.regions if region.type == "WINDOW"]
    assert len(regions) == 4
    pairs = zip(regions, area.spaces.active.region_quadviews, strict=True)
    for region, region_3d in pairs:
        options = {"region": region, "region_3d": region_3d}
        yield from check_is_bake("live-quad", 0.97, **options)
    call_in_view(bpy.ops.screen.region_quadview)


@live()
def test_edits_are_followed(monkey):
    """The look, the transform, modifiers, edit mode, sculpting and undo."""
    bpy.context.view_layer.objects.active, monkey_name = monkey, monkey.name
    bpy.context.scene.rosy.look.gain = 1.2
    yield from check_is_bake("live-look")
    monkey.location.x, monkey.rotation_euler.z, monkey.scale.y = 0.4, 0.5, 1.5
    yield from check_is_bake("live-moved")
    cast = monkey.modifiers.new("Cast", "CAST")
    cast.factor = 0.7
    yield from check_is_bake("live-deformed")
    monkey.modifiers.clear()  # other faces: the field is made again
    monkey.select_set(True)
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
    monkey.select_set(False)
    yield from check_is_bake("live-bare-mesh")
    with in_view():
        bpy.ops.ed.undo_push(message="bare")
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.resize(value=(1.0, 1.0, 1.08))
    yield from wait_for_final_pictures()
    call_in_view(bpy.ops.object.mode_set, mode="OBJECT")
    yield from check_is_bake("live-after-edit")
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
    point = {"name": "", "pressure": 1.0}
    stroke = [{**point, "location": (x, -0.9, 0.1), "is_start": x < 0} for x in (-0.3, 0.0, 0.3)]
    with in_view():
        bpy.context.view_layer.objects.active = bpy.data.objects[monkey_name]
        bpy.data.objects[monkey_name].select_set(True)
        bpy.ops.rosy.field_comb("EXEC_DEFAULT", True, stroke=stroke, radius=0.5)
        bpy.data.objects[monkey_name].select_set(False)
        bpy.ops.ed.undo_push(message="combed")
    yield from check_is_bake("live-combed")
    for operator in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        call_in_view(operator)
        yield 0.5
        yield from check_is_bake(f"live-{operator.idname_py()}")


@live()
def test_every_frame_is_drawn(monkey):
    """Every frame of an animation shows the mesh of that frame, also while it is played."""
    cast = monkey.modifiers.new("Cast", "CAST")
    for frame, factor in ((1, 0.0), (3, 0.6)):
        cast.factor = factor
        cast.keyframe_insert("factor", frame=frame)
    bpy.context.scene.frame_end = 3
    for frame in (1, 2, 3):
        bpy.context.scene.frame_set(frame)
        yield from check_is_bake(f"live-frame-{frame}")
    steps = []

    def record():
        views = session_module()._session.progressive.views.values()
        shows = all(view.shown and view.shown.request.key == view.requested.key for view in views)
        steps.append((bpy.context.scene.frame_current, shows))

    with redraws(record):
        call_in_view(bpy.ops.screen.animation_play)
        yield from wait_until(lambda: len({frame for frame, _ in steps}) >= 3 and len(steps) > 20)
        call_in_view(bpy.ops.screen.animation_cancel, restore_frame=False)
    assert all(shows for _, shows in steps)


@live(is_on=False)
def test_fallback_to_the_processor(monkey):
    """If the driver rejects a shader, the processor draws, and a message says so."""
    compute_pass, device = rosy("rosy_addon.gpu.passes").ComputePass, rosy("rosy_addon.gpu.device")
    device.release()
    source = property(lambda self: "void main() { this is not GLSL; }")
    with patch.object(compute_pass, "source", source):
        switch("ON")
        session = session_module()._session
        yield from wait_until(lambda: session.fallback_reason)
        assert type(session.progressive.renderer).__name__ == "CpuViewportRenderer"
        assert "cannot compile the shader" in session.fallback_reason
        # The picture has another size, and so another noise, whose mean differs a little.
        seen, drawn = yield from check_is_bake("live-processor", -1.0, 0.02, method="sheets")
        assert seen[drawn[..., 3] > 0].std() > 0.08
        look_from(0.9, 0.1)
        yield from check_is_bake("live-processor-turned", -1.0, 0.02, method="sheets")
        helper = session._helper
        assert helper.connection is not None, "no other process has drawn"
        switch("OFF")
        assert helper.connection is None
    device.release()


@live(levels=0)
def test_a_view_without_a_field_says_why_and_rests(monkey):
    """Each cause is named in the view; nothing is drawn again; later the field is back."""
    for cause, words in CAUSES:
        steps = cause(monkey)
        next(steps)
        view()[1].tag_redraw()
        yield from wait_until(messages)
        (message,) = messages()
        assert all(word in message for word in words), message
        load = yield from load_at_rest()
        assert load < REST_LOAD, (message, load)
        next(steps, None)
        view()[1].tag_redraw()
        yield from wait_until(lambda: not messages())
        assert visible_owners() == [monkey], message


@live(levels=1)
def test_two_windows_with_two_scenes_rest(monkey):
    """Two scenes share a mesh with modifiers."""
    first_scene = bpy.context.scene
    second_scene = bpy.data.scenes.new("Second")
    second_scene.collection.objects.link(monkey)
    call_in_view(bpy.ops.wm.window_new_main)
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
    layers = session_module()._session.layers._layers
    drawn = {key[0]: [entry.owner for entry in layer.instances] for key, layer in layers.items()}
    assert drawn == {first_scene.name: [monkey], "Second": [monkey]}, drawn
    assert load < REST_LOAD
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    session_module().stop()


def test_the_first_field_is_shown():
    """Make Field makes its view live once, unless the user or the preferences do not want that."""

    def make_field(how="EXEC_DEFAULT"):
        bpy.ops.mesh.primitive_ico_sphere_add()
        bpy.ops.rosy.field_generate(how, True, kind="axis", degree=2)

    try:
        for wanted, how in ((True, "INVOKE_DEFAULT"), (False, "EXEC_DEFAULT")):
            session_module().stop()
            bpy.ops.wm.read_homefile(use_empty=True)
            yield 0.5
            preferences().live_first_field = wanted
            call_in_view(make_field, how)
            if wanted:
                yield from wait_until(is_live)
            yield 0.5
            assert is_live() == wanted
        preferences().live_first_field = True
        call_in_view(make_field)
        assert not is_live(), "the second field came on"
        bpy.ops.wm.read_homefile(use_empty=True)
        yield 0.5
        make_field()
        assert not is_live(), "a script without a view made one live"
    finally:
        preferences().live_first_field = False
    yield 0.3
    check_nothing_is_left()


@live(levels=0, is_on=False)
def test_live_views_are_remembered(monkey):
    """A file shows its live views again if the scene says so, and only then."""
    path = str(SHOTS / "remembered.blend")
    for remember, is_on in ((False, True), (True, True), (True, False)):
        bpy.context.scene.rosy.remember_live = remember
        switch("ON" if is_on else "OFF")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_empty=True)
        yield 0.3
        assert session_module()._session is None
        bpy.ops.wm.open_mainfile(filepath=path)
        yield 0.5
        assert is_live() == (remember and is_on), (remember, is_on)
    os.remove(path)


def shown_phases():
    """Return how far the streaks in the views have drifted."""
    views = session_module()._session.progressive.views.values()
    return [
        next(part.phase for part in view_state.shown.request.key if hasattr(part, "phase"))
        for view_state in views
    ]


@live(levels=0)
def test_streaks_drift_while_they_are_played(monkey):
    """Streaks drift by the button; nothing runs on afterwards."""
    bpy.context.scene.rosy.look.flow = 1.5
    yield from wait_for_final_pictures()
    still = shown_phases()
    session = session_module()._session

    def play_or_pause():
        assert call_in_view(bpy.ops.rosy.flow_play) == {"FINISHED"}

    def has_timers():
        return any(map(bpy.app.timers.is_registered, session._timers.values()))

    play_or_pause()
    phases = []

    def drifts():
        phases.extend(phase for phase in shown_phases() if phase not in phases)
        return len(phases) > 4

    yield from wait_until(drifts)
    play_or_pause()
    yield from wait_for_final_pictures()
    paused, frames = shown_phases(), session.flow_clock.frames
    assert paused != still
    yield 0.5
    view()[1].tag_redraw()
    yield from wait_for_final_pictures()
    assert shown_phases() == paused and session.flow_clock.frames == frames
    play_or_pause()
    yield 0.3
    switch("OFF")
    yield 0.3
    assert not has_timers()


def test_nothing_is_left():
    """Toggles and opened files free all textures; the extension stops the live view with it."""
    path = str(SHOTS / "leak.blend")
    yield from fresh_scene(levels=1)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for ending in ("OFF", "FILE", "DISABLE"):
        switch("ON")
        yield from wait_for_final_pictures()
        held = session_module()._session.progressive.renderer.resources
        assert held._kept
        if ending == "OFF":
            switch("OFF")
        elif ending == "FILE":
            bpy.ops.wm.open_mainfile(filepath=path)
        else:
            switch_extension(False)
        yield 0.5
        assert not (held._kept or held._lookup_textures), ending
        check_nothing_is_left()
    os.remove(path)
