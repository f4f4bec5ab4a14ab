"""The notebooks of the documentation run, and show what they say they show.

``dist/notebooks`` keeps them with their outputs.
"""

import base64
import io
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))

PNG, SVG = "image/png", "image/svg+xml"

#: The pictures that each notebook shows, in order.
PICTURES = {
    "compare-two-methods": [PNG, PNG],
    "draw-a-field": [PNG, PNG, PNG, SVG],
    "hatch-a-scan": [PNG, PNG, PNG, PNG, PNG, SVG],
}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_its_pictures(path, tmp_path, monkeypatch):
    notebook = nbformat.read(path, as_version=4)
    for cell in code_cells(notebook):
        is_clear = not cell.outputs and cell.execution_count is None
        assert is_clear, "clear the outputs before a commit"
    run(notebook, tmp_path, monkeypatch)
    executed = ROOT / "dist/notebooks" / path.name
    executed.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, executed)

    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    assert not [output.text for output in outputs if output.get("name") == "stderr"]
    pictures = [
        (kind, output.data[kind])
        for output in outputs
        for kind in (PNG, SVG)
        if kind in output.get("data", {})
    ]
    assert [kind for kind, _ in pictures] == PICTURES[path.stem]
    for kind, data in pictures:
        (check_png if kind == PNG else check_svg)(data)
    check_text = TEXT_CHECKS.get(path.stem)
    if check_text:
        check_text("".join(text_of(output) for output in outputs))


def test_the_ten_lines_write_a_picture(tmp_path):
    script = ROOT / "examples/ten_lines.py"
    subprocess.run([sys.executable, script], cwd=tmp_path, check=True, timeout=300)
    check_png(base64.b64encode((tmp_path / "field.png").read_bytes()))
    code = script.read_text().split('"""')[2]
    assert len([line for line in code.splitlines() if line]) == 10


def run(notebook, folder, monkeypatch):
    """Execute a notebook in a folder, with this Python and without the settings of the user."""
    monkeypatch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
    for name in ("JUPYTER_CONFIG_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(name, str(folder / name))
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}}).execute()


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def text_of(output) -> str:
    return output.get("text") or output.get("data", {}).get("text/plain", "") + "\n"


def check_png(data):
    """A picture of a useful size, with a surface on it that is neither black nor white."""
    gray = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGBA").convert("LA"))
    assert gray.shape[1] >= 700 and gray.shape[0] >= 400
    luminance, opacity = gray[..., 0] / 255.0, gray[..., 1] / 255.0
    shown = opacity > 0.5
    assert shown.mean() > 0.3
    assert luminance[shown].std() > 0.1


def check_svg(data):
    """Many strokes, all of which are on the page."""
    svg = ElementTree.fromstring(data)
    left, top, width, height = map(float, svg.get("viewBox").split())
    paths = [element.get("d") for element in svg.iter() if element.tag.endswith("}path")]
    assert len(paths) > 100
    points = np.array(re.findall(r"(-?[\d.]+),(-?[\d.]+)", " ".join(paths)), dtype=float)
    assert (points >= (left, top)).all() and (points <= (left + width, top + height)).all()
    assert (np.ptp(points, axis=0) > (0.4 * width, 0.4 * height)).all()


def check_comparison(text):
    """The two smoothest fields nearly agree, and have as many singularities as a sphere needs.

    That of geometry-central has the least mean square, that of RoSy the least energy of unit vectors.
    """
    rows = {
        match[1]: [float(number) for number in re.findall(r"[\d.]+", match[2])]
        for match in re.finditer(r"^(RoSy|libigl|geometry-central)  +(.*)$", text, re.MULTILINE)
    }
    ours, principal, theirs = rows["RoSy"], rows["libigl"], rows["geometry-central"]
    # Degree, energy, singularities, positive and negative ones, matched ones, mean angle.
    assert ours[2] == theirs[2] == 8 and theirs[5] >= 6
    assert theirs[6] < 5 and 10 < principal[6] < 35
    assert ours[1] <= theirs[1] < principal[1]
    assert "'0.000000 degrees'" in text


def check_drawing(text):
    assert "0 singularities, sum of the indices 0" in text
    assert "['field.npz', 'field.png', 'strokes.svg']" in text
    assert "'0.000000 degrees'" in text


TEXT_CHECKS = {"compare-two-methods": check_comparison, "draw-a-field": check_drawing}
