"""Renders of the baked material, compared with the picture of the compositor."""

from itertools import product

import bpy
import numpy as np
import pytest
from objects import add_field, add_instance, add_plane, aim, link
from rosy.rosy_addon.compositor.look import Look
from rosy.rosy_addon.core.color import to_display
from rosy.rosy_addon.jobs.bake import bake
from scenes import render

#: No shading, so that only the picture is compared.
LOOK = Look(shading=0.0)

#: For 8-bit values, and for lookups that fall into an adjacent pixel.
TOLERANCE = 0.004


def difference(scene, path, picture, **options):
    """Return the mean absolute difference of display values on covered pixels, and their share."""
    rendered = render(scene, path, **options)
    assert rendered.shape == picture.rgba.shape
    covered = (picture.rgba[..., 3] > 0.999) & (rendered[..., 3] > 0.999)
    error = to_display(rendered[..., :3]) - to_display(picture.rgba[..., :3])
    return np.abs(error[covered]).mean(), covered.mean()


def odd_pixels(scene, camera, monkey):
    """A wide, shifted lens, a vertical sensor, and pixels that are not square."""
    camera.data.lens, camera.data.sensor_fit, camera.data.sensor_height = 20.0, "VERTICAL", 30.0
    camera.data.shift_x, camera.data.shift_y = 0.11, -0.07
    scene.render.resolution_x, scene.render.resolution_y = 160, 96
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 1.4


def orthographic(scene, camera, monkey):
    camera.data.type = "ORTHO"
    camera.data.ortho_scale = 3.0
    camera.data.shift_x = 0.1


def large_face(scene, camera, monkey):
    """One quad at a steep angle, where interpolated texture coordinates would be wrong."""
    bpy.data.objects.remove(monkey)
    plane = add_field(add_plane(), kind="axis")
    plane.rotation_euler = (1.2, 0.3, 0.5)
    camera.data.lens = 15.0
    aim(camera, (0.0, -1.2, 0.0))


def instances(scene, camera, monkey):
    """Each instance of a collection shows its own part of the picture."""
    collection = bpy.data.collections.new("Monkeys")
    scene.collection.objects.unlink(monkey)
    collection.objects.link(monkey)
    for x, angle in ((-0.9, 0.4), (0.9, -0.8)):
        empty = add_instance(collection, (x, 0, 0))
        empty.rotation_euler.z, empty.scale = angle, (0.7, 0.7, 0.7)


def shared_mesh(scene, camera, monkey):
    """Two objects of a mesh that a shape key deforms."""
    monkey.shape_key_add(name="Basis")
    key = monkey.shape_key_add(name="Long")
    for point in key.data:
        point.co.z *= 1.5
    key.value = 0.7
    monkey.location.x = -0.9
    other = link(bpy.data.objects.new("Other", monkey.data))
    other.location, other.scale = (1.0, 0.5, 0.0), (1.0, 1.0, 1.4)


CHANGES = [large_face, instances, shared_mesh]
CAMERAS = [odd_pixels, orthographic]


@pytest.mark.parametrize(
    ("change", "placement"),
    [*product(CAMERAS, ["PROJECTION", "WINDOW"]), *((change, "PROJECTION") for change in CHANGES)],
)
def test_the_render_is_the_picture(scene, camera, monkey, tmp_path, change, placement):
    change(scene, camera, monkey)
    scene.rosy.placement = placement
    (baked,) = bake(scene, look=LOOK)
    error, share = difference(scene, tmp_path / "render.exr", baked.picture)
    assert share > 0.02 and error < TOLERANCE


@pytest.mark.parametrize("as_float", [False, True])
def test_subdivided(scene, camera, monkey, tmp_path, as_float):
    modifier = monkey.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = 2
    scene.rosy.image_format = "FLOAT" if as_float else "BYTE"
    (baked,) = bake(scene, look=LOOK)
    assert baked.image.is_float == as_float
    error, _ = difference(scene, tmp_path / "render.exr", baked.picture)
    assert error < (1e-3 if as_float else TOLERANCE)


def test_camera_and_object_moved_together(scene, camera, monkey, tmp_path):
    """Object and camera moved together show the same picture, with the baked projection."""
    (baked,) = bake(scene, look=LOOK)
    parent = link(bpy.data.objects.new("Parent", None))
    for obj in (camera, monkey):
        obj.parent = parent
    parent.location, parent.rotation_euler = (1.0, 2.0, -0.5), (0.3, -0.2, 1.0)
    assert difference(scene, tmp_path / "render.exr", baked.picture)[0] < TOLERANCE
