"""Draw the picture of docs/start/scripters.md, with the script on that page."""

import contextlib
import sys
import tempfile
from pathlib import Path

from PIL import Image

import rosy_addon

from .page import IMAGES, ROOT

PAGE = ROOT / "docs" / "start" / "scripters.md"


def write() -> None:
    """Run the script of the page, and keep its picture as docs/images/start-torus.png."""
    script = PAGE.read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    # The script imports the package by the name that it has when it is installed.
    sys.modules["rosyfields"] = rosy_addon
    with tempfile.TemporaryDirectory() as folder:
        with contextlib.chdir(folder):
            exec(compile(script, str(PAGE), "exec"), {})
        # The picture is gray, so two channels are enough.
        picture = Image.open(Path(folder) / "torus.png").convert("LA")
        picture.save(IMAGES / "start-torus.png", optimize=True)
