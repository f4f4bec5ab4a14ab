"""A few random hostile cases of each category, always the same ones; `make fuzz` runs others."""

import sys

import numpy as np
import pytest
from command_helpers import python

from tests.fuzz.options import random_options


@pytest.mark.parametrize(
    "command", ["compare", "field", "info", "render", "strokes", "texture", "turntable"]
)
def test_every_option_has_random_values(command):
    assert random_options(np.random.default_rng(0), command, rate=1.0, wild=0.0)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="cases run in forks, with limits of Linux")
def test_no_case_shows_a_fault(tmp_path):
    words = ["--cases", "16", "--seed", "1", "--jobs", "1", "--keep", str(tmp_path)]
    done = python("-m", "tests.fuzz", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "16 cases" in done.stdout
