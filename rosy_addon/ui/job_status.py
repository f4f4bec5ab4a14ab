"""The progress of the running task, for the panels."""

from __future__ import annotations

from ..progress import Progress

#: Progress of the modal task that is running; None if there is none.
current: Progress | None = None
