"""Break the code on purpose, one fault at a time, and check that the tests notice.

    python tools/run_faults.py [NAME...] [--jobs N]

tests/faults.toml lists the faults. Each fault is applied to a temporary copy of the working tree, where its
tests have to fail. The exit status is 0 only if every fault is caught.
"""

import argparse
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from working_tree import ROOT, copy_working_tree

#: The environment whose Python runs the tests of each lane. Those of lane "blender" build a zip and run it in
#: a full Blender.
PYTHON = {
    "unit": ".venv",
    "extras": ".venv-extras",
    "bpy42": ".venv-bpy42",
    "blender": ".venv-bpy42",
}

#: Seconds after which the tests of a fault are stopped; the fault then counts as missed.
TIME_LIMIT = 900

#: Exit status of pytest when tests ran and failed. Other values mean that they did not run.
TESTS_FAILED = 1


#: A deliberate fault: a table of tests/faults.toml, which describes the keys.
Fault = dict[str, Any]


def broken_text(fault: Fault, root: Path) -> str | None:
    """Return the text of the file with the fault; None if `find` does not occur in it exactly once."""
    path = root / fault["file"]
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    return text.replace(fault["find"], fault["replace"]) if text.count(fault["find"]) == 1 else None


def copy_tree(folder: Path) -> Path:
    """Copy the working tree to `folder`/main, and link the files that tests expect around it.

    Return the copy.
    """
    copy = folder / "main"
    copy_working_tree(copy)
    for environment in ROOT.glob(".venv*"):
        (copy / environment.name).symlink_to(environment)
    if (ROOT.parent / "shared").is_dir():
        (folder / "shared").symlink_to(ROOT.parent / "shared")
    return copy


def run_tests(fault: Fault, copy: Path) -> tuple[int, str]:
    """Run the tests of a fault in a copy; return the exit status and the last line of output."""
    python = str(copy / PYTHON[fault["lane"]] / "bin/python")
    options = {"cwd": copy, "capture_output": True, "text": True, "timeout": TIME_LIMIT}
    options["env"] = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    command = [python, "-m", "pytest", "-x", "-p", "no:cacheprovider"]
    try:
        if fault["lane"] == "blender":
            shutil.rmtree(copy / "dist", ignore_errors=True)
            subprocess.run([python, "tools/build_zip.py", "dist"], check=True, **options)
            (zip_path,) = (copy / "dist").glob("*.zip")
            command = [sys.executable, "tests/blender/run.py", "stable", str(zip_path)]
            command += ["--windows", "none"]
        completed = subprocess.run([*command, *fault["tests"]], check=False, **options)
    except subprocess.TimeoutExpired:
        return -1, f"stopped after {TIME_LIMIT} s"
    except subprocess.CalledProcessError as error:
        return -1, f"the zip could not be built: {error.stderr.strip()}"
    message = completed.stdout.strip() or completed.stderr.strip() or "no output"
    return completed.returncode, message.splitlines()[-1].strip("= ")


def try_fault(fault: Fault, copies: queue.Queue[Path]) -> bool:
    """Run the tests of a fault, print a line, and return whether they have caught it."""
    copy, start, succeeded = copies.get(), time.monotonic(), False
    path, broken = copy / fault["file"], broken_text(fault, copy)
    verdict, message = "does not apply", f"`find` is not in {fault['file']} exactly once"
    if broken is not None:
        original = path.read_bytes()
        try:
            path.write_text(broken, encoding="utf-8")
            status, message = run_tests(fault, copy)
        finally:
            path.write_bytes(original)
        succeeded = status == TESTS_FAILED and "failed" in message
        verdict = "caught" if succeeded else "MISSED"
    copies.put(copy)
    print(
        f"{verdict:14} {fault['name']:36} {time.monotonic() - start:6.1f} s  {message}", flush=True
    )
    return succeeded


def main() -> int:
    """Try the chosen faults. Return the exit status: 0 if all are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="all faults if not given")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="copies used side by side")
    options = parser.parse_args()
    tables = tomllib.loads((ROOT / "tests/faults.toml").read_text(encoding="utf-8"))["fault"]
    faults = {fault["name"]: fault for fault in tables}
    if unknown := set(options.names) - set(faults):
        parser.error(f"no fault is named {', '.join(sorted(unknown))}")
    chosen = [faults[name] for name in options.names or faults]
    with tempfile.TemporaryDirectory(prefix="rosy-faults-") as name:
        copies: queue.Queue[Path] = queue.Queue()
        for number in range(options.jobs):
            copies.put(copy_tree(Path(name) / str(number)))
        with ThreadPoolExecutor(options.jobs) as pool:
            caught = list(pool.map(lambda fault: try_fault(fault, copies), chosen))
    print(f"{sum(caught)} of {len(caught)} caught")
    return 0 if all(caught) else 1


if __name__ == "__main__":
    sys.exit(main())
