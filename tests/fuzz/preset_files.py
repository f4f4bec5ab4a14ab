"""Write preset files with settings in and out of range."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.random import Generator

from rosy_addon.compositor.look import Look
from rosy_addon.core.settings import Choice, Color, Number, Numbers, Setting, Switch, settings_of

_OTHER_VALUES = (None, [], {}, [1], "", "nan", True, -1, 10**400, 1e308, "\x1b[31m", "\u202e", 0.1)


def preset_bytes(rng: Generator) -> bytes:
    """Return the contents of a preset file, valid in about half of all cases."""
    settings = list(settings_of(Look).values())
    picked = [settings[i] for i in rng.integers(len(settings), size=rng.integers(9))]
    look: dict[str, Any] = {setting.name: setting_value(rng, setting) for setting in picked}
    preset: dict[str, Any] = {"name": "Mine", "description": "A preset", "look": look}
    match rng.integers(10):
        case 0:
            if look:
                name = list(look)[rng.integers(len(look))]
                look[name] = _OTHER_VALUES[rng.integers(len(_OTHER_VALUES))]
        case 1:
            look[("color", "unknown", "", "a\x1b]0;b")[rng.integers(4)]] = 1
        case 2:
            key = ("name", "description", "look", "more")[rng.integers(4)]
            preset[key] = _OTHER_VALUES[rng.integers(len(_OTHER_VALUES))]
        case 3:
            preset["name"] = ("\x1b[2J", "a\nb", "x" * 60, "CON", "../up", "a/b")[rng.integers(6)]
        case 4:
            return json.dumps([preset]).encode()
        case 5:
            return (b"[" * 100_000, b'{"look":' * 5000, b"1", b"null")[rng.integers(4)]
    text = json.dumps(preset, allow_nan=True)
    return text.encode("utf-16" if rng.random() < 0.03 else "utf-8")


def setting_value(rng: Generator, setting: Setting) -> Any:
    """Return a value of a setting, mostly from the range that users choose from."""
    match setting:
        case Switch():
            return bool(rng.random() < 0.5)
        case Choice(options=options):
            return list(options)[rng.integers(len(options))]
        case Color(has_alpha=has_alpha):
            alpha = f"{rng.integers(1 << 8):02x}" if has_alpha and rng.random() < 0.5 else ""
            return f"#{rng.integers(1 << 24):06x}{alpha}"
        case Numbers(parts=parts, default=default):
            kind = rng.random()
            if kind < 0.3:
                return tuple(float(ends[rng.integers(2)]) for ends in parts.values())
            if kind < 0.5:
                return default
            near = rng.normal(0, 2, len(parts))
            return tuple(np.clip(near, *zip(*parts.values(), strict=True)).tolist())
        case Number(low=low, high=high, default=default):
            exact = int if isinstance(default, int) else float
            kind = rng.random()
            if kind < 0.15:
                return exact(low)
            if kind < 0.3:
                return exact(high)
            if kind < 0.5:
                return exact(rng.uniform(low, high))
            value = min(max(default * 10.0 ** rng.uniform(-1, 1), low), high)
            return exact(round(value)) if exact is int else float(value)
    raise TypeError(f"setting '{setting.name}' has no values")
