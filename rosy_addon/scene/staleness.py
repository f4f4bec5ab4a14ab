"""Whether a baked picture is out of date: states of looks, cameras, objects and meshes.

The record of a bake stores the states at that time as text. They are compared with the current ones.
"""

from __future__ import annotations

import json
import time
import zlib
from collections.abc import Iterable
from dataclasses import asdict

import bpy
import numpy as np

from ..compositor.look import Look
from .field_attributes import attribute_name, field_degree
from .look_properties import read_look

#: Seconds for which the cached state of a mesh is used before it is computed again.
STATE_TTL_SECONDS = 1.0

#: Number of checksums above which the cache is cleared, as the pointers of removed meshes stay in it.
MAX_CACHED_STATES = 256

#: Camera settings that change the picture.
_CAMERA_PROPERTIES = (
    "type",
    "lens",
    "sensor_fit",
    "sensor_width",
    "sensor_height",
    "ortho_scale",
    "shift_x",
    "shift_y",
    "clip_start",
    "clip_end",
)


def find_stale_reason(scene: bpy.types.Scene, record: bpy.types.PropertyGroup) -> str:
    """Return why a picture is out of date; empty if it is up to date."""
    if record.frames:
        return ""  # sidecar files of the frames record their state
    if record.look != look_state(read_look(scene.rosy)):
        return "the look was changed"
    if record.camera_state:
        camera = scene.objects.get(record.name)
        if camera is None or camera.type != "CAMERA":
            return f"camera '{record.name}' was deleted"
        if record.camera_state != camera_state(scene, camera):
            return f"camera '{record.name}' was changed"
    for entry in record.objects:
        obj = bpy.data.objects.get(entry.name)
        if obj is None:
            return f"object '{entry.name}' was deleted"
        transform_hash, mesh_state = entry.state.split(" ")
        current_transform_hash, current_mesh_state = object_state(obj).split(" ")
        if transform_hash != current_transform_hash:
            return f"'{entry.name}' was moved"
        if mesh_state != current_mesh_state:
            return f"the mesh or field of '{entry.name}' was changed"
    return ""


def look_state(look: Look) -> str:
    """Return a look as text."""
    return json.dumps(asdict(look))


def camera_state(scene: bpy.types.Scene, camera: bpy.types.Object) -> str:
    """Return the transform and settings of a camera as text."""
    data, render = camera.data, scene.render
    values = [
        round(value, 5) if isinstance(value, float) else value
        for value in (getattr(data, name) for name in _CAMERA_PROPERTIES)
    ]
    aspect = (render.resolution_x * render.pixel_aspect_x) / (
        render.resolution_y * render.pixel_aspect_y
    )
    return json.dumps([_rounded_entries(camera.matrix_world), values, round(aspect, 5)])


def object_state(obj: bpy.types.Object, recompute: bool = False) -> str:
    """Return two checksums as text: of an object's transform, and of its mesh and field."""
    transform_hash = zlib.crc32(json.dumps(_rounded_entries(obj.matrix_world)).encode())
    return f"{transform_hash:08x} {MESH_STATES.get(obj.data, recompute)}"


class MeshStateCache:
    """Checksums of meshes and their fields, each valid for `STATE_TTL_SECONDS`."""

    def __init__(self) -> None:
        # By the pointer of a mesh: when the checksum was computed, in seconds, and the checksum.
        self._states: dict[int, tuple[float, str]] = {}

    def get(self, mesh: bpy.types.Mesh, recompute: bool = False) -> str:
        """Return the checksum of a mesh and its field as text. Compute it if it is too old."""
        key = mesh.as_pointer()
        now = time.monotonic()
        if not recompute and key in self._states and now - self._states[key][0] < STATE_TTL_SECONDS:
            return self._states[key][1]
        if len(self._states) > MAX_CACHED_STATES:
            self._states.clear()
        state = _mesh_state(mesh)
        self._states[key] = (now, state)
        return state

    def clear(self) -> None:
        """Drop all checksums."""
        self._states.clear()


#: The cache that panels and bakes of one Blender process share, so that a bake is up to date in the
#: panel at once. Cleared by `unregister`.
MESH_STATES = MeshStateCache()


def _mesh_state(mesh: bpy.types.Mesh) -> str:
    """Compute the checksum of a mesh and its field as text."""
    if mesh.is_editmode:
        return "editing"
    name = attribute_name(mesh)
    checksum = zlib.crc32(f"{name} {field_degree(mesh)}".encode())
    for attribute in (mesh.attributes.get("position"), mesh.attributes.get(name)):
        checksum = zlib.crc32(_attribute_bytes(attribute), checksum)
    return f"{checksum:08x}"


def _rounded_entries(matrix: Iterable[Iterable[float]]) -> list[float]:
    """Return the entries of a matrix by rows, rounded to 5 decimals, without negative zeros."""
    return [round(value, 5) + 0.0 for row in matrix for value in row]


def _attribute_bytes(attribute: bpy.types.Attribute | None) -> bytes:
    """Return the values of a float or vector attribute as bytes; empty for others."""
    if attribute is None or attribute.data_type not in ("FLOAT_VECTOR", "FLOAT"):
        return b""
    is_vector = attribute.data_type == "FLOAT_VECTOR"
    values = np.empty(len(attribute.data) * (3 if is_vector else 1), dtype=np.float32)
    attribute.data.foreach_get("vector" if is_vector else "value", values)
    return values.tobytes()
