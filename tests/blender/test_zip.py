"""The zip holds what Blender needs and nothing else."""

import os
import zipfile

TOP_LEVEL = {
    "LICENSE",
    "__init__.py",
    "blender_manifest.toml",
    "operators",
    "presets",
    "rosy_addon",
}


def test_contents():
    path = os.environ["ROSY_ZIP"]
    with zipfile.ZipFile(path) as zipped:
        names = zipped.namelist()
    assert {name.split("/")[0] for name in names} <= TOP_LEVEL
    assert {name.rsplit(".", 1)[-1] for name in names if "." in name} <= {
        "py",
        "toml",
        "json",
        "glsl",
        "png",
    }
    pictures = {name for name in names if name.endswith(".png")}
    looks = {name for name in names if name.startswith("presets/") and name.endswith(".json")}
    assert pictures == {name.replace(".json", ".png") for name in looks}
    assert os.path.getsize(path) < 1_000_000
