#!/usr/bin/env python3
"""Install the built zip into an empty Blender and test it there, headless and in a window.

    tests/blender/run.py stable|latest ROSY.zip [REAL_BLENDER] [--shots DIR] [--windows NAMES] [--vulkan] [PYTEST...]

REAL_BLENDER is the `real-blender` script, by default the one in ../shared/tools. The screenshots of the panel
go to DIR. The exit status is 0 only if all tests passed; the last line sums up, as pytest does.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]

#: Scripts that test in a window, by what they test.
WINDOWS = {"panel": "window.py", "presets": "window_presets.py", "live": "window_live.py"}


def main() -> int:
    options = arguments()
    start = time.monotonic()
    folder = Path(tempfile.mkdtemp(prefix="blender-lane-"))
    try:
        counts = lane(options, folder)
    except subprocess.TimeoutExpired as late:
        print(f"Blender did not end within {late.timeout:.0f} s")
        counts = {"errors": 1}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    said = ", ".join(f"{number} {what}" for what, number in counts.items() if number)
    good = counts.get("passed", 0) > 0 and not counts.get("failed") and not counts.get("errors")
    line = f" Blender {options.which}: {said} in {time.monotonic() - start:.0f}s "
    print(line.center(80, "="))
    return 0 if good else 1


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("which", choices=("stable", "latest"))
    parser.add_argument("zip", type=Path)
    parser.add_argument(
        "real_blender",
        nargs="?",
        type=Path,
        default=REPOSITORY.parent / "shared/tools/real-blender",
    )
    parser.add_argument("--shots", type=Path, help="folder for the screenshots of the panel")
    parser.add_argument(
        "--windows",
        default="panel,presets,live",
        help="which tests to run in a window, by default panel,presets,live; none for headless",
    )
    parser.add_argument("--only-window", action="store_true")
    parser.add_argument("--vulkan", action="store_true", help="draw with Vulkan instead of OpenGL")
    options, options.pytest = parser.parse_known_args()
    if not options.zip.is_file():
        parser.error(f"{options.zip} is not a file: build it first")
    if not options.real_blender.is_file():
        parser.error(f"{options.real_blender} is not there")
    return options


def lane(options: argparse.Namespace, folder: Path) -> dict[str, int]:
    """Run all parts; how many tests passed, failed, had errors, were skipped."""
    zipped = folder / "rosy.zip"
    shutil.copy(options.zip, zipped)
    environment = dict(
        os.environ,
        BLENDER_USER_RESOURCES=str(folder / "user"),
        ROSY_BLENDER_LANE=str(folder),
        ROSY_ZIP=str(zipped),
        PYTHONDONTWRITEBYTECODE="1",
    )

    environment["ROSY_BACKEND"] = "vulkan" if options.vulkan else "opengl"
    backend = ["--gpu-backend", environment["ROSY_BACKEND"]]

    def blender(verb: str, *command: str, timeout: float = 480.0, **more) -> Any:
        words = [str(options.real_blender), verb, options.which, *command]
        return subprocess.run(
            words, cwd=REPOSITORY, env=environment, timeout=timeout, check=False, **more
        )

    counts = {"failed": 0, "passed": 0, "skipped": 0, "errors": 0}
    if blender("run", "--command", "extension", "validate", str(zipped)).returncode:
        counts["failed"] += 1
    installing = ("install-file", "-r", "user_default", "--enable", str(zipped))
    if blender("run", "--command", "extension", *installing).returncode:
        counts["errors"] += 1
        return counts
    if not options.only_window:
        results = folder / "results.xml"
        blender(
            "run", *backend, "--python-exit-code", "1", "-P", str(HERE / "inside.py"), "--",
            "-c", str(HERE / "pytest.ini"), f"--rootdir={HERE}", f"--junitxml={results}",
            *options.pytest, str(HERE),
        )  # fmt: skip
        add_junit(counts, results)
    windows = [WINDOWS[name] for name in options.windows.split(",") if name != "none"]
    if windows:
        shots = folder / "shots"
        shots.mkdir()
        environment["ROSY_SHOTS"] = str(shots)
        for script in windows:
            said = folder / f"{script}.json"
            environment["ROSY_RESULTS"] = str(said)
            patience = 900 if "ROSY_LIVE_MANY" in environment else 420
            done = blender(
                "gui", "-s", str(patience), *backend,
                "--enable-event-simulate", "--python-exit-code", "1",
                "-P", str(HERE / script),
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=patience + 60.0,
            )  # fmt: skip
            add_window(counts, said)
            # A panel that cannot be drawn says so on the terminal and nowhere else.
            if "Traceback" in done.stdout:
                print("in the window:\n" + done.stdout[done.stdout.index("Traceback") :][:3000])
                counts["failed"] += 1
        if options.shots is not None:
            shutil.copytree(shots, options.shots, dirs_exist_ok=True)
    return counts


def add_junit(counts: dict[str, int], results: Path) -> None:
    """Count what pytest wrote; none at all is an error."""
    if not results.is_file():
        print("the tests inside Blender did not come to their end")
        counts["errors"] += 1
        return
    suite = ElementTree.parse(results).getroot().find("testsuite")
    number = {what: int(suite.get(what)) for what in ("tests", "failures", "errors", "skipped")}
    counts["failed"] += number["failures"]
    counts["errors"] += number["errors"]
    counts["skipped"] += number["skipped"]
    counts["passed"] += number["tests"] - number["failures"] - number["errors"] - number["skipped"]


def add_window(counts: dict[str, int], said: Path) -> None:
    """Count what the run in a window wrote, step by step."""
    steps = json.loads(said.read_text()) if said.is_file() else {}
    for step, (failure, seconds) in steps.items():
        print(f"window: {step}: {failure or 'passed'} ({seconds} s)")
        counts["failed" if failure else "passed"] += 1
    if "the end" not in steps:
        print("the run in a window did not come to its end")
        counts["errors"] += 1


if __name__ == "__main__":
    sys.exit(main())
