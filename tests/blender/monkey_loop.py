"""The loop of the monkey, inside Blender. Run by monkey.py, which reads what this prints."""

from __future__ import annotations

import argparse
import faulthandler
import json
import os
import sys
import time
import traceback
from contextlib import nullcontext, suppress
from pathlib import Path
from random import Random
from typing import NamedTuple

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import monkey_state as state
from monkey_actions import ACTIONS, Action, CheckError, Monkey, push_undo
from monkey_rosy import forget_files, remove_everything

#: Number of parts of a run. After each, everything is removed and the memory is measured.
PARTS = 8

#: Megabytes by which the memory may grow in the second half of a run.
MAX_GROWTH = 150.0

#: Number of objects of one of RoSy's classes that may be added in the second half: new settings.
MAX_OBJECTS_GROWTH = 60

#: Seconds after which the Python stack of a step is printed.
STEP_SECONDS = 120.0


class Memory(NamedTuple):
    """Memory while the file is empty: resident megabytes, and numbers of objects by class."""

    megabytes: float
    objects: dict[str, int]


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int)
    parser.add_argument("--steps", type=int)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--blender-only", action="store_true")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :])
    faulthandler.enable()
    os.chdir(options.folder)  # where files without a folder go
    preferences = bpy.context.preferences
    preferences.view.show_splash = False
    preferences.edit.undo_steps = 20
    preferences.filepaths.use_auto_save_temporary_files = False
    preferences.filepaths.save_version = 0
    work = run(options)
    if bpy.app.background:
        for _ in work:
            pass
        return
    bpy.app.timers.register(lambda: tick(work), first_interval=1.0, persistent=True)


def tick(work) -> float | None:
    try:
        pause = next(work)
    except StopIteration:
        # As a user ends Blender, so that RoSy is unregistered.
        bpy.app.timers.register(lambda: bpy.ops.wm.quit_blender() and None, first_interval=0.1)
        return None
    except SystemExit as error:
        sys.stdout.flush()
        os._exit(error.code)
    return 0.01 if pause is None else pause


def say(text: str) -> None:
    print(text, flush=True)


def run(options: argparse.Namespace):
    """Yield after each slice of work that Blender may handle events after; exit at the end."""
    window = not bpy.app.background
    monkey = Monkey(options.folder, window, not options.blender_only, lambda text: say(f"  {text}"))
    actions = [a for a in ACTIONS if monkey.uses_rosy or not a.uses_rosy]
    weights = [a.weight for a in actions]
    part_steps = max(options.steps // PARTS, 1)
    start, measured = time.monotonic(), []
    try:
        yield from restart(monkey)
        counts = state.data_counts()
        for step in range(options.steps):
            monkey.random = Random(f"{options.seed} {step}")
            (chosen,) = monkey.random.choices(actions, weights)
            say(f"monkey step {step}: {chosen.name} ({state.resident_megabytes():.0f} MB)")
            faulthandler.dump_traceback_later(STEP_SECONDS)
            step_start = time.monotonic()
            yield from in_context(monkey, chosen)
            if chosen.name != "undo":
                push_undo(chosen.name)
            if window:
                yield 0.01
            faulthandler.cancel_dump_traceback_later()
            if (seconds := time.monotonic() - step_start) > 3:
                say(f"  took {seconds:.0f} s")
            if (step + 1) % part_steps == 0:
                say(f"monkey step {step}: the end of a part")
                yield from restart(monkey)
                measured.append(check_memory(monkey, counts))
        check_growth(measured)
    except CheckError as failure:
        say(f"monkey failed: {failure}")
        sys.exit(1)
    except BaseException:
        say(f"monkey failed: {traceback.format_exc().strip().splitlines()[-1]}")
        traceback.print_exc()
        sys.exit(1)
    seconds = time.monotonic() - start
    summary = {
        "steps": options.steps,
        "seconds": round(seconds),
        "steps per second": round(options.steps / seconds, 1),
        "MB by part": [round(memory.megabytes) for memory in measured],
        "MB grown": round(memory_growth(measured)),
    }
    for (operator, outcome), count in sorted(monkey.outcomes.items()):
        say(f"  rosy.{operator} {outcome} {count} times")
    say(f"monkey done: {json.dumps(summary)}")


def in_context(monkey: Monkey, chosen: Action):
    """Run an action, in the context of the 3D view if there is a window."""
    work, bare = chosen.slices(monkey), chosen.bare
    while True:
        try:
            with nullcontext() if bare or not monkey.window else in_view():
                pause = next(work)
        except StopIteration:
            return
        if isinstance(pause, str):
            bare, pause = pause == "bare", None
        yield pause


def in_view():
    """Return a context in which operators find the 3D view."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def restart(monkey: Monkey):
    """Remove all that RoSy made, and open an empty file with one mesh and a camera."""
    if monkey.uses_rosy:
        yield from remove_everything(monkey)
        state.rosy("rosy_addon.viewport.session").stop()
        state.rosy("rosy_addon.ui.overlay").hide()
    bpy.ops.wm.read_homefile(use_empty=True)
    yield 0.3 if monkey.window else None
    forget_files(monkey)
    if monkey.uses_rosy and (left := state.handlers()):
        raise CheckError("handlers are left: " + "; ".join(left))
    if monkey.window:
        yield from open_panel()


def open_panel():
    """Show RoSy's tab of the sidebar. Its name can be set once the sidebar was drawn."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    area.spaces.active.show_region_ui = True
    for _ in range(100):
        area.tag_redraw()
        yield 0.05
        sidebar = next(region for region in area.regions if region.type == "UI")
        with suppress(AttributeError):
            sidebar.active_panel_category = "RoSy"
            return


def check_memory(monkey: Monkey, counts: dict[str, int]) -> Memory:
    """Check that an empty file holds nothing, nor does Python, and measure the memory."""
    if monkey.uses_rosy:
        state.rosy("rosy_addon.core.cache").BAKE_CACHE.clear()
        state.rosy("rosy_addon.scene.staleness").SCENE_STATES.clear()
    if (found := state.data_counts()) != counts:
        raise CheckError(f"an empty file holds {found}, it held {counts}")
    state.release_free_memory()
    return Memory(state.resident_megabytes(), state.python_objects())


def memory_growth(measured: list[Memory]) -> float:
    """Return the megabytes by which the memory grew from the middle of a run to its end.

    The smaller of two measurements counts, as free memory that is scattered is resident too.
    """
    middle, end = measured[PARTS // 2 - 1 : PARTS // 2 + 1], measured[-2:]
    return min(memory.megabytes for memory in end) - min(memory.megabytes for memory in middle)


def check_growth(measured: list[Memory]) -> None:
    """Check that neither memory nor objects grow in the second half."""
    if len(measured) < PARTS:
        return
    half, end = measured[PARTS // 2 - 1], measured[-1]
    if memory_growth(measured) > MAX_GROWTH:
        sizes = [round(memory.megabytes) for memory in measured]
        raise CheckError(f"the memory grew in the second half, in MB: {sizes}")
    grown = {
        name: (half.objects.get(name, 0), count)
        for name, count in end.objects.items()
        if count > half.objects.get(name, 0) + MAX_OBJECTS_GROWTH
    }
    if grown:
        raise CheckError(f"the numbers of objects grew in the second half: {grown}")


main()
