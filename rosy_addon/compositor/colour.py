"""Display values and linear light, and colours that stand for magnitudes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Seventeen even samples of each map, sRGB. Viridis and magma are Nathaniel Smith's and Stefan van
# der Walt's, from matplotlib, dedicated to the public domain (CC0).
_MAPS = {
    "viridis": "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 "
    "3fbc73 5ec962 84d44b addc30 d8e219 fde725",
    "magma": "000004 0a0822 1d1147 36106b 51127c 6a1c81 832681 9c2e7f b73779 d0416f e75263 "
    "f56b5c fc8961 fea772 fec488 fde2a3 fcfdbf",
    "grey": "111111 ffffff",
}

#: Of linear light (Rec. 709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)


def map_colours(values: np.ndarray, name: str) -> np.ndarray:
    """Colours of values from 0 to 1.

    Parameters
    ----------
    values : (P,) ndarray
    name : {"viridis", "magma", "grey"}

    Returns
    -------
    (P, 3) float32 ndarray
        Display values (sRGB), 0 to 1.
    """
    stops = colour_stops(name)
    place = np.linspace(0, 1, len(stops))
    channels = [np.interp(values, place, stops[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=1).astype(np.float32)


def colour_stops(name: str) -> np.ndarray:
    """(n, 3) float64 display values of a map at even places from 0 to 1, linear in between."""
    return np.array([list(bytes.fromhex(code)) for code in _MAPS[name].split()]) / 255


def from_hex(code: str) -> np.ndarray:
    """(3,) float32 display values of a colour ``#rrggbb``."""
    return np.array(list(bytes.fromhex(code[1:])), dtype=np.float32) / 255


def to_hex(display: Sequence[float]) -> str:
    """``#rrggbb`` of three display values from 0 to 1."""
    return "#" + bytes(round(255 * min(max(value, 0), 1)) for value in display).hex()


def to_linear(display: np.ndarray) -> np.ndarray:
    """sRGB display values, clipped to 0 to 1, as linear light (IEC 61966-2-1); float32."""
    display = np.clip(display, 0, 1).astype(np.float32, copy=False)
    curve = ((display + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(display <= 0.04045, display / np.float32(12.92), curve)


def to_display(linear: np.ndarray) -> np.ndarray:
    """Linear light, clipped to 0 to 1, as sRGB display values; float32."""
    linear = np.clip(linear, 0, 1).astype(np.float32, copy=False)
    curve = np.float32(1.055) * linear ** np.float32(1 / 2.4) - np.float32(0.055)
    return np.where(linear <= 0.0031308, linear * np.float32(12.92), curve)


def luminance(rgba: np.ndarray) -> np.ndarray:
    """(H, W) float32 luminance of a (H, W, 4) linear picture, not premultiplied, on white."""
    return rgba[..., 3] * (rgba[..., :3] @ LUMINANCE - 1) + 1
