"""Read and write PNG files with numpy and zlib."""

import os
import struct
import zlib

import numpy as np

from ..core.color import to_display, to_linear
from ..core.errors import RosyError
from ..core.file_io import read_bytes, write_bytes
from ..core.memory import check_memory
from ..core.progress import report

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_BIT_DEPTH, _RGBA_COLOR_TYPE, _PERCEPTUAL_INTENT = 8, 6, 0

#: Compression level of zlib. Pictures of fields consist of noise, for which higher levels take five times as
#: long and make files only a tenth smaller.
ZLIB_LEVEL = 1

#: Number of rows that are converted to or from display values at once. It bounds memory.
BLOCK_ROWS = 64


def write_png(path: str | os.PathLike[str], rgba: np.ndarray) -> None:
    """Write a picture as an sRGB PNG file with 8 bits per channel.

    Parameters
    ----------
    path : path-like
    rgba : (H, W, 4) float ndarray
        Picture: linear, not premultiplied, rows from the bottom.

    Raises
    ------
    RosyError
        If the file cannot be written.
    """
    write_bytes(path, png_bytes(rgba))


def to_srgb_uint8(rgba: np.ndarray) -> np.ndarray:
    """Convert an (H, W, 4) linear picture to uint8: sRGB display values, and alpha without conversion."""
    display = np.concatenate([to_display(rgba[..., :3]), rgba[..., 3:]], axis=-1)
    return _to_uint8(display)


def _to_uint8(values: np.ndarray) -> np.ndarray:
    """Convert values from 0 to 1 to uint8."""
    return np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)


def png_bytes(rgba: np.ndarray, *, is_color: bool = True) -> bytes:
    """Return the contents of a PNG file with 8 bits per channel.

    `rgba`, (H, W, 4), is a picture: linear, not premultiplied, rows from the bottom. If `is_color` is false,
    the values are data, such as vectors, and are stored without conversion to sRGB.
    """
    height, width = rgba.shape[:2]
    compressor = zlib.compressobj(ZLIB_LEVEL)
    compressed = []
    for start in range(0, height, BLOCK_ROWS):
        report(start / height, "writing the picture")
        block = rgba[::-1][start : start + BLOCK_ROWS]
        block = to_srgb_uint8(block) if is_color else _to_uint8(block)
        # Each row starts with its filter type. It is 0 (no filter), as filters do not help with noise.
        rows = np.zeros((len(block), 1 + width * 4), dtype=np.uint8)
        rows[:, 1:] = block.reshape(len(block), -1)
        compressed.append(compressor.compress(rows.tobytes()))
    compressed.append(compressor.flush())
    header = struct.pack(">IIBBBBB", width, height, _BIT_DEPTH, _RGBA_COLOR_TYPE, 0, 0, 0)
    color_space = [(b"sRGB", bytes([_PERCEPTUAL_INTENT]))] if is_color else []
    chunks = [(b"IHDR", header), *color_space, (b"IDAT", b"".join(compressed)), (b"IEND", b"")]
    return _SIGNATURE + b"".join(_pack_chunk(kind, data) for kind, data in chunks)


def _pack_chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


#: Number of channels of a pixel by color type: gray, RGB, palette index, gray and alpha, RGBA.
_CHANNELS_BY_COLOR_TYPE = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
_PALETTE_COLOR_TYPE = 3

#: Largest possible ratio of the sizes before and after compression by zlib.
MAX_COMPRESSION = 1032

#: Memory in bytes of each pixel of a picture that has been read, and of each uncompressed byte of the file
#: while it is decoded.
PIXEL_BYTES, DECODING_BYTES = 16, 4


def read_png(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a PNG file with 8 or 16 bits per channel. Its values are assumed to be sRGB.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    (H, W, 4) float32 ndarray
        Picture: linear, not premultiplied, rows from the bottom.

    Raises
    ------
    RosyError
        If the file cannot be read, is not a valid PNG file, is interlaced, has fewer than 8 bits per
        channel, or needs more memory than is free.
    """
    chunks = _read_chunks(path, read_bytes(path))
    invalid_file = RosyError(f"{path}: is damaged, or not a valid .png file")
    try:
        header = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    except (KeyError, struct.error):
        raise invalid_file from None
    width, height, bits, color_type, _, _, interlaced = header
    if bits not in (8, 16) or color_type not in _CHANNELS_BY_COLOR_TYPE or interlaced:
        raise RosyError(
            f"{path}: only .png files with 8 or 16 bits per channel, not interlaced, are supported"
        )
    bytes_per_sample = bits // 8
    bytes_per_pixel = _CHANNELS_BY_COLOR_TYPE[color_type] * bytes_per_sample
    row_bytes = 1 + width * bytes_per_pixel
    _check_size(path, width, height, row_bytes, len(chunks.get(b"IDAT", b"")))
    try:
        # At most one byte more than the header says is decompressed.
        decompressor = zlib.decompressobj()
        data = decompressor.decompress(chunks[b"IDAT"], height * row_bytes + 1)
        if not decompressor.eof:
            raise invalid_file
        rows = np.frombuffer(data, dtype=np.uint8).reshape(height, row_bytes)
        values = _undo_filters(rows[:, 1:].reshape(height, width, bytes_per_pixel), rows[:, 0])
        palette = _palette(chunks) if color_type == _PALETTE_COLOR_TYPE else None
        return _to_linear_rgba(values[::-1], palette, bytes_per_sample)
    except (KeyError, ValueError, IndexError, zlib.error):
        raise invalid_file from None


def _check_size(
    path: str | os.PathLike[str], width: int, height: int, row_bytes: int, compressed: int
) -> None:
    """Check that the size of a picture in its header is possible, and that there is enough memory for it.

    `row_bytes` is the size of an uncompressed row, and `compressed` the size of all compressed data.

    Raises
    ------
    RosyError
        If the size is 0 or more than the compressed data can hold, or if there is not enough memory.
    """
    size = height * row_bytes
    if not width or not height:
        raise RosyError(f"{path}: is damaged: its size is {width} x {height} pixels")
    if size > MAX_COMPRESSION * compressed:
        raise RosyError(
            f"{path}: is damaged: {width} x {height} pixels are more than its data can hold"
        )
    check_memory(
        PIXEL_BYTES * width * height + DECODING_BYTES * size,
        f"{path}: a picture of {width} x {height} pixels",
        "choose a smaller picture",
    )


def _read_chunks(path: str | os.PathLike[str], data: bytes) -> dict[bytes, bytes]:
    """Return the data of the chunks of a PNG file by their type. Chunks of the same type are joined.

    `data` is the contents of the file.
    """
    if data[:8] != _SIGNATURE:
        raise RosyError(f"{path}: is not a .png file")
    chunks: dict[bytes, bytes] = {}
    offset = 8
    while offset + 8 <= len(data):
        size, name = struct.unpack(">I4s", data[offset : offset + 8])
        chunks[name] = chunks.get(name, b"") + data[offset + 8 : offset + 8 + size]
        offset += 12 + size
    return chunks


def _undo_filters(rows: np.ndarray, filter_types: np.ndarray) -> np.ndarray:
    """Reverse the filters that a PNG file applies to rows before compression.

    A byte depends on the bytes to the left, above, and above to the left. So all pixels of an
    antidiagonal (row + column = constant) are decoded at once, in the order of these sums.

    Parameters
    ----------
    rows : (H, W, bytes per pixel) uint8 ndarray
        Filtered rows.
    filter_types : (H,) uint8 ndarray
        Filter type of each row, 0 to 4.

    Returns
    -------
    (H, W, bytes per pixel) uint8 ndarray
        Rows without filters.

    Raises
    ------
    ValueError
        If a filter type is above 4.
    """
    height, width, bytes_per_pixel = rows.shape
    if not filter_types.any():
        return rows
    if filter_types.max() > 4:
        raise ValueError
    # A border of zeros to the left and above.
    out = np.zeros((height + 1, width + 1, bytes_per_pixel), dtype=np.int16)
    for diagonal in range(height + width - 1):
        row = np.arange(max(diagonal - width + 1, 0), min(diagonal + 1, height))
        column = diagonal - row
        left, above, corner = out[row + 1, column], out[row, column + 1], out[row, column]
        estimate = left + above - corner
        errors = [np.abs(estimate - neighbor) for neighbor in (left, above, corner)]
        is_left = (errors[0] <= errors[1]) & (errors[0] <= errors[2])
        paeth = np.where(is_left, left, np.where(errors[1] <= errors[2], above, corner))
        predictions = np.stack([np.zeros_like(left), left, above, (left + above) // 2, paeth])
        row_filters = filter_types[row].astype(np.intp)
        predicted = predictions[row_filters, np.arange(len(row))]
        out[row + 1, column + 1] = (rows[row, column] + predicted) & 255
    return out[1:, 1:].astype(np.uint8)


def _palette(chunks: dict[bytes, bytes]) -> np.ndarray:
    """Return (n, 4) uint8: the RGBA colors of the palette in the chunks of a PNG file."""
    colors = np.frombuffer(chunks[b"PLTE"], dtype=np.uint8).reshape(-1, 3)
    palette = np.full((len(colors), 4), 255, dtype=np.uint8)
    palette[:, :3] = colors
    alpha = np.frombuffer(chunks.get(b"tRNS", b""), dtype=np.uint8)
    palette[: len(alpha), 3] = alpha
    return palette


def _to_linear_rgba(
    samples: np.ndarray, palette: np.ndarray | None, bytes_per_sample: int
) -> np.ndarray:
    """Convert the bytes of pixels to linear RGBA, in blocks of rows.

    Parameters
    ----------
    samples : (H, W, bytes per pixel) uint8 ndarray
        Bytes of the pixels: gray, gray and alpha, RGB or RGBA display values, or indices into a palette.
    palette : (n, 4) uint8 ndarray or None
        RGBA colors of the palette; None if pixels have no palette indices.
    bytes_per_sample : {1, 2}
        Number of bytes per channel.

    Returns
    -------
    (H, W, 4) float32 ndarray
    """
    rgba = np.ones((*samples.shape[:2], 4), dtype=np.float32)
    for start in range(0, len(samples), BLOCK_ROWS):
        block = samples[start : start + BLOCK_ROWS]
        if palette is not None:
            block = palette[block[..., 0]]
        if bytes_per_sample == 2:
            block = np.ascontiguousarray(block).view(">u2")
        values = block.astype(np.float32) / np.float32(256**bytes_per_sample - 1)
        channels = values.shape[2]
        out = rgba[start : start + BLOCK_ROWS]
        out[..., :3] = to_linear(values[..., : 3 if channels > 2 else 1])
        if channels % 2 == 0:
            out[..., 3] = values[..., -1]
    return rgba
