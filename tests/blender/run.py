#!/usr/bin/env python3
"""Install the built zip into an empty Blender and test it there, headless and in a window.

    tests/blender/run.py stable|latest ROSY.zip [REAL_BLENDER] [--shots DIR] [--windows NAMES]
                         [--many] [--vulkan] [PYTEST...]

REAL_BLENDER is the `real-blender` script, by default the one in ../shared/tools. Screenshots of the
panel are saved in DIR. The exit status is 0 only if all tests passed. The last line is a
summary.
"""

import argparse
import fcntl
import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from harness.processes import all_end, marked_processes

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]

#: Simulated events. With this option Blender never waits for events, and takes a core at rest.
SIMULATED_EVENTS = ("--enable-event-simulate",)

#: For each window_*.py, the size of the window in pixels (small, as views are drawn in software, but
#: with room for the menu of all presets), and further options.
WINDOWS = {
    "panel": (1000, 720, SIMULATED_EVENTS),
    "tools": (1000, 720, SIMULATED_EVENTS),
    "presets": (1120, 900, SIMULATED_EVENTS),
    "live": (1000, 720, ()),
    "helper": (1000, 720, SIMULATED_EVENTS),
    "first-bake": (1000, 800, ()),
    "listing": (1922, 1200, ()),
}

#: Size of the screen that `real-blender gui` makes. Larger windows get a screen of their own.
SCREEN = 1400, 900

#: Seconds after which the screen of a window exists.
START_SECONDS = 4.0


def main() -> int:
    options = parse_arguments()
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="blender-lane-", ignore_cleanup_errors=True) as folder:
        lane = Lane(options, Path(folder))
        try:
            lane.run()
        except subprocess.TimeoutExpired as error:
            print(f"Blender did not end within {error.timeout:.0f} s")
            lane.counts["errors"] += 1
    counts = lane.counts
    summary = ", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items()) if count)
    passed = counts["passed"] and not counts["failed"] and not counts["errors"]
    line = f" Blender {options.which}: {summary} in {time.monotonic() - start:.0f}s "
    print(line.center(80, "="))
    return 0 if passed else 1


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("which", choices=("stable", "latest"))
    parser.add_argument("zip", type=Path)
    real_blender = REPOSITORY.parent / "shared/tools/real-blender"
    parser.add_argument("real_blender", nargs="?", type=Path, default=real_blender)
    parser.add_argument("--shots", type=Path, help="folder for the screenshots of the panel")
    windows = ",".join(name for name in WINDOWS if name != "listing")
    text = "which tests to run in a window, by default all; none for headless"
    parser.add_argument("--windows", default=windows, help=text)
    parser.add_argument("--only-window", action="store_true")
    parser.add_argument("--steps", default="", help="names of the only steps to run in a window")
    parser.add_argument("--many", action="store_true", help="take pictures for the documentation")
    parser.add_argument("--vulkan", action="store_true", help="draw with Vulkan instead of OpenGL")
    options, options.pytest = parser.parse_known_args()
    if not options.zip.is_file():
        parser.error(f"{options.zip} is not a file: build it first")
    if not options.real_blender.is_file():
        parser.error(f"{options.real_blender} is not there")
    return options


class Lane:
    """A Blender with the zip, and the counts of outcomes of its tests.

    Attributes
    ----------
    options : Namespace
        The command line.
    folder : Path
        Where files go.
    environment : dict of str to str
        The variables of Blender's processes.
    counts : Counter
        How many tests passed, failed, had errors and were skipped.
    """

    def __init__(self, options: argparse.Namespace, folder: Path) -> None:
        self.options, self.folder = options, folder
        self.counts: Counter[str] = Counter()
        self.zip = folder / "rosy.zip"
        shutil.copy(options.zip, self.zip)
        self.environment = os.environ | {
            "BLENDER_USER_RESOURCES": str(folder / "user"),
            "ROSY_BLENDER_LANE": str(folder),
            "ROSY_ZIP": str(self.zip),
            "ROSY_STEPS": options.steps,
            "ROSY_MANY": "1" if options.many else "",
            "ROSY_BACKEND": "vulkan" if options.vulkan else "opengl",
            "PYTHONDONTWRITEBYTECODE": "1",
            # Beside other runs, threads of linear algebra only wait for each other.
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.backend = ["--gpu-backend", self.environment["ROSY_BACKEND"]]

    def blender(self, verb: str, *command: str, timeout: float = 600.0, **run_options) -> Any:
        """Run a verb of `real-blender`, and return the finished process."""
        full_command = [str(self.options.real_blender), verb, self.options.which, *command]
        settings = {"cwd": REPOSITORY, "env": self.environment, "check": False}
        return subprocess.run(full_command, timeout=timeout, **settings, **run_options)

    def run(self) -> None:
        """Install the zip, and run all parts."""
        extension = ("run", "--command", "extension")
        self.counts["failed"] += self.blender(*extension, "validate", str(self.zip)).returncode != 0
        installing = ("install-file", "-r", "user_default", "--enable", str(self.zip))
        if self.blender(*extension, *installing).returncode:
            self.counts["errors"] += 1
            return
        if not self.options.only_window:
            self.test_without_a_window()
        shots = self.folder / "shots"
        shots.mkdir()
        self.environment["ROSY_SHOTS"] = str(shots)
        for name in self.options.windows.split(","):
            if name != "none":
                self.test_in_a_window(name)
        if self.options.shots is not None:
            shutil.copytree(shots, self.options.shots, dirs_exist_ok=True)

    def test_without_a_window(self) -> None:
        """Run pytest inside Blender, and the monkey."""
        results = self.folder / "results.xml"
        self.blender(
            "run", *self.backend, "--python-exit-code", "1", "-P", str(HERE / "run_pytest.py"), "--",
            "-c", str(HERE / "pytest.ini"), f"--rootdir={HERE}", f"--junitxml={results}",
            *self.options.pytest, str(HERE),
        )  # fmt: skip
        self.counts.update(junit_counts(results))
        monkey = [sys.executable, str(HERE / "monkey.py"), str(self.zip), "--steps", "400"]
        monkey += ["--blender", str(self.options.real_blender.resolve())]
        monkey += ["--which", self.options.which]
        status = subprocess.run(monkey, cwd=REPOSITORY, check=False, timeout=300.0).returncode
        self.counts["failed" if status else "passed"] += 1

    def test_in_a_window(self, name: str) -> None:
        """Run the steps of a module in a window, and check that no process is left."""
        width, height, options = WINDOWS[name]
        results_file = self.folder / f"{name}.json"
        self.environment["ROSY_RESULTS"] = str(results_file)
        self.environment["ROSY_WINDOW"] = f"window_{name}".replace("-", "_")
        is_large = width > SCREEN[0] or height > SCREEN[1]
        time_limit = 900 if is_large or self.options.many else 600
        arguments = [
            *self.backend, "--window-geometry", "0", "0", str(width), str(height), *options,
            "--python-exit-code", "1", "-P", str(HERE / "run_window.py"),
        ]  # fmt: skip
        command = ["gui", "-s", str(time_limit), *arguments]
        if is_large:
            screen = ["xvfb-run", "-a", "-s", f"-screen 0 {width}x{height}x24"]
            command = ["sh", shlex.join([*screen, "blender", *arguments])]
        wait_for_turn()
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        process = self.blender(*command, timeout=time_limit + 60.0, **streams)
        add_window(self.counts, results_file)
        if not all_end(str(results_file)):
            print("processes are left:", *marked_processes(str(results_file)).values(), sep="\n")
            self.counts["failed"] += 1
        # Errors in the drawing of a panel appear on the terminal alone.
        if "Traceback" in process.stdout:
            text = process.stdout[process.stdout.index("Traceback") :][:3000]
            print(f"in the window:\n{text}")
            self.counts["failed"] += 1


def wait_for_turn() -> None:
    """Wait until no other run starts a window: both might choose the same screen.

    Other runs then wait for this one. A process that outlives this function holds the lock.
    """
    with (Path(tempfile.gettempdir()) / "rosy-window.lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        subprocess.Popen(["sleep", str(START_SECONDS)], pass_fds=[file.fileno()])


def junit_counts(results: Path) -> dict[str, int]:
    """Return the counts of pytest's report. A missing report is an error."""
    if not results.is_file():
        print("the tests inside Blender did not come to their end")
        return {"errors": 1}
    suite = ElementTree.parse(results).getroot().find("testsuite")
    failed, errors, skipped, tests = (
        int(suite.get(key)) for key in ("failures", "errors", "skipped", "tests")
    )
    passed = tests - failed - errors - skipped
    return {"failed": failed, "errors": errors, "skipped": skipped, "passed": passed}


def add_window(counts: Counter[str], results: Path) -> None:
    """Add the results of the steps in a window. A missing end is an error."""
    steps = json.loads(results.read_text()) if results.is_file() else {}
    for step, (failure, seconds) in steps.items():
        print(f"window: {step}: {failure or 'passed'} ({seconds} s)")
        counts["failed" if failure else "passed"] += 1
    if "the end" not in steps:
        print("the run in a window did not come to its end")
        counts["errors"] += 1


if __name__ == "__main__":
    sys.exit(main())
