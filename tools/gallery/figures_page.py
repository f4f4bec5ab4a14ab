"""Draw pictures of docs/figures.md: comparisons, and a render with a key (legend)."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from rosy_addon import api
from rosy_addon.compositor.look import Look
from rosy_addon.field.generate import generate

from .page import IMAGES
from .shapes import suzanne
from .sheet import save

DEGREE, ANGLES = 4, (-26, 8)

#: Width and height of the render with a key (legend), and its look.
RENDER_SIZE = 824, 520
LOOK = Look(supersampling=2, hue="magnitude", singularity_dots="visible")

#: Options of the sheet of comparisons: width in inches, dots per inch, view, and number of processes.
SHEET = {"width": 7.0, "dpi": 150, "view": ANGLES, "workers": 1}
PAGE = {"width": 6.0, "dpi": 160, "view": ANGLES, "workers": 1}

CAPTION = (
    "Three fields of degree 4 on Suzanne: a field along the form of the surface, the smoothest field, and "
    "the directions of principal curvature. Dots are singularities, their color is the sign of the index, and "
    "their area its size."
)
DIFFERENCES = (
    "The angles of the other two fields to the first, and the singularities of both. The table has the "
    "energies, the numbers of singularities, and the angles over the whole surface."
)


def write() -> None:
    """Draw and save the pictures."""
    save(_render_with_key(), IMAGES / "figures-key.png")
    mesh = suzanne(2)
    faces = np.split(mesh.corner_vertex, mesh.face_start[1:-1])
    head = api.Surface(mesh.vertices, faces, name="Suzanne")
    two = {"Form": api.form(head), "Smoothest": api.smoothest(head)}
    three = two | {"Principal curvature": api.curvature(head)}
    parts = ("fields", "differences", "table")
    page = api.figure(two, parts=parts, scale_bar="m", **PAGE)
    api.save_figures(IMAGES / "figures-compare.png", page)
    sheets = [
        api.figure(three, caption=CAPTION, scale_bar="m", **SHEET),
        api.figure(three, parts=parts[1:], caption=DIFFERENCES, **SHEET),
    ]
    api.save_figures(IMAGES / "figures-sheet.pdf", sheets)


def _render_with_key() -> Image.Image:
    """Render a head in Blender: curvature as color, singularities as dots, and a key that explains both."""
    import bpy

    from rosy_addon.jobs.bake import bake
    from rosy_addon.scene.look_properties import apply_look
    from rosy_addon.scene.mesh_fields import write_mesh_field
    from rosy_addon.scene.meshes import mesh_surface
    from rosy_addon.ui.properties import ensure_registered

    from .in_blender import add, add_suzanne

    head = add_suzanne().data
    ensure_registered()
    head.shade_smooth()
    write_mesh_field(head, generate(mesh_surface(head), "curvature", DEGREE))
    scene = bpy.context.scene
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), ANGLES, 6)
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 4.3
    scene.render.resolution_x, scene.render.resolution_y = RENDER_SIZE
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (1.0, 1.0, 1.0)
    scene.view_settings.view_transform = "Standard"
    settings = scene.rosy
    apply_look(settings, LOOK)
    settings.key = settings.key_counts = True
    settings.key_caption = "The principal curvatures of a head, and their singularities."
    bake(scene)
    scene.render.engine, scene.cycles.samples = "CYCLES", 64
    scene.cycles.use_denoising = False
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
        return Image.open(scene.render.filepath).convert("RGB")
