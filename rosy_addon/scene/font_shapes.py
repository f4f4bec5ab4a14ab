"""Lines of text as triangles, in Blender's own font."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from .meshes import read_collection, vertex_positions

#: Points of each curve of a letter, for large letters too.
CURVE_RESOLUTION = 6


class FontShapes:
    """The triangles of lines of text. Each is read once."""

    def __init__(self) -> None:
        self._shapes: dict[str, np.ndarray] = {}

    def triangles(self, text: str) -> np.ndarray:
        """Return the (n, 3, 2) triangles of a text of size 1, from its left end and baseline."""
        if text not in self._shapes:
            with _font_object(text) as obj:
                self._shapes[text] = _flat_triangles(obj)
        return self._shapes[text]

    def width(self, text: str) -> float:
        """Return the width of a text of size 1."""
        triangles = self.triangles(text)
        return float(triangles[..., 0].max()) if len(triangles) else 0.0


@contextmanager
def _font_object(text: str) -> Iterator[bpy.types.Object]:
    """Yield an object with a text, which is in no scene. It is removed at the end."""
    fonts = set(bpy.data.fonts)
    curve = bpy.data.curves.new("RoSy text", type="FONT")
    created: list[bpy.types.ID] = [curve]
    try:
        curve.body = text
        curve.resolution_u = CURVE_RESOLUTION
        obj = bpy.data.objects.new(curve.name, curve)
        created.insert(0, obj)
        yield obj
    finally:
        # The font may have come with the curve.
        bpy.data.batch_remove([*created, *(set(bpy.data.fonts) - fonts)])


def _flat_triangles(obj: bpy.types.Object) -> np.ndarray:
    """Return the (n, 3, 2) triangles of the mesh of an object, moved so that the least x is 0."""
    mesh = obj.to_mesh()
    try:
        mesh.calc_loop_triangles()
        points = vertex_positions(mesh)[:, :2].astype(np.float64)
        corners = read_collection(mesh.loop_triangles, "vertices", np.int32, 3)
    finally:
        obj.to_mesh_clear()
    triangles = points[corners]
    if len(triangles):
        triangles[..., 0] -= triangles[..., 0].min()
    return triangles
