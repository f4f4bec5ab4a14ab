"""Files of simulations that never end, or take too much time or memory; no library reads them here."""

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rosy_addon.external import reading_process
from rosy_addon.external.reading_process import HELPER, read_in_helper

#: Files that name another file, in the way of each format.
NAMING = {
    "a.pvtu": '<VTKFile type="PUnstructuredGrid"><Piece Source="NAME"/></VTKFile>',
    "a.vtm": '<VTKFile type="vtkMultiBlockDataSet"><DataSet index="0" file="NAME"/></VTKFile>',
    "a.xdmf": '<Xdmf xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="NAME"/></Xdmf>',
    "b.xdmf": '<Xdmf><DataItem Format="Binary" Dimensions="9">\n NAME\n</DataItem></Xdmf>',
    "c.xdmf": '<Xdmf><DataItem Format="HDF" Dimensions="9">NAME:/data0</DataItem></Xdmf>',
    "a.gltf": '{"buffers": [{"byteLength": 9, "uri": "NAME"}]}',
    "a.inp": "*HEADING\n*INCLUDE, INPUT=NAME\n",
    "b.pvtu": '<VTKFile type="PUnstructuredGrid"><Piece Source="a.pvtu"/></VTKFile>',
}


@pytest.fixture(autouse=True)
def _without_helper():
    yield
    HELPER.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_names_of_pipes_and_devices(kind, tmp_path, error_of):
    """They are refused before the file is read, which would never end."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    for name, text in NAMING.items():
        (tmp_path / name).write_text(text.replace("NAME", kind))
        expected = f"{tmp_path / kind}: cannot be read: it is not a regular file"
        assert error_of(read_in_helper, [tmp_path / name], len, "") == expected, name


def test_names_of_ordinary_files(tmp_path):
    """Files that name each other, folders or files that are missing can be read."""
    for name, others in {"a.vtm": "b.vtm . none.vtu", "b.vtm": "a.vtm"}.items():
        text = "".join(f'<DataSet file="{other}"/>' for other in others.split())
        (tmp_path / name).write_text(text)
    assert read_in_helper([tmp_path / "a.vtm"], len, "abc") == 3


@pytest.mark.slow
def test_time_and_memory_have_limits(tmp_path, error_of, monkeypatch):
    path = tmp_path / "a.vtu"
    path.touch()
    monkeypatch.setattr(reading_process, "READ_SECONDS", 3.0)
    message = error_of(read_in_helper, [path], time.sleep, 100)
    assert message.startswith(f"{path}: cannot be read: its reader did not end in 3 seconds")
    assert HELPER.pid is None, "the process has ended"
    monkeypatch.setattr(reading_process, "READ_SECONDS", 50.0)
    if sys.platform == "linux":
        monkeypatch.setattr(reading_process, "available_memory", lambda: 10**9)
        message = error_of(read_in_helper, [path], np.ones, 200_000_000)
        assert message.endswith("it needs more memory than is free: choose a smaller file")
    message = error_of(read_in_helper, [path], os.abort)
    expected = f"{path}: cannot be read: its reader crashed: it is damaged, or needs"
    assert message.startswith(expected)
    assert read_in_helper([path], np.ones, 2).tolist() == [1, 1], "another process is started"


def test_the_working_directory_may_change(tmp_path, monkeypatch):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        (tmp_path / name / "a.vtu").write_text(name)
        assert read_in_helper([Path("a.vtu")], os.getcwd) == str(tmp_path / name)


def test_without_processes(tmp_path, monkeypatch):
    """Where no process can be started, this one reads."""
    monkeypatch.setattr(HELPER, "is_usable", False)
    (tmp_path / "a.vtu").touch()
    assert read_in_helper([tmp_path / "a.vtu"], os.getpid) == os.getpid()
