"""Run a command in a Blender process if Python has no module ``bpy``.

Blender prints its own messages, some of them from C code. They must not mix with the output of the
command. So the standard output and error of Blender are redirected to a log file. The command that runs in
Blender writes to copies of the streams of this process. So it still knows whether they are a terminal,
and it notices if a pipe is closed.

The command writes its exit status to a report file, because Blender can exit regularly only with the
status 0. If there is no report, Blender itself failed, and its log says why.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import BinaryIO, TextIO

from ..cli.options import Options, user_presets_folder
from ..cli.scene import import_blender
from ..core.errors import RosyError
from ..rendering.turntable import Encoder
from ..worker.lifeline import Lifeline
from ..worker.program import run_encoder
from ..worker.start import inheriting

#: The oldest version of Blender that RoSy runs in.
OLDEST_VERSION = (4, 2)

#: Environment variable with the path of the Blender to run. The option --blender takes precedence.
BLENDER_VARIABLE = "ROSY_BLENDER"

#: Folder of the package, and its name.
PACKAGE_FOLDER = Path(__file__).resolve().parents[1]
PACKAGE = __package__.split(".")[0]

#: The script that Blender runs.
SCRIPT = Path(__file__).resolve().with_name("blender_script.py")

#: Options with which Blender is started: without the user's settings and add-ons, and without scripts in
#: .blend files.
BLENDER_OPTIONS = ("-b", "--factory-startup", "--disable-autoexec", "--python-exit-code", "1")

#: Names of the program of Blender on the PATH. The second one is used by Flatpak.
PROGRAM_NAMES = ("blender", "org.blender.Blender")

#: Where installers and users put Blender, by `sys.platform`. ``%...%`` is an environment variable.
USUAL_PLACES = {
    "darwin": (
        "/Applications/Blender*.app",
        "/Applications/Blender*/Blender*.app",
        "~/Applications/Blender*.app",
        "~/Library/Application Support/Steam/steamapps/common/Blender/Blender.app",
    ),
    "win32": (
        "%ProgramFiles%/Blender Foundation/Blender*/blender.exe",
        "%LOCALAPPDATA%/Programs/Blender*/blender.exe",
        "%ProgramFiles(x86)%/Steam/steamapps/common/Blender/blender.exe",
    ),
    "linux": (
        "/opt/blender*/blender",
        "/usr/local/blender*/blender",
        "~/blender*/blender",
        "~/.local/blender*/blender",
        "~/.steam/steam/steamapps/common/Blender/blender",
        "/snap/bin/blender",
        "/var/lib/flatpak/exports/bin/org.blender.Blender",
        "~/.local/share/flatpak/exports/bin/org.blender.Blender",
    ),
}

#: Longest times in seconds for Blender to print its version, and to end after an interrupt. After the second
#: one it is killed.
VERSION_SECONDS, STOP_SECONDS = 60.0, 1.0


def find_blender(requested: str | None = None) -> str:
    """Return the program of the Blender to run.

    Parameters
    ----------
    requested : str, optional
        Path of a program, its name on the PATH, or a folder that contains it. By default, the value of the
        environment variable ROSY_BLENDER is used. If that is not set either, ``blender`` on the PATH is
        used, or else the newest Blender in the folders where it is usually installed.

    Raises
    ------
    RosyError
        If there is no Blender, or it is too old.
    """
    named = os.environ.get(BLENDER_VARIABLE)
    if requested:
        return _checked_blender(requested, "--blender ")
    if named:
        return _checked_blender(named, f"{BLENDER_VARIABLE}=")
    outdated = []
    for program in installed_blenders():
        version = blender_version(program)
        if version is not None and version >= OLDEST_VERSION:
            return program
        if version is not None:
            outdated.append(f"; {program} is {_version_text(version)}")
    raise RosyError(
        f"no version {_version_text(OLDEST_VERSION)} or later is on the PATH or in "
        f"{', '.join(_usual_places())}{''.join(outdated)}: install it, give --blender PATH or set "
        f"{BLENDER_VARIABLE}, or install the Python module bpy"
    )


def _checked_blender(named: str, source: str) -> str:
    """Return the program of a Blender that the user named, after a check.

    `source` says in errors where the user named it: the option or the environment variable.
    """
    program = shutil.which(named) or _program(Path(named).expanduser())
    if program is None:
        raise RosyError(f"{source}{named}: there is no such program")
    version = blender_version(program)
    if version is None:
        raise RosyError(f"{source}{named}: is not Blender, or does not start")
    if version < OLDEST_VERSION:
        found, oldest = _version_text(version), _version_text(OLDEST_VERSION)
        raise RosyError(f"{source}{named}: is Blender {found}, but RoSy needs {oldest} or later")
    return program


def _version_text(version: Sequence[int]) -> str:
    return ".".join(map(str, version))


def installed_blenders() -> list[str]:
    """Return the programs of Blender: first those on the PATH, then those in the usual folders, newest first.

    Versions are taken from the numbers in the names of the folders.
    """
    on_path = filter(None, map(shutil.which, PROGRAM_NAMES))
    found: list[str | None] = []
    for place in _usual_places():
        folder = Path(place).expanduser()
        found += map(_program, folder.parents[-1].glob(str(folder.relative_to(folder.anchor))))
    return [*on_path, *sorted(filter(None, found), key=_numbers, reverse=True)]


def _usual_places() -> list[str]:
    """Return patterns (as for `glob`) of the paths where Blender may be installed on this system."""
    places = map(os.path.expandvars, USUAL_PLACES.get(sys.platform, USUAL_PLACES["linux"]))
    return [place for place in places if not place.startswith("%")]


def _numbers(path: str) -> list[int]:
    """Return the numbers in the folder and file names of a path that contain "blender".

    For ``/opt/blender-4.10/blender`` they are [4, 10]. Such lists are compared to find the newest version.
    """
    names = " ".join(part for part in Path(path).parts if "blender" in part.lower())
    return [int(number) for number in re.findall(r"\d+", names)]


def _program(path: Path) -> str | None:
    """Return the program at a path (a program, a folder or an app bundle of macOS); None if there is none."""
    for part in (".", "blender", "blender.exe", "Contents/MacOS/Blender"):
        if os.access(path / part, os.X_OK) and (path / part).is_file():
            return str((path / part).absolute())
    return None


def blender_version(program: str) -> tuple[int, ...] | None:
    """Return the version of a Blender program, such as (4, 2, 1). None if the program is not Blender."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    try:
        with Lifeline() as lifeline:
            process = lifeline.start([program, "-b", "--version"], **streams)
            output, _ = process.communicate(timeout=VERSION_SECONDS)
    except (OSError, subprocess.TimeoutExpired):
        return None
    match = re.search(rb"^Blender (\d+)\.(\d+)(?:\.(\d+))?", output, re.MULTILINE)
    return tuple(int(part) for part in match.groups(b"0")) if match else None


def run_in_blender(
    arguments: Sequence[str], options: Options, command: str, path: Path | None
) -> None:
    """Run a command again in a Blender process, and exit with its status.

    If the option --blender is not set and Python has the module ``bpy``, do nothing, so that the command can
    run in this process.

    Parameters
    ----------
    arguments : sequence of str
        Arguments of the command.
    options : Options
        The options of the command.
    command : str
        Name of the command, such as "bake".
    path : Path or None
        The .blend file.

    Raises
    ------
    SystemExit
        With the exit status of the command.
    RosyError
        If there is no file, no Blender, or Blender failed.
    """
    if options.blender is None:
        with suppress(ImportError):
            import_blender()
            return
    if path is None:
        raise RosyError(f"{command}: no input: give SCENE.blend")
    try:
        program = find_blender(options.blender)
    except RosyError as error:
        raise RosyError(f"{command} needs Blender: {error}") from None
    raise SystemExit(run_job(program, arguments))


def run_job(program: str, arguments: Sequence[str]) -> int:
    """Run `blender_script.py` in a Blender process, and return the exit status of the command that it runs.

    Parameters
    ----------
    program : str
        Path of Blender.
    arguments : sequence of str
        Arguments of the command.

    Raises
    ------
    RosyError
        If Blender ended before the command did.
    KeyboardInterrupt
        If the user interrupted Blender before the command began, or the command did not end soon after.
    """
    with ExitStack() as stack:
        lifeline = stack.enter_context(Lifeline())
        log = stack.enter_context(open(lifeline.folder / "log", "w+b"))
        report = stack.enter_context(open(lifeline.folder / "report", "a+b", buffering=0))
        descriptors = [_copy(sys.stdout, 1, stack), _copy(sys.stderr, 2, stack), report.fileno()]
        handles = _handles(descriptors)
        job = {
            "package": PACKAGE,
            "folder": str(PACKAGE_FOLDER),
            "arguments": list(arguments),
            "handles": handles,
            "encodings": [_encoding(sys.stdout), _encoding(sys.stderr)],
        }
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        process = lifeline.start(
            [program, *BLENDER_OPTIONS, "--python", str(SCRIPT), "--", json.dumps(job)],
            stdout=log,
            stderr=subprocess.STDOUT,
            # A sandboxed Blender (Flatpak, Snap) has other folders of user data.
            env={"ROSY_PRESETS": str(user_presets_folder())},
            **inheriting(handles),
        )
        try:
            process.wait()
        except KeyboardInterrupt:
            if _report_words(report):  # before the command has begun, Blender ignores interrupts
                lifeline.interrupt(STOP_SECONDS)
            if len(_report_words(report)) < 2:
                raise
        words = _report_words(report)
        if len(words) < 2:
            raise RosyError(f"{program}: {_failure(process.returncode, log)}")
        return int(words[1])


def _copy(stream: TextIO | None, default: int, stack: ExitStack) -> int:
    """Return a duplicate of the file descriptor of a stream, or of `default` if the stream has none.

    `stack` closes it.
    """
    try:
        descriptor = stream.fileno()
    except (AttributeError, OSError, ValueError):
        descriptor = default
    copied = os.dup(descriptor)
    stack.callback(os.close, copied)
    return copied


def _encoding(stream: TextIO | None) -> tuple[str, str]:
    """Return the encoding of a stream, by default UTF-8, and the name of its error handler."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return encoding, getattr(stream, "errors", None) or "backslashreplace"


def _handles(descriptors: list[int]) -> list[int]:
    """Return file descriptors as a child process inherits them: unchanged; on Windows, their handles."""
    if sys.platform != "win32":
        return descriptors
    import msvcrt

    return [msvcrt.get_osfhandle(descriptor) for descriptor in descriptors]


def _report_words(report: BinaryIO) -> list[bytes]:
    """Return the words that the script has reported: "begun", then the exit status of the command."""
    report.seek(0)
    return report.read().split()


def _failure(status: int, log: BinaryIO) -> str:
    """Return an error message of one line that says how Blender failed."""
    log.seek(0)
    lines = [line.strip() for line in log.read().decode(errors="replace").splitlines()]
    last_line = next((line for line in reversed(lines) if line), "it printed nothing")
    ending = f"by signal {-status}" if status < 0 else f"with status {status}"
    return f"Blender ended {ending} before the command did: {last_line}"


def blender_encoder(requested: str | None) -> Encoder | None:
    """Return an encoder of .mp4 files that runs Blender. None if no Blender is installed.

    Parameters
    ----------
    requested : str, optional
        Path of a Blender program, its name on the PATH, or a folder that contains it. By default, the program
        is searched as by `find_blender`.

    Raises
    ------
    RosyError
        If the Blender that the user named cannot be used.
    """
    try:
        program = find_blender(requested)
    except RosyError:
        if requested or os.environ.get(BLENDER_VARIABLE):
            raise
        return None
    script = PACKAGE_FOLDER / "scene" / "video_encoding.py"

    def encode(folder: Path, count: int, size: tuple[int, int], fps: float, path: Path) -> None:
        """Encode the pictures in a folder; see `Encoder`."""
        command = [program, *BLENDER_OPTIONS, "--python", str(script), "--"]
        command += map(str, (folder, count, *size, repr(fps), path))
        run_encoder(command, f"{path}: {program} cannot encode a video", path)

    return encode
