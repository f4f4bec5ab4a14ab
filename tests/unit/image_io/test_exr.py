"""OpenEXR files that end too early are found."""

import struct

import pytest

from rosy_addon.image_io.exr import is_whole_exr


def exr_file(sizes, *, reverse):
    """A file with a chunk of each of these sizes in bytes, the last one first if `reverse`."""
    head = struct.pack("<II", 20000630, 2)
    for name, kind, value in ((b"channels", b"chlist", b"A\0R\0\0"), (b"x", b"float", b"\0" * 4)):
        head += name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value
    head += b"\0"
    position, chunks, offsets = len(head) + 8 * len(sizes), b"", {}
    order = range(len(sizes))[:: -1 if reverse else 1]
    for line in order:
        offsets[line] = position + len(chunks)
        chunks += struct.pack("<II", line, sizes[line]) + b"\x7f" * sizes[line]
    return head + struct.pack(f"<{len(sizes)}Q", *map(offsets.get, range(len(sizes)))) + chunks


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("sizes", [[20], [5, 0, 300, 7]])
def test_a_file_is_whole_up_to_its_last_byte(sizes, reverse, tmp_path):
    data, path = exr_file(sizes, reverse=reverse), tmp_path / "a.exr"
    path.write_bytes(data)
    assert is_whole_exr(path)
    for length in range(len(data)):
        path.write_bytes(data[:length])
        assert not is_whole_exr(path)
    path.write_bytes(data + b"\0")
    assert not is_whole_exr(path)
