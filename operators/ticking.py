"""Long work in a window: ticked by a timer, with progress, and stopped by ESC.

An operator that does long work mixes in `Ticking` and says in `work` what is to be done. Run as
``EXEC_DEFAULT``, or without a window, it works through to the end at once.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import bpy

from ..rosy_addon.errors import RosyError
from ..rosy_addon.progress import Progress, Work, drain
from ..rosy_addon.ui import status

#: Seconds of work between two looks at what the user does.
SLICE = 0.05

#: What the user may do that would pull the data away from under the work.
INTERRUPTIONS = {
    "undo_pre": "undo was used",
    "redo_pre": "redo was used",
    "load_pre": "another file was opened",
}

_running: Job | None = None


def stop_running() -> None:
    """End the work under way, if any, as ESC would."""
    if _running is not None:
        _running.stop("RoSy was switched off")


class Job:
    """One piece of work under way in a window, and all that Blender holds for it meanwhile.

    At any time at most one job runs. Once `stop` has been called, for whatever reason, the timer,
    the handlers and the progress display are gone and `why` says what happened.
    """

    def __init__(
        self, context: bpy.types.Context, work: Work[Any], needed: Iterable[bpy.types.ID]
    ) -> None:
        global _running
        self.work = work
        self.needed = list(needed)
        self.scene = context.scene
        self.why: str | None = None
        self.result: Any = None
        self.workspaces: list[bpy.types.WorkSpace] = []
        self.manager = context.window_manager
        self.timer = self.manager.event_timer_add(0.01, window=context.window)
        self.manager.progress_begin(0, 100)
        self.handlers = [
            (getattr(bpy.app.handlers, name), self._interruption(why))
            for name, why in INTERRUPTIONS.items()
        ]
        for handlers, handler in self.handlers:
            handlers.append(handler)
        _running = self
        self._show(context, Progress(0.0, "Starting"))

    def _interruption(self, why: str) -> Any:
        def interrupt(*_: Any) -> None:
            self.stop(why)

        return interrupt

    def tick(self, context: bpy.types.Context) -> bool:
        """Work for a `SLICE`; True when done, False when there is more to do or work was stopped.

        Raises
        ------
        RosyError
            What the work raised; the job is stopped by then.
        """
        if (why := self._obstacle(context)) is not None:
            self.stop(why)
            return False
        until = time.monotonic() + SLICE
        try:
            step = next(self.work)
            while time.monotonic() < until:
                step = next(self.work)
        except StopIteration as done:
            self.result = done.value
            self.stop("done")
            return True
        except ReferenceError:
            self.stop("something it needs was deleted")
            return False
        except BaseException:
            self.stop("an error")
            raise
        self._show(context, step)
        return False

    def _obstacle(self, context: bpy.types.Context) -> str | None:
        try:
            if context.scene != self.scene:
                return "the scene was changed"
            for thing in self.needed:
                if isinstance(thing, bpy.types.Object) and not thing.users_scene:
                    return f"'{thing.name}' was deleted"
        except ReferenceError:
            return "something it needs was deleted"
        return None

    def _show(self, context: bpy.types.Context, step: Progress) -> None:
        percent = int(100 * step.fraction)
        status.now = step
        self.manager.progress_update(percent)
        if context.workspace is not None:
            if context.workspace not in self.workspaces:
                self.workspaces.append(context.workspace)
            context.workspace.status_text_set(f"RoSy: {step.label}, {percent} %     ESC: cancel")
        _redraw_sidebars(self.manager)

    def stop(self, why: str) -> None:
        """End the work, if it has not ended, and let go of everything. May be called again."""
        global _running
        if self.why is not None:
            return
        self.why = why
        _running = None
        status.now = None
        try:
            self.work.close()
        except ReferenceError:
            pass  # what it would have put back is gone
        finally:
            self._let_go()

    def _let_go(self) -> None:
        for handlers, handler in self.handlers:
            handlers.remove(handler)
        self.manager.event_timer_remove(self.timer)
        self.manager.progress_end()
        for workspace in self.workspaces:
            # The text belongs to the context's workspace, whichever workspace is asked.
            with bpy.context.temp_override(workspace=workspace):
                workspace.status_text_set(None)
        _redraw_sidebars(self.manager)


def _redraw_sidebars(manager: bpy.types.WindowManager) -> None:
    for window in manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                for region in area.regions:
                    if region.type == "UI":
                        region.tag_redraw()


class Ticking:
    """What an operator doing long work has in common with others: execute, invoke, modal, cancel."""

    _job: Job | None = None

    #: What is true when work was stopped.
    if_stopped = "nothing was changed"

    def work(self, context: bpy.types.Context) -> Work[Any]:
        """What is to be done. An error may be raised here or by the work itself."""
        raise NotImplementedError

    def needed(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        """Objects without which the work cannot go on."""
        return ()

    def finish(self, context: bpy.types.Context, result: Any) -> None:
        """Tell the user what came of it."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            result = drain(self.work(context))
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.finish(context, result)
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self._job = Job(context, self.work(context), self.needed(context))
        except RosyError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._job
        if job.why is None and event.type == "ESC" and event.value == "PRESS":
            job.stop("cancelled")
        elif job.why is None and event.type == "TIMER":
            try:
                if job.tick(context):
                    self.finish(context, job.result)
                    return {"FINISHED"}
            except RosyError as error:
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
        if job.why is not None:
            self.report({"INFO"}, f"RoSy stopped, {self.if_stopped}: {job.why}")
            return {"CANCELLED"}
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the operator itself, as when its window is closed or a file is opened."""
        if self._job is not None:
            self._job.stop("the window was closed")
