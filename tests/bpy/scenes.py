"""Scenes: how they are opened, read and rendered, and what they hold."""

import bpy
import numpy as np
import pytest
from harness.blender_data import contents, member_vectors, pixels, render_image  # noqa: F401
from harness.steps import each_step  # noqa: F401
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.projection.project import project
from rosy.rosy_addon.scene.cameras import camera_of_object
from rosy.rosy_addon.scene.look_inputs import FIELDS_ONLY
from rosy.rosy_addon.scene.scene_reader import read_scene
from rosy.rosy_addon.scene.visible_objects import shown_instances


def expect_error(match, function, *arguments, **options):
    """Call a function, which raises a RosyError with this text."""
    with pytest.raises(RosyError, match=match):
        function(*arguments, **options)


def empty_scene(size):
    """Open an empty file, and return its scene, which renders squares of `size` pixels."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    return scene


def depsgraph():
    return bpy.context.evaluated_depsgraph_get()


def reopen(path):
    """Save and open the file, and return its scene."""
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def render(scene, path, *, samples=16, box=True, engine="CYCLES"):
    """Render the scene, and return (H, W, 4) linear values, not premultiplied."""
    scene.display.render_aa = "32"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, 1
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type = "BOX" if box else "BLACKMAN_HARRIS"
    cycles.filter_width = 1.0 if box else 1.5
    values = render_image(scene, path, engine)
    alpha = values[..., 3:]
    np.divide(values[..., :3], alpha, out=values[..., :3], where=alpha > 0)
    return values


def read_instances(depsgraph):
    """Read the mesh instances of a scene, as bakes do."""
    return read_scene(depsgraph).instances


def projected(camera, instances=None, display="smooth"):
    """Return the G-buffer of a camera, by default of the scene as it is read."""
    instances = read_instances(depsgraph()) if instances is None else instances
    view = camera_of_object(bpy.context.scene, depsgraph(), camera)
    return project(instances, view, display)


def read_live(reader, request=FIELDS_ONLY, **options):
    """Read the objects with a field as the live view does, in one step."""
    instances = shown_instances(depsgraph(), include_occluders=False)
    return reader.read(instances, request, **options)


def assert_same_directions(first, second, degrees=0.5, percentile=99.0):
    """Most directions of two G-buffers are the same."""
    same = np.intersect1d(first.pixel, second.pixel, return_indices=True)[1:]
    assert len(same[0]) > 0.99 * len(first.pixel)
    z, w = first.representation[same[0]], second.representation[same[1]]
    usable = np.abs(z) > 1e-3 * np.abs(z).max()
    error = np.degrees(np.abs(np.angle(z * w.conj()))) / 4
    assert np.percentile(error[usable], percentile) < degrees
