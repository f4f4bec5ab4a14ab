"""Base class and helpers of the panels in the sidebar of the 3D view."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import bpy

from ..core.errors import as_sentence
from . import job_status

#: Mean width of a character, and width of the icon and margins of a row, at a user interface scale
#: of 1.
CHARACTER_PIXELS, MARGIN_PIXELS = 6.0, 60

#: Characters of a row in the narrowest sidebar.
MIN_CHARACTERS = 16


class SidebarPanel:
    """Base of the panels: the tab RoSy in the sidebar of the 3D view."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "RoSy"


def use_property_columns(layout: bpy.types.UILayout) -> None:
    """Draw labels and values in two columns, without buttons for keyframes."""
    layout.use_property_split = True
    layout.use_property_decorate = False


def draw_wrapped(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    messages: Sequence[str],
    icon: str = "INFO",
) -> None:
    """Draw messages as sentences, each in as many lines as the width of the region needs."""
    for message in messages:
        column = layout.column(align=True)
        for index, row in enumerate(wrap_to_sidebar(as_sentence(message), context)):
            column.label(text=row, icon="BLANK1" if index else icon)


def wrap_to_sidebar(text: str, context: bpy.types.Context) -> list[str]:
    """Return a text as rows that fit into the region."""
    width = context.region.width / context.preferences.system.ui_scale - MARGIN_PIXELS
    return textwrap.wrap(text, max(int(width / CHARACTER_PIXELS), MIN_CHARACTERS))


def closed_panel(layout: bpy.types.UILayout, key: str, title: str) -> bpy.types.UILayout | None:
    """Add a panel that is closed at first. Return its layout; None while it is closed."""
    header, body = layout.panel(f"rosy_{key}", default_closed=True)
    header.label(text=title)
    return body


def draw_progress(layout: bpy.types.UILayout) -> None:
    """Draw the progress of the running job."""
    progress = job_status.current
    layout.progress(factor=progress.fraction, text=as_sentence(progress.label))
    layout.label(text="Press ESC to cancel")


def draw_cycles_hint(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Say what hatching that follows the light does in Cycles, if that renders the scene."""
    if context.scene.render.engine == "CYCLES":
        layout.label(text="Cycles: occlusion, not light", icon="INFO")
