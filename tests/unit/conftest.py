"""Settings, fixtures and parameter helpers that the unit tests share."""

import tracemalloc
from pathlib import Path

import pytest
from harness.errors import error_of as error_of
from hypothesis import settings

from rosy_addon.worker.helper import Helper

#: Machines may be busy, so hypothesis has no deadline for an example.
settings.register_profile("patient", deadline=None, max_examples=50)
settings.load_profile("patient")

ROOT = Path(__file__).resolve().parents[2]


def mainly(common, cases):
    """Parameters of all cases; `make test` runs the common ones, `make test LONG=1` all."""
    long = pytest.mark.long
    return [case if case in set(common) else pytest.param(case, marks=long) for case in cases]


def traced_peak(work) -> int:
    """Return the largest number of bytes that a function allocates at once."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def pytest_collection_modifyitems(items):
    """Mark the tests that draw on a graphics card as slow."""
    for item in items:
        if "card" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of meshes and fields of other programs, beside the repository."""
    folder = ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("no ../shared/data")
    return folder


@pytest.fixture
def helper():
    """A helper process that has not been started."""
    helper = Helper()
    yield helper
    helper.close()
