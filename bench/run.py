"""Run all benchmarks, each in its own process; --quick runs only Table 1 of the paper.

Two functions run in turn several times. The median ratio of their times is printed, with the smallest and the
largest. --json FILE writes all cases to a file, as a list of objects.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from .timing import write_json

ROOT = Path(__file__).resolve().parents[1]

#: The scripts, in the order in which they run.
SCRIPTS = (
    *("table1", "ibfv", "scaling", "planar_rlic", "surface_vtk", "two_cores_vtk", "large"),
    *("gpu_vtk", "again", "animation", "memory", "fields", "strokes"),
)


def main() -> None:
    """Run the command line."""
    summary, _, details = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(description=summary, epilog=details.strip())
    parser.add_argument("script", nargs="*", choices=[*SCRIPTS, []], help="all if not given")
    parser.add_argument("--quick", action="store_true", help="only Table 1, without the peers")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the cases to a file")
    parser.add_argument("--runs", help="runs of each case")
    options = parser.parse_args()
    arguments = ["--runs", options.runs] if options.runs else []
    entries = []
    if options.quick:
        options.script, arguments = ["table1"], ["--quick", "--runs", options.runs or "3"]
    for name in options.script or SCRIPTS:
        print(f"--- {name}", flush=True)
        entries += _run(name, arguments)
    if options.json:
        write_json(options.json, entries)


def _run(name: str, arguments: list[str]) -> list[dict[str, object]]:
    """Run one script and return its cases; none if a package that it compares with is missing."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cases.json"
        command = [sys.executable, "-m", f"bench.{name}", "--json", str(file), *arguments]
        completed = subprocess.run(
            command, cwd=ROOT, check=False, stderr=subprocess.PIPE, text=True
        )
        print(completed.stderr, end="", file=sys.stderr, flush=True)
        if file.exists():
            return json.loads(file.read_text(encoding="utf-8"))
        if "skipped" not in completed.stderr:
            sys.exit(f"bench.{name} failed")
        return []


if __name__ == "__main__":
    main()
