"""Modal operators that run a job. A helper process computes, a timer polls it, and ESC cancels the job.

An operator derives from `ModalJobMixin`, and returns the steps of its job from `begin`. If it is called
with ``EXEC_DEFAULT``, or if there is no window, the job runs in Blender's process at once.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from typing import Any

import bpy
from bpy.types import Context, Event, Mesh, Object, WorkSpace
from bpy_extras.io_utils import ExportHelper

from ..rosy_addon.core.errors import (
    REPORTED_ERRORS,
    RosyError,
    RosyWarning,
    as_sentence,
    telling_warnings,
)
from ..rosy_addon.scene.app_handlers import add_handlers, remove_handlers
from ..rosy_addon.scene.datablocks import field_mesh
from ..rosy_addon.scene.visible_objects import field_objects
from ..rosy_addon.ui import job_status
from ..rosy_addon.ui.preferences import uses_helper
from ..rosy_addon.ui.property_makers import toggle
from ..rosy_addon.viewport.view3d import redraw_sidebars
from ..rosy_addon.worker.helper import HELPER, HelperLostError
from ..rosy_addon.worker.job import Step, Steps, run
from ..rosy_addon.worker.step_runner import StepRunner
from .base import EDITABLE_FIELD, RosyOperator, selected_mesh_objects

#: Longest time in seconds for which steps run in Blender's process before the user's events are handled.
SLICE_SECONDS = 0.05

#: Seconds between two polls of the helper process.
TIMER_SECONDS = 0.01

#: Blender's lists of handlers for events that invalidate the data of a job, and the reason for the user why
#: the job is then stopped.
INTERRUPT_REASONS = {
    "undo_pre": "undo was used",
    "redo_pre": "redo was used",
    "load_pre": "another file was opened",
}

#: Warning if no helper process can be started. It is shown once.
NO_HELPER = "Blender waits while RoSy computes, as no other process can be started"

#: Reason for the end of a job that has a result.
DONE = "done"

#: The running job, or None.
_current_job: Job | None = None

#: Whether the warning that there is no helper process was shown.
_has_said_no_helper = False


def stop_current_job() -> None:
    """Cancel the current job, if there is one, as ESC does."""
    if _current_job is not None:
        _current_job.stop("RoSy was disabled")


def deleted_object(objects: Mapping[str, Object]) -> str | None:
    """Return the name of an object that was deleted since its name was read; None if there is none.

    An object that is in no scene counts as deleted: Blender keeps it while something else refers to it.
    """
    for name, obj in objects.items():
        try:
            is_deleted = not obj.users_scene
        except ReferenceError:
            is_deleted = True
        if is_deleted:
            return name
    return None


class Job:
    """A job that runs in a window, with its timer, handlers and progress display.

    At most one job runs at a time. `stop` ends the helper process, removes the timer, the handlers and
    the progress display, and sets `stop_reason`.

    Parameters
    ----------
    context : bpy.types.Context
    steps : Steps
    objects : mapping of str to bpy.types.Object
        The objects that the job works on, by name. It stops if one of them is deleted.

    Attributes
    ----------
    stop_reason : str or None
        Why the job has ended; None while it runs.
    result : Any
        The result of the job once it is done.
    """

    def __init__(self, context: Context, steps: Steps[Any], objects: Mapping[str, Object]) -> None:
        """Start the timer, the handlers and the progress display, and make this the current job."""
        global _current_job
        self.objects = objects
        self.scene, self.view_layer = context.scene, context.view_layer
        self.stop_reason: str | None = None
        self.result: Any = None
        HELPER.is_usable = uses_helper(context)
        self._runner = StepRunner(steps, HELPER)
        self.workspaces: list[WorkSpace] = []
        self.window_manager = context.window_manager
        self.timer = self.window_manager.event_timer_add(TIMER_SECONDS, window=context.window)
        self.window_manager.progress_begin(0, 100)
        self.handlers = {
            name: lambda *_, reason=reason: self.stop(reason)
            for name, reason in INTERRUPT_REASONS.items()
        }
        add_handlers(self.handlers)
        _current_job = self
        self._show_progress(context, Step(0.0, "starting"))

    @property
    def is_done(self) -> bool:
        """Whether the job has ended with a result."""
        return self.stop_reason == DONE

    def advance(self, context: Context) -> None:
        """Poll the helper process, and run steps of the job until it waits for the helper process again.

        Raises
        ------
        RosyError
            If the job raises an error. It is stopped then.
        """
        deadline = time.monotonic() + SLICE_SECONDS
        try:
            if (reason := self._abort_reason(context)) is not None:
                self.stop(reason)
                return
            while self._runner.poll() and time.monotonic() < deadline:
                with self._waiting(context) if self._runner.is_in_place else nullcontext():
                    self._runner.advance()
                self._show_progress(context, self._runner.step)
            self._show_progress(context, self._runner.step)
        except StopIteration as end:
            self.result = end.value
            self.stop(DONE)
        except ReferenceError:
            self.stop("required data was deleted")
        except BaseException:
            self.stop("an error")
            raise

    def finish(self, context: Context) -> None:
        """Run until the job is done or stopped."""
        self.advance(context)
        while self.stop_reason is None:
            HELPER.wait(SLICE_SECONDS)
            self.advance(context)

    @contextmanager
    def _waiting(self, context: Context) -> Iterator[None]:
        """Context manager: show the wait cursor.

        Warn once if there is no helper process although the preferences ask for one.
        """
        global _has_said_no_helper
        if uses_helper(context) and not _has_said_no_helper:
            _has_said_no_helper = True
            warnings.warn(NO_HELPER, RosyWarning, stacklevel=2)
        context.window.cursor_modal_set("WAIT")
        try:
            yield
        finally:
            context.window.cursor_modal_restore()

    def _abort_reason(self, context: Context) -> str | None:
        """Return why the job cannot continue; None if it can."""
        if context.scene != self.scene:
            return "another scene was chosen"
        if context.view_layer != self.view_layer:  # jobs use the depsgraph of the view layer
            return "another view layer was chosen"
        name = deleted_object(self.objects)
        return None if name is None else f"'{name}' was deleted"

    def _show_progress(self, context: Context, step: Step | None) -> None:
        """If the progress has changed, show it at the cursor, in the status bar and in the sidebars."""
        if step is None or step == job_status.current:
            return
        job_status.current = step
        percent, label = int(100 * step.fraction), as_sentence(step.label)
        self.window_manager.progress_update(percent)
        if context.workspace not in self.workspaces:
            self.workspaces.append(context.workspace)
        context.workspace.status_text_set(f"RoSy: {label}, {percent} %     ESC: Cancel")
        redraw_sidebars()

    def stop(self, reason: str) -> None:
        """Stop the job, for a reason that the user is told, and free its resources.

        Later calls have no effect.
        """
        global _current_job
        if self.stop_reason is not None:
            return
        self.stop_reason = reason
        _current_job = None
        job_status.current = None
        try:
            self._runner.close()
        except ReferenceError:
            pass  # the user has deleted data that the job wants to restore
        finally:
            self._cleanup()
        with suppress(HelperLostError):
            HELPER.start()  # so that it is ready for the next job

    def _cleanup(self) -> None:
        """Remove the handlers, the timer and the progress display."""
        remove_handlers(self.handlers)
        self.window_manager.event_timer_remove(self.timer)
        self.window_manager.progress_end()
        for workspace in self.workspaces:
            # `status_text_set` acts on the context's workspace, not on the one it is called on.
            with bpy.context.temp_override(workspace=workspace):
                workspace.status_text_set(None)
        redraw_sidebars()


class ModalJobMixin(RosyOperator):
    """Mixin of operators that run a job, and may ask the user something before.

    It implements act, invoke, execute, modal and cancel. Blender frees an operator when its dialog or file
    browser is confirmed. So the operator is then called a second time, with the answer in its properties, to
    do the work.

    The objects that the operator works on are found once, when it is invoked (`find_objects`). The selection
    may change while a dialog is open or the job runs.
    """

    _job: Job | None = None
    _has_asked = False

    #: The objects that the operator works on, by their names when it was invoked.
    _objects: Mapping[str, Object] = {}

    @property
    def objects(self) -> list[Object]:
        """The objects that the operator works on."""
        return list(self._objects.values())

    @property
    def meshes(self) -> list[Mesh]:
        """The meshes that hold the fields of the objects, each once."""
        return list(dict.fromkeys(map(field_mesh, self.objects)))

    #: Sentence for the user that says in which state the scene or files are after the job was cancelled.
    cancel_note = "nothing was changed"

    def begin(self, context: Context) -> Steps[Any]:
        """Return the steps of the operator's job.

        Raises
        ------
        RosyError
            The message is reported to the user, as are errors that the job itself raises.
        """
        raise NotImplementedError

    def find_objects(self, context: Context) -> list[Object]:
        """Return the objects that the operator works on. Its job stops if one of them is deleted.

        By default, these are all visible objects with a field.
        """
        return field_objects(context.view_layer)

    def resolve_objects(self, context: Context) -> None:
        """Set the objects that the operator works on, when it is invoked."""
        self._objects = {obj.name_full: obj for obj in self.find_objects(context)}

    def ask(self, context: Context, event: Event) -> set[str] | None:
        """Open a dialog or a file browser, and return the result of the operator. None if nothing is asked.

        Raises
        ------
        RosyError
            The message is reported to the user.
        """
        return None

    def take_answer(self, context: Context) -> None:
        """Set the properties for the second call of the operator, so that it does not ask again."""

    def finish(self, context: Context, result: Any) -> None:
        """Report the result of the job to the user. By default, it is reported if it is a text."""
        if isinstance(result, str):
            self.report_done(result)

    def act(self, context: Context) -> None:
        self.resolve_objects(context)
        self.finish(context, run(self.begin(context)))

    def invoke(self, context: Context, event: Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            self.resolve_objects(context)
            if (question := self.ask(context, event)) is not None:
                self._has_asked = True
                return question
            with telling_warnings(self.report_warnings):
                self._job = Job(context, self.begin(context), self._objects)
        except REPORTED_ERRORS as error:
            return self.report_error(error)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Context) -> set[str]:
        if not self._has_asked:
            return super().execute(context)
        if (deleted := deleted_object(self._objects)) is not None:
            return self.report_error(RosyError(f"object '{deleted}' was deleted: start again"))
        self.take_answer(context)
        names = self.properties.bl_rna.properties.keys()
        settings = {
            name: getattr(self, name)
            for name in names
            if name != "rna_type" and self.properties.is_property_set(name)
        }
        operator = getattr(bpy.ops.rosy, type(self).bl_idname.partition(".")[2])
        with context.temp_override(selected_objects=self.objects):
            return self.call(operator, **settings)

    def modal(self, context: Context, event: Event, *, runs_to_end: bool = False) -> set[str]:
        """Handle an event while the job runs. If `runs_to_end`, complete the job at once."""
        job = self._job
        if job.stop_reason is None and event.type == "ESC" and event.value == "PRESS":
            job.stop("cancelled")
        elif job.stop_reason is None and (runs_to_end or event.type == "TIMER"):
            try:
                with telling_warnings(self.report_warnings):
                    (job.finish if runs_to_end else job.advance)(context)
            except REPORTED_ERRORS as error:
                return self.report_error(error)
            if job.is_done:
                self.finish(context, job.result)
                return {"FINISHED"}
        if job.stop_reason is not None:
            self.report({"INFO"}, f"RoSy stopped, {self.cancel_note}: {job.stop_reason}")
            return {"CANCELLED"}
        return {"PASS_THROUGH"}

    def cancel(self, context: Context) -> None:
        """Stop the job. Blender calls this if the window is closed or a file is opened."""
        if self._job is not None:
            self._job.stop("the window was closed")


class ActiveMeshMixin:
    """Mixin of operators on the active mesh and its field."""

    conditions = EDITABLE_FIELD

    def find_objects(self, context: Context) -> list[Object]:
        return selected_mesh_objects(context)[:1]


class FileJobMixin(ModalJobMixin):
    """Mixin of operators that ask for a file, unless `skip_browser` is set.

    By default, it is a file to write, and the result of the job is its path.
    """

    skip_browser: toggle(
        "Skip Browser", "Start without a file browser", options={"HIDDEN", "SKIP_SAVE"}
    )

    def ask(self, context: Context, event: Event) -> set[str] | None:
        """Ask for the path of the file."""
        return None if self.skip_browser else ExportHelper.invoke(self, context, event)

    def take_answer(self, context: Context) -> None:
        self.skip_browser = True

    def finish(self, context: Context, result: Any) -> None:
        self.report_done(f"Wrote {result}")
