"""Pictures are the same with another version of numpy, except for the last bit of a few pixels."""

from __future__ import annotations

import os
import subprocess

import numpy as np
import pytest
import version_pictures
from conftest import ROOT


@pytest.fixture(scope="module")
def pictures():
    """The pictures that are compared, by name."""
    return version_pictures.draw()


@pytest.mark.slow
def test_another_numpy_version_draws_the_same(tmp_path, pictures):
    other = os.environ.get("ROSY_OTHER_PYTHON")
    if not other:
        pytest.skip("ROSY_OTHER_PYTHON names no other interpreter")
    script, file = ROOT / "tests" / "unit" / "version_pictures.py", tmp_path / "pictures.npz"
    subprocess.run([other, script, file], check=True)
    code = "import numpy; print(numpy.__version__, end='')"
    version = subprocess.run([other, "-c", code], check=True, capture_output=True, text=True).stdout
    assert version != np.__version__
    other_pictures = np.load(file)
    for name, picture in pictures.items():
        difference = np.abs(picture.astype(int) - other_pictures[name]).max(axis=2)
        assert difference.max() <= 1, name
        assert (difference > 0).mean() <= 1e-3, name


@pytest.mark.slow
def test_two_runs_draw_the_same(pictures):
    again = version_pictures.draw()
    assert all(np.array_equal(again[name], picture) for name, picture in pictures.items())
