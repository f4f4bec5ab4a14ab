"""Drawing of messages in a corner of a 3D view."""

from __future__ import annotations

from collections.abc import Sequence

import blf

#: RGBA, display values.
_COLOR = 1.0, 0.6, 0.2, 1.0

#: Pixels at a user interface scale of 1: size of the font, and distances from the view's corner.
_FONT_SIZE, _LINE_HEIGHT, _LEFT, _BOTTOM = 12, 18, 16, 64


def draw_messages(lines: Sequence[str], ui_scale: float) -> None:
    """Draw lines of text in the lower left corner of the current region, the first one lowest."""
    blf.size(0, _FONT_SIZE * ui_scale)
    blf.color(0, *_COLOR)
    for row, line in enumerate(lines):
        blf.position(0, _LEFT * ui_scale, (_BOTTOM + _LINE_HEIGHT * row) * ui_scale, 0)
        blf.draw(0, f"RoSy: {line}")
