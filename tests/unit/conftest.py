"""What several tests need."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from rosy_addon.errors import RosyError

#: Machines are busy at times: no example is wrong for being slow.
settings.register_profile("patient", deadline=None)
settings.load_profile("patient")

ROOT = Path(__file__).resolve().parents[2]


def long(*cases):
    """Cases of a test that `make test-long` adds to the usual ones. A tuple has several arguments."""
    return [
        pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.long)
        for case in cases
    ]


def mainly(common, cases):
    """All cases, of which `make test` runs those kept and `make test-long` the others."""
    common, cases = set(common), list(cases)
    return [
        *(case for case in cases if case in common),
        *long(*(c for c in cases if c not in common)),
    ]


def pytest_collection_modifyitems(items):
    """Mark the tests that draw on a graphics card as slow."""
    for item in items:
        if "card" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Meshes and fields that other programs made, where they lie beside the repository."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no ../shared/data")
    return folder


@pytest.fixture
def error_of():
    """The text of the RosyError that a call raises; it must be one line."""

    def catch(function, *arguments, **keywords) -> str:
        with pytest.raises(RosyError) as caught:
            function(*arguments, **keywords)
        message = str(caught.value)
        assert "\n" not in message
        return message

    return catch
