"""Compose the comparison of RoSy with Blender's own line renderers for docs/hatching.md."""

from __future__ import annotations

import json

import numpy as np
from PIL import Image

from .looks_page import IMAGES
from .page import ROOT
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
    names = list(LABELS)
    rows = []
    for pair in (names[:2], names[2:]):
        pictures = [np.asarray(Image.open(DRAWN / f"{name}.png").convert("L")) for name in pair]
        rows.append([Panel(_halved(picture)) for picture in pictures])
        rows.append(
            [
                Panel(_detail(picture), _label(name, seconds))
                for name, picture in zip(pair, pictures, strict=True)
            ]
        )
    save(sheet(rows), IMAGES / "hatching-peers.png")


def _label(name: str, seconds: dict[str, float]) -> str:
    if name in UNTIMED:
        return LABELS[name]
    return f"{LABELS[name]}; time {seconds[name] / seconds['rosy']:.1f}"


def _halved(picture: np.ndarray) -> np.ndarray:
    """Return (H / 2, W / 2, 3) means of 2 x 2 pixels."""
    height, width = picture.shape
    small = Image.fromarray(picture).resize((width // 2, height // 2), Image.Resampling.BOX)
    return np.asarray(small.convert("RGB"))


def _detail(picture: np.ndarray) -> np.ndarray:
    left, top, width, height = DETAIL
    part = Image.fromarray(picture[top : top + height, left : left + width])
    return np.asarray(part.convert("RGB"))
