"""Render a model with EEVEE for some lamps, and compare the pictures with screenshots of the page.

blender -b models/hatching.blend --python compare.py -- FOLDER AZIMUTH,ELEVATION ...
Screenshots are FOLDER/0.png and so on; see shots.mjs. The lamp turns as on the page, which has no shadows.
"""

from __future__ import annotations

import sys
from math import cos, radians, sin
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector


def main() -> None:
    """Print the correlation of each pair."""
    folder, *lamps = sys.argv[sys.argv.index("--") + 1 :]
    scene = bpy.context.scene
    scene.render.engine = eevee()
    scene.view_settings.view_transform = "Standard"
    scene.world = None
    sun = next(obj for obj in scene.objects if obj.type == "LIGHT")
    sun.data.use_shadow = False
    for index, lamp in enumerate(lamps):
        azimuth, elevation = (radians(float(angle)) for angle in lamp.split(","))
        # In glTF, y is up and the azimuth is counted from z.
        direction = (
            cos(elevation) * sin(azimuth),
            -cos(elevation) * cos(azimuth),
            sin(elevation),
        )
        sun.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
        scene.render.filepath = str(Path(folder) / f"blender-{index}.png")
        scene.render.film_transparent = True
        bpy.ops.render.render(write_still=True)
        ours, theirs = pixels(scene.render.filepath), pixels(str(Path(folder) / f"{index}.png"))
        covered = ours[..., 3] == 1
        gray = [picture[..., :3].mean(axis=2)[covered] for picture in (ours, theirs)]
        print(
            f"azimuth, elevation {lamp}: correlation {np.corrcoef(gray)[0, 1]:.4f}, "
            f"means {gray[0].mean():.3f}, {gray[1].mean():.3f}",
            flush=True,
        )


def eevee() -> str:
    """Return the name of EEVEE in this Blender."""
    names = bpy.types.RenderSettings.bl_rna.properties["engine"].enum_items.keys()
    return "BLENDER_EEVEE_NEXT" if "BLENDER_EEVEE_NEXT" in names else "BLENDER_EEVEE"


def pixels(path: str) -> np.ndarray:
    """Return the (H, W, 4) values of a picture as they are stored."""
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    values = np.empty((image.size[1], image.size[0], 4), dtype=np.float32)
    image.pixels.foreach_get(values.ravel())
    return values


main()
