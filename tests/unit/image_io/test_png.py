"""PNG files: writing, reading, and the errors of damaged files."""

import struct
import zlib

import numpy as np
import pytest
from conftest import traced_peak
from PIL import Image

from rosy_addon.core import memory
from rosy_addon.core.color import luminance, to_display, to_linear
from rosy_addon.image_io.png import read_png, write_png


def test_files_hold_srgb_values_from_the_top(tmp_path):
    rgba = np.random.default_rng(0).random((5, 7, 4), dtype=np.float32) * 1.2 - 0.1
    write_png(tmp_path / "a.png", rgba)
    with Image.open(tmp_path / "a.png") as image:
        image.verify()
    with Image.open(tmp_path / "a.png") as image:
        assert image.format == "PNG" and image.mode == "RGBA" and image.info["srgb"] == 0
        stored = np.asarray(image)[::-1] / 255
    assert np.abs(stored[..., :3] - to_display(rgba[..., :3])).max() <= 0.5 / 255 + 1e-6
    assert np.abs(stored[..., 3] - np.clip(rgba[..., 3], 0, 1)).max() <= 0.5 / 255 + 1e-6


# --- reading --------------------------------------------------------------------------------------


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def filtered(rows: np.ndarray, bytes_per_pixel: int, filters: list[int]) -> bytes:
    """Return filtered rows, byte by byte as the specification defines the filters."""
    above, out = np.zeros(rows.shape[1], dtype=int), b""
    for kind, row in zip(filters, rows.astype(int), strict=True):
        line = []
        for index, value in enumerate(row):
            a = row[index - bytes_per_pixel] if index >= bytes_per_pixel else 0
            b, c = above[index], above[index - bytes_per_pixel] if index >= bytes_per_pixel else 0
            nearest = min((a, b, c), key=lambda neighbor: abs(a + b - c - neighbor))
            line.append((value - (0, a, b, (a + b) // 2, nearest)[kind]) % 256)
        out += bytes([kind, *line])
        above = row
    return out


def write_filtered(path, values: np.ndarray, kind: int, extra_chunks=b"", interlaced=0):
    """Write a .png file of (H, W, K) uint8 or uint16 values, rows from the top."""
    height, width, channels = values.shape
    depth = values.dtype.itemsize
    rows = values.astype(values.dtype.newbyteorder(">")).reshape(height, -1).view(np.uint8)
    filters = [row % 5 for row in range(height)]
    data = zlib.compress(filtered(rows, channels * depth, filters))
    header = struct.pack(">IIBBBBB", width, height, 8 * depth, kind, 0, 0, interlaced)
    half = len(data) // 2
    parts = [chunk(b"IHDR", header), extra_chunks]
    parts += [chunk(b"IDAT", data[:half]), chunk(b"IDAT", data[half:]), chunk(b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    return path


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(("kind", "channels"), [(0, 1), (2, 3), (4, 2), (6, 4)])
@pytest.mark.parametrize("shape", [(1, 1), (11, 7), (6, 17)])
def test_files_of_all_kinds_are_read(tmp_path, kind, channels, dtype, shape):
    """With every filter, on values whose sums overflow."""
    generator = np.random.default_rng(kind)
    top = np.iinfo(dtype).max
    values = generator.integers(0, top, (*shape, channels), dtype, endpoint=True)
    rgba = read_png(write_filtered(tmp_path / "a.png", values, kind))
    expected = values[::-1] / top
    colors = expected[..., :3] if channels > 2 else np.repeat(expected[..., :1], 3, axis=2)
    np.testing.assert_allclose(rgba[..., :3], to_linear(colors), atol=1e-6)
    alpha = expected[..., -1] if channels % 2 == 0 else 1
    np.testing.assert_allclose(rgba[..., 3], np.broadcast_to(alpha, shape), atol=1e-6)


def test_files_with_a_palette_are_read(tmp_path):
    colors = np.array([[255, 0, 0], [0, 128, 255], [9, 9, 9]], dtype=np.uint8)
    extra_chunks = chunk(b"PLTE", colors.tobytes()) + chunk(b"tRNS", bytes([255, 64]))
    values = np.array([[0, 1], [2, 1]], dtype=np.uint8)[..., None]
    rgba = read_png(write_filtered(tmp_path / "a.png", values, 3, extra_chunks=extra_chunks))
    np.testing.assert_allclose(rgba[..., :3], to_linear(colors[[[2, 1], [0, 1]]] / 255), atol=1e-6)
    np.testing.assert_allclose(rgba[..., 3] * 255, [[255, 64], [255, 64]], atol=1e-4)


def test_errors_of_damaged_files(tmp_path, error_of):
    path = tmp_path / "a.png"
    values = np.zeros((4, 4, 3), dtype=np.uint8)
    assert "no such file" in error_of(read_png, path)
    path.write_bytes(b"GIF89a" + bytes(20))
    assert "is not a .png file" in error_of(read_png, path)
    write_filtered(path, values, 2, interlaced=1)
    assert "interlaced" in error_of(read_png, path)
    whole = write_filtered(path, values, 2).read_bytes()
    for damaged in (whole[:40], whole[:-30], whole.replace(b"IHDR", b"IHDX"), whole[:8]):
        path.write_bytes(damaged)
        assert "is damaged" in error_of(read_png, path)


@pytest.mark.parametrize(
    ("width", "height", "data", "message"),
    [
        (0, 5, bytes(5), "is damaged: its size is 0 x 5 pixels"),
        (5, 0, b"", "is damaged: its size is 5 x 0 pixels"),
        (18_000, 18_000, bytes(18_000), "18000 x 18000 pixels are more than its data can hold"),
        (4, 4, bytes(1 << 26), "is damaged, or not a valid .png file"),
        (4, 4, bytes(19), "is damaged, or not a valid .png file"),
        (1, 1, bytes([7, 0]), "is damaged"),  # an unknown filter type
    ],
)
def test_headers_that_do_not_fit_the_data(tmp_path, error_of, width, height, data, message):
    """They are refused before memory is taken, also for more data than the header says."""
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data))
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunks)
    errors = []
    peak = traced_peak(lambda: errors.append(error_of(read_png, tmp_path / "a.png")))
    assert message in errors[0] and peak < 1 << 21


def test_pictures_too_large_for_the_memory(tmp_path, error_of, monkeypatch):
    rgba = np.random.default_rng(1).random((600, 500, 4), dtype=np.float32)
    write_png(tmp_path / "a.png", rgba)
    peak = traced_peak(lambda: read_png(tmp_path / "a.png"))
    monkeypatch.setattr(memory, "available_memory", lambda: int(1.25 * peak))
    read_png(tmp_path / "a.png")
    monkeypatch.setattr(memory, "available_memory", lambda: int(0.75 * peak))
    message = error_of(read_png, tmp_path / "a.png")
    assert "a picture of 500 x 600 pixels needs about" in message
    assert "choose a smaller picture" in message


def test_luminance_over_white():
    rgba = np.array([[[1, 1, 1, 1], [0, 0, 0, 1], [0, 1, 0, 1], [0, 0, 0, 0.25]]], dtype=np.float32)
    np.testing.assert_allclose(luminance(rgba), [[1, 0, 0.7152, 0.75]], atol=1e-6)
