"""Check OpenEXR files that Blender has written. Blender does not notice every error of the disk."""

import os
import struct

#: Number of bytes at the beginning of a file that contain the header (less than 1 kB in files of Blender) and
#: the table of chunks (8 bytes for each line at most).
HEAD_BYTES = 1 << 20


def is_whole_exr(path: str | os.PathLike[str]) -> bool:
    """Return whether an OpenEXR file of one part, in scan lines, ends where its last chunk ends.

    The header consists of attributes, each with a name, a type, the size of its value and the value. An empty
    name ends it. Then comes a table with the offset of each chunk, as 64-bit integers. A chunk consists of the
    number of its first line, the size of its data, both as 32-bit integers, and the data. Chunks may be in any
    order ("OpenEXR File Layout", openexr.com).

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with open(path, "rb") as file:
        head = file.read(HEAD_BYTES)
        length = os.fstat(file.fileno()).st_size
        try:
            position = 8  # after the signature and the version
            while head[position]:
                for _ in ("name", "type"):
                    position = head.index(b"\0", position) + 1
                position += 4 + struct.unpack_from("<I", head, position)[0]
            position += 1
            offsets: list[int] = []
            while position < min(offsets, default=length):  # where the first chunk begins
                offsets += struct.unpack_from("<Q", head, position)
                position += 8
            file.seek(max(offsets) + 4)
            return file.tell() + 4 + struct.unpack("<I", file.read(4))[0] == length
        except (struct.error, ValueError, IndexError, OverflowError):  # the file ends before
            return False
