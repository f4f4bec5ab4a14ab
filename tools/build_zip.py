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
    for arguments in (
        ["build", "--source-dir", str(ROOT), "--output-filepath", str(target)],
        ["validate", str(target)],
    ):
        completed = subprocess.run([sys.executable, builder, *arguments], check=False)
        if completed.returncode:
            return completed.returncode
    print(target)
    return 0


def _builder() -> str:
    """Return the path of the script behind `blender --command extension`, in the module bpy."""
    spec = importlib.util.find_spec("bpy")
    folders = list(spec.submodule_search_locations or []) if spec else []
    for folder in folders:
        for script in sorted(Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")):
            return str(script)
    sys.exit("this Python has no bpy with Blender's extension builder")


if __name__ == "__main__":
    sys.exit(main())
