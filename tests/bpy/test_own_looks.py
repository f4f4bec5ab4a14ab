"""Objects and collections with presets of their own, in one picture."""

import bpy
import numpy as np
import pytest
from objects import add_field, add_monkey, add_plane
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.jobs.bake import bake
from rosy.rosy_addon.preset_files.store import load_preset
from rosy.rosy_addon.rendering.draw import draw_picture
from rosy.rosy_addon.scene.look_properties import apply_look, object_looks, read_look
from rosy.rosy_addon.scene.read_view import read_views, scene_depsgraph


@pytest.fixture
def three(scene, camera):
    """A ball in front of a wall and beside another ball, whose collection has a preset."""
    wall = add_field(add_plane("Wall", size=2.5, cuts=4), "axis", 4)
    wall.location.y = 2.0
    figure, other = (add_field(add_monkey(), "axis", 4) for _ in range(2))
    figure.name, other.name = "Figure", "Other"
    figure.scale = other.scale = 0.6, 0.6, 0.6
    figure.location, other.location = (-0.4, -0.5, 0.2), (0.7, 0.6, 0.2)
    group, inner = (bpy.data.collections.new(name) for name in ("Group", "Inner"))
    scene.collection.children.link(group)
    group.children.link(inner)
    scene.collection.objects.unlink(other)
    inner.objects.link(other)
    group.rosy.preset, figure.rosy.preset = "engraving", "pen-and-ink"
    apply_look(scene.rosy, load_preset("cross-hatch").look)
    return wall, figure, other


def drawn(scene, **options):
    (view,), _ = read_views(scene, scene_depsgraph(scene), [scene.camera], **options)
    return draw_picture(view).rgba


def test_pixels_are_those_of_a_picture_with_the_look_alone(scene, three):
    look = read_look(scene.rosy)
    picture, seen = drawn(scene, look=look), np.zeros((128, 128), dtype=int)
    for obj, own in zip(three, object_looks(scene, three, look), strict=True):
        preset, obj.rosy.preset = obj.rosy.preset, ""
        bpy.data.collections["Group"].rosy.preset = ""
        alone = drawn(scene, look=own, objects=[obj])
        bpy.data.collections["Group"].rosy.preset, obj.rosy.preset = "engraving", preset
        inside = alone[..., 3] == 1
        np.testing.assert_array_equal(picture[inside], alone[inside])
        seen += inside
    assert seen.max() == 1 and (seen == 1).sum() > 5000
    # On edges between two meshes, the colors of both are mixed.
    assert (picture[..., 3] == 1).sum() > (seen == 1).sum()


def test_looks_are_inherited(scene, three):
    wall, figure, other = object_looks(scene, three, read_look(scene.rosy))
    assert wall == read_look(scene.rosy)
    assert (figure.ink, figure.outline) == ("hatch", load_preset("pen-and-ink").look.outline)
    assert other.ink == "even"
    # Light and paper are one for all.
    assert len({(look.paper_color, look.light) for look in (wall, figure, other)}) == 1
    three[2].rosy.preset = "pencil"
    assert object_looks(scene, three, Look())[2].ink == "hatch"


def test_pictures_of_several_looks_are_baked(scene, three):
    (result,) = bake(scene)
    pixels = np.array(result.image.pixels[:]).reshape(128, 128, 4)
    assert len(np.unique(np.round(pixels[..., 0], 2))) > 10
    scene.rosy.relight = True
    with pytest.raises(RosyError, match="Relight draws one: switch Relight off"):
        bake(scene)
    scene.rosy.relight = False
    three[1].rosy.preset = "nothing"
    with pytest.raises(RosyError, match="look of object 'Figure': "):
        bake(scene)
