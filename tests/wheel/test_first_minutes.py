"""The first ten minutes of readers who need no Blender: their pages run as they are written."""

from __future__ import annotations

from pathlib import Path

import pytest
import rosyfields
from conftest import ENVIRONMENT, TREE, write_sphere
from first_minutes import MESH_SUFFIXES, Block, blocks_of, files_of, run_page

PAGE = """# Start

In a clone:

    python -m pip install .
    rosyfields render cow.off \\
        cow.rosy -o cow.png

1. Item

    Its second paragraph.

```python
a = 1
rf.render(surface).save("torus.png")
```

```text
not.obj
```

~~~bash
rosyfields info cow.off torus.png
~~~
"""


def test_blocks():
    blocks = blocks_of(PAGE)
    assert [(block.language, block.line) for block in blocks] == [
        ("sh", 4), ("python", 13), ("text", 18), ("sh", 22)
    ]  # fmt: skip
    assert blocks[1].text.splitlines()[0] == PAGE.splitlines()[13] == "a = 1"
    assert files_of(blocks) == (["cow.off", "cow.rosy"], ["cow.png", "torus.png"])


def test_failures_name_the_line(tmp_path):
    with pytest.raises(ZeroDivisionError) as caught:
        run_page(Path("page.md"), [Block("python", "a = 1\na / 0", 7)], tmp_path, ENVIRONMENT)
    assert caught.traceback[-1].lineno == 8
    with pytest.raises(AssertionError, match=r"page.md, from line 3: rosyfields render no.obj"):
        block = Block("sh", "rosyfields render no.obj -o no.png", 3)
        run_page(Path("page.md"), [block], tmp_path, ENVIRONMENT)


@pytest.mark.parametrize("reader", ["researchers", "scripters"])
def test_first_minutes(reader, tmp_path, monkeypatch):
    pages = sorted((TREE / "docs").rglob(f"*{reader}.md"))
    if not pages:
        pytest.skip(f"no page for {reader}")
    (page,) = pages
    blocks = blocks_of(page.read_text(encoding="utf-8"))
    inputs, outputs = files_of(blocks)
    assert outputs, f"{page} writes no file"
    # Meshes first: the fields are on the first of them.
    inputs.sort(key=lambda name: not name.endswith(MESH_SUFFIXES))
    for name in inputs:
        path = tmp_path / name
        if path.suffix in (".obj", ".off"):
            write_sphere(path)
        else:
            rosyfields.smoothest(rosyfields.Surface(tmp_path / inputs[0])).save(path)
    monkeypatch.chdir(tmp_path)
    assert run_page(page, blocks, tmp_path, ENVIRONMENT)
    for name in outputs:
        data = (tmp_path / name).read_bytes()
        assert data.startswith(b"\x89PNG") if name.endswith(".png") else data, name
