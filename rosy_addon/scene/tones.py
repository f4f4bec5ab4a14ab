"""Where tones come from in a scene: attributes and images on meshes, and pictures of the scene."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..compositor.colour import luminance, to_linear
from ..compositor.look import Look
from ..compositor.tone import Rendered
from ..errors import RosyError
from ..field.surface import Surface
from ..projection.tone import SurfaceTone
from ..reuse import Kept, digest
from .attributes import attribute_numbers
from .cameras import camera_of_object, picture_size
from .capabilities import has_properties


@dataclass(frozen=True)
class ToneWish:
    """What surfaces are asked for their tone.

    Attributes
    ----------
    kind : {"attribute", "image"}
    attribute : str
        Its name; that of the mesh's active colour if empty.
    """

    kind: str
    attribute: str = ""


def tone_wish(scene: bpy.types.Scene, look: Look) -> ToneWish | None:
    """What a look wants of the surfaces of a scene; None if nothing."""
    if look.tone == "attribute":
        return ToneWish("attribute", scene.rosy.tone_attribute)
    return ToneWish("image") if look.tone == "image" else None


def read_tone(
    mesh: bpy.types.Mesh,
    owner: bpy.types.Object,
    surface: Surface,
    wish: ToneWish | None,
    kept: Kept | None = None,
) -> SurfaceTone | None:
    """The tone that a mesh has of its own.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated.
    owner : bpy.types.Object
        The original object.
    surface : Surface
        Of the mesh.
    wish : ToneWish or None
    kept : Kept, optional
        Where a tone that has not changed is found.

    Returns
    -------
    SurfaceTone or None
        None if it has no such attribute, or no image.

    Raises
    ------
    RosyError
        If the attribute holds no numbers, the image cannot be read, or there is no UV map.
    """
    if wish is None:
        return None
    label = f"object '{owner.name}'"
    if wish.kind == "attribute":
        values, image = _corner_numbers(mesh, surface, wish.attribute, label), None
    else:
        image = owner.rosy.tone_image if has_properties() else None
        values = None if image is None else _uv(mesh, owner.rosy.tone_uv_map, label)
        image = None if image is None else image_luminance(image)
    if values is None:
        return None
    if kept is None:
        return SurfaceTone(values, image)
    key = "tone", digest(values, image)
    return kept.find_or_make(key, lambda: SurfaceTone(values, image))


def image_key(owner: bpy.types.Object, wish: ToneWish | None) -> tuple[str, ...]:
    """What is chosen on an object for a wish: another one is read anew."""
    if wish is None or wish.kind != "image" or not has_properties():
        return ()
    image = owner.rosy.tone_image
    return ("" if image is None else image.name_full, owner.rosy.tone_uv_map)


def check_tones(
    wish: ToneWish | None, found: Sequence[tuple[SurfaceTone | None, bpy.types.Object]]
) -> None:
    """Refuse a wish that no surface meets.

    Raises
    ------
    RosyError
        With what there is instead.
    """
    if wish is None or any(tone is not None for tone, _ in found):
        return
    names = ", ".join(f"'{thing.name}'" for thing in dict.fromkeys(owner for _, owner in found))
    if wish.kind == "image":
        raise RosyError(f"no image is chosen for the tone of {names}")
    if not wish.attribute:
        raise RosyError(f"there are no vertex colours on {names}: choose an attribute for the tone")
    there = dict.fromkeys(
        attribute.name
        for _, owner in found
        for attribute in owner.data.attributes
        if attribute.data_type in ("FLOAT", "FLOAT_COLOR", "BYTE_COLOR")
        and not attribute.name.startswith(".")
    )
    others = ", ".join(f"'{name}'" for name in there) or "none that would do"
    raise RosyError(
        f"there is no attribute '{wish.attribute}' for the tone on {names}; there is {others}"
    )


def _corner_numbers(
    mesh: bpy.types.Mesh, surface: Surface, name: str, label: str
) -> np.ndarray | None:
    """(C, 1) float32 numbers of an attribute at the corners; None if there are none."""
    name = name or mesh.color_attributes.active_color_name
    attribute = mesh.attributes.get(name)
    if attribute is None or not len(attribute.data):  # none is readable in edit mode
        return None
    source = f"{label}, attribute '{name}'"
    values = attribute_numbers(attribute, source)
    if not np.isfinite(values).all():
        raise RosyError(f"{source}: has values that are not finite")
    if attribute.domain == "POINT":
        values = values[surface.corner_vertex]
    elif attribute.domain == "FACE":
        values = values[surface.corner_face]
    return values[:, None].astype(np.float32)


def _uv(mesh: bpy.types.Mesh, name: str, label: str) -> np.ndarray:
    """(C, 2) float32 places on a UV map, the active one if no name is given."""
    layer = mesh.uv_layers.get(name) if name else mesh.uv_layers.active
    if layer is None:
        what = f"no UV map '{name}'" if name else "no UV map"
        raise RosyError(f"{label}: its mesh has {what} for the image of its tone")
    values = np.empty(2 * len(mesh.loops), dtype=np.float32)
    layer.uv.foreach_get("vector", values)
    return values.reshape(-1, 2)


def image_luminance(image: bpy.types.Image) -> np.ndarray:
    """(H, W) float32 linear luminance of an image, on white where it is transparent.

    Raises
    ------
    RosyError
        If it has no pixels.
    """
    width, height = image.size
    if not (width and height and len(image.pixels)):
        raise RosyError(f"image '{image.name}': has no pixels; is its file there?")
    rgba = np.empty(4 * width * height, dtype=np.float32)
    image.pixels.foreach_get(rgba)
    rgba = rgba.reshape(height, width, 4)
    alpha = rgba[..., 3:]
    if image.is_float:
        # Those are premultiplied.
        np.divide(rgba[..., :3], alpha, out=rgba[..., :3], where=alpha > 0)
    elif image.colorspace_settings.name != "Non-Color":
        rgba[..., :3] = to_linear(rgba[..., :3])
    return luminance(rgba)


def rendered_path(scene: bpy.types.Scene) -> Path:
    """The file of the picture that a scene's tone is to come from, at its frame.

    A row of # stands for the number of the frame.

    Raises
    ------
    RosyError
        If none is named.
    """
    named = scene.rosy.tone_picture
    if not named:
        raise RosyError("the tone is to come from a picture: choose its file under Look > Tone")
    numbered = re.sub("#+", lambda row: f"{scene.frame_current:0{len(row[0])}d}", named)
    return Path(bpy.path.abspath(numbered))


def read_rendered(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    camera: bpy.types.Object,
    look: Look,
    shown: np.ndarray | None = None,
) -> Rendered | None:
    """The picture that the tone of a look is to come from; None if it does not come from one.

    Parameters
    ----------
    scene : bpy.types.Scene
        At the frame of the picture.
    depsgraph : bpy.types.Depsgraph
    camera : bpy.types.Object
        Through which it was made.
    look : Look
    shown : (H, W) ndarray, optional
        The luminance of the picture, if it has been read.

    Raises
    ------
    RosyError
        If there is none, it cannot be read, or it is not of the shape of renders.
    """
    if look.tone != "picture":
        return None
    path = rendered_path(scene)
    view = camera_of_object(scene, depsgraph, camera, *picture_size(scene))
    return Rendered(file_luminance(path) if shown is None else shown, view, str(path))


def file_luminance(path: Path) -> np.ndarray:
    """(H, W) float32 of a picture that Blender can read."""
    try:
        image = bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError as reason:
        why = str(reason).strip().splitlines()[-1].removeprefix("Error: ")
        raise RosyError(f"{path}: cannot be read: {why}") from None
    try:
        return image_luminance(image)
    except RosyError:
        raise RosyError(f"{path}: is no picture that Blender can read") from None
    finally:
        bpy.data.images.remove(image)
