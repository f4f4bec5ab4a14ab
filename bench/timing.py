"""Ratios of alternating timings, which the load of the machine affects equally; command line."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

#: Runs of each function. The ratio is the median over them.
RUNS = 7


@dataclass(frozen=True)
class Case:
    """One line of a benchmark: the ratio of two times or amounts.

    Attributes
    ----------
    name : str
    ratio : float
        Median over the runs of the first time over the second, which are measured in turn.
    low, high : float
        The smallest and the largest ratio.
    target : float or None
        Required ratio.
    higher_is_better : bool
    amounts : tuple of float
        Medians of the two times or amounts, for reference.
    unit : str
        Unit of the amounts.
    """

    name: str
    ratio: float
    low: float
    high: float
    target: float | None
    higher_is_better: bool
    amounts: tuple[float, float]
    unit: str = "ms"

    @property
    def reached(self) -> bool:
        """Whether the ratio reaches its target."""
        if self.target is None:
            return True
        return self.ratio >= self.target if self.higher_is_better else self.ratio <= self.target

    def line(self) -> str:
        """Format the case for printing."""
        verdict = ""
        if self.target is not None:
            sign = "at least" if self.higher_is_better else "at most"
            verdict = f"  {sign} {self.target:g}: {'yes' if self.reached else 'NO'}"
        spread = f"({self.low:.2f} to {self.high:.2f})"
        amounts = " / ".join(f"{amount:.4g}" for amount in self.amounts)
        return f"{self.name:62} {self.ratio:6.2f} {spread:17} {amounts} {self.unit}{verdict}"

    def entry(self) -> dict[str, object]:
        """Return the case as an object for JSON."""
        return asdict(self)


def compare(
    name: str,
    one: Callable[[], object],
    other: Callable[[], object],
    *,
    target: float | None = None,
    higher_is_better: bool = True,
    runs: int = RUNS,
    cold: bool = False,
) -> Case:
    """Time two functions in turn, after each has run once.

    Parameters
    ----------
    name : str
    one, other : function
        The ratio is the time of `one` over that of `other`.
    target : float, optional
    higher_is_better : bool
    runs : int
        Runs of each function, not counting the first.
    cold : bool
        Time the first run of `one` as well, because it is slow and leaves no cached results.
    """
    if not cold:
        one()
    other()
    times = np.array([(_seconds(one), _seconds(other)) for _ in range(runs)])
    ratios = times[:, 0] / times[:, 1]
    first, second = np.median(times, axis=0) * 1e3
    case = Case(
        name=name,
        ratio=float(np.median(ratios)),
        low=float(ratios.min()),
        high=float(ratios.max()),
        target=target,
        higher_is_better=higher_is_better,
        amounts=(float(first), float(second)),
    )
    print(case.line(), flush=True)
    return case


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main(
    about: str | None,
    measure: Callable[[int], Iterable[Case]],
    arguments: Sequence[str] | None = None,
) -> int:
    """Run a benchmark as a program: print its cases, and write them to a file with --json.

    Parameters
    ----------
    about : str
        Text of its help.
    measure : function
        Takes the number of runs, and returns the cases.
    arguments : sequence of str, optional
        By default those of the program.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the cases to a file")
    parser.add_argument("--runs", type=int, default=RUNS, help="runs per case (%(default)s)")
    options = parser.parse_args(arguments)
    print(machine(), flush=True)
    cases = list(measure(options.runs))
    if options.json:
        write(options.json, [case.entry() for case in cases])
    return 0


def write(path: Path, entries: Sequence[dict[str, object]]) -> None:
    """Write cases as a list of JSON objects, each with the machine that it was measured on."""
    path.parent.mkdir(parents=True, exist_ok=True)
    named = [{**entry, "machine": machine()} for entry in entries]
    path.write_text(json.dumps(named, indent=1) + "\n", encoding="utf-8")


def machine() -> str:
    """Describe the machine: processor, cores, threads in use, versions."""
    versions = [f"Python {platform.python_version()}"]
    for package in ("numpy", "rlic", "vtk", "bpy"):
        try:
            versions.append(f"{package} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    cores = f"{os.cpu_count()} cores, 1 thread in use"
    return f"{_processor()}, {cores}, {platform.system()}, {', '.join(versions)}"


def use_one_core() -> None:
    """Limit this process to one core, so that the threads of libraries have no advantage."""
    use_cores(1)


def use_cores(count: int) -> None:
    """Limit this process, and those that it starts, to a number of cores."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, set(sorted(os.sched_getaffinity(0))[:count]))
    else:
        print(
            "this system cannot limit a process to some cores: peers may use more", file=sys.stderr
        )


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [
                line.split(":", 1)[1].strip() for line in file if line.startswith("model name")
            ]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()
