"""Add functions to Blender's lists of application handlers, and remove them."""

from collections.abc import Callable, Mapping
from typing import Any

import bpy


def add_handlers(handlers: Mapping[str, Callable[..., Any]]) -> None:
    """Add handlers, given by the names of their lists in `bpy.app.handlers`, unless they are there already."""
    for name, handler in handlers.items():
        if handler not in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).append(handler)


def remove_handlers(handlers: Mapping[str, Callable[..., Any]]) -> None:
    """Remove handlers, given by the names of their lists. Blender may have removed some when it loaded a file."""
    for name, handler in handlers.items():
        if handler in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).remove(handler)
