"""Read the cases of `cases.toml`, and run some of them with the files of one revision (TREE).

compare_outputs.py starts it as a child process::

    run_cases.py TREE OUTPUTS LANE NAME...

Each case runs in the folder OUTPUTS/NAME, where its outputs stay.
"""

import contextlib
import importlib
import importlib.util
import io
import itertools
import os
import re
import shlex
import sys
import time
import tomllib
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FOLDER = Path(__file__).resolve().parent
TABLES = tomllib.loads((FOLDER / "cases.toml").read_text(encoding="utf-8"))
PRESETS = sorted(path.stem for path in (FOLDER.parents[1] / "presets").glob("*.json"))

#: Files with what a case printed, and with its exit status, which is written last.
LOG, STATUS = "log.txt", "status.txt"

#: Pattern of the name of an input file in the code of a case, and folder of these files, next to the outputs.
INPUT, INPUTS = r"@([\w.-]+)", "inputs"

#: Environments in which cases run: `numpy` is plain Python, `bpy` is Blender's Python module, `card` is a
#: full Blender with a graphics card.
LANES = ("numpy", "bpy", "card")


class Case(NamedTuple):
    """A case: Python statements whose outputs are compared, and their expected exit status."""

    name: str
    lane: str
    code: str
    status: int


def read_cases() -> dict[str, Case]:
    """Return all cases by name."""
    cases = {}
    for group, table in TABLES["groups"].items():
        for pattern, runs in table["cases"].items():
            code = "; ".join(
                table["code"].replace("{}", words)
                for words in ([runs] if isinstance(runs, str) else runs)
            )
            for word, meaning in TABLES["words"].items():
                code = code.replace(word, meaning)
            for name, case_code in _expanded(pattern, code):
                name = table.get("prefix", f"{group}-") + name
                cases[name] = Case(name, table["lane"], case_code, table.get("status", 0))
    return cases


def _expanded(pattern: str, code: str) -> list[tuple[str, str]]:
    """Return a name and the code for each combination of the words that the pattern lists in braces."""
    choices = [
        PRESETS if words == "preset" else words.split(",")
        for words in re.findall(r"\{(.*?)\}", pattern)
    ]
    expanded = []
    for chosen in itertools.product(*choices):
        name, case_code = re.sub(r"\{.*?\}", "{}", pattern).format(*chosen), code
        for number, word in enumerate(chosen):
            case_code = case_code.replace(f"{{{number}}}", word)
        expanded.append((name, case_code))
    return expanded


def run_child(tree: Path, outputs: Path, lane: str, names: list[str]) -> None:
    """Run cases with the package in `tree`. Each case runs in a folder of its own in `outputs`."""
    cases = read_cases()
    sys.path[:0] = [str(tree), str(FOLDER)]
    extension = None if lane == "numpy" else load_extension(tree)
    parser = importlib.import_module(f"{'rosy.' * (extension is not None)}rosy_addon.cli.parser")
    assert Path(parser.__file__).is_relative_to(tree)
    for name in names:
        case, folder, start = cases[name], outputs / name, time.process_time()
        folder.mkdir(parents=True)
        os.chdir(folder)
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            try:
                status = str(run_case(case, parser.main))
            except BaseException:
                status = "error"
                traceback.print_exc()
        seconds = time.process_time() - start
        (folder / LOG).write_text(f"{printed.getvalue()}\n{seconds:.2f} s of processor time\n")
        (folder / "scene.blend").unlink(missing_ok=True)
        (folder / STATUS).write_text(status)
    if extension is not None:
        extension.unregister()


def load_extension(tree: Path) -> Any:
    """Load the folder `tree` as the package `rosy`, as Blender loads an extension, and register it."""
    spec = importlib.util.spec_from_file_location(
        "rosy", tree / "__init__.py", submodule_search_locations=[str(tree)]
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules["rosy"] = module
    importlib.import_module("bpy")
    spec.loader.exec_module(module)
    module.register()
    return module


def run_case(case: Case, main: Callable[..., int]) -> int:
    """Run a case in the current folder, with the variables of its lane. Return the largest exit status."""
    statuses = [0]

    def cli(line: str) -> None:
        words = []
        for word in shlex.split(line):
            words += ["--set", word] if "=" in word else [word]
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            statuses.append(main(words))
        if "--json" in words:
            with Path("stdout.txt").open("a") as file:
                file.write(printed.getvalue())
        print(printed.getvalue())

    def save(**arrays: Any) -> None:
        for key, value in arrays.items():
            if isinstance(value, np.ndarray):
                np.save(f"{key}.npy", value)
            else:
                Path(f"{key}.txt").write_text(f"{value}")

    names = {"cli": cli, "save": save, "np": np, "os": os}
    if case.lane != "numpy":
        import blender_scene

        names |= blender_scene.names_of_case(case.name)
    exec(re.sub(INPUT, rf"../../{INPUTS}/\1", case.code), names)
    return max(statuses)


if __name__ == "__main__":
    tree, outputs, lane, *names = sys.argv[sys.argv.index("--child") + 1 :]
    run_child(Path(tree), Path(outputs), lane, names)
