"""Run all benchmarks, each in its own process; --quick runs only Table 1 of the paper.

A ratio is the median over alternating runs, printed with the smallest and the largest. --json FILE
writes all cases to a file, as a list of objects.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from bench.table1 import quick  # noqa: E402
from bench.timing import RUNS, Bench, machine  # noqa: E402

#: The scripts, in the order in which they run.
SCRIPTS = (
    *(
        "table1",
        "ibfv",
        "scaling",
        "stages",
        "planar_rlic",
        "surface_vtk",
        "two_cores_vtk",
        "large",
    ),
    *("gpu_vtk", "again", "animation", "memory", "fields", "strokes"),
)

#: Runs per case with --quick, about a minute in total.
QUICK_RUNS = 3


def main() -> None:
    """Run the command line."""
    summary, _, details = (__doc__ or "").partition("\n")
    parser = argparse.ArgumentParser(description=summary, epilog=details.strip())
    parser.add_argument("script", nargs="*", help=f"{', '.join(SCRIPTS)}; all if not given")
    parser.add_argument("--quick", action="store_true", help="only Table 1, without the peers")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the cases to a file")
    parser.add_argument("--runs", type=int, help=f"runs per case ({RUNS}; --quick: {QUICK_RUNS})")
    options = parser.parse_args()
    if unknown := [name for name in options.script if name not in SCRIPTS]:
        parser.error(f"there is no '{unknown[0]}', only {', '.join(SCRIPTS)}")
    if options.quick:
        bench = Bench(options.runs or QUICK_RUNS)
        print(machine(), flush=True)
        quick(bench, cold=True)
        if options.json:
            bench.write(options.json)
        return
    entries = []
    for name in options.script or SCRIPTS:
        print(f"--- {name}", flush=True)
        entries += _run(name, options.runs or RUNS)
    if options.json:
        options.json.parent.mkdir(parents=True, exist_ok=True)
        options.json.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")


def _run(name: str, runs: int) -> list[dict[str, object]]:
    """Run one script and return its entries; none if it lacks what it compares with."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cases.json"
        command = [sys.executable, "-m", f"bench.{name}", "--runs", str(runs), "--json", str(file)]
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
