"""The pictures of docs/figures.md: a head with its singularities, and fields side by side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rosy_addon import api
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate
from rosy_addon.presets.store import load_preset

from .page import ROOT
from .shapes import suzanne
from .sheet import Panel, display, save, sheet
from .solid import render_view

IMAGES = ROOT / "docs" / "images"

DEGREE, SIDE, ANGLES = 4, 396, (-26, 8)

LOOK = Look(supersampling=2, singularity_labels=True)

#: Of the sheet and of the picture on the page, in inches and dots per inch.
SHEET_WIDTH, SHEET_DPI, PAGE_WIDTH, PAGE_DPI = 7.0, 150, 6.0, 160


def write() -> None:
    """Draw and save the pictures."""
    head = suzanne()
    field = generate(head, "form", DEGREE)
    engraving = replace(load_preset("engraving").look, singularity_dots="all")
    panels = []
    for look, text in (
        (replace(LOOK, singularity_dots="visible"), "Visible, with indices"),
        (engraving, "All"),
    ):
        panels.append(Panel(display(render_view(head, field, look, ANGLES, SIDE)), text))
    save(sheet([panels]), IMAGES / "figures-singularities.png")
    _write_figures()


def _write_figures() -> None:
    """Draw and save the comparisons."""
    mesh = suzanne(2)
    faces = np.split(mesh.corner_vertex, mesh.face_start[1:-1])
    head = api.Surface(mesh.vertices, faces, name="Suzanne")
    fields = {
        "Form": api.form(head),
        "Smoothest": api.smoothest(head),
        "Principal curvature": api.curvature(head),
    }
    all_parts = ("fields", "differences", "table")
    two = {title: fields[title] for title in ("Form", "Smoothest")}
    shared = {"view": ANGLES, "workers": 1}
    page = api.figure(two, parts=all_parts, width=PAGE_WIDTH, dpi=PAGE_DPI, scale_bar="m", **shared)
    api.save_figures(IMAGES / "figures-compare.png", page)
    shared |= {"width": SHEET_WIDTH, "dpi": SHEET_DPI}
    caption = (
        "Three fields of degree 4 on Suzanne: a field along the form of the surface, the smoothest field, and "
        "the directions of principal curvature. Dots are singularities, their color is the sign of the index, and "
        "their area its size."
    )
    differences = (
        "The angles of the other two fields to the first, and the singularities of both. The table has the "
        "energies, the numbers of singularities, and the angles over the whole surface."
    )
    pages = [
        api.figure(fields, caption=caption, scale_bar="m", **shared),
        api.figure(fields, parts=all_parts[1:], caption=differences, **shared),
    ]
    api.save_figures(IMAGES / "figures-sheet.pdf", pages)


if __name__ == "__main__":
    write()
