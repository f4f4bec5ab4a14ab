"""Check that a release is tagged with its version and has a date. If not, print the reason in one line.

tools/check_tag.py vVERSION
"""

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def main() -> str:
    """Return what is wrong with the tag in the command line; empty if it can be released."""
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    return fault_of(sys.argv[1], manifest["version"], changes)


def fault_of(tag: str, version: str, changes: str) -> str:
    """Return what is wrong with a tag; empty if it is right.

    Parameters
    ----------
    tag : str
        The tag, which has to be ``v`` and the version.
    version : str
        The version in blender_manifest.toml.
    changes : str
        The text of CHANGELOG.md. Its first section has to be about this version.
    """
    if tag != f"v{version}":
        return f"the tag is {tag}, but blender_manifest.toml has the version {version}"
    sections = re.findall(r"(?m)^## (.*)$", changes)
    if not sections or not re.fullmatch(rf"{re.escape(version)}, \d{{4}}-\d\d-\d\d", sections[0]):
        return f"the first section of CHANGELOG.md is not '## {version}, YEAR-MONTH-DAY'"
    return ""


if __name__ == "__main__":
    sys.exit(main() or 0)
