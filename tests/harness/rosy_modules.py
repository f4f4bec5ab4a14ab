"""Modules of RoSy: of the installed extension in a full Blender, of the repository elsewhere."""

import importlib
import os
from typing import Any

IS_INSTALLED = "ROSY_BLENDER_LANE" in os.environ
PACKAGE = "bl_ext.user_default.rosy.rosy_addon" if IS_INSTALLED else "rosy_addon"


def rosy(name: str) -> Any:
    """Import a module by its name in the package."""
    return importlib.import_module(f"{PACKAGE}.{name}")
