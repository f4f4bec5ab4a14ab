"""The progress of the running job, for the panels."""

from __future__ import annotations

from ..worker.job import Step

#: How far the job has come that runs in a window; None if there is none.
current: Step | None = None
