"""The picture of docs/figures.md: a head with its singularities."""

from __future__ import annotations

from dataclasses import replace

from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.presets.store import load_preset

from .page import ROOT
from .shapes import suzanne
from .sheet import Panel, display, save, sheet
from .solid import render_view

DEGREE, SIDE, ANGLES = 4, 396, (-26, 8)

LOOK = Look(supersampling=2, singularity_labels=True)


def write() -> None:
    """Draw and save the picture."""
    head = suzanne()
    field = generate(head, "form", DEGREE)
    engraving = replace(load_preset("engraving").look, singularity_dots="all")
    panels = []
    for look, text in (
        (replace(LOOK, singularity_dots="visible"), "Visible, with indices"),
        (engraving, "All"),
    ):
        panels.append(Panel(display(render_view(head, field, look, ANGLES, SIDE)), text))
    save(sheet([panels]), ROOT / "docs" / "images" / "figures-singularities.png")
