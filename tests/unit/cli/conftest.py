"""Meshes for the command line."""

import pytest
from field_helpers import write_off
from shapes import icosphere, torus


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    return write_off(tmp_path_factory.mktemp("meshes") / "sphere.off", icosphere(3))


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    return write_off(tmp_path_factory.mktemp("meshes") / "torus.off", torus(24, 12))
