"""The table of the monkey's actions, how they call and check operators, and what they choose from.

An action is a function of a `Monkey` that `action` adds to the table with a weight. If it yields,
Blender handles its events in between (in a window). An action that does not fit the current state
does nothing. Actions keep no references to datablocks across a yield, an undo or a file.

`monkey_blender` has the actions of Blender, `monkey_rosy` those of RoSy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any
from unicodedata import category

import bpy
from monkey_state import allowed_changes, changes, fingerprint, is_owned, rosy

#: Names that a user, or a script, can give.
ODD_NAMES = (
    "a/b\\c", "line\nbreak\ttab", "\x01\x1b[31m", "é 日本 🙂", "x" * 200, "", " ", ".", "..", "con",
    "%s {0} {x}", "'quote\" `", "-flag", "a.001", "RoSy Camera", "rosy", "dir0", "position", "Suzanne",
)  # fmt: skip

#: Largest number of faces, vertices and objects that the monkey makes.
MAX_FACES, MAX_OBJECTS = 1500, 14


class CheckError(Exception):
    """A check has failed."""


@dataclass(frozen=True)
class Action:
    """An action, how often it is chosen, and where.

    Attributes
    ----------
    run : callable
    weight : float
    uses_rosy : bool
    bare : bool
        Whether to run it outside of the context of a 3D view, as it replaces the window's contents.
    """

    run: Callable[[Monkey], Iterator[float | None] | None]
    weight: float
    uses_rosy: bool
    bare: bool

    @property
    def name(self) -> str:
        return self.run.__name__

    def slices(self, monkey: Monkey) -> Iterator[Any]:
        """Run the action; yield where Blender may handle events."""
        work = self.run(monkey)
        if work is not None:
            yield from work


ACTIONS: list[Action] = []


def action(weight: float = 1.0, *, uses_rosy: bool = False, bare: bool = False) -> Callable:
    """Add a function to the table of actions."""

    def add(run: Callable) -> Callable:
        ACTIONS.append(Action(run, weight, uses_rosy, bare))
        return run

    return add


class Monkey:
    """The random choices of one step, and how operators are called and checked.

    Attributes
    ----------
    random : Random
        Of the current step, so that steps do not depend on the choices within earlier ones.
    folder : Path
        Where files go.
    window : bool
        Whether there is a window.
    uses_rosy : bool
        False for Blender's own actions alone.
    note : callable
        Prints what an action does.
    outcomes : Counter
        How often each operator of RoSy's did something, and how often it failed.
    """

    def __init__(self, folder: Path, window: bool, uses_rosy: bool, note: Callable) -> None:
        self.folder, self.window, self.uses_rosy, self.note = folder, window, uses_rosy, note
        self.random = Random()
        self.outcomes: Counter[tuple[str, str]] = Counter()

    def chance(self, probability: float) -> bool:
        return self.random.random() < probability

    def pick(self, items: Any) -> Any:
        """Return one of the items; None if there is none."""
        items = list(items)
        return self.random.choice(items) if items else None

    def name(self) -> str:
        return self.pick(ODD_NAMES)

    def blender(self, operator: str, **settings: Any) -> bool:
        """Call an operator of Blender's. Return whether it did something."""
        module, name = operator.split(".")
        function = getattr(getattr(bpy.ops, module), name)
        if not function.poll():
            return False
        try:
            return function("EXEC_DEFAULT", **settings) == {"FINISHED"}
        except RuntimeError:
            return False

    def rosy(
        self,
        operator: str,
        *,
        attribute: str | None = None,
        invoke: bool = False,
        **settings: Any,
    ) -> set[str]:
        """Call an operator of RoSy's, and check its errors and what it changes."""
        function = getattr(bpy.ops.rosy, operator)
        if attribute is not None:
            settings["attribute"] = attribute
        self.note(f"rosy.{operator} {settings}")
        allowed = allowed_changes(operator, attribute)
        before = fingerprint()
        error = None
        try:
            result = function("INVOKE_DEFAULT" if invoke else "EXEC_DEFAULT", True, **settings)
        except RuntimeError as raised:
            error, result = str(raised), {"CANCELLED"}
            check_message(error)
            self.note(f"    {error.strip()}")
        self.outcomes[operator, "failed" if error else "did"] += 1
        if result == {"RUNNING_MODAL"}:
            return result
        if differences := changes(before, fingerprint(), () if error else allowed):
            verb = f"failed ({error.strip()}), but changed" if error else "changed"
            raise CheckError(f"rosy.{operator} {verb} " + "; ".join(differences[:8]))
        return result

    def cancelled_job(self, begin: Callable[[], Any], what: str) -> None:
        """Take some steps of a job of RoSy's, cancel it, and check that nothing has changed."""
        count = self.pick([0, 1, 1, 2, 3, 5, 8])
        self.note(f"cancel {what} after {count} steps")
        before = fingerprint()
        error_class = rosy("rosy_addon.core.errors").RosyError
        try:
            steps, answer = begin(), None
            try:
                for _ in range(count):
                    step = steps.send(answer)
                    answer = step() if callable(step) else None
            finally:
                steps.close()
        except StopIteration:
            return
        except error_class as error:
            check_message(f"Error: {error}\n")
        if differences := changes(before, fingerprint()):
            raise CheckError(f"{what}, cancelled, changed " + "; ".join(differences[:8]))


def check_message(message: str) -> None:
    """Check that the text of a RuntimeError is one clear line."""
    lines = message.strip().splitlines()
    if len(lines) != 1 or "Traceback" in message or not message.startswith(("Error: ", "Operator")):
        raise CheckError(f"the error is not one line: {message!r}")
    if any(category(character) == "Cc" for character in lines[0]):
        raise CheckError(f"the error has control characters: {message!r}")


def push_undo(name: str) -> None:
    """Add an undo step, as each of Blender's own actions does.

    Blender crashes if an undo meets datablocks that were deleted without one.
    """
    bpy.ops.ed.undo_push(message=name)


# --- choices -----------------------------------------------------------------------------------


def meshes(monkey: Monkey, *, editable: bool = True) -> list[bpy.types.Object]:
    """Return the mesh objects of the view layer that are not RoSy's."""
    return [
        obj
        for obj in objects(monkey)
        if obj.type == "MESH" and not is_owned(obj) and (obj.data.library is None or not editable)
    ]


def objects(monkey: Monkey) -> list[bpy.types.Object]:
    """Return the objects of the view layer. Blender lists None for some that were deleted."""
    return [obj for obj in bpy.context.view_layer.objects if obj is not None]


def select(monkey: Monkey, obj: bpy.types.Object, *others: bpy.types.Object) -> bool:
    """Make objects the selection. Return whether that was possible."""
    if bpy.context.mode != "OBJECT" and not monkey.blender("object.mode_set", mode="OBJECT"):
        return False
    # Names do not tell: a linked object may have the name of a local one.
    present = set(objects(monkey))
    for other in present:
        other.select_set(False)
    if not present.issuperset((obj, *others)):
        return False
    for other in (obj, *others):
        other.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj.select_get()


def select_mesh(monkey: Monkey, **options: Any) -> bpy.types.Object | None:
    """Select a mesh object, and sometimes more. Return the active one."""
    candidates = meshes(monkey, **options)
    obj = monkey.pick(candidates)
    if obj is None:
        return None
    others = [other for other in candidates if monkey.chance(0.15)]
    return obj if select(monkey, obj, *others) else None


def to_object_mode(monkey: Monkey) -> bool:
    return bpy.context.mode == "OBJECT" or monkey.blender("object.mode_set", mode="OBJECT")


def is_small(mesh: bpy.types.Mesh, factor: int = 1) -> bool:
    return len(mesh.polygons) * factor <= MAX_FACES and len(mesh.vertices) * factor <= MAX_FACES
