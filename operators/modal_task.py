"""Modal tasks: long work in small slices on a timer, with a progress display. ESC cancels it.

An operator derives from `ModalTaskMixin`, and returns its task from `make_task`. If it is called
with ``EXEC_DEFAULT``, or if there is no window, the task runs to completion at once.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import bpy

from ..rosy_addon.errors import REPORTED_ERRORS, as_sentence
from ..rosy_addon.progress import Progress, Task, run_to_completion
from ..rosy_addon.ui import job_status
from ..rosy_addon.viewport.view3d import redraw_sidebars
from .reports import report_error, report_operator_error

#: Seconds of work in each slice. Events of the user are handled between slices.
SLICE_SECONDS = 0.05

#: Handlers of events that invalidate the data of a task, and the reasons that the user is told.
INTERRUPT_REASONS = {
    "undo_pre": "undo was used",
    "redo_pre": "redo was used",
    "load_pre": "another file was opened",
}

#: The running job, if any.
_current_job: Job | None = None


def stop_current_job() -> None:
    """Cancel the current job, if any, like ESC."""
    if _current_job is not None:
        _current_job.stop("RoSy was disabled")


class Job:
    """A task that runs in a window, with its timer, handlers and progress display.

    At most one job runs at a time. `stop` releases the timer, the handlers and the progress
    display, and sets `stop_reason`.

    Parameters
    ----------
    context : bpy.types.Context
    task : Task
    required_data : iterable of bpy.types.ID
        Datablocks that the task needs. The job stops if one of them is deleted.

    Attributes
    ----------
    stop_reason : str or None
        Why the job has ended; None while it runs.
    result : Any
        The result of the task once it is done.
    """

    def __init__(
        self, context: bpy.types.Context, task: Task[Any], required_data: Iterable[bpy.types.ID]
    ) -> None:
        """Start the timer, the handlers and the progress display, and make this the current job."""
        global _current_job
        self.task = task
        self.required_data = list(required_data)
        self.scene, self.view_layer = context.scene, context.view_layer
        self.stop_reason: str | None = None
        self.result: Any = None
        self.workspaces: list[bpy.types.WorkSpace] = []
        self.window_manager = context.window_manager
        self.timer = self.window_manager.event_timer_add(0.01, window=context.window)
        self.window_manager.progress_begin(0, 100)
        self.handlers = [
            (getattr(bpy.app.handlers, name), self._make_interrupt_handler(reason))
            for name, reason in INTERRUPT_REASONS.items()
        ]
        for handlers, handler in self.handlers:
            handlers.append(handler)
        _current_job = self
        self._show_progress(context, Progress(0.0, "Starting"))

    def _make_interrupt_handler(self, reason: str) -> Any:
        """Return an application handler that stops the job."""

        def interrupt(*_: Any) -> None:
            self.stop(reason)

        return interrupt

    def run_slice(self, context: bpy.types.Context) -> bool:
        """Run the task for `SLICE_SECONDS`.

        Returns
        -------
        bool
            True if the task is done. False if it continues, or the job was stopped.

        Raises
        ------
        RosyError
            An error of the task. The job is stopped in this case.
        """
        if (reason := self._abort_reason(context)) is not None:
            self.stop(reason)
            return False
        deadline = time.monotonic() + SLICE_SECONDS
        try:
            progress = next(self.task)
            while time.monotonic() < deadline:
                progress = next(self.task)
        except StopIteration as done:
            self.result = done.value
            self.stop("done")
            return True
        except ReferenceError:
            self.stop("required data was deleted")
            return False
        except BaseException:
            self.stop("an error")
            raise
        self._show_progress(context, progress)
        return False

    def _abort_reason(self, context: bpy.types.Context) -> str | None:
        """Return why the job cannot continue; None if it can."""
        try:
            if context.scene != self.scene:
                return "another scene was chosen"
            if context.view_layer != self.view_layer:  # tasks hold its depsgraph
                return "another view layer was chosen"
            for data_block in self.required_data:
                if isinstance(data_block, bpy.types.Object) and not data_block.users_scene:
                    return f"'{data_block.name}' was deleted"
        except ReferenceError:
            return "required data was deleted"
        return None

    def _show_progress(self, context: bpy.types.Context, progress: Progress) -> None:
        """Show the progress in the cursor, the status bar and the sidebars."""
        percent = int(100 * progress.fraction)
        job_status.current = progress
        self.window_manager.progress_update(percent)
        if context.workspace is not None:
            if context.workspace not in self.workspaces:
                self.workspaces.append(context.workspace)
            label = as_sentence(progress.label)
            context.workspace.status_text_set(f"RoSy: {label}, {percent} %     ESC: Cancel")
        redraw_sidebars()

    def stop(self, reason: str) -> None:
        """Stop the job, and release everything that it holds. Later calls have no effect."""
        global _current_job
        if self.stop_reason is not None:
            return
        self.stop_reason = reason
        _current_job = None
        job_status.current = None
        try:
            self.task.close()
        except ReferenceError:
            pass  # the data that the task would restore were deleted
        finally:
            self._cleanup()

    def _cleanup(self) -> None:
        """Remove the handlers, the timer and the progress display."""
        for handlers, handler in self.handlers:
            handlers.remove(handler)
        self.window_manager.event_timer_remove(self.timer)
        self.window_manager.progress_end()
        for workspace in self.workspaces:
            # `status_text_set` acts on the context's workspace, not on the one it is called on.
            with bpy.context.temp_override(workspace=workspace):
                workspace.status_text_set(None)
        redraw_sidebars()


class ModalTaskMixin:
    """Mixin of operators that run a task: implements execute, invoke, modal and cancel."""

    _job: Job | None = None

    #: State of the scene or of the files after a cancel, for the message to the user.
    cancel_note = "nothing was changed"

    def make_task(self, context: bpy.types.Context) -> Task[Any]:
        """Return the task of the operator.

        Raises
        ------
        RosyError
            Reported to the user, like errors that the task itself raises.
        """
        raise NotImplementedError

    def required_data(self, context: bpy.types.Context) -> Iterable[bpy.types.ID]:
        """Return the datablocks that the task needs. The job stops if one of them is deleted."""
        return ()

    def finish(self, context: bpy.types.Context, result: Any) -> None:
        """Report the result of the task to the user."""

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            result = run_to_completion(self.make_task(context))
        except REPORTED_ERRORS as error:
            return report_error(self, error)
        self.finish(context, result)
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self._job = Job(context, self.make_task(context), self.required_data(context))
        except REPORTED_ERRORS as error:
            return report_error(self, error)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._job
        if job.stop_reason is None and event.type == "ESC" and event.value == "PRESS":
            job.stop("cancelled")
        elif job.stop_reason is None and event.type == "TIMER":
            try:
                if job.run_slice(context):
                    self.finish(context, job.result)
                    return {"FINISHED"}
            except REPORTED_ERRORS as error:
                return report_error(self, error)
        if job.stop_reason is not None:
            self.report({"INFO"}, f"RoSy stopped, {self.cancel_note}: {job.stop_reason}")
            return {"CANCELLED"}
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop the job. Blender calls this if the window is closed or a file is opened."""
        if self._job is not None:
            self._job.stop("the window was closed")


class DialogTaskMixin(ModalTaskMixin):
    """Mixin of operators that may ask the user something before they run their task.

    Blender frees an operator when its dialog or file browser is confirmed. So a second operator, with
    the answer, does the work.
    """

    _has_asked = False

    def ask(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str] | None:
        """Open a dialog or a file browser. Return what that returns; None if there is no need to ask.

        Raises
        ------
        RosyError
            Reported to the user.
        """
        raise NotImplementedError

    def take_answer(self, context: bpy.types.Context) -> None:
        """Set the properties of the operator that does the work, so that it need not ask again."""

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            result = self.ask(context, event)
        except REPORTED_ERRORS as error:
            return report_error(self, error)
        if result is None:
            return super().invoke(context, event)
        self._has_asked = True
        return result

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._has_asked:
            return super().execute(context)
        self.take_answer(context)
        names = self.properties.bl_rna.properties.keys()
        settings = {
            name: getattr(self, name)
            for name in names
            if name != "rna_type" and self.properties.is_property_set(name)
        }
        operator = getattr(bpy.ops.rosy, type(self).bl_idname.partition(".")[2])
        try:
            result = operator("INVOKE_DEFAULT", **settings)
        except RuntimeError as error:  # reported by the second operator
            return report_operator_error(self, error)
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}
