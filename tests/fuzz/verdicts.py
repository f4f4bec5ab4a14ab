"""What is wrong with a run: its streams, its exit status, and the files that it leaves."""

import io
import json
import re
import signal
import zlib
from enum import Enum
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from PIL import Image

from rosy_addon.core.errors import UNSAFE, RosyError
from rosy_addon.field.formats.ply import read_values
from rosy_addon.field.formats.text_rows import read_rows

from .cases import Case
from .execution import Run

#: Most resident memory of a run. Pictures of cases are small.
MEMORY_BYTES = 2 << 30


class Verdict(Enum):
    """The outcome of a run. All after `ENDED` are faults of the program."""

    DONE = "done"
    REFUSED = "refused in one line"
    ENDED = "ended by its signal or stream"
    TRACEBACK = "traceback"
    WARNING = "warning"
    STATUS = "wrong status"
    MESSAGE = "not one clear line"
    CONTROL = "control character"
    CRASH = "crash"
    HANG = "hang"
    MEMORY = "memory"
    HALF_WRITTEN = "file half written"
    STRAY = "stray or changed file"
    WRONG = "not what was asked"
    LEFT = "process or temporary folder left"
    NOT_REPEATED = "other bytes when repeated"

    @property
    def is_fault(self) -> bool:
        """Whether it is a fault of the program."""
        return self not in (Verdict.DONE, Verdict.REFUSED, Verdict.ENDED)


def judge(case: Case, run: Run, folder: Path) -> tuple[Verdict, str]:
    """Return the verdict on a run, and what it is based on.

    Parameters
    ----------
    case : Case
    run : Run
    folder : Path
        Folder of the case, as the run left it.
    """
    stderr = run.stderr.decode("utf-8", "replace")
    if run.status is None:
        return Verdict.HANG, f"{run.seconds:.0f} s"
    interrupted = case.stop_after is not None and case.stop_signal == signal.SIGINT
    if interrupted and _stopped_early(run, stderr):
        return Verdict.ENDED, "interrupted before RoSy started"
    if "Traceback" in stderr:
        return Verdict.TRACEBACK, stderr.strip().splitlines()[-1]
    killed = case.stop_after is not None and run.status == -case.stop_signal
    if run.left:
        return Verdict.LEFT, run.left
    if run.status < 0 and not killed:
        return Verdict.CRASH, signal.Signals(-run.status).name
    if re.search(r"\w+Warning\b", stderr):
        return Verdict.WARNING, stderr.strip()[:300]
    for text in (stderr, run.stdout.decode("utf-8", "replace")):
        if unsafe := UNSAFE.search(text):
            return Verdict.CONTROL, repr(text[max(unsafe.start() - 40, 0) :][:80])
    if run.peak_bytes > MEMORY_BYTES:
        return Verdict.MEMORY, f"{run.peak_bytes / 2**30:.1f} GiB"
    if stray := _stray_files(case, run):
        return Verdict.STRAY, stray
    for name in sorted(filter(case.may_write, run.after)):
        if run.after[name] != run.before.get(name) and (folder / name).is_file():
            if fault := _file_fault(folder / name):
                return Verdict.HALF_WRITTEN, f"{name}: {fault}"
            if run.status not in (0, 130, 141, 1) and not killed:
                return Verdict.STATUS, f"status {run.status}, but {name} was written"
    return _judge_status(case, run, stderr, killed, folder)


def _judge_status(
    case: Case, run: Run, stderr: str, killed: bool, folder: Path
) -> tuple[Verdict, str]:
    lines = stderr.splitlines()
    if killed:
        return Verdict.ENDED, "killed"
    match run.status:
        case 0:
            if fault := _stdout_fault(case, run):
                return Verdict.HALF_WRITTEN, fault
            if not all(line.startswith("rosy: ") for line in lines):
                return Verdict.MESSAGE, stderr.strip()[:300]
            written = [
                case.may_write(name) and text != run.before.get(name)
                for name, text in run.after.items()
            ]
            if "-o" in case.arguments and not any(written):
                # The same bytes as before are right, but no case begins with these.
                return Verdict.STATUS, "status 0, but nothing was written"
            if case.fault and (fault := case.fault(folder)):
                return Verdict.WRONG, fault
            return Verdict.DONE, ""
        case 2:
            usage = bool(lines) and lines[0].startswith("usage:")
            errors = [line for line in lines if re.match(r"(rosy|[\w. -]*): ", line)]
            if not lines or (run.stdout and case.arguments[0] in ("render", "field", "info")):
                return Verdict.MESSAGE, f"stdout {run.stdout[:80]!r}, stderr {stderr[:80]!r}"
            if not usage and len(errors) != len(lines):  # notes, then the error
                return Verdict.MESSAGE, stderr.strip()[:300]
            return Verdict.REFUSED, lines[-1]
        case 130 if case.stop_after is not None:
            if lines[-1:] != ["rosy: stopped"]:
                return Verdict.MESSAGE, stderr.strip()[:300]
            return Verdict.ENDED, lines[-1]
        case 141 if case.stdout == "closed":
            notes_only = all(line.startswith("rosy: ") for line in lines)
            return (Verdict.ENDED, "closed pipe") if notes_only else (Verdict.MESSAGE, stderr)
        case 1 if case.stdout == "full":
            return Verdict.ENDED, stderr.strip()
    return Verdict.STATUS, f"status {run.status}: {stderr.strip()[-200:]}"


def _stopped_early(run: Run, stderr: str) -> bool:
    """Return whether an interrupt ended Python before RoSy's first line, with a traceback or not."""
    interrupted = run.status == -signal.SIGINT or stderr.rstrip().endswith("KeyboardInterrupt")
    return interrupted and "rosy_addon" not in stderr


def _stray_files(case: Case, run: Run) -> str:
    """Return what was changed that should not have been, or an empty text."""
    for name in sorted(run.before.keys() | run.after.keys()):
        if case.may_write(name) or run.before.get(name) == run.after.get(name):
            continue
        change = "new" if name not in run.before else "changed" if name in run.after else "gone"
        return f"{name}: {change}"
    return ""


def _stdout_fault(case: Case, run: Run) -> str:
    """Return what is wrong with JSON on standard output."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is not JSON")

    is_json = not {"--json", "--format=json"}.isdisjoint(case.arguments)
    if is_json and case.stdout == "file" and "--help" not in case.arguments:
        try:
            json.loads(run.stdout, parse_constant=refuse)
        except ValueError as error:
            return str(error)
    return ""


def _pdf_fault(data: bytes) -> str:
    """Return what is wrong with a .pdf: its table has to point to every object, and streams are compressed."""
    if not data.startswith(b"%PDF-1") or not data.endswith(b"%%EOF\n"):
        return "the beginning or the end is missing"
    start = int(re.search(rb"startxref\s+(\d+)\s+%%EOF\s*$", data)[1])
    head, *rows = data[start : data.index(b"trailer", start)].splitlines()[1:]
    if int(head.split()[1]) != len(rows) or not data.startswith(b"xref", start):
        return "the table of objects is cut"
    for number, row in enumerate(rows):
        place, _, kind = row.split()
        if kind == b"n" and not data.startswith(b"%d 0 obj" % number, int(place)):
            return f"object {number} is in another place"
    for stream in re.finditer(rb"/FlateDecode.*?stream\r?\n(.*?)\nendstream", data, re.DOTALL):
        zlib.decompress(stream[1])
    return "" if b"/Type /Page\n" in data or b"/Type /Page " in data else "there is no page"


def _file_fault(path: Path) -> str:
    """Return what is wrong with a file that RoSy wrote, or an empty text."""
    data = path.read_bytes()
    try:
        match path.suffix.lower():
            case ".png" | ".gif":
                with Image.open(io.BytesIO(data)) as picture:
                    for frame in range(getattr(picture, "n_frames", 1)):
                        picture.seek(frame)
                        picture.load()
            case ".pdf":
                return _pdf_fault(data)
            case ".svg":
                ElementTree.fromstring(data)
                # Colors are as the user wrote them.
                numbers = re.sub(rb'(fill|stroke)="[^"]*"', b"", data)
                if re.search(rb'[ ",](nan|inf|-inf)[ ",]', numbers):
                    return "a coordinate is not finite"
            case ".npy":
                if not np.isfinite(np.load(io.BytesIO(data))).all():
                    return "a vector is not finite"
            case ".rosy" | ".rawfield" | ".txt" | ".sings":
                if re.search(rb"nan|inf", data):
                    return "a number is not finite"
                read_rows(path)
            case ".obj" | ".csv":
                if not data.endswith(b"\n"):
                    return "the last line is cut"
                if re.search(rb"[ ,]-?(nan|inf)\b", data):
                    return "a number is not finite"
            case ".ply":
                if not all(np.isfinite(column).all() for column in read_values(path).values()):
                    return "a number is not finite"
    except (OSError, ValueError, TypeError, SyntaxError, RosyError, zlib.error) as error:
        return f"{type(error).__name__}: {error}"
    return ""
