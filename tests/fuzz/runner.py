"""Make, run and judge many cases, several at once, and print what came of them."""

import argparse
import math
import multiprocessing
import shlex
import shutil
import tempfile
import time
from collections import Counter
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rosy_addon.api.figures import load_drawing
from rosy_addon.cli.streams import print_line
from rosy_addon.core.errors import RosyError

from .cases import CATEGORIES, Case, make_case
from .execution import Run, execute
from .verdicts import Verdict, judge

#: Every case of this number runs twice, to compare the files that it writes.
REPEATED = 20


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
    parser.add_argument("--cases", type=int, default=10**9, help="number of cases")
    parser.add_argument("--seconds", type=float, default=math.inf, help="stop after this time")
    parser.add_argument("--jobs", type=int, default=multiprocessing.cpu_count())
    parser.add_argument(
        "--category", action="append", choices=list(CATEGORIES), help="by default all"
    )
    parser.add_argument(
        "--keep", type=Path, default="dist/fuzz", help="folder for cases with faults"
    )
    parser.add_argument("--verbose", action="store_true", help="print the outcome of every case")
    options = parser.parse_args()
    if options.cases == 10**9 and options.seconds == math.inf:
        parser.error("give --cases, --seconds, or both")
    # The processes are new, not forked, so that each case forks from the same state.
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        shares = pool.map(partial(_run_share, options), range(options.jobs), chunksize=1)
    outcomes = [outcome for share in shares for outcome in share]
    counts = Counter((outcome.category, outcome.verdict.value) for outcome in outcomes)
    for (category, verdict), count in sorted(counts.items()):
        print(f"{category:12} {verdict}: {count}")
    slowest = max(outcomes, key=lambda outcome: outcome.seconds)
    largest = max(outcomes, key=lambda outcome: outcome.peak_bytes)
    faults = sum(outcome.verdict.is_fault for outcome in outcomes)
    print(f"slowest: {slowest.category} {slowest.seed}, {slowest.seconds:.1f} s")
    print(f"largest: {largest.category} {largest.seed}, {largest.peak_bytes / 2**20:.0f} MiB")
    print(f"{len(outcomes):,} cases, seed {options.seed}: {faults} faults")
    return int(faults > 0)


def _run_share(options: argparse.Namespace, index: int) -> list[Outcome]:
    """Run the cases of one process, every `options.jobs`-th from an index on, and print faults."""
    with suppress(RosyError):
        load_drawing()  # which then takes no time in each case
    categories = options.category or list(CATEGORIES)
    shares = {name: CATEGORIES[name][1] for name in categories}
    outcomes, done, start = [], dict.fromkeys(categories, 0), time.monotonic()
    for number in range(options.cases):
        if time.monotonic() - start > options.seconds:
            break
        # Each category occurs as often as its share says, spread evenly.
        category = min(done, key=lambda name: (done[name] + 1) / shares[name])
        seed = options.seed + done[category]
        done[category] += 1
        if number % options.jobs == index:
            outcomes.append(outcome := _run_case(category, seed, options.keep))
            if outcome.verdict.is_fault or options.verbose:
                print_line(f"{category} {seed}: {outcome.verdict.value}: {outcome.reason}")
    return outcomes


def _run_case(category: str, seed: int, keep: Path) -> Outcome:
    """Make, run and judge one case. Keep its folder if there is a fault."""
    with tempfile.TemporaryDirectory(prefix="rosy-fuzz-") as parent:
        folder = Path(parent) / "case"
        folder.mkdir()
        case = make_case(category, seed, folder)
        run = execute(case, folder)
        verdict, reason = judge(case, run, folder)
        if verdict is Verdict.DONE and seed % REPEATED == 0 and case.stop_after is None:
            again = Path(parent) / "again"
            again.mkdir()
            repeated = execute(make_case(category, seed, again), again)
            if _comparable(case, repeated) != _comparable(case, run):
                verdict, reason = Verdict.NOT_REPEATED, "files or standard output differ"
        if verdict.is_fault:
            _keep(keep / f"{category}-{seed}", folder, case, run, f"{verdict.value}: {reason}")
        return Outcome(category, seed, verdict, reason, run.seconds, run.peak_bytes)


def _comparable(case: Case, run: Run) -> tuple[dict[str, str], bytes]:
    """Return the files and the output of a run, which are the same when it is repeated."""
    return run.after, run.stdout if case.arguments[0] == "info" else b""


def _keep(target: Path, folder: Path, case: Case, run: Run, text: str) -> None:
    """Copy the files of a case, and write its command line, the verdict and its error stream."""
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    for path in folder.iterdir():
        if path.is_file() and not path.is_symlink():
            shutil.copy2(path, target)
    command = shlex.join(["python", "-m", "rosy_addon", *case.arguments]).encode(errors="replace")
    (target / "fault.txt").write_bytes(
        b"\n".join([command, text.encode(errors="replace"), run.stderr])
    )
