"""The pages for readers who need no Blender: their programs and commands run as they are written."""

import subprocess

import pytest
import rosyfields
from conftest import ENVIRONMENT, write_torus

from examples import BLOCK, PAGES


@pytest.mark.parametrize(
    ("page", "written"),
    [("researchers", ["bunny.png", "bunny.rosy", "curvature.rosy"]), ("scripters", ["torus.png"])],
)
def test_a_page_runs_as_it_is_written(page, written, tmp_path, monkeypatch):
    """Without the commands that install the package, and with a torus for the bunny."""
    monkeypatch.chdir(tmp_path)
    write_torus(tmp_path / "bunny.obj")
    rosyfields.smoothest(rosyfields.Surface("bunny.obj")).save("bunny.rawfield")
    for block in BLOCK.finditer((PAGES / f"{page}.md").read_text(encoding="utf-8")):
        if block["python"]:
            exec(compile(block["python"], page, "exec"), {})
            continue
        for command in block["shell"].splitlines():
            if command.strip().startswith("rosyfields"):
                subprocess.run(command, shell=True, env=ENVIRONMENT, check=True)
    for name in written:
        data = (tmp_path / name).read_bytes()
        assert data.startswith(b"\x89PNG") if name.endswith(".png") else data
