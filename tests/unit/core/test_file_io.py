"""Writing whole files, and what processes leave behind that are killed meanwhile."""

import os
import signal
import subprocess
import sys
import time

import pytest

from rosy_addon.core.errors import RosyError
from rosy_addon.core.file_io import (
    LEFTOVER_SECONDS,
    check_folder,
    guarding_inputs,
    read_bytes,
    replacing,
    write_bytes,
)

WRITER = """
import sys, time
from rosy_addon.core.file_io import replacing
with replacing(sys.argv[1]) as (temporary,):
    temporary.write_bytes(b"half")
    print("writing", flush=True)
    time.sleep(60)
"""


WHOLE_WRITER = (
    "import sys; from rosy_addon.core.file_io import write_bytes; write_bytes(sys.argv[1], b'')"
)


def write_in_process(folder, *prefix):
    """Write a file by another process, which is started by the program of the prefix."""
    command = [*prefix, sys.executable, "-c", WHOLE_WRITER, folder / "b.png"]
    return subprocess.run(command, capture_output=True, text=True, timeout=30)


@pytest.fixture
def writer(tmp_path):
    """A process in the midst of writing a file."""
    command = [sys.executable, "-c", WRITER, tmp_path / "a.png"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "writing\n"
    yield process
    process.kill()
    process.communicate()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="only there a process can be asked for")
def test_what_a_killed_process_leaves_is_deleted_by_the_next_one(writer, tmp_path):
    write_bytes(tmp_path / "b.png", b"whole")
    (left, *_) = names(tmp_path)
    assert left.startswith(".rosy-")  # its process is running
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    write_bytes(tmp_path / "b.png", b"whole")
    assert names(tmp_path) == ["b.png"]


@pytest.mark.skipif(sys.platform != "linux", reason="Linux has PID namespaces")
def test_processes_that_see_each_other_only_in_the_folder(writer, tmp_path):
    """In a container, whose processes have other numbers, a process that is writing has none."""
    namespace = "unshare", "--user", "--map-root-user", "--pid", "--fork"
    done = write_in_process(tmp_path, *namespace)
    if "unshare" in done.stderr:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    left, written = names(tmp_path)
    assert left.startswith(".rosy-") and written == "b.png"


@pytest.mark.skipif(sys.platform != "linux", reason="Linux has the program flock")
def test_a_program_that_has_locked_the_folder_may_start_rosy(tmp_path):
    """As ``flock FOLDER rosy ...`` does."""
    assert write_in_process(tmp_path, "flock", tmp_path).returncode == 0
    assert names(tmp_path) == ["b.png"]


def test_leftovers_of_other_machines_are_deleted_after_a_day(tmp_path):
    left = tmp_path / f".rosy-00000000-{0:016x}.png"
    others = [tmp_path / ".rosy-notes.txt", tmp_path / ".rosy-00000000-0.png"]
    for path in (left, *others):
        path.write_bytes(b"")
        os.utime(path, (0, time.time() - LEFTOVER_SECONDS + 100))
    write_bytes(tmp_path / "a.png", b"whole")
    assert left.exists()
    for path in (left, *others):
        os.utime(path, (0, time.time() - LEFTOVER_SECONDS - 100))
    write_bytes(tmp_path / "a.png", b"whole")
    assert names(tmp_path) == sorted(["a.png", *(path.name for path in others)])


@pytest.fixture
def linked(tmp_path):
    """A file in another folder, and links to it."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").write_bytes(b"old")
    (tmp_path / "link.png").symlink_to(tmp_path / "elsewhere" / "file")
    (tmp_path / "folder").symlink_to(tmp_path / "elsewhere")
    return tmp_path / "elsewhere" / "file", tmp_path / "link.png"


def test_links_are_followed_only_for_paths_of_the_user(linked):
    target, link = linked
    write_bytes(link, b"named by the user", follow_links=True)
    assert link.is_symlink() and target.read_bytes() == b"named by the user"
    write_bytes(link, b"derived")
    assert not link.is_symlink() and link.read_bytes() == b"derived"
    assert target.read_bytes() == b"named by the user"


@pytest.mark.parametrize("target", ["missing", "folder", "link.png"])
def test_links_to_nothing_or_folders_are_replaced_themselves(target, tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.png").symlink_to(target)
    write_bytes(tmp_path / "link.png", b"derived")
    assert names(tmp_path) == ["folder", "link.png"] and names(tmp_path / "folder") == []
    assert (tmp_path / "link.png").read_bytes() == b"derived"


@pytest.mark.parametrize("fault", ["check", "block"])
def test_several_files_are_all_replaced_or_none(fault, tmp_path):
    paths = [tmp_path / name for name in ("a", "b", "c")]
    for path in paths[:2]:
        path.write_bytes(b"old")
    if fault == "check":
        paths[2].mkdir()
    reason = "is a folder" if fault == "check" else "a: cannot be written"
    with pytest.raises(RosyError, match=reason), replacing(*paths) as temporaries:
        temporaries[0].write_bytes(b"new")
        raise OSError("the disk is full")
    assert [path.read_bytes() for path in paths[:2]] == [b"old", b"old"]
    assert names(tmp_path) == ["a", "b", "c"][: 3 if fault == "check" else 2]


@pytest.mark.parametrize(
    "name", ["link.png", "hard.png", "elsewhere/file", "folder/file", "elsewhere/../elsewhere/file"]
)
def test_what_was_read_is_not_replaced(name, linked, tmp_path):
    target, link = linked
    with guarding_inputs():
        write_bytes(target, b"before it is read")
        (tmp_path / "hard.png").hardlink_to(target)
        read_bytes(link)
        with pytest.raises(RosyError, match="is also an input: choose another output file"):
            write_bytes(tmp_path / name, b"new", follow_links=True)
        write_bytes(tmp_path / "other.png", b"new")
    assert target.read_bytes() == b"before it is read"
    write_bytes(tmp_path / name, b"new", follow_links=True)


@pytest.mark.skipif(os.sep == "\\", reason="the backslash is a separator")
def test_a_folder_that_blender_would_look_for_elsewhere_is_refused(tmp_path, error_of):
    assert "takes the backslash" in error_of(check_folder, tmp_path / "a\\b" / "c")
