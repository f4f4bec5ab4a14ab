#!/usr/bin/env python3
"""A monkey at the panel: random, seeded actions on objects with fields, in a full Blender.

    tests/blender/monkey.py ROSY.zip --blender /path/to/blender [--seed N] [--seeds COUNT]
                            [--steps COUNT]

With `--which stable|latest`, the path is that of a `real-blender` script.

Each seed runs in a Blender of its own, with empty preferences and the zip installed. The actions
are the functions of monkey_actions.py (RoSy) and monkey_blender.py (Blender); what is checked after each of
them is in monkey_checks.py. If a check fails, a Python traceback is printed, or Blender crashes or hangs, the
seed and the last actions are printed. `--seed N` repeats them. The exit status is 0 only if all seeds
passed.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent

#: Texts in the output that mean that something is wrong.
BAD_TEXTS = ("monkey failed: ", "Traceback (most recent call last)", "EXCEPTION_ACCESS_VIOLATION")

#: A line of the output of a run that has passed begins with it.
DONE = "monkey done: "

#: Number of lines of the output, up to the fault, that are printed.
LAST_LINES = 60


def main() -> int:
    options = parse_arguments()
    command = [options.blender, *(["run", options.which] if options.which else ["-b"])]
    install = ["--command", "extension", "install-file", "-r", "user_default", "--enable"]
    failures = 0
    with tempfile.TemporaryDirectory(prefix="monkey-", ignore_cleanup_errors=True) as parent:
        folder = Path(parent)
        zipped = shutil.copy(options.zip, folder / "rosy.zip")
        subprocess.run(
            [*command, *install, str(zipped)],
            env=environment(folder / "user"), check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        for seed in range(options.seed, options.seed + options.seeds):
            lines, fault = run_seed(command, seed, options.steps, folder)
            failures += fault is not None
            print(f"seed {seed}: {fault or lines[-1]}", flush=True)
            print("\n".join(lines[-LAST_LINES:] if fault else []), flush=True)
    print(f"monkey: {options.seeds - failures} passed, {failures} failed")
    return 1 if failures else 0


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("zip", type=Path)
    parser.add_argument("--blender", required=True, help="path of Blender")
    parser.add_argument("--which", choices=("stable", "latest"), help="for a real-blender script")
    parser.add_argument("--seed", type=int, default=1, help="the first seed, by default 1")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds, by default 1")
    parser.add_argument("--steps", type=int, default=400, help="steps of each seed")
    return parser.parse_args()


def environment(user_folder: Path) -> dict[str, str]:
    user = {"BLENDER_USER_RESOURCES": str(user_folder), "PYTHONDONTWRITEBYTECODE": "1"}
    return {**os.environ, **user, "PYTHONHASHSEED": "0"}


def run_seed(
    command: list[str], seed: int, steps: int, folder: Path
) -> tuple[list[str], str | None]:
    """Run one seed. Return the output up to the first fault, and the fault; None if it passed."""
    work = folder / f"seed-{seed}"
    shutil.copytree(folder / "user", work / "user")
    script = ["--python-exit-code", "1", "-P", str(HERE / "monkey_loop.py"), "--"]
    options = ["--seed", str(seed), "--steps", str(steps), "--folder", str(work)]
    done = subprocess.run(
        [*command, *script, *options], env=environment(work / "user"), cwd=HERE.parents[1],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False,
    )  # fmt: skip
    shutil.rmtree(work, ignore_errors=True)
    lines = [line for line in done.stdout.splitlines() if line.strip()]
    for number, line in enumerate(lines):
        if any(text in line for text in BAD_TEXTS):
            return lines[: number + 30], line.strip()
    summary = [line for line in lines if line.startswith(DONE)]
    if done.returncode or not summary:
        return lines, f"Blender ended with status {done.returncode}"
    return summary, None


if __name__ == "__main__":
    sys.exit(main())
