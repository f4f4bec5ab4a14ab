"""Strokes in a full Blender: drawn by the operator, rendered where they are, undone, taken away."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from itertools import pairwise

import bpy
import numpy as np
import pytest
from conftest import contents, error_of

SVG = "{http://www.w3.org/2000/svg}"


def stroke_objects():
    return [thing for thing in bpy.data.objects if thing.type in ("GREASEPENCIL", "CURVES")]


@pytest.fixture
def drawn(with_field, scene):
    """Suzanne with a field, and what is asked of her strokes."""
    settings = scene.rosy.strokes
    settings.spacing, settings.width, settings.outline, settings.taper = 7.0, 2.0, True, 0.0
    return with_field


def ink(scene, path, engine="BLENDER_WORKBENCH"):
    """(H, W) how much ink covers each pixel of a render of the strokes alone, rows from the top."""
    for thing in bpy.data.objects:
        thing.hide_render = thing.type == "MESH"
    scene.render.engine = engine
    scene.render.film_transparent = True
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGBA", "8"
    if engine == "CYCLES":
        scene.cycles.samples, scene.cycles.use_denoising = 32, False
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    values = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)[::-1, :, 3]


def ink_of_svg(path, width, height, fine=6):
    """(H, W) how much of each pixel the paths of a file cover, by many small discs."""
    canvas = np.zeros((height * fine, width * fine), dtype=bool)
    y, x = np.mgrid[: height * fine, : width * fine] + 0.5
    for group in ElementTree.parse(path).getroot().findall(SVG + "g"):
        for line in group.findall(SVG + "path"):
            r = float(line.get("stroke-width", group.get("stroke-width"))) / 2 * fine
            text = line.get("d")[1:].removesuffix("Z").split()
            points = np.array([[float(v) for v in pair.split(",")] for pair in text]) * fine
            if line.get("d").endswith("Z"):
                points = np.concatenate([points, points[:1]])
            for a, b in pairwise(points):
                steps = int(np.hypot(*(b - a)) / 2) + 1
                for at in a + np.linspace(0, 1, steps + 1)[:, None] * (b - a):
                    rows = slice(max(int(at[1] - r) - 1, 0), max(int(at[1] + r) + 2, 0))
                    columns = slice(max(int(at[0] - r) - 1, 0), max(int(at[0] + r) + 2, 0))
                    box = rows, columns
                    canvas[box] |= np.hypot(x[box] - at[0], y[box] - at[1]) <= r
    return canvas.reshape(height, fine, width, fine).mean(axis=(1, 3))


@pytest.mark.parametrize(
    ("kind", "engine"), [("PENCIL", "BLENDER_WORKBENCH"), ("CURVES", "CYCLES")]
)
def test_renders_show_ink_where_the_file_has_it(drawn, scene, tmp_path, kind, engine):
    path = tmp_path / "strokes.svg"
    assert bpy.ops.rosy.strokes(kind="SVG", filepath=str(path)) == {"FINISHED"}
    expected = ink_of_svg(path, 160, 120)
    assert bpy.ops.rosy.strokes(kind=kind) == {"FINISHED"}
    found = ink(scene, tmp_path / "render.png", engine)
    assert expected.mean() > 0.05
    alike = np.corrcoef(found.ravel(), expected.ravel())[0, 1]

    assert alike > 0.93
    assert np.isclose(found.mean(), expected.mean(), rtol=0.15)
    for step in (-1, 1):
        for axis in (0, 1):
            aside = np.corrcoef(np.roll(found, step, axis).ravel(), expected.ravel())[0, 1]
            assert aside < alike - 0.05


def test_what_is_hidden_is_not_rendered(drawn, scene, tmp_path):
    bpy.ops.mesh.primitive_plane_add(
        size=1.0, location=(0.0, -2.0, 0.6), rotation=(np.pi / 2, 0, 0)
    )
    scene.rosy.strokes.outline, scene.rosy.strokes.spacing = False, 4.0
    assert bpy.ops.rosy.strokes(kind="PENCIL") == {"FINISHED"}
    found = ink(scene, tmp_path / "render.png")
    middle = found[52:68, 72:88]  # what the square covers, and more
    assert found.mean() > 0.03 and middle.max() < 0.02
    scene.rosy.strokes.hidden = True
    bpy.data.objects["Suzanne"].hide_render = False
    assert bpy.ops.rosy.strokes(kind="PENCIL") == {"FINISHED"}
    assert ink(scene, tmp_path / "kept.png")[52:68, 72:88].mean() > 0.1


def test_grease_pencil_data(drawn, scene):
    assert bpy.ops.rosy.strokes(kind="PENCIL") == {"FINISHED"}
    (thing,) = stroke_objects()
    assert [layer.name for layer in thing.data.layers] == ["Family 1", "Family 2", "Outline"]
    for number, layer in enumerate(thing.data.layers):
        drawing = layer.frames[0].drawing
        points = drawing.attributes["position"].data
        for name in ("radius", "opacity"):
            values = np.empty(len(points), dtype=np.float32)
            drawing.attributes[name].data.foreach_get("value", values)
            assert (values > 0).all()
        materials = np.empty(len(drawing.strokes), dtype=np.int32)
        drawing.attributes["material_index"].data.foreach_get("value", materials)
        assert (materials == number).all() and len(drawing.strokes) > 0
        assert not layer.use_lights


@pytest.mark.parametrize("kind", ["PENCIL", "CURVES"])
def test_undo_and_remove(drawn, scene, kind):
    before = contents()
    bpy.ops.ed.undo_push(message="before")
    assert bpy.ops.rosy.strokes(kind=kind) == {"FINISHED"}
    once = contents()
    assert once != before
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert contents() == before
    bpy.ops.ed.redo()
    assert contents() == once
    scene = bpy.context.scene
    scene.rosy.strokes.spacing = 12.0
    assert bpy.ops.rosy.strokes(kind=kind) == {"FINISHED"}
    assert contents() == once
    assert bpy.ops.rosy.strokes_remove() == {"FINISHED"}
    assert contents() == before
    assert not bpy.ops.rosy.strokes_remove.poll()


def test_refusals(drawn, scene, tmp_path):
    before = contents()
    assert ".svg" in error_of(bpy.ops.rosy.strokes, kind="SVG", filepath=str(tmp_path / "a.png"))
    assert "view" in error_of(bpy.ops.rosy.strokes, camera="VIEW")
    scene.rosy.strokes.selected = True
    drawn.select_set(False)
    assert "no selected object" in error_of(bpy.ops.rosy.strokes)
    drawn.select_set(True)
    scene.camera = None
    assert "no active camera" in error_of(bpy.ops.rosy.strokes)
    assert contents() == before
    drawn.rosy.include = False
    assert not bpy.ops.rosy.strokes.poll()
