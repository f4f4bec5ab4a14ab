"""Make, run and judge many cases, several at once, and print what came of them."""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import shlex
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, as_completed, wait
from pathlib import Path
from typing import NamedTuple

from .cases import CATEGORIES, MAKING_LIMIT, Case, SlowSceneError, make_case
from .execution import Run, execute, opens_in_blender
from .verdicts import Verdict, judge

#: Share of the cases that run twice, to compare the files that they write.
REPEATED_SHARE = 0.05


class Outcome(NamedTuple):
    """The result of one case."""

    category: str
    seed: int
    verdict: Verdict
    reason: str
    seconds: float
    peak_bytes: int


def main() -> int:
    """Run the cases that the options name. Return 1 if there is a fault, otherwise 0."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz", description="Run random hostile cases."
    )
    parser.add_argument("--seed", type=int, default=1, help="of the first case (1)")
    parser.add_argument("--cases", type=int, help="number of cases; by default no limit")
    parser.add_argument("--seconds", type=float, help="stop after this time")
    parser.add_argument("--jobs", type=int, default=multiprocessing.cpu_count())
    parser.add_argument(
        "--category", action="append", choices=list(CATEGORIES), help="by default all of them"
    )
    parser.add_argument(
        "--keep", type=Path, default=Path("dist/fuzz"), help="folder for the cases with faults"
    )
    parser.add_argument(
        "--log",
        type=Path,
        help="file that gets the outcome of every case; cases that it has do not run again",
    )
    parser.add_argument("--verbose", action="store_true", help="print the outcome of every case")
    options = parser.parse_args()
    if options.cases is None and options.seconds is None:
        parser.error("give --cases, --seconds, or both")
    counts: Counter[tuple[str, Verdict]] = Counter()
    slowest, largest, start = None, None, time.monotonic()
    for outcome in _logged_outcomes(options, start):
        counts[outcome.category, outcome.verdict] += 1
        slowest = max(slowest or outcome, outcome, key=lambda o: o.seconds)
        largest = max(largest or outcome, outcome, key=lambda o: o.peak_bytes)
        if outcome.verdict.is_fault or options.verbose:
            print(
                f"{outcome.category} {outcome.seed}: {outcome.verdict.value}: {outcome.reason}",
                flush=True,
            )
    _print_table(counts)
    print(
        f"{sum(counts.values()):,} cases in {time.monotonic() - start:.0f} s, seed {options.seed}"
    )
    if slowest is not None:
        print(f"slowest: {slowest.category} {slowest.seed}, {slowest.seconds:.1f} s")
        print(f"largest: {largest.category} {largest.seed}, {largest.peak_bytes / 2**20:.0f} MiB")
    faults = sum(count for (_, verdict), count in counts.items() if verdict.is_fault)
    print(f"{faults} faults" + (f", kept in {options.keep}" if faults else ""))
    return int(faults > 0)


def _logged_outcomes(options: argparse.Namespace, start: float) -> Iterator[Outcome]:
    """Yield the outcomes of the cases, from the log where it has them, and append the others."""
    past: dict[tuple[str, int], Outcome] = {}
    if options.log is None:
        yield from _outcomes(options, start, past)
        return
    text = options.log.read_text() if options.log.exists() else ""
    for line in text.splitlines():
        # A line may be cut, where a run was stopped.
        with contextlib.suppress(ValueError):
            category, seed, verdict, *others = json.loads(line)
            past[category, seed] = Outcome(category, seed, Verdict(verdict), *others)
    with options.log.open("a") as log:
        print(file=log, end="" if text.endswith("\n") else "\n")
        for outcome in _outcomes(options, start, past):
            if (outcome.category, outcome.seed) not in past:
                row = outcome._replace(verdict=outcome.verdict.value)
                print(json.dumps(row), file=log, flush=True)
            yield outcome


def _outcomes(
    options: argparse.Namespace, start: float, past: dict[tuple[str, int], Outcome]
) -> Iterator[Outcome]:
    """Yield the outcomes of the cases, which run in several processes where not in ``past``."""
    categories = options.category or list(CATEGORIES)

    def numbered() -> Iterator[tuple[str, int, Path]]:
        # Each category occurs as often as its share says, spread evenly.
        total = sum(CATEGORIES[name].share for name in categories)
        done = dict.fromkeys(categories, 0)
        number = 0
        while options.cases is None or number < options.cases:
            if options.seconds is not None and time.monotonic() - start > options.seconds:
                return
            number += 1
            name = max(done, key=lambda key: number * CATEGORIES[key].share / total - done[key])
            yield name, options.seed + done[name], options.keep
            done[name] += 1

    if options.jobs == 1:
        for case in numbered():
            yield past.get(case[:2]) or _run_case(case)
        return
    # The processes are new, not forked, so that each case forks from the same state.
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
        pending = set()
        for case in numbered():
            if case[:2] in past:
                yield past[case[:2]]
                continue
            pending.add(pool.submit(_run_case, case))
            if len(pending) >= 4 * options.jobs:
                done, pending = wait(pending, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        yield from (future.result() for future in as_completed(pending))


def _run_case(arguments: tuple[str, int, Path]) -> Outcome:
    """Make, run and judge one case. Keep its folder if there is a fault."""
    category, seed, keep = arguments
    with tempfile.TemporaryDirectory(prefix="rosy-fuzz-") as parent:
        folder = Path(parent) / "case"
        folder.mkdir()
        try:
            case = make_case(category, seed, folder)
        except SlowSceneError:
            return Outcome(category, seed, Verdict.UNREADABLE, "not made", MAKING_LIMIT, 0)
        run = execute(case, folder)
        verdict, reason = judge(case, run, folder)
        blend_file = folder / "scene.blend"
        if verdict is Verdict.HANG and blend_file.is_file() and not opens_in_blender(blend_file):
            verdict = Verdict.UNREADABLE
        is_repeated = seed % round(1 / REPEATED_SHARE) == 0 and not case.is_stopped
        if verdict is Verdict.DONE and is_repeated:
            again = Path(parent) / "again"
            again.mkdir()
            repeated = execute(make_case(category, seed, again), again)
            if _comparable(case, repeated) != _comparable(case, run):
                verdict, reason = Verdict.NOT_REPEATED, "files or standard output differ"
        if verdict.is_fault:
            _keep(keep / f"{category}-{seed}", folder, case, run, f"{verdict.value}: {reason}")
        return Outcome(category, seed, verdict, reason, run.seconds, run.peak_bytes)


def _comparable(case: Case, run: Run) -> tuple[dict[str, str], bytes]:
    """Return the files and the output of a run, without what contains times."""
    files = {name: text for name, text in run.after.items() if ".blend" not in name}
    return files, run.stdout if case.arguments[0] == "info" else b""


def _keep(target: Path, folder: Path, case: Case, run: Run, text: str) -> None:
    """Copy the files of a case, its streams, its command line and the verdict."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for path in folder.iterdir():
        if path.is_file() and not path.is_symlink():
            shutil.copy2(path, target)
    (target / "stdout.txt").write_bytes(run.stdout)
    (target / "stderr.txt").write_bytes(run.stderr)
    command = shlex.join(["python", "-m", "rosy_addon", *case.arguments])
    (target / "command.txt").write_text(f"{command}\n{text}\n", errors="surrogateescape")


def _print_table(counts: Counter[tuple[str, Verdict]]) -> None:
    """Print a row for each category, and a column for each verdict that occurs."""
    verdicts = [v for v in Verdict if any(verdict is v for _, verdict in counts)]
    names = dict.fromkeys(category for category, _ in counts)
    width = max(map(len, names), default=0)
    print(" " * width, *(verdict.value for verdict in verdicts), sep="  ")
    for name in names:
        row = (f"{counts[name, verdict]:{len(verdict.value)}}" for verdict in verdicts)
        print(f"{name:{width}}", *row, sep="  ")
