"""What RoSy is doing at the moment, for the panels to show."""

from __future__ import annotations

from ..progress import Progress

#: How far the work under way in a window is; None when there is none.
now: Progress | None = None
