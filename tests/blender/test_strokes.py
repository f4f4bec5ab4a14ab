"""Strokes in a full Blender: drawn by the operator, rendered, undone and removed."""

import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import bpy
import numpy as np
import pytest
from conftest import contents, render_image
from mathutils.bvhtree import BVHTree

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture
def with_stroke_settings(with_field, scene):
    """Suzanne with a field, and the settings of strokes."""
    settings = scene.rosy.strokes
    settings.spacing, settings.width, settings.outline, settings.taper = 7.0, 2.0, 1.0, 0.0
    settings.from_look = False
    return with_field


def render_strokes(scene, path, engine="BLENDER_WORKBENCH"):
    """Render the strokes alone, and return the (H, W) alpha, rows from the top."""
    for obj in bpy.data.objects:
        obj.hide_render = obj.type == "MESH"
    scene.cycles.samples, scene.cycles.use_denoising = 32, False
    return render_image(scene, path, engine)[::-1, :, 3]


def coverage_of_svg(path, width, height, subpixels=6):
    """Return the (H, W) share of each pixel that the paths of a file cover."""
    canvas = np.zeros((height * subpixels, width * subpixels), dtype=bool)
    y, x = np.mgrid[: height * subpixels, : width * subpixels] + 0.5
    for group in ElementTree.parse(path).getroot().findall(SVG + "g"):
        for line in group.findall(SVG + "path"):
            radius = float(line.get("stroke-width", group.get("stroke-width"))) / 2 * subpixels
            text = line.get("d")[1:].removesuffix("Z").split()
            points = np.array([[float(v) for v in pair.split(",")] for pair in text]) * subpixels
            if line.get("d").endswith("Z"):
                points = np.concatenate([points, points[:1]])
            for a, b in pairwise(points):
                steps = int(np.hypot(*(b - a)) / 2) + 1
                for center in a + np.linspace(0, 1, steps + 1)[:, None] * (b - a):
                    low = (center - radius).astype(int).clip(1) - 1
                    high = (center + radius).astype(int).clip(-2) + 2
                    box = slice(low[1], high[1]), slice(low[0], high[0])
                    canvas[box] |= np.hypot(x[box] - center[0], y[box] - center[1]) <= radius
    return canvas.reshape(height, subpixels, width, subpixels).mean(axis=(1, 3))


@pytest.mark.parametrize(
    ("kind", "engine"), [("PENCIL", "BLENDER_WORKBENCH"), ("CURVES", "CYCLES")]
)
def test_renders_show_the_ink_of_the_file(with_stroke_settings, scene, tmp_path, kind, engine):
    path = tmp_path / "strokes.svg"
    assert bpy.ops.rosy.strokes(kind="FILE", filepath=str(path)) == {"FINISHED"}
    expected = coverage_of_svg(path, 160, 120)
    assert bpy.ops.rosy.strokes(kind=kind) == {"FINISHED"}
    rendered = render_strokes(scene, tmp_path / "render.png", engine)
    assert expected.mean() > 0.05
    correlation = np.corrcoef(rendered.ravel(), expected.ravel())[0, 1]

    assert correlation > 0.93
    assert np.isclose(rendered.mean(), expected.mean(), rtol=0.15)
    for step in (-1, 1):
        for axis in (0, 1):
            shifted = np.corrcoef(np.roll(rendered, step, axis).ravel(), expected.ravel())[0, 1]
            assert shifted < correlation - 0.05


def test_undo_and_remove(with_stroke_settings, scene):
    before = contents()
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.rosy.strokes(kind="PENCIL") == {"FINISHED"}
    drawn_once = contents()
    assert drawn_once != before
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert contents() == before
    bpy.ops.ed.redo()
    assert contents() == drawn_once
    assert bpy.ops.rosy.strokes_remove() == {"FINISHED"}
    assert contents() == before
    assert not bpy.ops.rosy.strokes_remove.poll()


def bent_tube():
    """A tube with a field, and a modifier that can bend it."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=48, radius=0.5, depth=3.0)
    tube = bpy.context.object
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=4)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.object.shade_smooth()
    bpy.ops.rosy.field_generate(kind="form", degree=4)
    bend = tube.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.angle = "BEND", 0.0
    return tube, bend


def evaluated_points(obj):
    """(n, 3) points of curves after their modifiers."""
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([point.position for point in evaluated.data.points])


def test_curves_follow_a_mesh_that_is_bent(scene):
    """Their feet stay on the surface, to a hundredth of the spacing, without a new drawing."""
    tube, bend = bent_tube()
    settings = scene.rosy.strokes
    settings.kind, settings.follow, settings.hidden = "CURVES", True, True
    settings.from_look = False
    assert bpy.ops.rosy.strokes() == {"FINISHED"}
    strokes = next(obj for obj in scene.objects if obj.type == "CURVES")
    drawn = np.array([point.position for point in strokes.data.points])
    points = evaluated_points(strokes)
    rest = np.linalg.norm(points - drawn, axis=1)
    spacing = np.array([item.value for item in strokes.data.attributes["spacing"].data])
    assert np.quantile(rest / spacing, 0.9) < 0.01
    height = strokes.data.attributes["surface_height"].data
    height.foreach_set("value", np.zeros(len(height), dtype=np.float32))
    strokes.data.update_tag()
    for angle in (0.0, 0.5, 1.2):
        bend.angle = tube.location.x = angle
        depsgraph = bpy.context.evaluated_depsgraph_get()
        points = evaluated_points(strokes)
        to_tube = np.array(tube.evaluated_get(depsgraph).matrix_world.inverted())
        to_tube = to_tube @ np.array(strokes.evaluated_get(depsgraph).matrix_world)
        local = points @ to_tube[:3, :3].T + to_tube[:3, 3]
        surface = BVHTree.FromObject(tube, depsgraph)
        distance = np.array([surface.find_nearest(point)[3] for point in local.tolist()])
        assert np.quantile(distance / spacing, 0.99) < 0.01, angle
    assert np.linalg.norm(points - drawn, axis=1).max() > 0.3
    assert bpy.ops.rosy.strokes_remove() == {"FINISHED"}
    assert not bpy.data.hair_curves and not bpy.data.node_groups
