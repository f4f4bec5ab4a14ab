"""Color conversion: sRGB display values, linear light, luminance, hex codes and color maps."""

from collections.abc import Sequence

import numpy as np

# Evenly spaced samples of each color map, as sRGB hex codes. Viridis and magma are by Nathaniel
# Smith and Stefan van der Walt, from matplotlib, dedicated to the public domain (CC0).
_COLOR_MAPS = {
    "viridis": "440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 "
    "3fbc73 5ec962 84d44b addc30 d8e219 fde725",
    "magma": "000004 0a0822 1d1147 36106b 51127c 6a1c81 832681 9c2e7f b73779 d0416f e75263 "
    "f56b5c fc8961 fea772 fec488 fde2a3 fcfdbf",
    "gray": "111111 ffffff",
}

#: Luminance weights of linear red, green and blue (Rec. 709). Their sum is 1.
REC709_LUMINANCE = (0.2126, 0.7152, 0.0722)
LUMINANCE_WEIGHTS = np.array(REC709_LUMINANCE, dtype=np.float32)


def map_colors(values: np.ndarray, name: str) -> np.ndarray:
    """Map values from 0 to 1 to colors of a color map.

    Parameters
    ----------
    values : (P,) ndarray
        Values from 0 to 1. Others are clamped to this range.
    name : {"viridis", "magma", "gray"}
        Name of the color map.

    Returns
    -------
    (P, 3) float32 ndarray
        Display values (sRGB), 0 to 1.
    """
    stops = color_stops(name)
    positions = np.linspace(0, 1, len(stops))
    channels = [np.interp(values, positions, stops[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=1).astype(np.float32)


def color_stops(name: str) -> np.ndarray:
    """Return (n, 3) float64: the colors of a color map at n evenly spaced values from 0 to 1.

    They are sRGB display values, 0 to 1. Between them, the map is interpolated linearly. `name` is "viridis",
    "magma" or "gray".
    """
    return np.array([list(bytes.fromhex(code)) for code in _COLOR_MAPS[name].split()]) / 255


def from_hex(code: str) -> np.ndarray:
    """Return (3,) float32: the sRGB display values, 0 to 1, of a color ``#rrggbb`` or ``#rrggbbaa``."""
    return np.array(list(bytes.fromhex(code[1:7])), dtype=np.float32) / 255


def alpha_from_hex(code: str) -> float:
    """Return the opacity, 0 to 1, of a color ``#rrggbb`` or ``#rrggbbaa``. It is 1 without ``aa``."""
    return int(code[7:] or "ff", 16) / 255


def to_hex(display: Sequence[float]) -> str:
    """Return the hex code of a color: ``#rrggbb``, or ``#rrggbbaa`` if its opacity is below 1.

    `display` holds three sRGB display values and optionally the opacity. All are clamped to 0 to 1.
    """
    code = "#" + bytes(round(255 * min(max(value, 0), 1)) for value in display).hex()
    return code[:7] if code[7:] == "ff" else code


def to_linear(display: np.ndarray) -> np.ndarray:
    """Convert sRGB display values, clipped to 0 to 1, to linear light (IEC 61966-2-1), float32."""
    display = np.clip(display, 0, 1).astype(np.float32, copy=False)
    curve = ((display + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(display <= 0.04045, display / np.float32(12.92), curve)


def to_display(linear: np.ndarray) -> np.ndarray:
    """Convert linear light, clipped to 0 to 1, to sRGB display values (IEC 61966-2-1), float32."""
    linear = np.clip(linear, 0, 1).astype(np.float32, copy=False)
    curve = np.float32(1.055) * linear ** np.float32(1 / 2.4) - np.float32(0.055)
    return np.where(linear <= 0.0031308, linear * np.float32(12.92), curve)


def luminance(rgba: np.ndarray) -> np.ndarray:
    """Return (H, W): the luminance of a linear (H, W, 4) picture over a white background.

    Colors are not premultiplied with alpha.
    """
    return rgba[..., 3] * (rgba[..., :3] @ LUMINANCE_WEIGHTS - 1) + 1
