"""The loop of the monkey, inside Blender. Run by monkey.py, which reads what this prints."""

import argparse
import faulthandler
import os
import shutil
import sys
from itertools import pairwise
from pathlib import Path
from random import Random

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import monkey_blender  # noqa: F401  adds its actions
from extension import rosy
from monkey_actions import ACTIONS, DISTURBANCE, Monkey, action, field_in_view, meshes, select
from monkey_checks import (
    CheckError,
    all_datablocks,
    changes,
    expect_none,
    handlers,
    leftovers,
    resident_megabytes,
    whole_state,
)
from monkey_jobs import disturb_jobs

#: Number of parts of a run. After each, everything is removed and the memory is measured.
PARTS = 8

#: Megabytes by which the memory may grow in the second half of a run.
MAX_GROWTH = 150.0

#: Operators whose results can be removed, with settings.
MADE = {
    "bake": {"camera": "ALL"}, "bake_texture": {"unwrap": False}, "singularities": {"show": "BOTH"},
    "strokes": {"kind": "PENCIL", "camera": "SCENE"},
}  # fmt: skip

#: Seconds after which a step counts as hanging: its Python stack is printed, and Blender ends.
STEP_SECONDS = 120.0


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int)
    parser.add_argument("--steps", type=int)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])
    faulthandler.enable()
    os.chdir(options.folder)  # where files without a folder go
    preferences = bpy.context.preferences
    preferences.edit.undo_steps = 20
    preferences.filepaths.use_auto_save_temporary_files = False
    preferences.filepaths.save_version = 0
    try:
        run(options)
    except CheckError as failure:
        say(f"monkey failed: {failure}")
        sys.exit(1)


def say(text: str) -> None:
    print(text, flush=True)


def run(options: argparse.Namespace) -> None:
    """Do random actions, and check each of them; exit if a check fails."""
    monkey = Monkey(options.folder, lambda text: say(f"  {text}"))
    disturb_jobs(monkey)
    megabytes: list[int] = []
    restart(monkey)
    for step in range(options.steps):
        monkey.random = Random(f"{options.seed} {step}")
        (chosen,) = monkey.random.choices(list(ACTIONS), list(ACTIONS.values()))
        say(f"monkey step {step}: {chosen.__name__}")
        faulthandler.dump_traceback_later(STEP_SECONDS, exit=True)
        chosen(monkey)
        if chosen.__name__ != "undo":
            # Blender crashes if an undo meets datablocks that were deleted without a step.
            bpy.ops.ed.undo_push(message=chosen.__name__)
        faulthandler.cancel_dump_traceback_later()
        if (step + 1) % max(options.steps // PARTS, 1) == 0:
            say(f"monkey step {step}: the end of a part")
            restart(monkey)
            megabytes.append(round(resident_megabytes()))
    # Blender 5.2 takes some 200 MB at once, whenever it first needs a part of itself.
    increases = sorted(later - earlier for earlier, later in pairwise(megabytes[3:]))
    if len(megabytes) >= PARTS and sum(increases[:-1]) > MAX_GROWTH:
        raise CheckError(f"the memory grew in the second half, in MB: {megabytes}")
    for (operator, outcome), count in sorted(monkey.outcomes.items()):
        say(f"  rosy.{operator} {outcome} {count} times")
    say(f"monkey done: {options.steps} steps, MB by part {megabytes}")


def restart(monkey: Monkey) -> None:
    """Remove all that RoSy made, open an empty file, and check that nothing is left there."""
    remove_everything(monkey)
    rosy("rosy_addon.viewport.session").stop()
    rosy("rosy_addon.ui.overlay").hide()
    bpy.ops.wm.read_homefile(use_empty=True)
    left = [f"{kind}: {b.name}" for kind, b in all_datablocks() if "rosy" in b.name.lower()]
    rosy("rosy_addon.core.cache").BAKE_CACHE.clear()
    rosy("rosy_addon.scene.staleness").SCENE_STATES.clear()
    expect_none([*left, *handlers()], "an empty file holds")
    for path in monkey.folder.iterdir():
        if path.name != "user":
            shutil.rmtree(path) if path.is_dir() else path.unlink()


@action(1)
def remove_everything(monkey: Monkey) -> None:
    """Press all buttons that remove something, in all scenes, and check that nothing is left."""
    window = bpy.context.window_manager.windows[0]
    if bpy.context.mode != "OBJECT":
        return
    original, pressed = window.scene, set()
    for scene in [scene for scene in bpy.data.scenes if scene.library is None]:
        window.scene = scene
        for operator in ("remove", "strokes_remove"):
            if getattr(bpy.ops.rosy, operator).poll():
                monkey.rosy(operator)
                pressed.add(operator)
        for obj in meshes(editable=False):
            if select(monkey, obj) and bpy.ops.rosy.singularities.poll():
                monkey.rosy("singularities", show="NONE")
    window.scene = original
    # If there is nothing to remove, the user has deleted it all; what that used is unused data in the file.
    if not pressed:
        bpy.ops.outliner.orphans_purge(do_recursive=True)
    unused = () if "remove" in pressed else ("materials", "images")
    left = [found for found in leftovers() if not found.startswith(unused)]
    expect_none(left, "left after everything was removed")


@action(2)
def make_and_remove(monkey: Monkey) -> None:
    """Remove what RoSy has just made, and check that the file is as it was before."""
    if bpy.context.mode != "OBJECT" or any(obj.library for obj in bpy.data.objects):
        return
    monkey.disturbance = 0.0
    remove_everything(monkey)
    field_in_view(monkey)
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    if bpy.context.selected_objects:  # otherwise dots cannot be hidden
        for show in ("OVERLAY", "NONE"):  # which forgets the dots of deleted objects
            monkey.rosy("singularities", show=show)
        bpy.context.view_layer.update()
        before = whole_state()
        for operator, settings in monkey.random.sample(list(MADE.items()), 2):
            monkey.rosy(operator, **settings)
        remove_everything(monkey)
        bpy.context.view_layer.update()
        # Strokes that the user has deleted exist as long as RoSy's record of them.
        allowed = "context", "*RoSy Strokes*"
        expect_none(changes(before, whole_state(), allowed), "after Remove")
    monkey.disturbance = DISTURBANCE


if __name__ == "__main__":
    main()
