"""Jobs that are disturbed: while they run, the monkey selects, deletes, renames and cancels.

Without a window, Blender runs a job to its end at once. `disturb_jobs` lets operators run them as in a window,
as a `Job`, and acts between its steps. So that a seed repeats a run, there is no helper process, and each
`Job.advance` makes one step.
"""

from collections.abc import Callable
from itertools import count
from types import SimpleNamespace

import bpy
from extension import rosy
from monkey_actions import Monkey, meshes, objects
from monkey_checks import fingerprint


def disturb_jobs(monkey: Monkey) -> None:
    """Disturb a share of the jobs of all operators, from now on."""
    modal_job = rosy("operators.modal_job")
    run_in_place = modal_job.ModalJobMixin.act
    modal_job.uses_helper = lambda _: False
    seconds = count(0.0, 0.8 * modal_job.SLICE_SECONDS)
    modal_job.time = SimpleNamespace(monotonic=seconds.__next__)

    def act(operator: bpy.types.Operator, context: bpy.types.Context) -> None:
        if not monkey.chance(monkey.disturbance):
            return run_in_place(operator, context)
        window = context.window_manager.windows[0]
        with context.temp_override(window=window):
            operator.resolve_objects(context)
            job = modal_job.Job(context, operator.begin(context), operator._objects)
            try:
                while job.stop_reason is None:
                    disturb(monkey, job)
                    job.advance(context)
            finally:
                job.stop("an error")
        if not job.is_done:
            raise rosy("rosy_addon.core.errors").RosyError(f"stopped: {job.stop_reason}")
        operator.finish(context, job.result)

    modal_job.ModalJobMixin.act = act


def disturb(monkey: Monkey, job: object) -> None:
    """Do something to the file while a job runs, mostly nothing. It is no change of the operator."""
    before = fingerprint()
    act: Callable[[Monkey], str | None] | None = monkey.pick([*ACTS, *[None] * 12])
    if act is not None:
        monkey.note(f"    meanwhile: {act.__name__} {act(monkey) or ''}")
    elif monkey.chance(0.02):
        job.stop("cancelled")
    bpy.context.view_layer.update()
    after = fingerprint()
    changed = [path for path in {*before, *after} if before.get(path) != after.get(path)]
    for path in changed:
        monkey.before.pop(path, None)
    monkey.before |= {path: after[path] for path in changed if path in after}


def select_others(monkey: Monkey) -> None:
    for obj in objects():
        obj.select_set(monkey.chance(0.4))
    bpy.context.view_layer.objects.active = monkey.pick([None, *objects()])


def delete(monkey: Monkey) -> str | None:
    obj = monkey.pick(obj for obj in objects() if obj.library is None)
    if obj is None or not monkey.chance(0.15):
        return None
    name = obj.name
    if monkey.chance(0.5) or obj.data is None:
        bpy.data.objects.remove(obj)
    else:  # as the user does: Blender may keep it as long as it has users
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
    return name


def rename(monkey: Monkey) -> str | None:
    obj = monkey.pick(meshes())
    if obj is not None and obj.library is None:
        obj.name = monkey.pick(["Renamed", "a/b", ""]) or "b"
        return obj.name
    return None


ACTS = (select_others, select_others, delete, rename)
