"""Switching the extension off and on again leaves nothing behind and loses nothing."""

import bpy
from conftest import EXTENSION

ID_TYPES = ("Scene", "Mesh", "Object", "WindowManager", "World", "Material", "Image", "Camera")


def snapshot():
    """Everything in Blender that an extension could have added to."""
    drawn = {}
    for name in dir(bpy.types):
        cls = getattr(bpy.types, name)
        for draw in getattr(getattr(cls, "draw", None), "_draw_funcs", ()):
            drawn.setdefault(name, []).append(draw.__module__)
    return {
        "types": set(dir(bpy.types)),
        "operators": set(dir(bpy.ops.rosy)),
        "properties": {
            name: set(getattr(bpy.types, name).bl_rna.properties.keys()) for name in ID_TYPES
        },
        "attributes": {name: set(dir(getattr(bpy.types, name))) for name in ID_TYPES},
        "handlers": {
            name: [
                getattr(handler, "__module__", "") for handler in getattr(bpy.app.handlers, name)
            ]
            for name in dir(bpy.app.handlers)
            if isinstance(getattr(bpy.app.handlers, name), list)
        },
        "draw callbacks": drawn,
        "keymaps": {
            keymap.name: len(keymap.keymap_items)
            for keymap in bpy.context.window_manager.keyconfigs.addon.keymaps
        },
    }


def switch(on):
    if on:
        bpy.ops.preferences.addon_enable(module=EXTENSION)
    else:
        bpy.ops.preferences.addon_disable(module=EXTENSION)


def test_off_and_on_and_off_leaves_nothing():
    on = snapshot()
    assert any(name.startswith("ROSY_OT_") for name in on["types"])
    assert "rosy" in on["properties"]["Scene"]
    switch(False)
    off = snapshot()
    switch(True)
    assert snapshot() == on
    switch(False)
    assert snapshot() == off
    assert not [name for name in off["types"] if "rosy" in name.lower()]
    assert not off["operators"]
    for names in off["properties"].values():
        assert "rosy" not in names
    for modules in (*off["handlers"].values(), *off["draw callbacks"].values()):
        assert not [module for module in modules if "rosy" in module]
    switch(True)


def test_a_bake_leaves_no_handler(baked):
    used = snapshot()
    bpy.ops.rosy.remove()
    for modules in used["handlers"].values():
        assert not [module for module in modules if "rosy" in module]


def test_settings_survive_off_and_on(with_field):
    with_field.data.rosy.degree = 6
    switch(False)
    switch(True)
    assert with_field.data.rosy.degree == 6


def test_nothing_outside_bpy_is_touched():
    import sys

    assert not [entry for entry in sys.path if "rosy" in entry]
    assert not [name for name in sys.modules if name.startswith(("rosy_addon", "operators"))]
