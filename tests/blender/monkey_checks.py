"""What the monkey checks: what an action has changed, what RoSy leaves behind, and memory."""

import ctypes
import gc
import hashlib
from collections.abc import Iterator
from contextlib import suppress
from fnmatch import fnmatchcase
from glob import escape
from typing import Any
from unicodedata import category

import bpy
import numpy as np

#: Datablocks of Blender's interface and brushes, and others that no operator of RoSy can reach.
IGNORED_COLLECTIONS = {
    "all_ids", "window_managers", "screens", "workspaces", "brushes", "fonts", "palettes", "libraries",
}  # fmt: skip

#: Data types and domains of the attributes that a modifier of RoSy leaves in a mesh if it is applied.
APPLIED = {"rosy_projection": ("FLOAT_VECTOR", "POINT"), "rosy_material": ("INT", "FACE")}

#: Values by paths, such as objects/Cube/modifiers.
Fingerprint = dict[str, Any]


class CheckError(Exception):
    """A check has failed."""


def expect_none(found: list[str], text: str) -> None:
    """Raise an error that lists what was found, if anything was."""
    if found:
        raise CheckError(f"{text}: " + "; ".join(found[:8]))


def is_owned(datablock: bpy.types.ID) -> bool:
    """Return whether RoSy made a datablock, or the mesh or curves whose shape keys it has."""
    if isinstance(datablock, bpy.types.Key):
        datablock = datablock.user
    return bool(datablock.get("rosy_made"))


def all_datablocks() -> Iterator[tuple[str, bpy.types.ID]]:
    """Yield each datablock with the name of its collection."""
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION" and prop.identifier not in IGNORED_COLLECTIONS:
            for datablock in getattr(bpy.data, prop.identifier):
                yield prop.identifier, datablock


# --- what an action changes ---------------------------------------------------------------------


def fingerprint() -> Fingerprint:
    """Return the state of the file and the context.

    RoSy's own datablocks are under ``owned/``, its modifiers under ``picture/``.
    """
    state: Fingerprint = {}
    for kind, datablock in all_datablocks():
        path = f"{kind}/{full_name(datablock)}"
        if kind == "objects" and datablock.type == "CAMERA" and not datablock.users_collection:
            continue  # a camera that the user has deleted, and that the record of a bake keeps
        if kind == "images" and datablock.type == "RENDER_RESULT":
            continue  # Blender makes it when it likes
        if is_owned(datablock):
            state[f"owned/{path}"] = None
            continue
        state[path] = datablock.use_fake_user
        if kind in _ADDERS:
            _ADDERS[kind](state, path, datablock)
    layer = bpy.context.view_layer
    selected = [obj.name for obj in layer.objects if obj and obj.select_get() and not is_owned(obj)]
    active = _user_name(layer.objects.active)
    place = bpy.context.scene.name, layer.name, bpy.context.mode
    state["context"] = (*place, active, sorted(selected))
    return state


def full_name(datablock: bpy.types.ID) -> str:
    """Return the name of a datablock with the one of its library, in which names may occur again."""
    library = datablock.library
    return datablock.name if library is None else f"{datablock.name}@{library.name}"


def _user_name(datablock: bpy.types.ID | None) -> str | None:
    """Return the name of a datablock of the user; None if there is none, or RoSy made it."""
    return None if datablock is None or is_owned(datablock) else datablock.name


def _add_values(state: Fingerprint, path: str, struct: bpy.types.bpy_struct) -> None:
    """Add all plain values of a struct that can be written."""
    for prop in struct.bl_rna.properties:
        if prop.type not in ("POINTER", "COLLECTION") and not prop.is_readonly:
            state[f"{path}/{prop.identifier}"] = repr(_plain(getattr(struct, prop.identifier)))


def _plain(value: Any) -> Any:
    if isinstance(value, (str, int, float)):
        return value
    return sorted(value) if isinstance(value, set) else [_plain(entry) for entry in value or ()]


def _add_object(state: Fingerprint, path: str, obj: bpy.types.Object) -> None:
    # Blender 4.3 forgets the parent of an override when its creation is undone and redone.
    parent = None if obj.override_library is not None else _user_name(obj.parent)
    state[f"{path}/basis"] = (
        *(obj.data and obj.data.name, parent, obj.hide_render, obj.hide_viewport),
        None if obj.animation_data else _plain(obj.matrix_basis),
        # Cycles adds its settings to objects when a file is opened.
        sorted(set(obj.keys()) - {"rosy", "cycles"}),
    )
    state[f"{path}/rest"] = obj.add_rest_position_attribute
    state[f"{path}/collections"] = sorted(collection.name for collection in obj.users_collection)
    state[f"{path}/slots"] = [(s.link, _user_name(s.material)) for s in obj.material_slots]
    state[f"{path}/groups"] = [group.name for group in obj.vertex_groups]
    modifiers = []
    for modifier in obj.modifiers:
        group = getattr(modifier, "node_group", None)
        if group is not None and is_owned(group):
            state[f"picture/{full_name(obj)}/{modifier.name}"] = group.name
        else:
            modifiers.append((modifier.name, modifier.type, modifier.show_viewport))
    state[f"{path}/modifiers"] = modifiers
    if hasattr(obj, "rosy"):
        _add_values(state, f"{path}/rosy", obj.rosy)


def _add_mesh(state: Fingerprint, path: str, mesh: bpy.types.Mesh) -> None:
    if not mesh.is_editmode:  # otherwise they are those when edit mode was left last
        state[f"{path}/counts"] = len(mesh.vertices), len(mesh.edges), len(mesh.polygons)
    state[f"{path}/materials"] = [_user_name(material) for material in mesh.materials]
    keys = mesh.shape_keys
    state[f"{path}/keys"] = keys and [(block.name, block.value) for block in keys.key_blocks]
    if hasattr(mesh, "rosy"):
        _add_values(state, f"{path}/rosy", mesh.rosy)
    for attribute in mesh.attributes:
        digest = None if mesh.is_editmode else _attribute_digest(attribute)
        description = attribute.data_type, attribute.domain, digest
        is_applied = APPLIED.get(attribute.name) == description[:2]
        place = f"picture/{full_name(mesh)}" if is_applied else f"{path}/attributes"
        state[f"{place}/{attribute.name}"] = description


def _attribute_digest(attribute: bpy.types.Attribute) -> str | None:
    if attribute.data_type in ("STRING", "FLOAT4X4") or not len(attribute.data):
        return None
    first = attribute.data[0]
    name = next(name for name in ("value", "color", "vector") if hasattr(first, name))
    size = np.size(getattr(first, name))
    values = np.empty(len(attribute.data) * size, dtype=np.float32)
    attribute.data.foreach_get(name, values)
    return hashlib.sha1(values.tobytes(), usedforsecurity=False).hexdigest()[:12]


def _add_scene(state: Fingerprint, path: str, scene: bpy.types.Scene) -> None:
    state[f"{path}/camera"] = _user_name(scene.camera)
    state[f"{path}/frame"] = scene.frame_current, scene.frame_subframe
    state[f"{path}/layers"] = [layer.name for layer in scene.view_layers]
    state[f"{path}/objects"] = sorted(obj.name for obj in scene.objects if not is_owned(obj))
    for name in ("render", "view_settings", "display_settings", "tool_settings"):
        _add_values(state, f"{path}/{name}", getattr(scene, name))
    if hasattr(scene, "rosy"):
        for name, group in (("", scene.rosy), ("look/", scene.rosy.look)):
            _add_values(state, f"{path}/rosy/{name}", group)
        for record in scene.rosy.bakes:
            state[f"{path}/rosy/bakes/{record.name}"] = record.image and record.image.name


_ADDERS = {
    "objects": _add_object,
    "meshes": _add_mesh,
    "scenes": _add_scene,
    "cameras": _add_values,
}


def changes(before: Fingerprint, after: Fingerprint, allowed: tuple[str, ...] = ()) -> list[str]:
    """Return what differs between two fingerprints, without the allowed patterns of paths."""
    missing = "nothing"
    return [
        f"{path}: {before.get(path, missing)!r} became {after.get(path, missing)!r}"
        for path in sorted({*before, *after})
        if repr(before.get(path, missing)) != repr(after.get(path, missing))
        and not any(fnmatchcase(path, pattern) for pattern in allowed)
    ]


#: Patterns of the paths that an operator may change, if it succeeds: RoSy's own data, its settings, and
#: what is listed for the operator. SELECTED stands for each selected mesh, HOLDER for each field mesh.
OWN = ("owned/*", "picture/*", "scenes/*/rosy/*")
FIELD = (
    *("meshes/SELECTED/attributes/*", "meshes/SELECTED/rosy/*", "meshes/SELECTED/counts"),
    *("meshes/* field*", "meshes/HOLDER", "meshes/HOLDER/*", "objects/*/rosy/field_mesh"),
)
FURTHER = {
    "occlusion": ("meshes/*/attributes/Occlusion",),
    "bake_texture": ("meshes/SELECTED/*", "context"),
    # Strokes that the user has edited become the user's.
    "strokes": ("*/RoSy *",),
    # What a modifier of RoSy that the user has applied left in a mesh.
    "remove": ("meshes/*/materials", "objects/*/slots", "meshes/*/attributes/material_index"),
}


def allowed_changes(operator: str) -> tuple[str, ...]:
    """Return the patterns of what an operator may change in the current context."""
    objects = [*bpy.context.selected_objects, bpy.context.view_layer.objects.active]
    meshes = {obj.data for obj in objects if obj is not None and obj.type == "MESH"}
    patterns = FIELD if operator.startswith("field_") else FURTHER.get(operator, ())
    holders = {mesh for mesh in bpy.data.meshes if mesh.get("rosy_field_mesh")}
    filled = (
        pattern.replace(word, escape(full_name(mesh)))
        for word, group in (("SELECTED", meshes), ("HOLDER", holders))
        for mesh in group
        for pattern in patterns
    )
    return *OWN, *patterns, *filled


def check_message(message: str) -> None:
    """Check that the text of a RuntimeError is one clear line."""
    lines = message.strip().splitlines()
    if len(lines) != 1 or "Traceback" in message or not message.startswith(("Error: ", "Operator")):
        raise CheckError(f"the error is not one line: {message!r}")
    if any(category(character) == "Cc" for character in lines[0]):
        raise CheckError(f"the error has control characters: {message!r}")


# --- what is left -------------------------------------------------------------------------------

#: Kinds of data that are the user's once they were copied: strokes and points of singularities.
COPIED = ("objects", "meshes", "grease_pencils", "hair_curves", "pointclouds")


def leftovers() -> list[str]:
    """Return what RoSy has left behind, after everything that it made was removed."""
    left = [
        f"{kind}: '{block.name}'"
        for kind, block in all_datablocks()
        if is_owned(block) and block.library is None and not _is_used(block)
        if not kind.startswith(COPIED)
    ]
    for obj in bpy.data.objects:
        if obj.library is not None or obj.type == "CURVES":
            continue
        groups = [getattr(modifier, "node_group", None) for modifier in obj.modifiers]
        if obj.override_library is not None:  # the library may have modifiers
            groups = [group for group in groups if group is not None and group.library is None]
        left += [f"a modifier of '{obj.name}'" for g in groups if g is not None and is_owned(g)]
    for mesh in bpy.data.meshes:
        if mesh.library is None and mesh.override_library is None:
            names = [attribute.name for attribute in mesh.attributes]
            left += [
                f"'{attribute.name}' of '{mesh.name}'"
                for attribute in mesh.attributes
                if APPLIED.get(attribute.name) == (attribute.data_type, attribute.domain)
                and names.count(attribute.name) == 1  # else Blender 4.3 may remove the other one
            ]
    return left


def whole_state() -> Fingerprint:
    """Return the fingerprint with the users and custom properties of all datablocks, and RoSy's handlers."""
    state = fingerprint() | {"handlers": handlers()}
    for kind, block in all_datablocks():
        # Blender 4.3 stores settings of extensions with custom properties, also if they are only read.
        names = sorted({*block.keys()} - {"rosy", "cycles"})
        state[f"{kind}/{full_name(block)}/properties"] = names, block.users
    return state


def handlers() -> list[str]:
    """Return RoSy's handlers, without those that remember live views and note changes."""
    return [
        f"{name}: {function!r}"
        for name in dir(bpy.app.handlers)
        if isinstance(functions := getattr(bpy.app.handlers, name), list)
        for function in functions
        if "rosy" in (module := getattr(function, "__module__", ""))
        and not module.endswith((".ui.live_views", ".scene.staleness"))
    ]


def _is_used(block: bpy.types.ID) -> bool:
    """Return whether the user needs a datablock of RoSy, or another one that uses it."""
    users = bpy.data.user_map(subset=[block])[block]
    stroke_data = ("grease_pencil", "GreasePencil", "GreasePencilv3", "Curves")
    return block.use_fake_user or any(
        not is_owned(user) or type(user).__name__ in stroke_data or _is_used(user) for user in users
    )


def resident_megabytes() -> float:
    """Return the resident memory of this process without what is free; 0 if the system is not Linux."""
    gc.collect()
    process = ctypes.CDLL(None)
    for release in (
        lambda: process.malloc_trim(0),  # the GNU C library
        lambda: process.scalable_allocation_command(0, None),  # TBB: TBBMALLOC_CLEAN_ALL_BUFFERS
        lambda: process.mallctl(b"arena.4096.purge", None, None, None, 0),  # jemalloc: all arenas
    ):
        with suppress(AttributeError):
            release()
    with suppress(OSError), open("/proc/self/status") as status:
        return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) / 1024
    return 0.0
