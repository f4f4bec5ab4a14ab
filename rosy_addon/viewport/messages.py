"""Drawing of messages in a corner of a 3D view."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import blf
import bpy

from ..core.errors import as_sentence

#: RGBA, display values.
_COLOR = 1.0, 0.6, 0.2, 1.0

#: Pixels at a user interface scale of 1: size of the font, and distances from the view's corner.
_FONT_SIZE, _LINE_HEIGHT, _LEFT, _BOTTOM = 12, 18, 16, 64

#: Characters of a row in the narrowest view.
_MIN_CHARACTERS = 20


def draw_messages(messages: Sequence[str], context: bpy.types.Context) -> None:
    """Draw messages in the lower left corner of the context's region, the first one lowest.

    They are wrapped to the part of the region that the sidebar does not cover.
    """
    if not messages:
        return
    ui_scale = context.preferences.system.ui_scale
    blf.size(0, _FONT_SIZE * ui_scale)
    blf.color(0, *_COLOR)
    width = _uncovered_width(context.area, context.region) - 2 * _LEFT * ui_scale
    character_width = blf.dimensions(0, "abcdefghijklmnopqrst")[0] / 20
    max_characters = max(int(width / character_width), _MIN_CHARACTERS)
    rows = [
        row
        for message in messages
        for row in reversed(textwrap.wrap(f"RoSy: {as_sentence(message)}", max_characters))
    ]
    for index, row in enumerate(rows):
        blf.position(0, _LEFT * ui_scale, (_BOTTOM + _LINE_HEIGHT * index) * ui_scale, 0)
        blf.draw(0, row)


def _uncovered_width(area: bpy.types.Area, region: bpy.types.Region) -> int:
    """Return the width of a region, in pixels, up to a sidebar that overlaps it."""
    sidebars = (
        other.x - region.x
        for other in area.regions
        if other.type == "UI" and other.alignment == "RIGHT" and other.width > 1
    )
    return min(region.width, *(left for left in sidebars if left > 0), region.width)
