"""The pictures of docs/textures.md, whose text is written by hand."""

from __future__ import annotations

import tempfile
from functools import partial

import numpy as np

from rosy_addon.compositor.ink_from_thresholds import ink_of_thresholds
from rosy_addon.compositor.look import Look
from rosy_addon.compositor.shading import KEY_LIGHT
from rosy_addon.core.color import to_linear
from rosy_addon.field.generate import GeneratorSettings, generate
from rosy_addon.field.surface import Surface, build_surface
from rosy_addon.image_io.image_data import image_of_pixels
from rosy_addon.line_drawing.tangent_mesh import build_tangent_mesh
from rosy_addon.preset_files.store import load_preset
from rosy_addon.projection.camera import orbit_basis, orbit_camera
from rosy_addon.projection.gbuffer import GBuffer, MeshInstance
from rosy_addon.projection.project import project
from rosy_addon.surface_texture.charts import uv_charts
from rosy_addon.surface_texture.draw import draw_texture

from .looks_page import IMAGES
from .sheet import Panel, display, save, sheet

#: Side of a picture, samples per pixel in each direction, and side of the texture.
SIDE, SAMPLES, TEXTURE_SIDE = 402, 3, 2048

#: Lamps: labels, azimuths from the camera and elevations in degrees.
LAMPS = (("a lamp at the left", -50.0, 35.0), ("a lamp at the right", 55.0, 25.0))

#: Views from the front and from behind, azimuth and elevation in degrees.
FRONT, BACK = (-26.0, 8.0), (150.0, 14.0)


def write() -> None:
    """Draw and save the pictures."""
    surface, uv = unwrapped_suzanne()
    field = generate(surface, GeneratorSettings("form"), 4)
    instance = MeshInstance(surface, np.eye(4), field)
    texture = draw_texture(instance, uv, Look(), TEXTURE_SIDE).rgba
    charts = uv_charts(surface, build_tangent_mesh(instance), uv)
    hue = np.random.default_rng(3).uniform(0.25, 0.95, (int(charts.chart.max()) + 1, 3))
    chart_color = to_linear(hue)[charts.chart]

    def textured(gbuffer: GBuffer) -> np.ndarray:
        return texture_at(texture, uv[surface.triangles], gbuffer)[:, :3]

    panels = [
        Panel(view(instance, FRONT, lambda g: chart_color[g.triangle]), "the charts of the UV map"),
        Panel(view(instance, FRONT, textured), "the texture"),
        Panel(view(instance, BACK, textured), "from behind"),
        Panel(display(_reduced(texture, SIDE)), "the file"),
    ]
    save(sheet([panels[:2], panels[2:]]), IMAGES / "textures.png")
    close = project([instance], _zoomed(instance))
    color = _lit(textured(close), close)
    chart = chart_color[close.triangle]
    crops = [_picture(close, color), _picture(close, _lit(chart, close))]
    labels = ["the texture from near", "the charts in the same view"]
    save(
        sheet([[Panel(crop, label) for crop, label in zip(crops, labels, strict=True)]]),
        IMAGES / "textures-seams.png",
    )
    _write_hatching(instance, uv)
    _write_highlights(instance, uv)


def _write_highlights(instance: MeshInstance, uv: np.ndarray) -> None:
    """Render and save the pictures of brushed metal: one field, two guiding angles, and without a map."""
    import bpy

    from rosy_addon.scene.blender_images import new_image
    from rosy_addon.scene.texture_nodes import brushed_metal_shader, new_texture_material

    scene, obj = bpy.context.scene, bpy.context.object
    obj.data.shade_smooth()
    _light_metal(scene)
    panels = []
    for label, angle in (("horizontal strokes", 0.0), ("vertical strokes", np.pi / 2)):
        look = Look(guiding_angle=angle)
        pixels = draw_texture(instance, uv, look, TEXTURE_SIDE, content="anisotropy").rgba
        image_data = image_of_pixels(pixels, as_float=False, is_color=False)
        image = new_image("map", image_data, is_color=False)
        uv_map = obj.data.uv_layers.active.name
        add_shader = partial(brushed_metal_shader, uv_map=uv_map)
        material = new_texture_material("metal", image, uv_map, add_shader)
        obj.data.materials.clear()
        obj.data.materials.append(material)
        panels.append(Panel(_rendered(scene), label))
    save(sheet([panels]), IMAGES / "textures-highlights.png")


def _light_metal(scene) -> None:
    """Add a camera, a dim world and bright panels that a metal reflects."""
    import bpy

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.data.lens = 85.0
    axes = orbit_basis(*FRONT)
    camera.matrix_world = _placed(axes, 7.0)
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.15, 0.15, 0.15)
    for azimuth, elevation, power in ((-50, 30, 250), (30, 60, 300), (75, 5, 250)):
        lamp = bpy.data.objects.new("Panel", bpy.data.lights.new("Panel", "AREA"))
        scene.collection.objects.link(lamp)
        lamp.data.energy, lamp.data.size = power, 1.0
        axes = orbit_basis(FRONT[0] + azimuth, elevation)
        lamp.matrix_world = _placed(axes, 4.0)


def _placed(axes: np.ndarray, distance: float):
    """Return the matrix of an object that looks at the origin along the last axis."""
    from mathutils import Matrix

    return Matrix([*np.c_[axes.T, distance * axes[2]].tolist(), [0, 0, 0, 1]])


def _rendered(scene) -> np.ndarray:
    """Return (SIDE, SIDE, 3) uint8 from the top, rendered with Cycles."""
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


def _write_hatching(instance: MeshInstance, uv: np.ndarray) -> None:
    """Draw and save the picture of one texture of hatching in the light of several lamps."""
    panels = []
    for key, lamps in (("cross-hatch", LAMPS), ("engraving", LAMPS)):
        look = load_preset(key).look
        thresholds = draw_texture(instance, uv, look, TEXTURE_SIDE).rgba
        for label, azimuth, elevation in lamps:
            lamp = orbit_basis(FRONT[0] + azimuth, elevation)[2]

            def inked(gbuffer: GBuffer, lamp=lamp, look=look, thresholds=thresholds) -> np.ndarray:
                pixels = texture_at(thresholds, uv[instance.surface.triangles], gbuffer)
                lambert = np.maximum(gbuffer.normal @ (gbuffer.camera.view[:3, :3] @ lamp), 0)
                tone = 1 - look.shading + look.shading * lambert
                return ink_of_thresholds(pixels, tone.astype(np.float32), look, 2)[0]

            panels.append(Panel(view(instance, FRONT, inked, is_lit=False), label))
    save(sheet([panels[:2], panels[2:]]), IMAGES / "textures-hatching.png")


def unwrapped_suzanne() -> tuple[Surface, np.ndarray]:
    """Return Blender's monkey, subdivided and unwrapped into charts, and (C, 2) coordinates."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add()
    obj = bpy.context.object
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 2
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.uv.smart_project(angle_limit=np.radians(66), island_margin=0.003)
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = obj.data
    vertices = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", vertices.ravel())
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    start = np.empty(len(mesh.polygons), dtype=np.int32)
    mesh.polygons.foreach_get("loop_start", start)
    uv = np.empty((len(corners), 2), dtype=np.float32)
    mesh.uv_layers.active.uv.foreach_get("vector", uv.ravel())
    return build_surface(vertices, corners, np.append(start, len(corners)), name="Suzanne"), uv


def view(
    instance: MeshInstance, angles: tuple[float, float], color_of, *, is_lit: bool = True
) -> np.ndarray:
    """Return a picture; `color_of` returns the colors of the pixels of a G-buffer, to be lit by a lamp."""
    side = SIDE * SAMPLES
    camera = orbit_camera(instance.surface.vertices, *angles, side, side, margin=0.03)
    gbuffer = project([instance], camera)
    color = color_of(gbuffer)
    return _picture(gbuffer, _lit(color, gbuffer) if is_lit else color)


def texture_at(texture: np.ndarray, corner_uv: np.ndarray, gbuffer: GBuffer) -> np.ndarray:
    """(P, 4) values of a texture, interpolated as a renderer does."""
    place = np.einsum("nk,nki->ni", gbuffer.barycentric, corner_uv[gbuffer.triangle])
    height, width = texture.shape[:2]
    x, y = place[:, 0] * width - 0.5, place[:, 1] * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    x, y = (x - column)[:, None], (y - row)[:, None]

    def at(dx: int, dy: int) -> np.ndarray:
        return texture[(row + dy) % height, (column + dx) % width]

    return (at(0, 0) * (1 - x) + at(1, 0) * x) * (1 - y) + (at(0, 1) * (1 - x) + at(1, 1) * x) * y


def _lit(color: np.ndarray, gbuffer: GBuffer) -> np.ndarray:
    """Light colors by a lamp over the left shoulder of the viewer."""
    cosine = gbuffer.normal @ KEY_LIGHT.vector.astype(np.float32)
    return color * (0.35 + 1.1 * np.maximum(cosine, 0))[:, None]


def _picture(gbuffer: GBuffer, color: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) uint8 from the top, with the mean of the samples of each pixel."""
    camera = gbuffer.camera
    rgba = np.zeros((camera.height * camera.width, 4), dtype=np.float32)
    rgba[gbuffer.pixel, :3], rgba[gbuffer.pixel, 3] = color, 1
    shape = camera.height // SAMPLES, SAMPLES, camera.width // SAMPLES, SAMPLES, 4
    rgba[:, :3] *= rgba[:, 3:]
    mean = rgba.reshape(shape).mean(axis=(1, 3))
    mean[..., :3] /= np.maximum(mean[..., 3:], 1e-6)
    return display(mean)


def _zoomed(instance: MeshInstance):
    """Return a camera that sees the forehead from near."""
    vertices = instance.surface.vertices
    near = vertices[np.linalg.norm(vertices - [-0.25, -0.75, 0.55], axis=1) < 0.32]
    side = SIDE * SAMPLES
    return orbit_camera(near, *FRONT, side, side, margin=-0.1)


def _reduced(texture: np.ndarray, side: int) -> np.ndarray:
    """Return a texture with about `side` pixels on each side, as the mean of its texels."""
    factor = len(texture) // side
    used = texture[: side * factor, : side * factor]
    return used.reshape(side, factor, side, factor, 4).mean(axis=(1, 3))
