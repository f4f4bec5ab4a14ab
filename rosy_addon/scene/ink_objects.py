"""Ink objects: child objects that show a picture over the materials of their parents.

Geometry nodes give an ink object the evaluated geometry of its parent, slightly above the surface. Its material shows
the picture, and is transparent between the lines. So the parent is not changed, and the ink object follows its edits.
"""

import bpy
import numpy as np
from bpy.types import NodeSocket, Object

from .datablocks import INK_TAG, Track
from .node_builder import NodeBuilder

#: Distance of the ink from the surface, relative to the diagonal of the bounding box of the object. It avoids z-fighting, and
#: is less than half a pixel if the object covers a thousand pixels.
INK_OFFSET = 4e-4

#: Properties of an ink object that follow its parent.
_FOLLOWED = ("hide_render", "hide_viewport")


def find_ink_object(obj: Object) -> Object | None:
    """Return the ink object of an object; None if it has none."""
    return next((child for child in obj.children if child.get(INK_TAG)), None)


def new_ink_object(obj: Object, track: Track) -> Object:
    """Create an ink object, without a modifier, in the collections of an object.

    `track` is called with each new datablock; see `datablocks.rollback_on_error`.
    """
    name = f"{obj.name} ink"
    ink = track(bpy.data.objects.new(name, track(bpy.data.meshes.new(name))))
    ink[INK_TAG] = ink.hide_select = True
    ink.parent = obj
    ink.visible_diffuse = ink.visible_shadow = False
    for collection in obj.users_collection:
        collection.objects.link(ink)
    for path in _FOLLOWED:
        driver = ink.driver_add(path).driver
        driver.type = "SUM"
        target = driver.variables.new().targets[0]
        target.id, target.data_path = obj, path
    return ink


def geometry_of_parent(build: NodeBuilder, ink: Object) -> NodeSocket:
    """Add geometry nodes with the evaluated geometry of the parent of an ink object, and return their output."""
    inputs = {"Object": ink.parent}
    return build("GeometryNodeObjectInfo", inputs, transform_space="RELATIVE").outputs["Geometry"]


def lifted(build: NodeBuilder, geometry: NodeSocket, ink: Object) -> NodeSocket:
    """Add geometry nodes that lift geometry by `INK_OFFSET` above the surface, and return their output."""
    low, high = np.array(ink.parent.bound_box)[[0, 6]]
    normal = build("GeometryNodeInputNormal").outputs[0]
    offset = build.scaled(normal, INK_OFFSET * float(np.linalg.norm(high - low)))
    inputs = {"Geometry": geometry, "Offset": offset}
    return build("GeometryNodeSetPosition", inputs).outputs["Geometry"]
