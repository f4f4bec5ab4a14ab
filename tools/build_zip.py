"""Build the zip of the extension into a folder, with the builder that comes with bpy, and validate it.

The builder stores the files in the order of the file system, with their times and permissions. All three are
replaced, so that the same files give the same bytes.
"""

import importlib.util
import os
import subprocess
import sys
import time
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

#: Modification time of all files in the zip, in seconds since 1970. The files in the wheel have the same
#: time. The environment variable SOURCE_DATE_EPOCH sets another one for both.
DEFAULT_TIME = 1580601600

#: Permissions of all files in the zip: a regular file that its owner can write.
PERMISSIONS = 0o100644


def main() -> None:
    """Write FOLDER/rosy-VERSION.zip and print its path."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    target = folder / f"{manifest['id']}-{manifest['version']}.zip"
    _run("build", "--source-dir", str(ROOT), "--output-filepath", str(target))
    make_reproducible(target)
    _run("validate", str(target))
    print(target)


def make_reproducible(path: Path) -> None:
    """Rewrite a zip with its files in the order of their names, with equal times, without folders."""
    with zipfile.ZipFile(path) as zipped:
        files = {name: zipped.read(name) for name in zipped.namelist() if not name.endswith("/")}
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", DEFAULT_TIME))
    date = time.gmtime(seconds)[:6]
    with zipfile.ZipFile(path, "w") as zipped:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, date)
            entry.create_system = 3  # Unix: its permissions are in the next line
            entry.external_attr = PERMISSIONS << 16
            zipped.writestr(entry, files[name], zipfile.ZIP_DEFLATED, compresslevel=9)


def _run(*arguments: str) -> None:
    """Run a command of Blender's builder. If it fails, end with its exit status."""
    command = [sys.executable, _builder(), *arguments]
    if status := subprocess.run(command, check=False).returncode:
        sys.exit(status)


def _builder() -> str:
    """Return the path of the script in the module bpy that runs `blender --command extension`."""
    spec = importlib.util.find_spec("bpy")
    folders = list(spec.submodule_search_locations or []) if spec else []
    for folder in folders:
        for script in sorted(Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")):
            return str(script)
    sys.exit("this Python has no bpy with Blender's extension builder")


if __name__ == "__main__":
    main()
