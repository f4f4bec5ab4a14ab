"""The pictures of docs/figures.md: singularities, fields side by side, and a render with a key."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from rosy_addon import api
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.preset_files.store import load_preset

from .page import ROOT
from .shapes import sphere, suzanne
from .sheet import Panel, display, save, sheet
from .solid import render_view

IMAGES = ROOT / "docs" / "images"

DEGREE, SIDE, ANGLES = 4, 396, (-26, 8)

#: Width and height of the render with a key.
RENDER_SIZE = 824, 520

LOOK = Look(supersampling=2)

#: Of the sheet and of the picture on the page, in inches and dots per inch.
SHEET_WIDTH, SHEET_DPI, PAGE_WIDTH, PAGE_DPI = 7.0, 150, 6.0, 160


def write() -> None:
    """Draw and save the pictures."""
    head = suzanne()
    field = generate(head, "form", DEGREE)
    engraving = replace(load_preset("engraving").look, singularity_dots="all")
    panels = []
    for look, text in (
        (replace(LOOK, singularity_dots="visible_indices"), "Visible, with indices"),
        (engraving, "All"),
    ):
        panels.append(Panel(display(render_view(head, field, look, ANGLES, SIDE)), text))
    save(sheet([panels]), IMAGES / "figures-singularities.png")
    save(_render_with_key(), IMAGES / "figures-key.png")
    save(sheet([_oriented_panels()]), IMAGES / "figures-oriented.png")
    write_arrowheads()
    _write_figures()


def write_arrowheads() -> None:
    """Draw and save a vector field and a field of three directions with arrowheads."""
    head = suzanne()
    wind = generate(head, GeneratorSettings("axis", axis=(1.0, 0.3, 0.4)), 1)
    three = generate(head, "smoothest", 3)
    engraving = replace(load_preset("engraving").look, arrows=40.0)
    streaks = Look(supersampling=2, density=0.05, line_width=2.0, arrows=40.0)
    panels = [
        Panel(display(render_view(head, field, look, ANGLES, SIDE)), text)
        for field, look, text in (
            (wind, engraving, "One direction, engraved"),
            (three, streaks, "Three directions"),
        )
    ]
    save(sheet([panels]), IMAGES / "figures-arrowheads.png")


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


def _oriented_panels() -> list[Panel]:
    """Draw a vector field and a field of three directions with oriented streaks."""
    ball = sphere()
    look = Look(
        supersampling=2,
        fade="tail",
        density=0.04,
        line_width=3.0,
        length=45,
        high_pass=0.0,
        gain=1.6,
    )
    flow = generate(ball, GeneratorSettings("axis", axis=(0.3, 0.2, 1.0)), 1)
    three = generate(ball, "smoothest", 3)
    return [
        Panel(display(render_view(ball, field, look, ANGLES, SIDE)), text)
        for field, text in ((flow, "One direction"), (three, "Three directions"))
    ]


def _render_with_key() -> Image.Image:
    """Render a head in Blender: its curvature as color, its singularities, and what both mean."""
    import bpy
    from mathutils import Matrix

    from rosy_addon.jobs.bake import bake
    from rosy_addon.projection.camera import orbit_basis
    from rosy_addon.scene.look_properties import apply_look
    from rosy_addon.scene.meshes import mesh_surface
    from rosy_addon.scene.write_field import write_mesh_field
    from rosy_addon.ui.properties import ensure_registered

    bpy.ops.wm.read_factory_settings(use_empty=True)
    ensure_registered()
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_monkey_add()
    head = bpy.context.object
    modifier = head.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = 2
    bpy.ops.object.modifier_apply(modifier=modifier.name)
    head.data.shade_smooth()
    field = generate(mesh_surface(head.data), "curvature", DEGREE)
    write_mesh_field(head.data, field)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 4.3
    axes = orbit_basis(*ANGLES)
    rows = [[*axis, place] for axis, place in zip(axes.T.tolist(), 6 * axes[2], strict=True)]
    scene.camera.matrix_world = Matrix([*rows, [0, 0, 0, 1]])
    scene.render.resolution_x, scene.render.resolution_y = RENDER_SIZE
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (1.0, 1.0, 1.0)
    scene.view_settings.view_transform = "Standard"
    look = replace(LOOK, hue="magnitude", singularity_dots="visible")
    apply_look(scene.rosy, look)
    settings = scene.rosy
    settings.key_counts = True
    settings.key_caption = "The principal curvatures of a head, and their singularities."
    settings.key = True
    bake(scene)
    scene.render.engine, scene.cycles.samples = "CYCLES", 64
    scene.cycles.use_denoising = False
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
        return Image.open(scene.render.filepath).convert("RGB")
