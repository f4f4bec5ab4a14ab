"""Run the tests of this folder with the pytest that this Blender's Python has."""

import sys

import pytest

sys.exit(pytest.main(sys.argv[sys.argv.index("--") + 1 :]))
