"""Objects for scenes, renders of scenes, and the contents of a file."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from harness.blender_data import contents, member_vectors, pixels, render_image  # noqa: F401
from mathutils import Vector
from rosy.rosy_addon.core.errors import RosyError
from rosy.rosy_addon.field.generate import GeneratorSettings, generate
from rosy.rosy_addon.scene.look_inputs import FIELDS_ONLY
from rosy.rosy_addon.scene.mesh_fields import write_mesh_field
from rosy.rosy_addon.scene.meshes import mesh_surface
from rosy.rosy_addon.scene.scene_reader import read_scene
from rosy.rosy_addon.scene.visible_objects import shown_instances
from rosy.rosy_addon.worker.job import Call


def expect_error(match, function, *arguments, **options):
    """Call a function, which raises a RosyError with this text."""
    with pytest.raises(RosyError, match=match):
        function(*arguments, **options)


def each_step(steps):
    """Yield what a job yields, and make its calls. Closing this generator cancels the job."""
    answer = None
    try:
        while True:
            try:
                step = steps.send(answer)
            except StopIteration:
                return
            yield step
            answer = step() if isinstance(step, Call) else None
    finally:
        steps.close()


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


def link(obj):
    """Put an object into the scene."""
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_camera(name="Camera", location=(0.0, -5.0, 0.5), target=(0.0, 0.0, 0.0)):
    camera = link(bpy.data.objects.new(name, bpy.data.cameras.new(name)))
    aim(camera, location, target)
    return camera


def aim(camera, location, target=(0.0, 0.0, 0.0)):
    """Place a camera so that it looks at a target."""
    camera.location = location
    toward = Vector(target) - Vector(location)
    camera.rotation_euler = toward.to_track_quat("-Z", "Y").to_euler()
    bpy.context.view_layer.update()


def add_monkey(location=(0.0, 0.0, 0.0)):
    bpy.ops.mesh.primitive_monkey_add(location=location)
    bpy.ops.object.shade_smooth()
    return bpy.context.object


def add_mesh(name, vertices, faces, edges=()):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, edges, faces)
    return link(bpy.data.objects.new(name, mesh))


def add_plane(name="Plane", size=1.0, cuts=1):
    """Add a square in the plane y = 0 that faces -y."""
    line = np.linspace(-size, size, cuts + 1)
    vertices = [(x, 0.0, z) for z in line for x in line]
    row = cuts + 1
    faces = [
        (j * row + i, j * row + i + 1, (j + 1) * row + i + 1, (j + 1) * row + i)
        for j in range(cuts)
        for i in range(cuts)
    ]
    return add_mesh(name, vertices, faces)


def add_nodes(obj, *node_types):
    """Add a modifier that passes a mesh through a chain of geometry nodes."""
    group = bpy.data.node_groups.new("Chain", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Mesh", in_out=direction, socket_type="NodeSocketGeometry")
    source, target = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    last = source.outputs[0]
    for node_type in node_types:
        node = group.nodes.new(node_type)
        geometry = next((socket for socket in node.inputs if socket.type == "GEOMETRY"), None)
        if geometry is not None:
            group.links.new(last, geometry)
        last = node.outputs[0]
    group.links.new(last, target.inputs[0])
    modifier = obj.modifiers.new("Nodes", "NODES")
    modifier.node_group = group
    return group


def add_uv(mesh):
    """Add a UV map from 0 to 1 over the square of `add_plane`."""
    layer = mesh.uv_layers.new(name="Map")
    for loop, corner in zip(mesh.loops, layer.uv, strict=True):
        position = mesh.vertices[loop.vertex_index].co
        corner.vector = position.x / 2 + 0.5, position.z / 2 + 0.5


def add_field(obj, kind="curvature", degree=4, axis=(0.0, 0.0, 1.0)):
    field = generate(mesh_surface(obj.data), GeneratorSettings(kind, axis), degree)
    write_mesh_field(obj.data, field)
    return obj


def set_attribute(mesh, values, name="rosy", domain="FACE", kind="FLOAT_VECTOR"):
    """Store values in a new attribute, as another program would."""
    old = mesh.attributes.get(name)
    if old is not None:
        mesh.attributes.remove(old)
    attribute = mesh.attributes.new(name, kind, domain)
    key = {"VECTOR": "vector", "COLOR": "color"}.get(kind.rpartition("_")[2], "value")
    number = np.int32 if kind == "INT" else np.float32
    attribute.data.foreach_set(key, np.asarray(values, dtype=number).ravel())
    mesh.update()


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


def read_live(reader, request=FIELDS_ONLY, **options):
    """Read the objects with a field as the live view does, in one step."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    instances = shown_instances(depsgraph, include_occluders=False)
    return reader.read(instances, request, **options)


def assert_same_directions(first, second, degrees=0.5, percentile=99.0):
    """Most directions of two G-buffers are the same."""
    same = np.intersect1d(first.pixel, second.pixel, return_indices=True)[1:]
    assert len(same[0]) > 0.99 * len(first.pixel)
    z, w = first.representation[same[0]], second.representation[same[1]]
    usable = np.abs(z) > 1e-3 * np.abs(z).max()
    error = np.degrees(np.abs(np.angle(z * w.conj()))) / 4
    assert np.percentile(error[usable], percentile) < degrees
