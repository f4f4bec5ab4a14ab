"""Compose the comparison of RoSy with Blender's own line renderers for docs/hatching.md."""

from __future__ import annotations

import json

import numpy as np
from PIL import Image

from .page import IMAGES, ROOT
from .sheet import Panel, save, sheet

#: Folder into which `peers_blender` has drawn.
DRAWN = ROOT / "dist" / "peers"

#: Labels by the names of the pictures.
LABELS = {
    "line_art": "Line Art: contours and creases",
    "freestyle": "Freestyle: sketched contours, marked edges",
    "shader": "EEVEE: light to bands of the window",
    "rosy": "RoSy: the preset Cross-hatch",
}

#: Pictures without a time, because they use the graphics card, here emulated by the processor.
UNTIMED = ("shader",)

#: Box of the detail that is shown pixel by pixel: left, top, width and height.
DETAIL = (300, 70, 402, 250)


def write() -> None:
    """Compose the pictures that Blender drew. Without them, keep the old sheet."""
    if not (DRAWN / "seconds.json").exists():
        print(
            "peers: unchanged; run first: blender -b --factory-startup "
            "-P tools/gallery/peers_blender.py -- dist/peers"
        )
        return
    seconds = json.loads((DRAWN / "seconds.json").read_text(encoding="utf-8"))
    halves, details = [], []
    left, top, width, height = DETAIL
    for name, label in LABELS.items():
        if name not in UNTIMED:
            label += f"; time {seconds[name] / seconds['rosy']:.1f}"
        picture = Image.open(DRAWN / f"{name}.png").convert("L")
        half = picture.resize((picture.width // 2, picture.height // 2), Image.Resampling.BOX)
        detail = picture.crop((left, top, left + width, top + height))
        halves.append(Panel(np.asarray(half.convert("RGB"))))
        details.append(Panel(np.asarray(detail.convert("RGB")), label))
    rows = [halves[:2], details[:2], halves[2:], details[2:]]
    save(sheet(rows), IMAGES / "hatching-peers.png")
