"""Switching the extension off and on again leaves nothing behind and loses nothing."""

import sys

import bpy
from extension import rosy, switch_extension

#: Words that are small in titles, and property groups whose properties are controls.
SMALL_WORDS = frozenset(
    ["a", "an", "and", "as", "at", "by", "for", "from", "in", "of", "on", "or", "the", "to", "with"]
)
VISIBLE_GROUPS = {"RosyLook", "RosyStrokes", "RosyScene", "RosyMesh", "RosyObject"}

ID_TYPES = (
    *("Scene", "Mesh", "Object", "NodeTree", "WindowManager", "World", "Material", "Image"),
    "Camera",
)


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
            name: [getattr(each, "__module__", "") for each in getattr(bpy.app.handlers, name)]
            for name in dir(bpy.app.handlers)
            if isinstance(getattr(bpy.app.handlers, name), list)
        },
        "draw callbacks": drawn,
        "keymaps": {
            keymap.name: len(keymap.keymap_items)
            for keymap in bpy.context.window_manager.keyconfigs.addon.keymaps
        },
    }


def test_off_and_on_and_off_leaves_nothing():
    on = snapshot()
    assert any(name.startswith("ROSY_OT_") for name in on["types"])
    assert "rosy" in on["properties"]["Scene"]
    switch_extension(False)
    off = snapshot()
    switch_extension(True)
    assert snapshot() == on
    switch_extension(False)
    assert snapshot() == off
    assert not [name for name in off["types"] if "rosy" in name.lower()]
    assert not off["operators"]
    for names in off["properties"].values():
        assert "rosy" not in names
    for modules in (*off["handlers"].values(), *off["draw callbacks"].values()):
        assert not [module for module in modules if "rosy" in module]
    switch_extension(True)


def test_settings_survive_off_and_on(with_field):
    with_field.data.rosy.degree = 6
    switch_extension(False)
    switch_extension(True)
    assert with_field.data.rosy.degree == 6


def test_the_interface_is_translated_while_the_extension_is_on():
    view = bpy.context.preferences.view
    before = view.language, view.use_translate_interface
    view.language, view.use_translate_interface = "de_DE", True
    translated = bpy.app.translations.pgettext_iface
    try:
        assert translated("Crispness") == "Schärfe"
        assert translated("Bake Animation", "Operator") == "Animation backen"
        switch_extension(False)
        assert translated("Crispness") == "Crispness"
    finally:
        switch_extension(True)
        view.language, view.use_translate_interface = before


def test_nothing_outside_bpy_is_touched():
    assert not [entry for entry in sys.path if "rosy" in entry]
    assert not [name for name in sys.modules if name.startswith(("rosy_addon", "operators"))]


def is_title(text):
    """Return whether a label is in title case, as Blender's are."""
    words = [word for word in text.replace("-", " ").split() if word not in SMALL_WORDS]
    return bool(words) and not any(word.islower() for word in words)


def controls():
    """Yield the description of each operator, and all properties that a user sees, by their owner."""
    for cls in rosy("operators.registration").CLASSES:
        if issubclass(cls, bpy.types.Operator):
            rna = getattr(bpy.ops.rosy, cls.bl_idname.split(".")[1]).get_rna_type()
            yield cls.bl_idname, rna.description, [rna.properties[k] for k in cls.__annotations__]
    for cls in rosy("rosy_addon.ui.properties").CLASSES:
        if cls.__name__ in VISIBLE_GROUPS:
            items = [cls.bl_rna.properties[name] for name in cls.__annotations__]
            yield cls.__name__, None, [item for item in items if item.name != item.identifier]


def test_every_control_has_a_label_and_a_tooltip():
    """As in Blender: title case, and tooltips that do not end with a period."""
    for owner, description, properties in controls():
        texts = [] if description is None else [description]
        for item in properties:
            if item.is_hidden:
                continue
            texts.append(item.description)
            labels = [item.name]
            if item.type == "ENUM":
                labels += [option.name for option in item.enum_items]
                texts += [option.description for option in item.enum_items]
            assert all(map(is_title, labels)), (owner, labels)
        for text in texts:
            assert text and text == text.strip() and not text.endswith("."), (owner, text)
            assert not text[0].islower(), (owner, text)


def test_names_of_presets_are_in_title_case():
    library = rosy("rosy_addon.ui.preset_library")
    shipped = [entry.preset for entry in library.entries().values() if not entry.is_user]
    assert len(shipped) > 5
    for preset in shipped:
        assert is_title(preset.name), preset.name
        assert not preset.description.endswith(".")
