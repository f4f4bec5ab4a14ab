"""Two ways timed in turn, so that a noisy machine slows both, and what machine that was."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Case:
    """One line of a bench: how many times as long one thing takes as another.

    Attributes
    ----------
    name : str
    ratio : float
        Median over the runs of the time of one over that of the other, right after each other.
    low, high : float
        The least and the largest.
    target : float or None
        What it is to be.
    higher_is_better : bool
    milliseconds : tuple of float
        Medians of both, for reference.
    """

    name: str
    ratio: float
    low: float
    high: float
    target: float | None
    higher_is_better: bool
    milliseconds: tuple[float, float]

    @property
    def reached(self) -> bool:
        """Whether the ratio is what it is to be."""
        if self.target is None:
            return True
        return self.ratio >= self.target if self.higher_is_better else self.ratio <= self.target

    def line(self) -> str:
        """As it is printed."""
        first, second = self.milliseconds
        wanted = ""
        if self.target is not None:
            sign = "at least" if self.higher_is_better else "at most"
            wanted = f"{sign} {self.target:g}: {'yes' if self.reached else 'NO'}"
        spread = f"{self.low:.2f} to {self.high:.2f}"
        return (
            f"{self.name:58} {self.ratio:7.2f}  ({spread:15}) "
            f"{first:8.1f} ms / {second:7.1f} ms  {wanted}"
        )

    def entry(self) -> dict[str, object]:
        """As it is written to a file."""
        return asdict(self)


def compare(
    name: str,
    one: Callable[[], object],
    other: Callable[[], object],
    *,
    target: float | None = None,
    higher_is_better: bool = True,
    runs: int = 5,
) -> Case:
    """Time two things in turn, after each has run once.

    Parameters
    ----------
    name : str
    one, other : function
        The ratio is the time of `one` over that of `other`.
    target : float, optional
    higher_is_better : bool
    runs : int
        Of each, beside the first.
    """
    one(), other()
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
        milliseconds=(float(first), float(second)),
    )
    print(case.line(), flush=True)
    return case


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def machine() -> dict[str, object]:
    """What the times were measured on."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": 1,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "system": platform.system(),
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [
                line.split(":", 1)[1].strip() for line in file if line.startswith("model name")
            ]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()
