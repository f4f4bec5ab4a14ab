"""The progress of the running job, for the panels, and the start of the helper process.

The helper process runs the computations of jobs. It starts before the first job, so that no click has to
wait for it.
"""

from contextlib import suppress

import bpy

from ..worker.helper import HELPER, HelperLostError
from ..worker.job import Step
from .preferences import uses_helper

#: Progress of the job that runs in a window. None if no job runs.
current: Step | None = None

_has_started = False


def start_helper_once(context: bpy.types.Context) -> None:
    """Start the helper process at the first call, unless the preferences switch it off."""
    global _has_started
    if _has_started or bpy.app.background or not uses_helper(context):
        return
    _has_started = True
    with suppress(HelperLostError):
        HELPER.start()


def unregister() -> None:
    """End the helper process, and forget the progress of the job."""
    global current, _has_started
    HELPER.close()
    current, _has_started = None, False
