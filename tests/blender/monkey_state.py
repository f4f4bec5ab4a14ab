"""What the monkey checks: fingerprints of a file, what RoSy leaves behind, and memory."""

from __future__ import annotations

import ctypes
import gc
import hashlib
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from fnmatch import fnmatchcase
from glob import escape
from typing import Any

import bpy
import numpy as np

EXTENSION = "bl_ext.user_default.rosy"

#: Custom property of RoSy's datablocks.
OWNED_TAG = "rosy_made"

#: Datablocks of Blender's interface and brushes, and others that no operator of RoSy's can reach.
IGNORED_COLLECTIONS = {
    "all_ids",
    "window_managers",
    "screens",
    "workspaces",
    "brushes",
    "fonts",
    "palettes",
    "libraries",
}

#: Values of attributes by data type: the property, the number of values, and their type.
ATTRIBUTE_VALUES = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, np.bool_),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "INT32_2D": ("value", 2, np.int32),
    "INT16_2D": ("value", 2, np.int32),
    "QUATERNION": ("value", 4, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
}

Fingerprint = dict[str, Any]


def rosy(name: str) -> Any:
    """Return a module of the extension."""
    return sys.modules[f"{EXTENSION}.{name}"]


def is_owned(datablock: bpy.types.ID) -> bool:
    """Whether RoSy created a datablock."""
    return bool(datablock.get(OWNED_TAG))


# --- fingerprints -----------------------------------------------------------------------------


def fingerprint(pixels: bool = False) -> Fingerprint:
    """Return the state of the file and the context: values by paths such as mesh/Cube/faces.

    RoSy's own datablocks are under ``owned/``, its modifiers under ``picture/``.

    Parameters
    ----------
    pixels : bool
        Include the pixels of RoSy's images.
    """
    state: Fingerprint = {}
    for kind, datablock in all_datablocks():
        name = _full_name(datablock)
        if _is_deleted_camera(datablock):
            continue
        if is_owned(datablock):
            state[f"owned/{kind}/{name}"] = _pixels(datablock) if pixels else None
        else:
            state[f"{kind}/{name}/id"] = datablock.use_fake_user
    for obj in bpy.data.objects:
        if not _is_deleted_camera(obj):
            _add_object(state, obj)
    for mesh in bpy.data.meshes:
        if not is_owned(mesh):
            _add_mesh(state, mesh)
    for camera in bpy.data.cameras:
        _add_values(state, f"cameras/{_full_name(camera)}", camera)
    for scene in bpy.data.scenes:
        _add_scene(state, scene)
    view_layer = bpy.context.view_layer
    state["context"] = (
        bpy.context.scene.name,
        view_layer.name,
        bpy.context.mode,
        _users_object_name(view_layer.objects.active),
        sorted(
            obj.name for obj in view_layer.objects if obj and obj.select_get() and not is_owned(obj)
        ),
    )
    return state


def _users_object_name(obj: bpy.types.Object | None) -> str | None:
    """Name of an object, or None if there is none or RoSy made it."""
    return None if obj is None or is_owned(obj) else obj.name


def _is_deleted_camera(datablock: bpy.types.ID) -> bool:
    """Whether a datablock is a camera that the user has deleted, and that the record of a bake keeps."""
    return (
        isinstance(datablock, bpy.types.Object)
        and datablock.type == "CAMERA"
        and not datablock.users_collection
    )


def all_datablocks() -> Iterator[tuple[str, bpy.types.ID]]:
    """Yield the name of its collection and each datablock."""
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION" and prop.identifier not in IGNORED_COLLECTIONS:
            for datablock in getattr(bpy.data, prop.identifier):
                yield prop.identifier, datablock


def _full_name(datablock: bpy.types.ID) -> str:
    library = datablock.library
    return datablock.name if library is None else f"{datablock.name}@{library.name}"


def _pixels(datablock: bpy.types.ID) -> Any:
    """Return a digest of the pixels of an image."""
    if not isinstance(datablock, bpy.types.Image) or datablock.source != "FILE":
        return None
    if datablock.is_dirty:  # changed by the user, and not saved with the file
        return None
    values = np.empty(len(datablock.pixels), dtype=np.float32)
    datablock.pixels.foreach_get(values)
    return tuple(datablock.size), _digest(values)


def _digest(values: np.ndarray) -> str:
    return hashlib.sha1(values.tobytes(), usedforsecurity=False).hexdigest()[:12]


_VALUE_NAMES: dict[type, list[str]] = {}


def _add_values(state: Fingerprint, path: str, struct: bpy.types.bpy_struct) -> None:
    """Add all plain values of a struct that can be written."""
    names = _VALUE_NAMES.get(type(struct))
    if names is None:
        names = _VALUE_NAMES[type(struct)] = [
            prop.identifier
            for prop in struct.bl_rna.properties
            if prop.type not in ("POINTER", "COLLECTION") and not prop.is_readonly
        ]
    for name in names:
        value = getattr(struct, name)
        state[f"{path}/{name}"] = value if isinstance(value, (str, int, float)) else _plain(value)


def _plain(value: Any) -> Any:
    if isinstance(value, (set, frozenset)):
        return tuple(sorted(value))
    try:
        return tuple(map(_plain, value)) if not isinstance(value, str) else value
    except TypeError:
        return value


def _parent_name(obj: bpy.types.Object) -> str | None:
    """Return the name of an object's parent, if it must stay.

    An object that the user has parented to one of RoSy's loses that parent with it. Blender 4.3
    itself forgets the parent of a library override when its creation is undone and redone, until the
    file is opened again.
    """
    if obj.parent is None or obj.override_library is not None or is_owned(obj.parent):
        return None
    return obj.parent.name


def _add_object(state: Fingerprint, obj: bpy.types.Object) -> None:
    path = f"objects/{_full_name(obj)}"
    if is_owned(obj):
        state[f"owned/{path}"] = None
        return
    state[f"{path}/basis"] = (
        obj.data and obj.data.name,
        _parent_name(obj),
        None if obj.animation_data else _plain(obj.matrix_basis),
        _plain(obj.matrix_parent_inverse),
        obj.hide_render,
        obj.hide_viewport,
        obj.add_rest_position_attribute,
        # Cycles adds its settings to objects when a file is opened.
        sorted(set(obj.keys()) - {"rosy", "cycles"}),
    )
    state[f"{path}/collections"] = sorted(collection.name for collection in obj.users_collection)
    state[f"{path}/slots"] = [
        (slot.link, _material_name(slot.material)) for slot in obj.material_slots
    ]
    state[f"{path}/groups"] = [group.name for group in obj.vertex_groups]
    modifiers = []
    for modifier in obj.modifiers:
        group = getattr(modifier, "node_group", None)
        if group is not None and is_owned(group):
            state[f"picture/{_full_name(obj)}/{modifier.name}"] = group.name
        else:
            modifiers.append((modifier.name, modifier.type, modifier.show_viewport))
    state[f"{path}/modifiers"] = modifiers
    if hasattr(obj, "rosy"):
        _add_values(state, f"{path}/rosy", obj.rosy)


def _material_name(material: bpy.types.Material | None) -> str | None:
    """Return the name of a user's material. RoSy's come to meshes if its modifier is applied."""
    return None if material is None or is_owned(material) else material.name


def _add_mesh(state: Fingerprint, mesh: bpy.types.Mesh) -> None:
    path = f"meshes/{_full_name(mesh)}"
    if not mesh.is_editmode:  # of the last time that edit mode was left, or the mesh evaluated
        state[f"{path}/counts"] = (len(mesh.vertices), len(mesh.edges), len(mesh.polygons))
    state[f"{path}/materials"] = [_material_name(material) for material in mesh.materials]
    keys = mesh.shape_keys
    state[f"{path}/keys"] = keys and [(block.name, block.value) for block in keys.key_blocks]
    if hasattr(mesh, "rosy"):
        _add_values(state, f"{path}/rosy", mesh.rosy)
    for attribute in mesh.attributes:
        state[f"{path}/attributes/{attribute.name}"] = (
            attribute.data_type,
            attribute.domain,
            None if mesh.is_editmode else _attribute_digest(attribute),
        )


def _attribute_digest(attribute: bpy.types.Attribute) -> str | None:
    if attribute.data_type not in ATTRIBUTE_VALUES:
        return None
    name, size, dtype = ATTRIBUTE_VALUES[attribute.data_type]
    values = np.empty(len(attribute.data) * size, dtype=dtype)
    attribute.data.foreach_get(name, values)
    return _digest(values)


def _add_scene(state: Fingerprint, scene: bpy.types.Scene) -> None:
    path = f"scenes/{_full_name(scene)}"
    state[f"{path}/camera"] = _users_object_name(scene.camera)
    state[f"{path}/frame"] = (scene.frame_current, scene.frame_subframe)
    state[f"{path}/world"] = scene.world and scene.world.name
    state[f"{path}/layers"] = [layer.name for layer in scene.view_layers]
    state[f"{path}/objects"] = sorted(obj.name for obj in scene.objects if not is_owned(obj))
    for name in ("render", "view_settings", "display_settings", "tool_settings"):
        _add_values(state, f"{path}/{name}", getattr(scene, name))
    if hasattr(scene, "rosy"):
        _add_values(state, f"{path}/rosy", scene.rosy)
        _add_values(state, f"{path}/rosy/look", scene.rosy.look)
        _add_values(state, f"{path}/rosy/strokes", scene.rosy.strokes)
        for record in scene.rosy.bakes:
            state[f"{path}/rosy/bakes/{record.name}"] = record.image and record.image.name
        for record in scene.rosy.strokes.made:
            key = f"{path}/rosy/made/{record.kind} {record.name}"
            state[key] = record.thing and record.thing.name


def changes(before: Fingerprint, after: Fingerprint, allowed: Iterable[str] = ()) -> list[str]:
    """Return what differs between two fingerprints, without the allowed patterns of paths."""
    patterns = tuple(allowed)
    missing = "nothing"
    return [
        f"{path}: {before.get(path, missing)!r} became {after.get(path, missing)!r}"
        for path in sorted({*before, *after})
        if not _same(before.get(path, missing), after.get(path, missing))
        and not any(fnmatchcase(path, pattern) for pattern in patterns)
    ]


def _same(a: Any, b: Any) -> bool:
    return a == b or repr(a) == repr(b)  # NaN


# --- what each operator may change ------------------------------------------------------------

#: Patterns of the paths that operators may change. SELECTED stands for each selected mesh, SCENE for
#: the current scene. An operator that fails or is stopped may change nothing.
_FIELD = ("meshes/SELECTED/attributes/FIELD", "meshes/SELECTED/rosy/*", "meshes/SELECTED/counts")
_PICTURE = ("owned/images/*", "owned/materials/*", "owned/node_groups/*", "picture/*")
#: What an applied modifier has left in a mesh.
_APPLIED = (
    "meshes/*/materials",
    "meshes/*/attributes/rosy_projection",
    "meshes/*/attributes/rosy_material",
    "meshes/*/attributes/material_index",
    "objects/*/slots",
)
_STROKES = (
    "owned/objects/*",
    "owned/materials/*",
    "owned/grease_pencils*",
    "owned/hair_curves/*",
    "owned/curves/*",
    "owned/node_groups/*",
    "picture/*",  # the modifier by which curves follow a surface
    "scenes/*/rosy/made/*",  # a linked copy of the scene shows the same objects
)
MAY_CHANGE: dict[str, tuple[str, ...]] = {
    "field_generate": _FIELD,
    "field_convert": _FIELD,
    "field_singularities": _FIELD,
    "field_comb": (*_FIELD, "meshes/SELECTED/attributes/*rosy_guides*"),
    "field_compare": (
        "meshes/SELECTED/attributes/Difference",
        "scenes/SCENE/rosy/color_attribute",
        *(f"scenes/SCENE/rosy/look/{name}" for name in ("hue", "values_*", "color_map")),
    ),
    "field_store": _FIELD,
    "field_import": _FIELD,
    "field_export": (),
    "singularities": ("owned/objects/*", "owned/meshes/*", "owned/pointclouds/*"),
    "occlusion": (
        "meshes/*/attributes/Occlusion",
        "scenes/SCENE/rosy/tone_attribute",
        "scenes/SCENE/rosy/look/tone",
    ),
    "bake": (*_PICTURE, "scenes/SCENE/rosy/bakes/*"),
    "bake_animation": (*_PICTURE, "scenes/SCENE/rosy/bakes/*"),
    "bake_texture": (*_PICTURE, "scenes/SCENE/rosy/bakes/*", "meshes/SELECTED/*", "context"),
    "remove": (*_PICTURE, "scenes/SCENE/rosy/bakes/*", *_APPLIED),
    "show": ("owned/node_groups/*", "picture/*"),
    "show_here": (),
    "turntable": (),
    "viewport": (),
    "flow_play": (),
    "strokes": _STROKES,
    "strokes_remove": _STROKES,
    "preset_apply": ("scenes/SCENE/rosy/look/*", "scenes/SCENE/rosy/preset*"),
    "preset_save": ("scenes/SCENE/rosy/preset*",),
    "preset_rename": ("scenes/*/rosy/preset*",),
    "preset_remove": ("scenes/*/rosy/preset",),
    "preset_import": ("scenes/*/rosy/preset",),
    "preset_export": (),
}

#: Names of attributes that hold fields.
_FORMS = ("rosy", "rosy_angle", "rosy_tangent", "dir[0-9]", "dir[0-9][0-9]")
FIELD_NAMES = (*_FORMS, ".*_rest", ".*_check")


def allowed_changes(operator: str, attribute: str | None = None) -> list[str]:
    """Return the patterns of an operator in the current context.

    Parameters
    ----------
    operator : str
    attribute : str, optional
        A further name of the field's attribute.
    """
    context = bpy.context
    objects = [*context.selected_objects, context.view_layer.objects.active]
    meshes = {obj.data for obj in objects if obj is not None and obj.type == "MESH"}
    names = [*FIELD_NAMES, *([escape(attribute)] if attribute else [])]
    names += [escape(mesh.rosy.attribute) for mesh in meshes]
    scene = escape(_full_name(context.scene))
    patterns = []
    for pattern in MAY_CHANGE[operator]:
        for mesh in meshes if "SELECTED" in pattern else [None]:
            for name in names if "FIELD" in pattern else [None]:
                patterns.append(
                    pattern.replace("SELECTED", "" if mesh is None else escape(_full_name(mesh)))
                    .replace("FIELD", name or "")
                    .replace("SCENE", scene)
                )
    return patterns


# --- what is left -----------------------------------------------------------------------------


def leftovers() -> list[str]:
    """Return what RoSy has left behind, after everything that it made was removed."""
    left = [
        f"{kind}: '{block.name}'"
        for kind, block in all_datablocks()
        if is_owned(block) and block.library is None and not _is_used(block)
    ]
    for obj in bpy.data.objects:
        if obj.library is not None or obj.override_library is not None:
            continue
        left += [
            f"modifier '{modifier.name}' of '{obj.name}'"
            for modifier in obj.modifiers
            if getattr(modifier, "node_group", None) is not None
            and is_owned(modifier.node_group)
            and obj.type != "CURVES"  # a copy of strokes that follow a surface is the user's
        ]
    for mesh in bpy.data.meshes:
        if mesh.library is not None:
            continue
        left += [
            f"attribute '{attribute.name}' of '{mesh.name}'"
            for attribute in mesh.attributes
            if attribute.name.startswith(
                ("rosy_stand_in", "rosy_face_normal", "rosy_projection", "rosy_material")
            )
        ]
    return left


def _is_used(block: bpy.types.ID) -> bool:
    """Whether the user needs a datablock of RoSy's, as for strokes that the user has copied.

    Also if the user needs another one that uses it.
    """
    users = bpy.data.user_map(subset=[block])[block]
    stroke_data = ("grease_pencil", "GreasePencil", "GreasePencilv3", "Curves")
    return block.use_fake_user or any(
        not is_owned(user) or type(user).__name__ in stroke_data or _is_used(user) for user in users
    )


def handlers() -> list[str]:
    """Return the application handlers of RoSy's, but for those that remember live views."""
    return [
        f"{name}: {function!r}"
        for name in dir(bpy.app.handlers)
        if isinstance(functions := getattr(bpy.app.handlers, name), list)
        for function in functions
        if "rosy" in (module := getattr(function, "__module__", ""))
        and not module.endswith(".ui.live_views")
    ]


# --- memory -----------------------------------------------------------------------------------


def resident_megabytes() -> float:
    """Return the resident memory of this process; 0 where the system does not tell."""
    try:
        with open("/proc/self/status") as status:
            line = next(line for line in status if line.startswith("VmRSS"))
    except OSError:
        return 0.0
    return int(line.split()[1]) / 1024


def release_free_memory() -> None:
    """Return freed memory to the system, as far as the allocator of this Blender can."""
    gc.collect()
    process = ctypes.CDLL(None)
    for release in (
        lambda: process.malloc_trim(0),  # the GNU C library
        lambda: process.scalable_allocation_command(0, None),  # TBB: TBBMALLOC_CLEAN_ALL_BUFFERS
        lambda: process.mallctl(b"arena.4096.purge", None, None, None, 0),  # jemalloc: all arenas
    ):
        with suppress(AttributeError):
            release()


def python_objects() -> dict[str, int]:
    """Return the number of objects of RoSy's classes that are alive, and of arrays, by class."""
    gc.collect()
    counts: dict[str, int] = {}
    for obj in gc.get_objects():
        cls = type(obj)
        if str(cls.__module__).startswith(EXTENSION):
            counts[cls.__qualname__] = counts.get(cls.__qualname__, 0) + 1
    return counts


def data_counts() -> dict[str, int]:
    """Return the number of datablocks by collection."""
    counts: dict[str, int] = {}
    for kind, _ in all_datablocks():
        counts[kind] = counts.get(kind, 0) + 1
    return counts
