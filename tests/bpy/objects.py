"""Objects for scenes: how they are added, selected and animated, and their attributes."""

import bpy
import numpy as np
from awkward import grid
from mathutils import Vector
from rosy.rosy_addon.field.generate import GeneratorSettings, generate
from rosy.rosy_addon.scene.mesh_fields import write_mesh_field
from rosy.rosy_addon.scene.meshes import mesh_surface


def link(obj):
    """Put an object into the scene."""
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_light(name, kind, energy, location=(0.0, 0.0, 0.0)):
    light = link(bpy.data.objects.new(name, bpy.data.lights.new(name, kind)))
    light.data.energy, light.location = energy, location
    return light


def add_instance(collection, location=(0.0, 0.0, 0.0)):
    """Add an empty that shows a collection."""
    empty = link(bpy.data.objects.new("Instance", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    empty.location = location
    return empty


def animate(owner, path, values):
    """Insert keyframes, given the values by their frames."""
    for frame, value in values.items():
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)


def load(path, name, kind="objects", **options):
    """Link or append a datablock of another file, and return it."""
    with bpy.data.libraries.load(str(path), **options) as (_, target):
        setattr(target, kind, [name])
    return getattr(target, kind)[0]


def select_only(*objects):
    """Select objects; the first one is active."""
    for obj in bpy.context.scene.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0]


def apply_modifiers(obj):
    select_only(obj)
    for modifier in list(obj.modifiers):
        bpy.ops.object.modifier_apply(modifier=modifier.name)


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
    points, faces = grid(cuts)
    vertices = (2 * np.array(points)[:, [0, 2, 1]] / cuts - (1, 0, 1)) * size
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
