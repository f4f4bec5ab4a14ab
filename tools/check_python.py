"""Check that a Python can be used for an environment, and print why not in one line."""

from __future__ import annotations

import sys
from pathlib import Path

#: PyPI has one build of each version of Blender's module, for the Python of that Blender.
BLENDERS_PYTHON = (3, 11)


def main() -> int:
    """Check this interpreter against a file of requirements."""
    wants_bpy = any(line.startswith("bpy") for line in Path(sys.argv[1]).read_text().splitlines())
    found = sys.version_info[:2]
    shown = ".".join(map(str, found))
    if wants_bpy and found != BLENDERS_PYTHON:
        print(f"PyPI has no bpy for Python {shown}, only for 3.11: make PYTHON=/path/to/python3.11")
        return 1
    if found < BLENDERS_PYTHON:
        print(f"Python {shown} is too old, 3.11 is required: make PYTHON=/path/to/python3.11")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
