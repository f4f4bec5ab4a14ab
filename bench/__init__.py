"""Benchmarks. Each module is a script: ``python -m bench.NAME``. `bench/run.py` runs all of them."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))  # for the package `harness`
