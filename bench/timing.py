"""Measure ratios of times, and run a benchmark from the command line.

The two functions of a ratio run in turn, so the load of the machine affects both equally.
"""

import argparse
import importlib
import importlib.metadata
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

#: Default number of runs of each function. The median ratio of the runs is reported.
RUNS = 7


class Bench:
    """Measures cases, prints them, and keeps them.

    Attributes
    ----------
    runs : int
        Number of runs of each function.
    cases : list of dict
        The cases so far. Each compares two times or other amounts. Keys: `name`; `ratio` (the median of all
        runs), `low` and `high`; `target` (the required ratio or None: the least one if `higher_is_better`,
        else the largest); `amounts` (the medians of both) and their `unit`; `machine`.
    """

    def __init__(self, runs: int = RUNS) -> None:
        self.runs = runs
        self.cases: list[dict[str, Any]] = []

    def compare(
        self,
        name: str,
        one: Callable[[], object],
        other: Callable[[], object],
        *,
        at_least: float | None = None,
        at_most: float | None = None,
        runs: int | None = None,
        cold: bool = False,
    ) -> dict[str, Any]:
        """Time two functions in turn, after a first run of each, and return the case.

        Parameters
        ----------
        name : str
        one, other : function
            The ratio is the time of `one` over that of `other`.
        at_least, at_most : float, optional
            Required ratio: a lower or an upper bound.
        runs : int, optional
            Largest number of runs of each function, not counting the first.
        cold : bool
            Whether the first run of `one` is timed too. For slow functions that leave nothing in a cache.
        """
        if not cold:
            one()
        other()
        count = min(self.runs, runs or self.runs)
        times = np.array([(_seconds(one), _seconds(other)) for _ in range(count)])
        medians = np.median(times, axis=0) * 1e3
        return self.add(name, times[:, 0] / times[:, 1], medians, "ms", at_least, at_most)

    def add(
        self,
        name: str,
        ratios: np.ndarray | float,
        amounts: Sequence[float],
        unit: str,
        at_least: float | None = None,
        at_most: float | None = None,
    ) -> dict[str, Any]:
        """Print, keep and return a case, given the ratios of all runs; see `cases`."""
        ratio, low, high = map(float, (np.median(ratios), np.min(ratios), np.max(ratios)))
        first, second = amounts = [float(amount) for amount in amounts]
        verdict, target = "", at_most if at_least is None else at_least
        if target is not None:
            is_reached = ratio <= target if at_least is None else ratio >= target
            bound = "at most" if at_least is None else "at least"
            verdict = f"  {bound} {target:g}: {'yes' if is_reached else 'NO'}"
        spread = f"({low:.2f} to {high:.2f})"
        print(f"{name:62} {ratio:6.2f} {spread:17} {first:.4g} / {second:.4g} {unit}{verdict}")
        sys.stdout.flush()
        case = {"name": name, "ratio": ratio, "low": low, "high": high, "target": target}
        case |= {"higher_is_better": at_least is not None, "amounts": amounts, "unit": unit}
        self.cases.append(case | {"machine": machine()})
        return case


def write_json(path: Path, content: object) -> None:
    """Write the results of a benchmark to a JSON file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main(about: str | None, measure: Callable[..., None], **options: dict[str, Any]) -> None:
    """Run a benchmark as a program: print its cases, and write them to a file with --json.

    Parameters
    ----------
    about : str
        Description of the program in its help.
    measure : function
        Function that measures the cases. Its arguments are a `Bench` and the values of `options`.
    **options
        Further options of the command line: arguments of `ArgumentParser.add_argument` by name.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the cases to a file")
    parser.add_argument("--runs", type=int, default=RUNS, help="runs per case (%(default)s)")
    for name, settings in options.items():
        parser.add_argument(f"--{name}", **settings)
    values = vars(parser.parse_args())
    path, bench = values.pop("json"), Bench(values.pop("runs"))
    print(machine(), flush=True)
    measure(bench, **values)
    if path:
        write_json(path, bench.cases)


def peer(module: str) -> Any:
    """Import and return a module that a benchmark needs. If it is missing, end the program with a message."""
    try:
        return importlib.import_module(module)
    except ImportError:
        sys.exit(f"skipped, because {module} is not installed")


@cache
def machine() -> str:
    """Return a description of the machine: processor, cores, threads in use, versions of packages."""
    versions = [f"Python {platform.python_version()}"]
    for package in ("numpy", "rlic", "vtk", "bpy"):
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    cores = f"{os.cpu_count()} cores, 1 thread in use"
    return f"{_processor()}, {cores}, {platform.system()}, {', '.join(versions)}"


def use_cores(count: int) -> None:
    """Limit this process, and those that it starts, to a number of cores.

    Call it before VTK is imported, so that Mesa's llvmpipe uses the same number of threads.
    """
    os.environ["LP_NUM_THREADS"] = str(count) if count > 1 else "0"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, set(sorted(os.sched_getaffinity(0))[:count]))
    else:
        print("this system cannot limit a process to some cores: peers may use more")


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
