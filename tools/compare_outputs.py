"""Compare the outputs of two commits, byte for byte.

    .venv-bpy42/bin/python tools/compare_outputs.py OLD [NEW] [--only TEXT] [--keep DIR] [--data DIR]
    .venv-bpy42/bin/python tools/compare_outputs.py OLD --blender "COMMAND"

OLD and NEW are git revisions. If NEW is not given, the working tree is compared. Each revision is copied to a
temporary folder. Every case (a short program) of `tools/outputs/cases.toml` runs there in a child process
that imports only this copy. The exit status is 0 only if all cases ran and gave the same files. One revision
takes 3 to 4 minutes on two processor cores.

Cases use only interfaces that users have: the command line, the Python package, operators and properties.

Each case runs in one of three environments, called lanes: `numpy` (plain Python), `bpy` (Blender's Python
module, if this Python has it) and `card` (a full Blender that draws on the graphics card, only with
--blender). COMMAND starts Blender without a window, and arguments are appended to it, as to "blender -b".

Outputs of commits are cached in build/compare/SHA/DIGEST. DIGEST is computed from the cases, their inputs and
the versions of Python and numpy.
"""

import argparse
import contextlib
import hashlib
import importlib.util
import io
import itertools
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from outputs.inputs import write_inputs
from outputs.run_cases import FOLDER, INPUT, INPUTS, LANES, LOG, STATUS, Case, read_cases
from working_tree import ROOT, copy_working_tree

CACHE = ROOT / "build" / "compare"

#: Number of cases that one child process runs, and seconds after which the process is stopped.
BATCH_SIZE, BATCH_TIMEOUT = 12, 900

#: Endings of the names of files that are not compared: logs, and the sidecar files of frames of animations.
NOT_COMPARED = (LOG, ".rosy.txt")

#: Name of an input file that must not exist, for cases with a missing file.
MISSING = "missing.off"


@dataclass(frozen=True)
class Revision:
    """A git revision or the working tree, with the folders for its comparison.

    Attributes
    ----------
    label : str
        Name in messages.
    sha : str
        Hash of the commit. Empty for the working tree.
    tree : Path
        Copy of its files. It exists if cases have to run.
    outputs : Path
        Outputs of this run, with a folder for each case.
    cache : Path
        Outputs of earlier runs.
    """

    label: str
    sha: str
    tree: Path
    outputs: Path
    cache: Path

    def folder(self, case: Case) -> Path:
        """Return the folder with the outputs of a case: of this run, or of an earlier one."""
        new = self.outputs / case.name
        return new if new.is_dir() else self.cache / case.name

    def extract(self) -> None:
        """Copy the files of the revision to `tree`.

        Of the working tree, files that git ignores are left out.
        """
        if self.sha:
            with tarfile.open(fileobj=io.BytesIO(git("archive", self.sha))) as files:
                files.extractall(self.tree, filter="data")
        else:
            copy_working_tree(self.tree)


def git(*arguments: str) -> bytes:
    """Run git and return its output. If it fails, it prints the reason, and the program ends."""
    completed = subprocess.run(["git", "-C", ROOT, *arguments], check=False, stdout=subprocess.PIPE)
    if completed.returncode:
        sys.exit(f"git {arguments[0]} failed for {arguments[-1]}")
    return completed.stdout


def find_revision(side: str, name: str | None, work: Path, blender: str) -> Revision:
    """Return the revision `name`, or the working tree if it is None. `side` is "old" or "new"."""
    sha = git("rev-parse", "--verify", f"{name}^{{commit}}").decode().strip() if name else ""
    digest = hashlib.sha256(f"{sys.version} {np.__version__} {platform.platform()}".encode())
    digest.update(f"{blender} {read_cases()}".encode())
    for path in [*sorted(FOLDER.glob("*.*")), *sorted((work / INPUTS).iterdir())]:
        digest.update(path.name.encode() + path.read_bytes())
    cache = CACHE / (sha or "none") / digest.hexdigest()[:12]
    label = f"{side} ({name or 'working tree'})"
    return Revision(label, sha, work / f"{side}-tree", work / side, cache)


def run_cases(
    revisions: Sequence[Revision], cases: Sequence[Case], blender: str, jobs: int
) -> None:
    """Run the cases whose outputs are not in the cache, several at once."""
    batches = []
    for revision in revisions:
        missing = [case for case in cases if not revision.folder(case).is_dir()]
        print(f"{revision.label}: {len(cases) - len(missing)} cached, {len(missing)} to run")
        if missing:
            revision.extract()
        for lane in reversed(LANES):  # the lanes that take longest come first
            chosen = [case for case in missing if case.lane == lane]
            starts = range(0, len(chosen), BATCH_SIZE)
            batches += [(revision, chosen[start : start + BATCH_SIZE]) for start in starts]
    sys.stdout.flush()
    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(lambda batch: run_batch(*batch, blender), batches))


def run_batch(revision: Revision, batch: Sequence[Case], blender: str) -> None:
    """Run cases of one lane in a child process. If the revision is a commit, cache their outputs.

    If a case ends the process, this case and the following ones are marked as crashed.
    """
    printed = run_child(revision, batch, blender)
    for case in batch:
        new = revision.outputs / case.name
        if not (new / STATUS).is_file():
            new.mkdir(parents=True, exist_ok=True)
            (new / LOG).write_text(printed)
            (new / STATUS).write_text("crashed")
        elif revision.sha and (new / STATUS).read_text() == str(case.status):
            revision.cache.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(OSError):  # another run has cached it already
                os.replace(new, revision.cache / case.name)


def run_child(revision: Revision, cases: Sequence[Case], blender: str) -> str:
    """Run cases in one child process, and return what it printed."""
    work, lane, script = revision.outputs.parent, cases[0].lane, str(FOLDER / "run_cases.py")
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "ROSY_PRESETS": str(work / "no-presets"),
        "BLENDER_USER_RESOURCES": str(work / "blender-user"),
    }
    command = [sys.executable, script]
    if lane == "card":
        command = [*shlex.split(blender), "--factory-startup", "-P", script, "--"]
    command += ["--child", str(revision.tree), str(revision.outputs), lane]
    command += [case.name for case in cases]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    try:
        completed = subprocess.run(
            command, cwd=ROOT, env=environment, timeout=BATCH_TIMEOUT, check=False, **streams
        )
    except subprocess.TimeoutExpired:
        return f"stopped after {BATCH_TIMEOUT} s"
    return completed.stdout.decode(errors="replace")


def report(revisions: Sequence[Revision], cases: Sequence[Case], keep: Path | None) -> Counter[str]:
    """Print a line for each case and return how many are the same, differ or failed."""
    counts: Counter[str] = Counter()
    for case in cases:
        old, new = folders = [revision.folder(case) for revision in revisions]
        differences = compare(old, new)
        failed = [
            f"{side} ended with {status}, see its {LOG} (--keep)"
            for side, folder in zip(("old", "new"), folders, strict=True)
            if (status := (folder / STATUS).read_text()) != str(case.status)
        ]
        result = "failed" if failed else "DIFFERS" if differences else "same"
        counts[result] += 1
        print(f"{result:7}  {case.name}  {'; '.join(failed or differences)}".rstrip())
        if keep is not None and result != "same":
            for side, folder in zip(("old", "new"), folders, strict=True):
                shutil.copytree(folder, keep / case.name / side, dirs_exist_ok=True)
    return counts


def compare(old: Path, new: Path) -> list[str]:
    """Return what differs between two folders of outputs of a case, one line per file."""
    first, second = compared_files(old), compared_files(new)
    differences = []
    for name in sorted({*first, *second}):
        if name not in first or name not in second:
            differences.append(f"{name} is only in {'old' if name in first else 'new'}")
        elif first[name].read_bytes() != second[name].read_bytes():
            differences.append(f"{name}: {describe_difference(first[name], second[name])}")
    return differences


def compared_files(folder: Path) -> dict[str, Path]:
    """Return the files in a folder of outputs that are compared, by their relative paths."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    files = {str(path.relative_to(folder)): path for path in paths}
    return {name: path for name, path in files.items() if not name.endswith(NOT_COMPARED)}


def describe_difference(old: Path, new: Path) -> str:
    """Return a description of how two files differ."""
    if old.suffix in (".npy", ".png"):
        first, second = (
            np.load(path) if path.suffix == ".npy" else 255 * read_png(path) for path in (old, new)
        )
        if first.shape != second.shape or first.ndim != 3:
            return f"arrays of shape {first.shape} and {second.shape}"
        difference = np.abs(first.astype(np.float64) - second).max(axis=2)
        count = np.count_nonzero(difference)
        return f"{count} of {difference.size} pixels differ, by {difference.max():.6g} at most"
    before, after = old.read_bytes(), new.read_bytes()
    if b"\0" in before:
        return f"{len(before)} and {len(after)} bytes"
    lines = list(itertools.zip_longest(before.splitlines(), after.splitlines()))
    differing = [number for number, (a, b) in enumerate(lines, 1) if a != b]
    return f"{len(differing)} of {len(lines)} lines differ, the first are {differing[:3]}"


def read_png(path: Path) -> np.ndarray:
    """Return the (H, W, 4) sRGB values of a PNG file."""
    from rosy_addon.core.color import to_display
    from rosy_addon.image_io.png import read_png

    rgba = read_png(path)
    return np.concatenate([to_display(rgba[..., :3]), rgba[..., 3:]], axis=-1)


def parse_arguments() -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("old", metavar="OLD", help="git revision")
    add("new", nargs="?", metavar="NEW", help="git revision; by default the working tree")
    add("--only", default="", metavar="TEXT", help="cases with this in their name")
    add("--keep", type=Path, metavar="DIR", help="copy outputs that differ or failed")
    data = ROOT.parent / "shared" / "data"
    add("--data", type=Path, default=data, metavar="DIR", help="meshes and fields of others")
    add("--blender", default="", metavar="COMMAND", help="run the graphics card's cases as well")
    add("--jobs", type=int, default=2, metavar="N", help="processes (%(default)s)")
    return parser.parse_args()


def main() -> int:
    """Compare two revisions and return the exit status."""
    options = parse_arguments()
    sys.path.append(str(ROOT))  # for the package, which reads picture files
    has_blender = importlib.util.find_spec("bpy") is not None
    lanes = {"numpy": True, "bpy": has_blender, "card": bool(options.blender)}
    cases = [case for name, case in read_cases().items() if options.only in name]
    cases = [case for case in cases if lanes[case.lane]]
    print("lanes:", *(lane for lane in LANES if lanes[lane]))
    CACHE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE, prefix="work-") as work_name:
        work = Path(work_name)
        write_inputs(work / INPUTS, options.data)
        inputs = {path.name for path in (work / INPUTS).iterdir()} | {MISSING}
        chosen = [case for case in cases if inputs.issuperset(re.findall(INPUT, case.code))]
        revisions = [
            find_revision(side, name, work, options.blender)
            for side, name in (("old", options.old), ("new", options.new))
        ]
        run_cases(revisions, chosen, options.blender, options.jobs)
        counts = report(revisions, chosen, options.keep)
    print(
        f"{len(chosen)} cases: {counts['same']} same, {counts['DIFFERS']} differ, "
        f"{counts['failed']} failed; {len(cases) - len(chosen)} left out because an input is missing"
    )
    return 0 if chosen and counts["same"] == len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
