"""Fields are read and written block by block."""

from __future__ import annotations

import numpy as np
import pytest
from listeners import CancelledError, cancel_at
from shapes import torus

from rosy_addon.core.progress import listening
from rosy_addon.field import blocks, surface
from rosy_addon.field.field_io import load_field, write_field
from rosy_addon.field.formats import fieldgen, obj, plain, text_rows
from rosy_addon.field.generate import axis_field

#: Rows of the blocks in these tests, and faces of the mesh.
BLOCK, SIDE = 64, 32


@pytest.fixture
def mesh():
    return torus(SIDE, SIDE)


@pytest.fixture
def small_blocks(monkeypatch):
    for module in (blocks, text_rows, plain, obj, fieldgen):
        monkeypatch.setattr(module, "ROWS_PER_BLOCK", BLOCK)
    monkeypatch.setattr(text_rows, "WORDS_PER_BLOCK", BLOCK)
    monkeypatch.setattr(surface, "BLOCK_ELEMENTS", BLOCK)


@pytest.mark.parametrize("suffix", [".rosy", ".rawfield", ".txt", ".obj"])
def test_small_blocks_change_nothing(mesh, tmp_path, suffix, request):
    """Neither the file nor the field, to the last byte."""
    field = axis_field(mesh, 4, (1, 0.3, 0.2))
    one, many = tmp_path / f"one{suffix}", tmp_path / f"many{suffix}"
    write_field(one, field, mesh)
    expected = load_field(one, mesh).field
    request.getfixturevalue("small_blocks")
    write_field(many, field, mesh)
    assert many.read_bytes() == one.read_bytes()
    again = load_field(many, mesh).field
    assert np.array_equal(again.vectors, expected.vectors)


def test_a_cancelled_export_leaves_the_old_file(mesh, tmp_path, small_blocks):
    path = tmp_path / "a.rosy"
    path.write_bytes(b"old")
    field = axis_field(mesh, 4, (1, 0.3, 0.2))
    with listening(cancel_at(8)), pytest.raises(CancelledError):
        write_field(path, field, mesh)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    write_field(path, field, mesh)
    assert path.read_bytes().startswith(b"1024\n4\n")
