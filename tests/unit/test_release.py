"""The version of a release is the same everywhere."""

import re
import tomllib

import pytest
from conftest import ROOT

from tools.check_tag import fault_of


def test_citation_has_the_version_of_the_manifest():
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"(?m)^version: (\S+)$", citation) == [manifest["version"]]


@pytest.mark.parametrize(
    ("tag", "heading", "fault"),
    [
        ("v1.2.0", "1.2.0, 2026-11-24", ""),
        ("v1.2.1", "1.2.0, 2026-11-24", "the tag is v1.2.1, but .* the version 1.2.0"),
        ("1.2.0", "1.2.0, 2026-11-24", "the tag is 1.2.0, but"),
        ("v1.2.0", "1.2.0, unreleased", "the first section of CHANGELOG.md is not '## 1.2.0, "),
        ("v1.2.0", "1.1.0, 2026-11-24", "the first section of CHANGELOG.md is not '## 1.2.0, "),
    ],
)
def test_tag(tag, heading, fault):
    found = fault_of(tag, "1.2.0", f"# Changes\n\n## {heading}\n\n- One\n\n## 1.0.0, 2026-01-01\n")
    assert re.match(fault, found) if fault else found == ""
