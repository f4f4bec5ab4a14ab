"""Check that a Python can be used for an environment, and print why not in one line."""

from __future__ import annotations

import sys
from pathlib import Path

#: Oldest version, and the only one for which PyPI has Blender's module.
REQUIRED_VERSION = (3, 11)


def main() -> int:
    """Check this interpreter against a file of requirements."""
    needs_bpy = any(line.startswith("bpy") for line in Path(sys.argv[1]).read_text().splitlines())
    version = sys.version_info[:2]
    version_text = ".".join(map(str, version))
    if needs_bpy and version != REQUIRED_VERSION:
        print(
            f"PyPI has no bpy for Python {version_text}, only for 3.11: make PYTHON=/path/to/python3.11"
        )
        return 1
    if version < REQUIRED_VERSION:
        print(
            f"Python {version_text} is too old, 3.11 is required: make PYTHON=/path/to/python3.11"
        )
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
