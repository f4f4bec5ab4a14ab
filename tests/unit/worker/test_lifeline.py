"""All processes and temporary folders end with the process that started them, however it ends."""

import os
import signal
import subprocess
import sys
import tempfile
import uuid

import pytest
from conftest import ROOT
from harness.processes import all_end, becomes_true, marked_processes

from rosy_addon.worker.frame_workers import run_local
from rosy_addon.worker.lifeline import Lifeline

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads the list of processes")

#: A program behind another one, as Blender is behind the scripts of some installations. It writes to
#: its temporary folder as long as it lives, also when that is gone.
SCRIPT = """
import contextlib, os, pathlib, time
print("begun", flush=True)
while True:
    time.sleep(0.001)
    with contextlib.suppress(OSError):
        pathlib.Path(os.environ["TMPDIR"], f"{os.getpid()}-{time.time()}").touch()
"""
WRAPPED = ["sh", "-c", f"{sys.executable} -c '{SCRIPT}'; exit"]

#: Programs that start others and then print a line, and the number of processes, with the guard process.
PROGRAMS = {
    "frames": (
        f"""
from rosy_addon.worker.frame_workers import run_local
for line in run_local({WRAPPED!r}, range(2), 2):
    print(line, flush=True)
""",
        6,
    ),
    "program": (
        f"""
from rosy_addon.worker.program import run_program
for step in run_program.begin({WRAPPED!r}, "begun"):
    print(step.label, flush=True)
""",
        4,
    ),
    "helper": (
        """
from rosy_addon.worker.helper import Helper
helper = Helper()
helper.submit(time.sleep, 100)  # it does not see that its parent has ended
while not helper._is_ready:
    helper.poll()
print("begun", flush=True)
time.sleep(100)
""",
        3,
    ),
}


@pytest.fixture
def mark(monkeypatch):
    """A text in the environment of all processes that the test starts. Those that are left are killed."""
    mark = uuid.uuid4().hex
    monkeypatch.setenv("ROSY_TEST", mark)
    yield mark
    for pid in marked_processes(mark):
        os.kill(pid, signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
@pytest.mark.parametrize("kill", [os.kill, os.killpg])
def test_nothing_outlives_the_process_that_started_it(name, number, kill, mark, tmp_path):
    """Neither processes nor folders, if the process gets a signal, or its group as from a terminal."""
    if signal.getsignal(number) == signal.SIG_IGN:
        pytest.skip("the tests ignore this signal, as under nohup, and so would the process")
    program, count = PROGRAMS[name]
    with subprocess.Popen(
        [sys.executable, "-c", f"import sys, time\nsys.path.insert(0, {str(ROOT)!r})\n{program}"],
        stdout=subprocess.PIPE,
        env=os.environ | {"TMPDIR": str(tmp_path)},
        start_new_session=True,
    ) as process:
        assert process.stdout.readline() == b"begun\n"
        assert becomes_true(lambda: len(marked_processes(mark)) == count, 20.0)
        kill(process.pid, number)
        process.wait()
        assert all_end(mark), marked_processes(mark)
        assert becomes_true(lambda: not list(tmp_path.iterdir()))


def test_programs_that_others_started_end_with_the_lifeline(mark):
    with Lifeline() as lifeline:
        process = lifeline.start(WRAPPED, stdout=subprocess.PIPE)
        assert process.stdout.readline() == b"begun\n" and len(marked_processes(mark)) == 3
    process.stdout.close()
    assert all_end(mark) and not lifeline.folder.exists()


def test_interrupted_programs_may_remove_their_files(tmp_path):
    """An interrupt reaches a program behind another one, and not the guard process."""
    script = (
        f"import pathlib, time; path = pathlib.Path({str(tmp_path / 'file')!r})\n"
        "try:\n    path.touch(); print(1, flush=True); time.sleep(60)\nfinally:\n    path.unlink()"
    )
    lines = run_local(["sh", "-c", f'exec {sys.executable} -c "$0"', script], range(1), 1)
    assert next(lines) == "1" and list(tmp_path.iterdir())
    lines.close()
    assert not list(tmp_path.iterdir())


def test_the_next_start_removes_folders_of_killed_processes(tmp_path, monkeypatch):
    """Also if the guard process was killed as well."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    code = (
        f"import os, sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from rosy_addon.worker.lifeline import Lifeline\nlifeline = Lifeline()\n"
        "(lifeline.folder / 'file').touch()\nos.kill(lifeline.group, 9); os.kill(os.getpid(), 9)"
    )
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    subprocess.run([sys.executable, "-c", code], env=environment, check=False)
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))
    with Lifeline() as running, Lifeline() as lifeline:
        os.utime(running.folder, (0, 0))
        folders = {running.folder, lifeline.folder}
        assert set(tmp_path.iterdir()) == folders and left not in folders


def test_no_temporary_folder_is_one_line(monkeypatch, error_of):
    monkeypatch.setattr(tempfile, "tempdir", "/no/such/folder")
    with Lifeline() as lifeline:
        assert "set TMPDIR to a folder" in error_of(getattr, lifeline, "folder")
