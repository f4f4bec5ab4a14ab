"""Check that a Python interpreter can be used for an environment. If not, print the reason in one line."""

import re
import sys
from pathlib import Path

#: Oldest version of Python that RoSy supports.
OLDEST_VERSION = (3, 11)

#: Versions of Python by the first version of Blender's module (bpy) that needs them, newest first. PyPI has
#: each version of bpy for only one version of Python.
BPY_VERSIONS = {(5, 1): (3, 13), (4, 2): (3, 11)}


def main() -> str:
    """Check this interpreter against a file of requirements. Return the reason; empty if it can be used."""
    version = sys.version_info[:2]
    required = _version_for_bpy(Path(sys.argv[1]).read_text())
    if required is not None and version != required:
        return (
            f"PyPI has this bpy for Python {_text(required)} alone, not for {_text(version)}: "
            f"name one with make {'PYTHON' if required == OLDEST_VERSION else 'PYTHON313'}="
            f"/path/to/python{_text(required)}"
        )
    if version < OLDEST_VERSION:
        return (
            f"Python {_text(version)} is too old, {_text(OLDEST_VERSION)} is required: "
            f"make PYTHON=/path/to/python{_text(OLDEST_VERSION)}"
        )
    return ""


def _version_for_bpy(requirements: str) -> tuple[int, int] | None:
    """Return the version of Python that the required version of bpy needs; None if bpy is not required."""
    match = re.search(r"^bpy==(\d+)\.(\d+)", requirements, re.MULTILINE)
    if match is None:
        return None
    bpy_version = int(match[1]), int(match[2])
    return next(python for bpy, python in BPY_VERSIONS.items() if bpy_version >= bpy)


def _text(version: tuple[int, ...]) -> str:
    return ".".join(map(str, version))


if __name__ == "__main__":
    sys.exit(main() or 0)
