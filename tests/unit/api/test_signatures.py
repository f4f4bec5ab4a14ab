"""Public signatures change deliberately: programs of users depend on them."""

from __future__ import annotations

import difflib

from public_signatures import FILE, signatures

from rosy_addon import api


def test_public_signatures():
    held, now = FILE.read_text().splitlines(), signatures(api).splitlines()
    changes = "\n".join(difflib.unified_diff(held, now, "signatures.txt", "the code", lineterm=""))
    renew = "If the change is meant: python tests/unit/public_signatures.py, and the CHANGELOG."
    assert not changes, f"{changes}\n{renew}"
