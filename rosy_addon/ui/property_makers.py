"""Functions that make Blender's properties, from a name and a description or from a settings class.

Further keyword arguments are passed on to the functions of `bpy.props`.
"""

from collections.abc import Iterable
from typing import Any

import bpy

from ..core.settings import Choice, Color, Number, Numbers, Setting, Switch, settings_of, title
from ..scene.look_properties import color_components

#: Options of path properties. The path may start with ``//``, which stands for the folder of the .blend file.
#: Blender 5.0 and later require the second option for this.
PATH_OPTIONS = {"ANIMATABLE"} | (
    {"PATH_SUPPORTS_BLEND_RELATIVE"}
    if "is_path_supports_blend_relative" in bpy.types.Property.bl_rna.properties
    else set()
)

#: Subtypes of number properties, by the unit of the setting.
SUBTYPE_BY_UNIT = {"angle": "ANGLE", "length": "DISTANCE", "pixels": "PIXEL"}


def toggle(name: str, description: str, **others: Any) -> Any:
    """Return a boolean property, by default false."""
    return bpy.props.BoolProperty(name=name, description=description, **others)


def integer(name: str, description: str, **others: Any) -> Any:
    """Return an integer property, by default 0."""
    return bpy.props.IntProperty(name=name, description=description, **others)


def real(name: str, description: str, **others: Any) -> Any:
    """Return a floating-point property, by default 0."""
    return bpy.props.FloatProperty(name=name, description=description, **others)


def fraction(name: str, description: str, **others: Any) -> Any:
    """Return a property for a length divided by the longest side of the bounding box, 0 to 10."""
    return real(name, description, min=0.0, max=10.0, precision=3, step=1, **others)


def brush_strength() -> Any:
    """Return the property for the strength of the brush that combs fields."""
    others = {"subtype": "FACTOR", "min": 0.0, "max": 1.0, "default": 1.0}
    return real("Strength", "How much of its effect the brush has", **others)


def text(name: str, description: str, **others: Any) -> Any:
    """Return a text property, by default empty."""
    return bpy.props.StringProperty(name=name, description=description, **others)


def file_filter(*suffixes: str) -> Any:
    """Return the property by which the file browser of an operator shows only files with some suffixes.

    Suffixes begin with a dot, such as ".json".
    """
    pattern = ";".join(f"*{suffix}" for suffix in suffixes)
    return bpy.props.StringProperty(default=pattern, options={"HIDDEN"})


def choice(name: str, description: str, items: Iterable[tuple[Any, ...]], **others: Any) -> Any:
    """Return an enum property, by default the first item."""
    return bpy.props.EnumProperty(name=name, description=description, items=items, **others)


def color(name: str, description: str, **others: Any) -> Any:
    """Return a color property in display values (sRGB), by default black."""
    arguments = {"size": 3, "min": 0, "max": 1, "default": (0.0, 0.0, 0.0)} | others
    return bpy.props.FloatVectorProperty(
        name=name, description=description, subtype="COLOR_GAMMA", **arguments
    )


def setting_properties(cls: type) -> dict[str, Any]:
    """Return Blender's properties for a settings class, by name."""
    return {name: _setting_property(setting) for name, setting in settings_of(cls).items()}


def _setting_property(setting: Setting) -> Any:
    """Return Blender's property for a setting."""
    described: dict[str, Any] = {"name": setting.label, "description": setting.text}
    default = setting.default
    match setting:
        case Choice(options=options, option_labels=labels):
            items = [(key, labels.get(key, title(key)), help) for key, help in options.items()]
            return choice(**described, items=items, default=default)
        case Color():
            components = color_components(default, setting)
            return color(**described, default=components, size=len(components))
        case Switch():
            return toggle(**described, default=default)
        case Number(low=low, high=high, is_integer=True):
            return integer(**described, default=default, min=low, max=high)
        case Numbers(parts=parts):
            lows, highs = zip(*parts.values(), strict=True)
            return bpy.props.FloatVectorProperty(
                **described,
                default=default,
                size=len(parts),
                min=min(lows),
                max=max(highs),
                subtype="XYZ" if [*parts] == ["X", "Y", "Z"] else "NONE",
            )
        case Number(low=low, high=high, unit=unit, soft_high=soft_high):
            others = {} if soft_high is None else {"soft_max": soft_high}
            if unit == "size":
                others |= {"precision": 3, "step": 1}
            subtype = SUBTYPE_BY_UNIT.get(unit, "NONE")
            return real(**described, default=default, min=low, max=high, subtype=subtype, **others)
    raise TypeError(f"setting '{setting.name}' has no property")
