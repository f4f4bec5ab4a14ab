"""Lines of text as triangles, in Blender's own font."""

from __future__ import annotations

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
            self._shapes[text] = _text_triangles(text)
        return self._shapes[text]

    def width(self, text: str) -> float:
        """Return the width of a text of size 1."""
        triangles = self.triangles(text)
        return float(triangles[..., 0].max()) if len(triangles) else 0.0


def _text_triangles(text: str) -> np.ndarray:
    """Return the (n, 3, 2) triangles of a text, moved so that the least x is 0."""
    fonts = set(bpy.data.fonts)
    curve = bpy.data.curves.new("RoSy text", type="FONT")
    created: list[bpy.types.ID] = [curve]
    try:
        curve.body = text
        curve.resolution_u = CURVE_RESOLUTION
        obj = bpy.data.objects.new(curve.name, curve)  # in no scene
        created.insert(0, obj)
        mesh = obj.to_mesh()
        mesh.calc_loop_triangles()
        points = vertex_positions(mesh)[:, :2].astype(np.float64)
        triangles = points[read_collection(mesh.loop_triangles, "vertices", np.int32, 3)]
    finally:
        # The mesh goes with the object. The font may have come with the curve.
        bpy.data.batch_remove([*created, *(set(bpy.data.fonts) - fonts)])
    if len(triangles):
        triangles[..., 0] -= triangles[..., 0].min()
    return triangles
