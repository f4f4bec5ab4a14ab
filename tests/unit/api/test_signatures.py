"""Public signatures change deliberately: programs of users depend on them."""

from __future__ import annotations

import difflib
import inspect

import pytest
from public_signatures import FILE, signatures

from rosy_addon import api
from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import settings_of


def test_public_signatures():
    held, now = FILE.read_text().splitlines(), signatures(api).splitlines()
    changes = "\n".join(difflib.unified_diff(held, now, "signatures.txt", "the code", lineterm=""))
    renew = "If the change is meant: python tests/unit/public_signatures.py, and the CHANGELOG."
    assert not changes, f"{changes}\n{renew}"


@pytest.mark.parametrize("name", ["render", "texture", "turntable"])
def test_parameters_do_not_hide_settings(name):
    """Functions that draw pictures take the settings of the look as keywords, too."""
    assert not settings_of(Look).keys() & inspect.signature(getattr(api, name)).parameters.keys()
