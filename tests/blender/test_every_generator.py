"""Every kind of field on every awkward mesh, with the operator that the panel's button runs."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "unit"))
from awkward import AWKWARD

KINDS = ("form", "smoothest", "curvature", "features", "guided", "axis", "uv")

#: Errors of kinds on meshes where they are undefined. Curvature has no direction on flat meshes and on
#: those that are alike in all directions at each corner; the edges of an octahedron's triangles cancel
#: out; the default axis is perpendicular to flat meshes.
ERRORS = {
    ("curvature", "cube"): "no direction",
    ("curvature", "faces_without_area"): "no direction",
    ("curvature", "fan"): "no direction",
    ("curvature", "grid"): "no direction",
    ("curvature", "pieces"): "no direction",
    ("curvature", "triangle"): "no direction",
    ("axis", "grid"): "no direction",
    ("axis", "triangle"): "no direction",
    ("features", "faces_without_area"): "the edges cancel each other",
}


@pytest.mark.parametrize("name", AWKWARD)
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_on_every_mesh(scene, kind, name, capfd):
    points, faces = AWKWARD[name]()
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    uv_layer = mesh.uv_layers.new(name="UVMap")
    corner = np.array([points[vertex] for face in faces for vertex in face], dtype=np.float32)
    uv_layer.uv.foreach_set("vector", (corner[:, :2] + 0.2 * corner[:, 2:]).ravel())
    obj = bpy.data.objects.new(name, mesh)
    scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    settings = {"guides": {"EDGES", "UV"}, "reach": 0.1} if kind == "guided" else {}
    if (kind, name) in ERRORS:
        with pytest.raises(RuntimeError, match=ERRORS[kind, name]):
            bpy.ops.rosy.field_generate(kind=kind, degree=4)
        assert "rosy" not in mesh.attributes
        return
    assert bpy.ops.rosy.field_generate(kind=kind, degree=4, **settings) == {"FINISHED"}
    warned = "Möbius" in capfd.readouterr().out
    assert warned == (name == "moebius")
    values = np.empty(3 * len(faces), dtype=np.float32)
    mesh.attributes["rosy"].data.foreach_get("vector", values)
    assert np.isfinite(values).all()
    if kind in ("form", "smoothest"):
        length = np.linalg.norm(values.reshape(-1, 3), axis=1)
        area = np.array([face.area > 0 for face in mesh.polygons])
        np.testing.assert_allclose(length, area, atol=1e-5)
