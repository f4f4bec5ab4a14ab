"""What the tests of the live view in a window share: its scenes, and what the screen has to show."""

import functools
import math
import time
from dataclasses import replace
from unittest.mock import patch

import bpy
import numpy as np
from conftest import add_suzanne
from extension import rosy
from mathutils import Euler
from monkey_checks import handlers
from window_steps import call_in_view, capture, in_view, redraws, view, wait_until

#: Seconds for which a window at rest is measured, and CPU seconds that it may take in each of them:
#: it looks for closed views, and draws no pixel.
REST_SECONDS, REST_LOAD = 0.8, 0.08


def session_module():
    return rosy("rosy_addon.viewport.session")


def messages():
    """Return what the live view says."""
    return session_module().messages(view()[1])


def switch(show, **options):
    assert call_in_view(bpy.ops.rosy.viewport, show=show, **options) == {"FINISHED"}


def bare_view():
    """Hide everything in the 3D view but the scene, and return its space."""
    _, area, _, _ = view()
    space = area.spaces.active
    space.overlay.show_overlays = space.show_gizmo = False
    space.show_region_header = space.show_region_tool_header = False
    space.show_region_toolbar = space.show_region_ui = False
    space.shading.type = "SOLID"
    return space


def fresh_scene(levels=2):
    """Create a scene with Suzanne and a field, in a bare view."""
    session_module().stop()
    bpy.context.preferences.system.viewport_aa = "8"
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.5
    with in_view():
        add_suzanne(levels)
        bpy.ops.object.shade_smooth()
        bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
        bpy.ops.object.select_all(action="DESELECT")
    space = bare_view()
    space.region_3d.view_distance = 7.0
    space.region_3d.view_perspective = "PERSP"
    look_from(0.3, -0.3)
    yield 0.5
    # Blender's own antialiasing continues over many redraws, and its result varies. Without it, the first
    # picture from a side has black pixels at silhouettes.
    bpy.context.preferences.system.viewport_aa = "OFF"


def look_from(azimuth, elevation):
    region_3d = bare_view().region_3d
    rotation = Euler((math.pi / 2 + elevation, 0.0, azimuth)).to_quaternion()
    region_3d.view_rotation = rotation
    view()[1].tag_redraw()


def wait_for_final_pictures():
    """Wait until all views have drawn their final pictures."""

    def rests():
        view()[1].tag_redraw()
        session = session_module()._session
        final_downscale = session.progressive.renderer.downscale_factors[1]
        views = session.progressive.views.values()
        are_final = all(
            view.shown is not None
            and view.shown.request.key == view.requested.key
            and view.shown.downscale == final_downscale
            for view in views
        )
        return len(drawn) >= 3 and views and are_final

    with redraws() as drawn:
        yield from wait_until(rests)
        drawn.clear()
        yield from wait_until(rests)
    yield 0.2


def bake_of_view(region=None, region_3d=None, method="brute"):
    """Return the picture that a bake draws of a region, (h, w, 4) display values."""
    region = region or view()[2]
    region_3d = region_3d or view()[1].spaces.active.region_3d
    camera = rosy("rosy_addon.scene.cameras").camera_of_view(region, region_3d)
    scene, depsgraph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    look = replace(rosy("rosy_addon.scene.look_properties").read_look(scene.rosy), method=method)
    (drawn,), _ = rosy("rosy_addon.scene.read_view").read_views(scene, depsgraph, [camera], look)
    picture = rosy("rosy_addon.rendering.draw").draw_picture(drawn).rgba.copy()
    picture[..., :3] = rosy("rosy_addon.core.color").to_display(picture[..., :3])
    return picture


def check_is_bake(name, min_correlation=0.98, max_difference=0.01, **options):
    """Check that the screen shows the picture that `bake_of_view` draws, and return both."""
    yield from wait_for_final_pictures()
    drawn = bake_of_view(**options)
    seen = capture(name, options.get("region") or view()[2])
    inside = eroded(drawn[..., 3] > 0)
    seen_tones, drawn_tones = seen[inside].mean(axis=1), drawn[inside][:, :3].mean(axis=1)
    correlation = np.corrcoef(seen_tones, drawn_tones)[0, 1]
    means = seen_tones.mean(), drawn_tones.mean()
    assert correlation >= min_correlation, f"{name}: correlation {correlation:.4f}"
    assert abs(means[0] - means[1]) < max_difference, f"{name}: {means}"
    return seen, drawn


def eroded(mask):
    """Return a mask without its border, which Blender may draw differently."""
    inside = mask.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inside &= np.roll(mask, step, axis)
    return inside


def live(levels=2, *, is_on=True):
    """Return a decorator for a step: it begins with a view of Suzanne, live or not, which is off afterwards."""

    def decorate(step):
        @functools.wraps(step)
        def run():
            yield from fresh_scene(levels)
            if is_on:
                switch("ON")
                yield from wait_for_final_pictures()
            yield from step(bpy.data.objects["Suzanne"])
            switch("OFF")
            yield 0.5
            check_nothing_is_left()

        return run

    return decorate


def check_nothing_is_left():
    assert session_module()._session is None and not handlers()


def visible_owners():
    """Return the objects that the live view draws now."""
    (layer,) = session_module()._session.layers._layers.values()
    space = view()[1].spaces.active
    depsgraph = bpy.context.evaluated_depsgraph_get()
    is_visible = rosy("rosy_addon.viewport.view3d").is_visible
    shown = (e for e in layer.instances if is_visible(e.visibility_object, depsgraph, space))
    return [entry.owner for entry in shown]


def load_at_rest():
    """Wait until the window rests, and return the CPU seconds that it takes in each second."""
    yield 0.7
    start = time.process_time()
    yield REST_SECONDS
    return (time.process_time() - start) / REST_SECONDS


def is_live():
    return session_module().is_live(view()[1].spaces.active)


def _remeshed(monkey):
    modifier = monkey.modifiers.new("Rebuild", "REMESH")
    modifier.mode, modifier.voxel_size = "VOXEL", 0.1
    yield
    monkey.modifiers.remove(modifier)


def _no_memory(monkey):
    renderer = type(session_module()._session.progressive.renderer)
    with patch.object(renderer, "texture_steps", side_effect=MemoryError):
        bpy.context.scene.rosy.look.seed += 1
        yield
    bpy.context.scene.rosy.look.seed += 1


#: Causes of a view that shows no field: in the scene, and while it is drawn; and words of the message.
CAUSES = (
    (_remeshed, ("'Suzanne'", "Rebuild", "no attribute 'rosy'")),
    (_no_memory, ("not enough memory",)),
)
