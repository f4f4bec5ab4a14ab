#!/usr/bin/env python3
"""A monkey at the panel: random, seeded actions on objects with fields, in a full Blender.

    tests/blender/monkey.py ROSY.zip --blender /path/to/blender [--seed N] [--seeds COUNT]
                            [--steps COUNT] [--window] [--blender-only]

With `--which stable|latest`, the path is that of a `real-blender` script.

Each seed runs in a Blender of its own, with empty preferences and the zip installed. The actions
are the functions of monkey_blender.py and monkey_rosy.py; what is checked after each of them is in
monkey_state.py and monkey_loop.py. If a check fails, a Python traceback is printed, or Blender crashes or hangs, the
seed and the last actions are printed. `--seed N` repeats them. `--blender-only` leaves out
everything of RoSy's, to see whether Blender alone does the same. The exit status is 0 only if all
seeds passed.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]

#: Starts of lines of monkey_loop.py.
STEP, FAILED, DONE = "monkey step ", "monkey failed: ", "monkey done: "

#: Texts that Blender or Python prints only if something is wrong.
BAD_TEXTS = (
    "Traceback (most recent call last)",
    "EXCEPTION_ACCESS_VIOLATION",
    "Segmentation fault",
)

#: Seconds without any output after which Blender counts as hanging.
SILENCE_SECONDS = 150.0

#: Number of lines of one step after which Blender counts as hanging, too.
MAX_LINES_PER_STEP = 100_000

#: Number of actions, and of other lines, that are printed after a failure.
LAST_STEPS, LAST_LINES = 15, 60


def main() -> int:
    options = parse_arguments()
    folder = Path(tempfile.mkdtemp(prefix="monkey-"))
    try:
        zipped = folder / "rosy.zip"
        shutil.copy(options.zip, zipped)
        install = ("--command", "extension", "install-file", "-r", "user_default", "--enable")
        subprocess.run(
            [*blender_command(options, False), *install, str(zipped)],
            env=environment(folder / "user"), cwd=REPOSITORY, check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        failures = sum(not run_seed(options, seed, folder) for seed in options.seed_range)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    count = len(options.seed_range)
    print(f"monkey: {count - failures} passed, {failures} failed")
    return 1 if failures else 0


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("zip", type=Path)
    parser.add_argument("--blender", default=os.environ.get("BLENDER"), help="path of Blender")
    parser.add_argument("--which", choices=("stable", "latest"), help="for a real-blender script")
    parser.add_argument("--seed", type=int, default=1, help="the first seed, by default 1")
    parser.add_argument("--seeds", type=int, default=1, help="number of seeds, by default 1")
    parser.add_argument("--steps", type=int, default=400, help="steps of each seed")
    parser.add_argument("--window", action="store_true", help="in a window, instead of headless")
    parser.add_argument("--blender-only", action="store_true", help="leave out RoSy's actions")
    parser.add_argument("--log", type=Path, help="folder for the whole output of each seed")
    options = parser.parse_args()
    if not options.blender:
        parser.error("give the path of Blender: --blender, or the variable BLENDER")
    if not options.zip.is_file():
        parser.error(f"{options.zip} is not a file: build it first")
    options.seed_range = range(options.seed, options.seed + options.seeds)
    return options


def blender_command(options: argparse.Namespace, window: bool) -> list[str]:
    """Return the command that starts Blender, to which its arguments are appended."""
    if options.which is None:
        return [options.blender, *([] if window else ["-b"])]
    verb = ["gui", options.which, "-s", "86400"] if window else ["run", options.which]
    return [options.blender, *verb]


def environment(user_folder: Path) -> dict[str, str]:
    user = {"BLENDER_USER_RESOURCES": str(user_folder), "PYTHONDONTWRITEBYTECODE": "1"}
    return {**os.environ, **user, "PYTHONHASHSEED": "0"}


def run_seed(options: argparse.Namespace, seed: int, folder: Path) -> bool:
    """Run one seed, and print how it ended. Return whether it passed."""
    work = folder / f"seed-{seed}"
    shutil.copytree(folder / "user", work / "user")
    window = ["--window-geometry", "0", "0", "640", "480", "--enable-event-simulate"]
    command = [
        *blender_command(options, options.window), *(window if options.window else []),
        "--python-exit-code", "1", "-P", str(HERE / "monkey_loop.py"), "--",
        "--seed", str(seed), "--steps", str(options.steps), "--folder", str(work),
        *(["--blender-only"] if options.blender_only else []),
    ]  # fmt: skip
    process = subprocess.Popen(
        command, env=environment(work / "user"), cwd=REPOSITORY, text=True, errors="replace",
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
    )  # fmt: skip
    start = time.monotonic()
    log = Log(options.log and options.log / f"seed-{seed}.log")
    failure = watch(process, log)
    shutil.rmtree(work, ignore_errors=True)
    if failure is None:
        summary = json.loads(log.summary)
        print(f"seed {seed}: passed, {describe(summary)}", flush=True)
        return True
    print(f"seed {seed}: {failure} (after {time.monotonic() - start:.0f} s)")
    print("\n".join([*log.steps, *log.lines]), flush=True)
    return False


def describe(summary: dict) -> str:
    return ", ".join(f"{name} {value}" for name, value in summary.items())


class Log:
    """The output of one Blender: the last steps, the lines after the last one, and the summary."""

    def __init__(self, path: Path | None) -> None:
        self.steps: deque[str] = deque(maxlen=LAST_STEPS)
        self.lines: deque[str] = deque(maxlen=LAST_LINES)
        self.summary: str | None = None
        self.failure: str | None = None
        self.line_count = 0
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
        self.file = None if path is None else path.open("w")

    def add(self, line: str) -> None:
        if self.file is not None:
            self.file.write(line + "\n")
            self.file.flush()
        if line.startswith(STEP):
            self.steps.append(line)
            self.lines.clear()
            self.line_count = 0
        else:
            self.lines.append(line)
            self.line_count += 1
        if line.startswith(FAILED):
            self.failure = self.failure or line.removeprefix(FAILED)
        elif self.line_count > MAX_LINES_PER_STEP:
            self.failure = self.failure or "it prints without end"
        elif line.startswith(DONE):
            self.summary = line.removeprefix(DONE)
        elif any(text in line for text in BAD_TEXTS):
            self.failure = self.failure or f"it printed '{line.strip()}'"


def watch(process: subprocess.Popen, log: Log) -> str | None:
    """Read all output until Blender ends. Return what is wrong, if anything."""
    lines: queue.Queue[str | None] = queue.Queue()

    def read() -> None:
        for line in process.stdout:
            lines.put(line.rstrip("\n"))
        lines.put(None)

    threading.Thread(target=read, daemon=True).start()
    silence = SILENCE_SECONDS
    try:
        while (line := lines.get(timeout=silence)) is not None:
            log.add(line)
            if log.failure is not None:
                silence = 1.0  # the rest of the message
            if log.line_count > MAX_LINES_PER_STEP:
                stop(process)
                return log.failure
    except queue.Empty:
        stop(process)
        return log.failure or f"no output for {silence:.0f} s"
    status = process.wait()
    if log.failure is not None:
        return log.failure
    if status or log.summary is None:
        return f"Blender ended with status {status}"
    return None


def stop(process: subprocess.Popen) -> None:
    """End Blender, and the processes that its starter made for it."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


if __name__ == "__main__":
    sys.exit(main())
