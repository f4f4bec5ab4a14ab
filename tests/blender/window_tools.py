"""The tools of RoSy in a window, used with the mouse: singularities, the comb, and annotations as guides.

Run by run.py, as window_panel.py is.
"""

import math

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from conftest import member_vectors
from extension import rosy
from mathutils import Vector
from window_steps import call_in_view, fresh_scene, in_view, redraw_view, view, wait_until


def fresh_sphere(segments=48, ring_count=24, **options):
    """Create a scene in which a sphere is the only object."""
    yield from fresh_scene()
    with in_view():
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
        bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=ring_count, **options)


def test_singularities_dragged_with_the_tool():
    """Move one, undo that, and drag a new pair apart with Ctrl."""
    yield from fresh_sphere()
    with in_view():
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
    yield from wait_until(lambda: overlay.shown(bpy.data.objects["Sphere"]) is not None)
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
    call_in_view(bpy.ops.ed.undo)
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
    call_in_view(bpy.ops.wm.tool_set_by_id, name="builtin.select_box")
    assert overlay.shown(bpy.context.object) is None


def test_field_combed_with_the_tool():
    """Comb a mesh with modifiers, and undo, replay and take back strokes; in Object Mode and in Sculpt Mode."""
    for mode, tool in (("OBJECT", "rosy.comb_tool"), ("SCULPT", "rosy.comb_sculpt_tool")):
        yield from fresh_sphere()
        with in_view():
            bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
            bpy.context.object.modifiers.new("Wave", "CAST").factor = -0.2
            bpy.ops.rosy.field_generate("EXEC_DEFAULT", True, kind="smoothest", degree=4)
            bpy.ops.object.mode_set(mode=mode)
            bpy.ops.view3d.view_axis(type="FRONT")
            bpy.ops.view3d.view_selected()
            bpy.ops.wm.tool_set_by_id(name=tool)
            bpy.ops.ed.undo_push(message="Before the stroke")
        yield from redraw_view()
        yield from comb()
        if mode == "OBJECT":  # drags that do not meet the mesh select
            yield from drag((-1.15, -0.9, 0.3), (-1.15, -0.9, -0.3))
            yield 0.3
            assert bpy.context.selected_objects
            yield from drag((-1.15, -0.9, 0.0), (-1.15, -0.9, 0.0))
            yield from wait_until(lambda: not bpy.context.selected_objects)
        with in_view():
            brush = "builtin.select_box" if mode == "OBJECT" else "builtin.brush"
            bpy.ops.wm.tool_set_by_id(name=brush)
            bpy.ops.object.mode_set(mode="OBJECT")


def test_annotations_guide_a_field():
    """A stroke of the Annotate tool across the middle of a sphere, drawn on its surface."""
    yield from fresh_sphere(64, 32, location=(0.5, 0.0, 0.0))
    scene = bpy.context.scene
    call_in_view(bpy.ops.view3d.view_axis, type="FRONT")
    view()[1].spaces.active.region_3d.view_distance = 5.0
    view()[1].spaces.active.region_3d.view_perspective = "ORTHO"
    yield 0.5
    scene.tool_settings.annotation_stroke_placement_view3d = "SURFACE"
    call_in_view(bpy.ops.wm.tool_set_by_id, name="builtin.annotate")
    yield from drag((0.0, -1.0, -0.5), (1.0, -1.0, 0.5), move_count=20)
    settings = {"kind": "guided", "degree": 2, "guides": {"ANNOTATIONS"}}
    call_in_view(bpy.ops.rosy.field_generate, "EXEC_DEFAULT", True, **settings)
    call_in_view(bpy.ops.wm.tool_set_by_id, name="builtin.select_box")
    mesh = bpy.context.object.data
    center = np.array([face.center for face in mesh.polygons])
    x, y, z = center.T
    near = (np.abs(x - z) < 0.05) & (np.abs(x) < 0.4) & (y < 0.0)
    assert near.sum() > 5
    direction = member_vectors(mesh)[near]
    angle = np.degrees(np.arctan2(direction[:, 2], direction[:, 0])) % 180.0
    assert np.abs(angle - 45.0).max() < 5.0, angle


def comb():
    """Comb the sphere, undo that, replay the stroke as a script does, and take back another stroke with ESC."""
    before = field_bytes()
    yield from drag((-0.4, -0.9, 0.2), (0.4, -0.8, 0.3))
    yield from wait_until(lambda: "rosy_guides" in field_mesh().attributes)
    combed = field_bytes()
    assert combed != before
    operator = bpy.context.window_manager.operators[-1]
    assert operator.bl_idname == "ROSY_OT_field_comb", operator.bl_idname
    names = ("name", "location", "pressure", "is_start")
    stroke = [{name: getattr(point, name) for name in names} for point in operator.stroke]
    stroke = [{**point, "location": tuple(point["location"])} for point in stroke]
    settings = {"radius": operator.radius, "strength": operator.strength}
    undo, redo = bpy.ops.ed.undo, bpy.ops.ed.redo
    for operator, expected in ((undo, before), (redo, combed), (undo, before)):
        call_in_view(operator)
        yield 0.3
        assert field_bytes() == expected
    call_in_view(bpy.ops.rosy.field_comb, "EXEC_DEFAULT", True, stroke=stroke, **settings)
    assert field_bytes() == combed
    yield from move_mouse((-0.4, -0.9, -0.2), "LEFTMOUSE", "PRESS")
    yield from move_mouse((0.3, -0.9, -0.3))
    assert field_bytes() != combed
    yield from move_mouse((0.3, -0.9, -0.3), "ESC", "PRESS")
    assert field_bytes() == combed
    # A stroke may begin beside the mesh.
    yield from drag((-1.15, -0.9, 0.0), (0.2, -0.9, -0.3))
    yield from wait_until(lambda: field_bytes() != combed)
    assert bpy.context.object.location.length == 0


def field_mesh():
    """Return the mesh that holds the active object's field."""
    return rosy("rosy_addon.scene.datablocks").field_mesh(bpy.context.object)


def field_bytes():
    """Return the vectors of the active object's field."""
    return member_vectors(field_mesh()).tobytes()


def shown_singularities():
    """Return the indices of the sphere's singularities that the overlay shows, by their vertices."""
    shown = rosy("rosy_addon.ui.overlay").shown(bpy.data.objects["Sphere"])
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


def drag(start, end, move_count=1, **keys):
    """Drag from a point of the scene to another one, with a number of moves between them."""
    yield from move_mouse(start, "LEFTMOUSE", "PRESS", **keys)
    for point in np.linspace(start, end, move_count + 2)[1:-1]:
        yield from move_mouse(point, **keys)
    yield from move_mouse(end, "LEFTMOUSE", "RELEASE")
