"""Run the steps of the module that ROSY_WINDOW names, in the window of this Blender."""

import importlib
import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

importlib.import_module("window_steps").run_module(os.environ["ROSY_WINDOW"])
