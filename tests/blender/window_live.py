"""The live view in a window: what is on the screen, compared with a bake of the same view.

Run by run.py as window.py is. With ROSY_LIVE_MANY it compares more views and frames, and switches,
opens files and undoes as often as it takes to see a leak: ten minutes.
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
from watching import SHOTS, captured, in_view, rosy, until, view, watch

MANY = bool(os.environ.get("ROSY_LIVE_MANY"))

#: Views that are compared, all around, and frames of an animation.
VIEWS, FRAMES = (24, 24) if MANY else (4, 4)


def live():
    return rosy("rosy_addon.viewport.session")


def switch(show, **more):
    with in_view():
        assert bpy.ops.rosy.viewport(show=show, **more) == {"FINISHED"}


def bare_view():
    """The 3D view without anything in it that is not of the scene."""
    _, area, _, _ = view()
    space = area.spaces.active
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_header = space.show_region_tool_header = False
    space.show_region_toolbar = space.show_region_ui = False
    space.shading.type = "SOLID"
    return space


def fresh_scene(levels=2, kind="smoothest", degree=4):
    """Suzanne with a field, alone in a bare view."""
    live().stop()
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
    turn = Euler((math.pi / 2 + elevation, 0.0, azimuth)).to_quaternion()
    region_3d.view_rotation = turn
    view()[1].tag_redraw()


def at_rest():
    """Wait until the views show what they are to show, in full, and have been drawn so."""
    redraws = []
    handler = bpy.types.SpaceView3D.draw_handler_add(
        lambda: redraws.append(1), (), "WINDOW", "POST_PIXEL"
    )

    def rests():
        view()[1].tag_redraw()
        if len(redraws) < 3:
            return False
        running = live()._session
        fine = running.progressive.renderer.downscale_factors[1]
        views = running.progressive.views.values()
        return views and all(
            each.texture_key == each.requested_key
            and each.downscale == fine
            and each.requested_key is not None
            for each in views
        )

    try:
        yield from until(rests)
        redraws.clear()
        yield from until(rests)
    finally:
        bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    yield 0.2


def by_hand(space=None, region=None, method="brute"):
    """(h, w, 4) what a bake draws of the view, display values."""
    space = space or view()[1].spaces.active
    region = region or view()[2]
    camera = rosy("rosy_addon.scene.cameras").camera_of_view(region, space.region_3d)
    scene = bpy.context.scene
    look = replace(rosy("rosy_addon.scene.look_properties").read_look(scene.rosy), method=method)
    depsgraph, tones = bpy.context.evaluated_depsgraph_get(), rosy("rosy_addon.scene.tone_inputs")
    wish = tones.make_tone_request(scene, look)
    instances = (
        rosy("rosy_addon.scene.scene_reader").read_scene(depsgraph, tone_request=wish).instances
    )
    lights = rosy("rosy_addon.scene.lights").read_lights(depsgraph, camera.view)
    rendered = tones.load_reference(scene, depsgraph, scene.camera, look)
    gbuffer = rosy("rosy_addon.projection.project").project(instances, camera, look.display)
    compose = rosy("rosy_addon.compositor.compose").compose
    picture = compose(gbuffer, look, lights, rendered).rgba.copy()
    picture[..., :3] = rosy("rosy_addon.color").to_display(picture[..., :3])
    return picture


def is_the_bake(name, least=0.98, most=0.01):
    """See that the screen shows what a bake draws."""
    yield from at_rest()
    seen, drawn = captured(name, view()[2]), by_hand()
    agrees(name, seen, drawn, least, most)


def agrees(name, seen, drawn, least=0.98, most=0.01):
    covered = drawn[..., 3] > 0
    # Blender may see the border a little otherwise.
    inner = covered.copy()
    for axis in (0, 1):
        for way in (-1, 1):
            inner &= np.roll(covered, way, axis)
    one, other = seen[inner].mean(axis=1), drawn[inner][:, :3].mean(axis=1)
    found = np.corrcoef(one, other)[0, 1]
    assert found >= least, f"{name}: correlation {found:.4f}"
    assert abs(one.mean() - other.mean()) < most, f"{name}: {one.mean():.3f} {other.mean():.3f}"
    return found


# The steps


def every_view_is_a_bake():
    """All around, in perspective and without."""
    yield from fresh_scene()
    switch("ON")
    found = []
    for number in range(VIEWS):
        look_from(2 * math.pi * number / VIEWS, -0.6 + 1.2 * (number * 7 % VIEWS) / VIEWS)
        view()[1].spaces.active.region_3d.view_perspective = "ORTHO" if number % 3 == 2 else "PERSP"
        yield from at_rest()
        name = f"live-view-{number:02d}"
        found.append(agrees(name, captured(name, view()[2]), by_hand()))
    print(f"{VIEWS} views: correlation {min(found):.4f} to {max(found):.4f}")
    switch("OFF")
    nothing_is_left()


def off_is_as_before():
    """Switched on and off again, the view is what it was, pixel for pixel."""
    yield from fresh_scene()
    # Blender smooths its own borders over many redraws, and not twice the same.
    bpy.context.preferences.system.viewport_aa = "OFF"
    yield 1.0
    before = captured("live-0-off", view()[2])
    switch("ON")
    yield from at_rest()
    assert (captured("live-1-on", view()[2]) != before).any()
    switch("OFF")
    yield 1.0
    bpy.context.preferences.system.viewport_aa = "8"
    after = captured("live-2-off", view()[2])
    assert (after == before).all(), f"{(after != before).any(axis=2).sum()} pixels differ"
    nothing_is_left()


def nothing_is_left():
    assert live()._session is None
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        for handler in handlers if isinstance(handlers, list) else ():
            assert "viewport" not in getattr(handler, "__module__", ""), name


def as_a_user_sees_it():
    """The picture of the documentation: the whole view, with the panel."""
    yield from fresh_scene()
    _, area, region, sidebar = view()
    space = area.spaces.active
    space.show_region_header = space.show_region_ui = True
    space.overlay.show_overlays = space.show_gizmo = True
    space.region_3d.view_distance = 4.2
    look_from_here = Euler((math.pi / 2 - 0.25, 0.0, 0.35)).to_quaternion()
    space.region_3d.view_rotation = look_from_here
    bpy.context.view_layer.objects.active = bpy.data.objects["Suzanne"]
    yield 0.5
    sidebar.active_panel_category = "RoSy"
    switch("ON")
    yield from at_rest()
    captured("live-window", region)
    switch("OFF")
    yield 0.3


def what_is_in_front_hides_it():
    """An opaque cube covers the field; what the cube hides is not drawn over it."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.mesh.primitive_cube_add(size=0.8, location=(0.7, -2.0, 0.2))
        bpy.ops.object.select_all(action="DESELECT")
    yield 1.0
    before = captured("live-cube-off", view()[2])
    switch("ON")
    yield from at_rest()
    seen, drawn = captured("live-cube-on", view()[2]), by_hand()
    agrees("cube", seen, drawn, 0.95)
    bpy.data.objects["Suzanne"].rosy.include = False
    rest = ~(drawn[..., 3] > 0)
    grown = rest.copy()
    for axis in (0, 1):
        for way in (-1, 1):
            grown &= np.roll(rest, way, axis)
    # Blender refines its own borders as it goes on drawing.
    apart = (np.abs(seen[grown] - before[grown]) > 0.1).any(axis=1).mean()
    assert apart < 1e-4, f"{apart:.2%} of what is not the field has changed"


def views_choose_what_they_show():
    """Hidden objects, local view, bounds and wireframe; the frame of a camera; a clipped region."""
    yield from fresh_scene()
    monkey, space = bpy.data.objects["Suzanne"], view()[1].spaces.active
    yield 0.5
    switch("ON")
    yield from at_rest()
    with in_view():
        bpy.ops.mesh.primitive_torus_add(location=(2.5, 0, 0))
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=2)
        bpy.ops.object.select_all(action="DESELECT")
    yield from is_the_bake("live-two-degrees")
    monkey.select_set(True)
    bpy.context.view_layer.objects.active = monkey
    with in_view():
        bpy.ops.view3d.localview(frame_selected=False)
    yield from at_rest()
    torus = bpy.data.objects["Torus"]
    assert [entry.owner for entry in shown()] == [monkey]
    with in_view():
        bpy.ops.view3d.localview(frame_selected=False)
    monkey.select_set(False)
    torus.hide_set(True)
    yield from at_rest()
    assert [entry.owner for entry in shown()] == [monkey]
    torus.hide_set(False)
    torus.display_type = "WIRE"
    yield from at_rest()
    assert [entry.owner for entry in shown()] == [monkey]
    bpy.data.objects.remove(torus)
    yield from is_the_bake("live-one-again")
    camera = add_camera("Camera", (0.0, -6.0, 1.0), (math.radians(80), 0.0, 0.0))
    camera.data.shift_x = 0.1
    bpy.context.scene.camera = camera
    space.region_3d.view_perspective = "CAMERA"
    yield from is_the_bake("live-camera")
    space.region_3d.view_perspective = "PERSP"
    yield 0.5
    switch("OFF")
    yield 0.5


def shown():
    """What the live view draws now."""
    running = live()._session
    (layer,) = running.layers._layers.values()
    space = view()[1].spaces.active
    depsgraph = bpy.context.evaluated_depsgraph_get()
    is_visible = rosy("rosy_addon.viewport.view3d").is_visible
    return [
        entry for entry in layer.instances if is_visible(entry.visibility_object, depsgraph, space)
    ]


def clipped_region():
    """What a clipping region cuts away is not drawn, and Blender agrees on which side it is."""
    yield from fresh_scene()
    region = view()[2]
    middle = region.width // 2
    with in_view():
        bpy.ops.view3d.clip_border(
            xmin=middle, xmax=region.width - 5, ymin=5, ymax=region.height - 5
        )
    yield 0.7
    off = captured("live-clipped-off", region)
    switch("ON")
    yield from at_rest()
    on = captured("live-clipped-on", region)
    changed = (on != off).any(axis=2)
    assert changed[:, middle + 5 :].sum() > 2000
    assert changed[:, : middle - 5].sum() == 0
    switch("OFF")
    with in_view():
        bpy.ops.view3d.clip_border()
    yield 0.5


def tones_are_those_of_a_bake():
    """Painted, in the shadow of something without a field, and as a picture from elsewhere says."""
    yield from fresh_scene()
    scene, monkey = bpy.context.scene, bpy.data.objects["Suzanne"]
    look, mesh = scene.rosy.look, monkey.data
    look.ink, look.grain, look.light, look.shading = "hatch", 3.0, "scene", 0.9
    most = 0.03  # lines are sharp, and a mean of what is on screen is not one of light
    switch("ON")
    yield from at_rest()
    ink = mesh.attributes.new("Ink", "FLOAT", "POINT")
    places = np.array([vertex.co for vertex in mesh.vertices])
    ink.data.foreach_set("value", (0.5 + 0.4 * np.sin(4 * places[:, 0])).astype(np.float32))
    mesh.update()
    scene.rosy.tone_attribute, look.tone = "Ink", "attribute"
    yield from is_the_bake("live-tone-attribute", 0.97, most)
    scene.rosy.tone_attribute = "Pencil"
    view()[1].tag_redraw()
    yield from until(lambda: live()._session.error)
    assert "'Pencil'" in live()._session.error and "'Ink'" in live()._session.error
    look.tone, look.shadows = "light", True
    with in_view():
        bpy.ops.object.light_add(type="SUN", location=(0, 0, 5), rotation=(0.9, 0.3, 0.0))
        bpy.context.object.data.energy = 3.5
        bpy.ops.mesh.primitive_cube_add(size=0.7, location=(0.9, -2.0, 2.4))
        bpy.ops.object.select_all(action="DESELECT")
    yield from is_the_bake("live-tone-shadows", 0.97, most)
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
    yield from is_the_bake("live-tone-picture", 0.97, most)
    os.remove(path)
    switch("OFF")
    yield 0.5
    nothing_is_left()


def quad_view():
    """Four views in one, each from its own side."""
    yield from fresh_scene()
    switch("ON")
    with in_view():
        bpy.ops.screen.region_quadview()
    yield 0.5
    yield from at_rest()
    area = view()[1]
    regions = [region for region in area.regions if region.type == "WINDOW"]
    assert len(regions) == 4
    assert len(live()._session.progressive.views) >= 4
    space = area.spaces.active
    views = [*space.region_quadviews]
    by_size = rosy("rosy_addon.scene.cameras").camera_of_view
    checked = 0
    for region, region_3d in zip(regions, views, strict=True):
        seen = captured("live-quad", region)
        drawn = _of_region(region, region_3d, by_size)
        agrees("quad", seen, drawn, 0.97)
        checked += 1
    assert checked == 4
    with in_view():
        bpy.ops.screen.region_quadview()
    switch("OFF")
    yield 0.5


def _of_region(region, region_3d, by_size):
    class Space:
        pass

    space = Space()
    space.region_3d = region_3d
    return by_hand(space, region)


def edits_are_followed():
    """The look, the place, modifiers, edit mode, sculpting and undo."""
    yield from fresh_scene()
    monkey, scene = bpy.data.objects["Suzanne"], bpy.context.scene
    bpy.context.view_layer.objects.active = monkey
    switch("ON")
    yield from at_rest()
    scene.rosy.look.gain = 1.2
    scene.rosy.look.noise = "colour"
    yield from is_the_bake("live-look")
    with in_view():
        bpy.ops.ed.undo_push(message="look")
    monkey.location.x, monkey.rotation_euler.z, monkey.scale.y = 0.4, 0.5, 1.5
    yield from is_the_bake("live-moved")
    cast = monkey.modifiers.new("Cast", "CAST")
    cast.factor = 0.7
    yield from is_the_bake("live-deformed")
    monkey.modifiers.remove(monkey.modifiers["Subdivision"])
    yield from is_the_bake("live-fewer-faces")
    monkey.modifiers.remove(cast)
    yield from is_the_bake("live-bare-mesh")
    with in_view():
        bpy.ops.ed.undo_push(message="bare")
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.resize(value=(1.0, 1.0, 1.08))
    yield from at_rest()
    edited = captured("live-edited", view()[2])
    with in_view():
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from is_the_bake("live-after-edit")
    assert np.corrcoef(edited.ravel(), captured("live-x", view()[2]).ravel())[0, 1] > 0.5
    if bpy.app.version >= (5, 0):  # before, Blender crashes on this operator in a script
        with in_view():
            bpy.ops.object.mode_set(mode="SCULPT")
            bpy.ops.sculpt.mesh_filter(type="SCALE", strength=0.1)
            bpy.ops.object.mode_set(mode="OBJECT")
        yield from is_the_bake("live-sculpted")
    with in_view():
        bpy.ops.ed.undo_push(message="sculpted")
        bpy.ops.ed.undo()
    yield 0.5
    yield from is_the_bake("live-undone")
    switch("OFF")
    yield 0.5


def animation_is_in_step():
    """Every frame of an armature's animation shows the mesh as it is in that frame."""
    live().stop()
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
    yield from at_rest()
    assert sum(len(e.instance.surface.triangles) for e in shown()) == 50_000
    found = []
    for frame in range(1, frames + 1):
        bpy.context.scene.frame_set(frame)
        yield from at_rest()
        name = f"live-frame-{frame:02d}"
        found.append(agrees(name, captured(name, view()[2]), by_hand()))
    print(f"{frames} frames of 50,000 triangles: correlation from {min(found):.4f}")
    # Played, each redraw shows the frame that is current, be it as coarse as it takes.
    steps = []

    def note(*_):
        running = live()._session
        now = {each.requested_key for each in running.progressive.views.values()}
        steps.append(
            (
                bpy.context.scene.frame_current,
                all(
                    each.texture_key == each.requested_key
                    for each in running.progressive.views.values()
                ),
                now,
            )
        )

    handler = bpy.types.SpaceView3D.draw_handler_add(note, (), "WINDOW", "POST_PIXEL")
    with in_view():
        bpy.ops.screen.animation_play()
    yield 4.0
    with in_view():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")
    played = {frame for frame, _, _ in steps}
    assert len(played) >= 3, f"{len(played)} frames were drawn"
    assert all(shows for _, shows, _ in steps)
    print(f"played: {len(steps)} redraws of {len(played)} frames in 4 s")
    switch("OFF")
    yield 0.5


def _tube(around, along):
    """A tube of 2 x around x along triangles, with a field along and around it."""
    turn = np.arange(around) * 2 * np.pi / around
    height = np.linspace(-1.5, 1.5, along + 1)
    points = np.stack(
        [
            np.tile(0.5 * np.cos(turn), along + 1),
            np.tile(0.5 * np.sin(turn), along + 1),
            np.repeat(height, around),
        ],
        axis=1,
    )
    here = np.arange(along)[:, None] * around + np.arange(around)
    right = np.roll(here, -1, axis=1)
    faces = np.concatenate(
        [
            np.stack([here, right, right + around], axis=-1).reshape(-1, 3),
            np.stack([here, right + around, here + around], axis=-1).reshape(-1, 3),
        ]
    )
    mesh = bpy.data.meshes.new("Tube")
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    mesh.shade_smooth()
    thing = bpy.data.objects.new("Tube", mesh)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    with in_view():
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="axis", degree=4)
    thing.select_set(False)
    return thing


def _bend(thing, frames):
    """Bones that bend it in the middle, more and more."""
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
    height = np.array([vertex.co.z for vertex in thing.data.vertices])
    share = np.clip(0.5 + height, 0, 1)
    for name, weights in (("lower", 1 - share), ("upper", share)):
        group = thing.vertex_groups.new(name=name)
        for number, weight in enumerate(weights.tolist()):
            group.add([number], weight, "REPLACE")
    thing.modifiers.new("Armature", "ARMATURE").object = bones
    posed = bones.pose.bones["upper"]
    posed.rotation_mode = "XYZ"
    for frame, angle in ((1, 0.0), (frames, 1.3)):
        posed.rotation_euler = (0.0, 0.0, angle * 0.3)
        posed.rotation_euler.x = angle
        posed.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_end = frames


def without_the_card():
    """A driver that refuses a shader: the processor draws, says so once, and the view is usable."""
    yield from fresh_scene()
    sources = rosy("rosy_addon.gpu.passes").ComputePass
    before = sources.source
    rosy("rosy_addon.gpu.device").release()
    sources.source = property(lambda self: "void main() { this is not GLSL; }")
    try:
        switch("ON")
        running = live()._session
        yield from until(lambda: running.fallback_reason)
        assert type(running.progressive.renderer).__name__ == "CpuViewportRenderer"
        assert "cannot compile the shader" in running.fallback_reason
        yield from at_rest()
        seen, drawn = captured("live-processor", view()[2]), by_hand(method="sheets")
        # Of another size, its noise is another.
        agrees("processor", seen, drawn, -1.0)
        assert seen[drawn[..., 3] > 0].std() > 0.08
        look_from(0.9, 0.1)
        yield from at_rest()
        seen, drawn = captured("live-processor-turned", view()[2]), by_hand(method="sheets")
        agrees("processor", seen, drawn, -1.0)
        switch("OFF")
    finally:
        sources.source = before
        rosy("rosy_addon.gpu.device").release()
    yield 0.5
    nothing_is_left()


def bad_fields_are_named():
    """A field that cannot be drawn is said in the view, others are drawn, and nothing breaks."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.mesh.primitive_cube_add(location=(2.5, 0, 0))
    cube = bpy.data.objects["Cube"]
    cube.data.attributes.new("rosy", "FLOAT_COLOR", "POINT")
    cube.select_set(False)
    switch("ON")
    yield from at_rest()
    (layer,) = live()._session.layers._layers.values()
    assert "Cube" in layer.scene_cache.errors and "FLOAT_COLOR" in layer.scene_cache.errors["Cube"]
    captured("live-error", view()[2])
    bpy.data.objects.remove(cube)
    yield from is_the_bake("live-no-error")
    assert not layer.scene_cache.errors
    switch("OFF")
    yield 0.5


def nothing_leaks():
    """Switched on and off, files opened, steps undone: memory comes back to where it was."""
    toggles, loads, undos = (500, 200, 100) if MANY else (4, 5, 3)
    yield from fresh_scene(levels=1)
    # On software OpenGL textures lie in the memory of the process: one that stays is seen there.
    cards = []

    def count():
        gc.collect()
        return sum(card.resources.texture_count for card in cards), resident()

    def toggle():
        switch("ON")
        cards[:] = [*cards[-9:], live()._session.progressive.renderer]
        view()[1].tag_redraw()
        yield from until(lambda: cards[-1].resources.texture_count > 8)
        switch("OFF")
        yield 0.02

    for _ in range(4):
        yield from toggle()
    start = count()
    for _ in range(toggles):
        yield from toggle()
    yield 0.5
    nothing_is_left()
    toggled = count()
    switch("ON")
    yield from at_rest()
    for number in range(undos):
        with in_view():
            bpy.data.objects["Suzanne"].location.z = 0.01 * (number % 5)
            bpy.ops.ed.undo_push(message="move")
            bpy.ops.ed.undo()
        yield 0.1
        assert live()._session is not None, f"switched off by undo {number}"
    switch("OFF")
    yield 0.5
    undone = count()
    path = str(SHOTS / "leak.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    for number in range(loads):
        switch("ON")
        view()[1].tag_redraw()
        yield 0.1
        bpy.ops.wm.open_mainfile(filepath=path)
        yield 0.1
        assert live()._session is None
        if number == 3:
            opened_first = count()
    opened = count()
    print(
        f"textures and MiB: {start}, {toggled} toggled, {undone} undone, "
        f"{opened_first} and {opened} opened"
    )
    os.remove(path)
    assert start[0] == toggled[0] == undone[0] == opened[0] == 0
    per = (toggled[1] - start[1]) / toggles, (opened[1] - opened_first[1]) / max(loads - 4, 1)
    if MANY:
        assert max(per) < 0.1, f"MiB a toggle and a file: {per}"
    nothing_is_left()


def resident():
    """MiB of memory that this process holds."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return 0.0


def time_of_a_toggle():
    """Switched off with the extension, no trace is left."""
    yield from fresh_scene(levels=1)
    switch("ON")
    yield from at_rest()
    start = time.monotonic()
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.rosy")
    yield 0.5
    assert time.monotonic() - start < 20
    assert live()._session is None


ONLY = os.environ.get("ROSY_LIVE_ONLY", "").split()

STEPS = (
    every_view_is_a_bake,
    off_is_as_before,
    as_a_user_sees_it,
    what_is_in_front_hides_it,
    views_choose_what_they_show,
    clipped_region,
    tones_are_those_of_a_bake,
    quad_view,
    edits_are_followed,
    animation_is_in_step,
    without_the_card,
    bad_fields_are_named,
    nothing_leaks,
    time_of_a_toggle,
)

watch(*(step for step in STEPS if not ONLY or step.__name__ in ONLY))
