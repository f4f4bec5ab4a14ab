"""The deliberate faults of faults.toml can still be applied; `tools/run_faults.py` runs them."""

import tomllib

from conftest import ROOT


def test_every_fault_applies_to_the_code():
    faults = tomllib.loads((ROOT / "tests/faults.toml").read_text(encoding="utf-8"))["fault"]
    assert len(faults) > 50
    for fault in faults:
        text = (ROOT / fault["file"]).read_text(encoding="utf-8")
        assert text.count(fault["find"]) == 1, fault["name"]
        for test in fault["tests"]:
            path, name = test.split("::")
            source = (ROOT / path).read_text(encoding="utf-8")
            assert f"def {name.partition('[')[0]}(" in source, test
