"""Base class of the panels in the sidebar of the 3D view, and functions that they share."""

import textwrap
from collections.abc import Sequence
from typing import Any

from bpy.types import Context, UILayout

from ..core.errors import as_sentence
from . import job_status

#: Mean width of a character, and total width of the icon and the margins of a row, in pixels at a resolution
#: scale of 1.
CHARACTER_PIXELS, MARGIN_PIXELS = 6.0, 60

#: Number of characters in a row of the narrowest sidebar.
MIN_CHARACTERS = 16


class SidebarPanel:
    """Base class of the panels. It puts them into the tab RoSy in the sidebar of the 3D view."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "RoSy"


def use_property_columns(layout: UILayout) -> None:
    """Let a layout show labels and values in two columns, without buttons for keyframes."""
    layout.use_property_split = True
    layout.use_property_decorate = False


def new_row(layout: UILayout, **settings: Any) -> UILayout:
    """Add a row to a layout, set its properties, such as ``active`` and ``scale_y``, and return it."""
    row = layout.row()
    for name, value in settings.items():
        setattr(row, name, value)
    return row


def draw_wrapped(
    layout: UILayout, context: Context, messages: Sequence[str], icon: str = "INFO"
) -> None:
    """Draw messages as sentences, each wrapped to the width of the region."""
    for message in messages:
        column = layout.column(align=True)
        for index, row in enumerate(wrap_to_sidebar(as_sentence(message), context)):
            column.label(text=row, icon="BLANK1" if index else icon)


def wrap_to_sidebar(text: str, context: Context) -> list[str]:
    """Return the rows of a text that is wrapped to the width of the region."""
    width = context.region.width / context.preferences.system.ui_scale - MARGIN_PIXELS
    return textwrap.wrap(text, max(int(width / CHARACTER_PIXELS), MIN_CHARACTERS))


def closed_panel(layout: UILayout, key: str, title: str) -> UILayout | None:
    """Add a subpanel that is closed by default. Return its layout; None while it is closed.

    Blender stores under the name `key` whether the user has opened the subpanel.
    """
    header, body = layout.panel(f"rosy_{key}", default_closed=True)
    header.label(text=title)
    return body


def draw_progress(layout: UILayout) -> None:
    """Draw the progress of the running job."""
    progress = job_status.current
    layout.progress(factor=progress.fraction, text=as_sentence(progress.label))
    layout.label(text="Press ESC to cancel")


def draw_cycles_hint(layout: UILayout, context: Context) -> None:
    """Draw a note on what hatching with the light of the scene looks like in Cycles, if Cycles is chosen."""
    if context.scene.render.engine == "CYCLES":
        layout.label(text="Cycles: occlusion, not light", icon="INFO")
