"""Meshes for the command line."""

import pytest
from field_helpers import write_off
from shapes import icosphere


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    return write_off(tmp_path_factory.mktemp("meshes") / "sphere.off", icosphere(3))
