"""Draw the pictures of docs/textures.md."""

import tempfile
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import ndimage
from skimage.measure import block_reduce

from rosy_addon.compositor.ink_from_thresholds import ink_of_thresholds
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import KEY_LIGHT
from rosy_addon.core.color import to_linear
from rosy_addon.field.generate import generate
from rosy_addon.field.surface import Surface
from rosy_addon.image_io.image_data import image_of_pixels
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_basis, orbit_camera
from rosy_addon.projection.gbuffer import GBuffer, MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.surface_texture.charts import uv_charts
from rosy_addon.surface_texture.draw import draw_texture

from .page import IMAGES
from .sheet import Panel, display, save, sheet

#: Side of a picture in pixels, samples along each side of a pixel, and side of the texture in texels.
SIDE, SAMPLES, TEXTURE_SIDE = 402, 3, 2048

#: Lamps: label, azimuth relative to the camera, and elevation, in degrees.
LAMPS = (("a lamp at the left", -50.0, 35.0), ("a lamp at the right", 55.0, 25.0))

#: Azimuth and elevation of the views from the front and from behind, in degrees.
FRONT, BACK = (-26.0, 8.0), (150.0, 14.0)

#: A point at the forehead of Suzanne.
FOREHEAD = (-0.25, -0.75, 0.55)


def write() -> None:
    """Draw and save the pictures."""
    surface, uv = unwrapped_suzanne()
    instance = MeshInstance(surface, np.eye(4), generate(surface, "form", 4))
    corner_uv = uv[surface.triangles]
    texture = draw_texture(instance, uv, Look(), TEXTURE_SIDE).rgba
    charts = uv_charts(surface, build_tangent_mesh(instance), uv)
    hue = np.random.default_rng(3).uniform(0.25, 0.95, (int(charts.chart.max()) + 1, 3))
    chart_color = to_linear(hue)[charts.chart]

    def textured(gbuffer: GBuffer) -> np.ndarray:
        return texture_at(texture, corner_uv, gbuffer)[:, :3]

    def by_chart(gbuffer: GBuffer) -> np.ndarray:
        return chart_color[gbuffer.triangle]

    panels = [
        Panel(view(instance, FRONT, by_chart), "the charts of the UV map"),
        Panel(view(instance, FRONT, textured), "the texture"),
        Panel(view(instance, BACK, textured), "from behind"),
        Panel(
            display(
                block_reduce(texture, (TEXTURE_SIDE // SIDE,) * 2 + (1,), np.mean)[:SIDE, :SIDE]
            ),
            "the file",
        ),
    ]
    save(sheet([panels[:2], panels[2:]]), IMAGES / "textures.png")
    # The forehead, from near.
    near = surface.vertices[np.linalg.norm(surface.vertices - FOREHEAD, axis=1) < 0.32]
    crops = [
        Panel(view(instance, FRONT, textured, points=near), "the texture from near"),
        Panel(view(instance, FRONT, by_chart, points=near), "the charts in the same view"),
    ]
    save(sheet([crops]), IMAGES / "textures-seams.png")
    save(sheet(_hatching(instance, uv)), IMAGES / "textures-hatching.png")
    save(sheet([_highlights(instance, uv)]), IMAGES / "textures-highlights.png")


def _hatching(instance: MeshInstance, uv: np.ndarray) -> list[list[Panel]]:
    """For two presets, draw the same hatching texture in the light of several lamps."""
    corner_uv = uv[instance.surface.triangles]
    rows = []
    for preset in ("cross-hatch", "engraving"):
        look = load_preset(preset).look
        thresholds = draw_texture(instance, uv, look, TEXTURE_SIDE).rgba
        row = []
        for label, azimuth, elevation in LAMPS:
            lamp = orbit_basis(FRONT[0] + azimuth, elevation)[2]

            def inked(gbuffer: GBuffer, lamp=lamp, look=look, thresholds=thresholds) -> np.ndarray:
                pixels = texture_at(thresholds, corner_uv, gbuffer)
                lambert = np.maximum(gbuffer.normal @ (gbuffer.camera.view[:3, :3] @ lamp), 0)
                tone = 1 - look.shading + look.shading * lambert
                return ink_of_thresholds(pixels, tone.astype(np.float32), look, 2)[0]

            row.append(Panel(view(instance, FRONT, inked, is_lit=False), label))
        rows.append(row)
    return rows


def _highlights(instance: MeshInstance, uv: np.ndarray) -> list[Panel]:
    """Render a brushed metal head, with two guiding angles for the same field."""
    import bpy

    from rosy_addon.scene.blender_images import new_image
    from rosy_addon.scene.texture_nodes import brushed_metal_shader, new_texture_material

    scene, obj = bpy.context.scene, bpy.context.object
    obj.data.shade_smooth()
    _light_metal(scene)
    uv_map = obj.data.uv_layers.active.name
    panels = []
    for label, angle in (("horizontal strokes", 0.0), ("vertical strokes", np.pi / 2)):
        look = Look(guiding_angle=angle)
        pixels = draw_texture(instance, uv, look, TEXTURE_SIDE, content="anisotropy").rgba
        data = image_of_pixels(pixels, as_float=False, is_color=False)
        image = new_image("map", data, is_color=False)
        add_shader = partial(brushed_metal_shader, uv_map=uv_map)
        obj.data.materials.clear()
        obj.data.materials.append(new_texture_material("metal", image, uv_map, add_shader))
        panels.append(Panel(_rendered(scene), label))
    return panels


def _light_metal(scene) -> None:
    """Add a camera, a dim world and bright panels that a metal reflects."""
    import bpy

    from .in_blender import add

    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), FRONT, 7.0)
    scene.camera.data.lens = 85.0
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.15, 0.15, 0.15)
    for azimuth, elevation, power in ((-50, 30, 250), (30, 60, 300), (75, 5, 250)):
        light = bpy.data.lights.new("Panel", "AREA")
        light.energy, light.size = power, 1.0
        add("Panel", light, (FRONT[0] + azimuth, elevation), 4.0)


def _rendered(scene) -> np.ndarray:
    """Render the scene with Cycles. Return (SIDE, SIDE, 3) uint8 with rows from the top."""
    import bpy

    scene.render.engine, scene.cycles.samples = "CYCLES", 256
    scene.cycles.use_denoising, scene.cycles.max_bounces = False, 2
    scene.cycles.sample_clamp_indirect = 1.0
    scene.render.film_transparent = True
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.view_settings.view_transform = "Standard"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = f"{folder}/picture.exr"
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        rgba = np.empty((SIDE, SIDE, 4), dtype=np.float32)
        image.pixels.foreach_get(rgba.ravel())
        bpy.data.images.remove(image)
    rgba[..., :3] /= np.maximum(rgba[..., 3:], 1e-6)
    return display(rgba)


def unwrapped_suzanne() -> tuple[Surface, np.ndarray]:
    """Return Blender's monkey, subdivided, and (C, 2) UV coordinates that unwrap it into charts."""
    import bpy

    from .in_blender import add_suzanne, surface_of

    mesh = add_suzanne().data
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=np.radians(66), island_margin=0.003)
    bpy.ops.object.mode_set(mode="OBJECT")
    uv = np.empty((len(mesh.loops), 2), dtype=np.float32)
    mesh.uv_layers.active.uv.foreach_get("vector", uv.ravel())
    return surface_of(mesh, "Suzanne"), uv


def view(
    instance: MeshInstance,
    angles: tuple[float, float],
    color_of: Callable[[GBuffer], np.ndarray],
    *,
    points: np.ndarray | None = None,
    is_lit: bool = True,
) -> np.ndarray:
    """Draw a mesh with colors of its pixels, averaged over samples. Return (SIDE, SIDE, 3) uint8.

    Parameters
    ----------
    instance : MeshInstance
    angles : (float, float)
        Azimuth and elevation in degrees.
    color_of : function
        Function that returns the (P, 3) linear colors of the pixels of a G-buffer.
    points : (P, 3) ndarray, optional
        Points that the camera frames closely. By default the whole surface.
    is_lit : bool
        Whether a lamp over the left shoulder of the viewer lights the colors.
    """
    side = SIDE * SAMPLES
    framed, margin = (instance.surface.vertices, 0.03) if points is None else (points, -0.1)
    gbuffer = project([instance], orbit_camera(framed, *angles, side, side, margin=margin))
    color = color_of(gbuffer)
    if is_lit:
        cosine = gbuffer.normal @ KEY_LIGHT.vector.astype(np.float32)
        color = color * (0.35 + 1.1 * np.maximum(cosine, 0))[:, None]
    rgba = np.zeros((side * side, 4), dtype=np.float32)
    rgba[gbuffer.pixel, :3], rgba[gbuffer.pixel, 3] = color, 1
    rgba[:, :3] *= rgba[:, 3:]
    mean = rgba.reshape(SIDE, SAMPLES, SIDE, SAMPLES, 4).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
    return display(mean)


def texture_at(texture: np.ndarray, corner_uv: np.ndarray, gbuffer: GBuffer) -> np.ndarray:
    """Return the (P, 4) values of a texture at the pixels of a G-buffer, bilinearly interpolated."""
    place = np.einsum("nk,nki->ni", gbuffer.barycentric, corner_uv[gbuffer.triangle])
    row_and_column = (place * texture.shape[1::-1] - 0.5)[:, ::-1].T
    options = {"order": 1, "mode": "grid-wrap"}
    channels = [
        ndimage.map_coordinates(texture[..., k], row_and_column, **options) for k in range(4)
    ]
    return np.stack(channels, axis=1)
