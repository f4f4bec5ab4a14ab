"""Build the extension into a folder, with the builder that comes with bpy, and validate it."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    """Write FOLDER/rosy-VERSION.zip and print its path."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    target = folder / f"{manifest['id']}-{manifest['version']}.zip"
    builder = _builder()
    for words in (
        ["build", "--source-dir", str(ROOT), "--output-filepath", str(target)],
        ["validate", str(target)],
    ):
        done = subprocess.run([sys.executable, builder, *words], check=False)
        if done.returncode:
            return done.returncode
    print(target)
    return 0


def _builder() -> str:
    """Import the script behind `blender --command extension`, without starting Blender."""
    spec = importlib.util.find_spec("bpy")
    places = list(spec.submodule_search_locations or []) if spec else []
    for place in places:
        for script in sorted(Path(place).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")):
            return str(script)
    sys.exit("this Python has no bpy with Blender's extension builder")


if __name__ == "__main__":
    sys.exit(main())
