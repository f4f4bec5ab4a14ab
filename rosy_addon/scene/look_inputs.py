"""Read the inputs of a look other than fields: tones, values for the color map, and reference renders.

A `ReadRequest` says which of them a look needs from the meshes. Tones are read from mesh attributes or from
images that are mapped to meshes, values for the color map from mesh attributes, and reference renders (renders
of the scene whose luminance is used as the tone) from files.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from bpy.types import Depsgraph, Image, Mesh, Object, Scene

from ..compositor.look import Look, colors_values
from ..compositor.target_tone import ReferenceRender
from ..core.cache import Cache, cached, content_hash
from ..core.color import luminance, to_linear
from ..core.errors import RosyError
from ..core.file_io import check_readable
from ..core.memory import check_memory
from ..field.blocks import ROWS_PER_BLOCK, row_blocks
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from .cameras import camera_of_object
from .datablocks import has_rosy_properties
from .face_values import COLOR_TYPES, corner_scalars, filled_attribute
from .meshes import read_uvs

#: Memory in bytes of each pixel while the luminance of an image is read: four float32 numbers, and the luminance in
#: blocks and as a whole.
LUMINANCE_BYTES = 4 * 4 + 2 * 4


@dataclass(frozen=True)
class ReadRequest:
    """What to read from the meshes of a scene besides their shapes and fields.

    Attributes
    ----------
    nonfinite : {"error", "zero"}
        Raise an error if a vector is not finite, or treat it as undefined.
    tone : {"", "attribute", "image"}
        Read the tones of surfaces (how light or dark they are drawn) from a mesh attribute, from the image
        that is chosen on each object, or not at all.
    tone_attribute : str
        Name of the attribute. If it is empty, the active color attribute of each mesh is read.
    color_attribute : str or None
        Name of the attribute with the values for the color map. None: no values are read.
    """

    nonfinite: str = "error"
    tone: str = ""
    tone_attribute: str = ""
    color_attribute: str | None = None


#: A request for nothing but shapes and fields.
FIELDS_ONLY = ReadRequest()


def read_request(scene: Scene, look: Look) -> ReadRequest:
    """Return what to read from the meshes of a scene to draw a look, with the settings of the scene."""
    tone = look.tone if look.tone in ("attribute", "image") else ""
    attribute = scene.rosy.tone_attribute if tone == "attribute" else ""
    return ReadRequest(nonfinite_policy(scene), tone, attribute, color_attribute_of(scene, look))


def nonfinite_policy(scene: Scene) -> str:
    """Return how vectors that are not finite are treated, by the setting of a scene: "zero" or "error"."""
    return "zero" if scene.rosy.undefined else "error"


def color_attribute_of(scene: Scene, look: Look) -> str | None:
    """Return the name of the attribute with values for the color map; None if the look does not use it."""
    return scene.rosy.color_attribute if colors_values(look) else None


# --- tones and values for the color map ---------------------------------------------------------------


def read_tone(
    mesh: Mesh, owner: Object, request: ReadRequest, cache: Cache | None = None
) -> SurfaceTone | None:
    """Read the surface tone of a mesh.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated mesh.
    owner : bpy.types.Object
        The original object.
    request : ReadRequest
    cache : Cache, optional
        Keeps tones that have not changed since an earlier call.

    Returns
    -------
    SurfaceTone or None
        None if no tone is requested, the mesh has no such attribute, or no image is chosen on the object.

    Raises
    ------
    RosyError
        If the type of the attribute is not supported, a value is not finite, the image cannot be
        read, or there is no UV map.
    """
    if not request.tone:
        return None
    label, image = f"object '{owner.name}'", None
    if request.tone == "attribute":
        name = request.tone_attribute or mesh.color_attributes.active_color_name
        attribute = filled_attribute(mesh, name)
        if attribute is None:
            return None
        source = f"{label}, attribute '{attribute.name}'"
        numbers = corner_scalars(attribute, mesh, source)
        if not np.isfinite(numbers).all():
            raise RosyError(f"{source}: has values that are not finite")
        values = numbers[:, None].astype(np.float32)
    else:
        tone_image = owner.rosy.tone_image if has_rosy_properties() else None
        if tone_image is None:
            return None
        values = read_uvs(mesh, owner.rosy.tone_uv_map, label)
        image = image_luminance(tone_image)
    return cached(cache, lambda: SurfaceTone(values, image), "tone", values, image)


def tone_digest(mesh: Mesh, owner: Object, request: ReadRequest) -> bytes:
    """Return a digest of the result of `read_tone`; empty if the mesh has no tone.

    If the tone cannot be read, a digest of the error message is returned.
    """
    try:
        tone = read_tone(mesh, owner, request)
    except RosyError as error:
        return content_hash(str(error))
    return b"" if tone is None else content_hash(tone.values, tone.image)


def tone_image_key(owner: Object, request: ReadRequest) -> tuple[str, ...]:
    """Return a cache key for the tone image and UV map of an object; empty if the tone is not an image."""
    if request.tone != "image" or not has_rosy_properties():
        return ()
    image = owner.rosy.tone_image
    return ("" if image is None else image.name_full, owner.rosy.tone_uv_map)


def read_color_values(
    mesh: Mesh, name: str | None, label: str, cache: Cache | None = None
) -> np.ndarray | None:
    """Read the values for the color map from a mesh attribute.

    Parameters
    ----------
    mesh : bpy.types.Mesh
        Evaluated mesh.
    name : str or None
        Name of the attribute. None: nothing is read.
    label : str
        Name of the object in messages.
    cache : Cache, optional
        Keeps values that have not changed since an earlier call.

    Returns
    -------
    (C,) float32 ndarray or None
        Values at the corners; NaN where a value is not finite. None if the mesh has no such attribute.

    Raises
    ------
    RosyError
        If the type of the attribute is not supported.
    """
    attribute = filled_attribute(mesh, name) if name else None
    if attribute is None:
        return None
    source = f"{label}, attribute '{attribute.name}'"
    values = corner_scalars(attribute, mesh, source).astype(np.float32)
    values[~np.isfinite(values)] = np.nan
    return cached(cache, lambda: values, "color values", values)


def color_values_digest(mesh: Mesh, name: str | None) -> bytes:
    """Return a digest of the result of `read_color_values`; empty if the mesh has no such attribute.

    If the attribute cannot be read, a digest of the error message is returned.
    """
    try:
        values = read_color_values(mesh, name, mesh.name)
    except RosyError as error:
        return content_hash(str(error))
    return b"" if values is None else content_hash(values)


def check_sources(with_field: Sequence[tuple[MeshInstance, Object]], request: ReadRequest) -> None:
    """Check that the requested tones and values for the color map were found on some mesh with a field.

    At least one mesh must have a tone, if tones are requested. At least one mesh must have values for the
    color map, if these are requested.

    Parameters
    ----------
    with_field : sequence of (MeshInstance, bpy.types.Object)
        Each mesh instance with a field, and its original object.
    request : ReadRequest
        What was to be read.

    Raises
    ------
    RosyError
        If no mesh has them. The message lists the attributes that exist.
    """
    tone, numbers = request.tone, request.color_attribute
    owners = list(dict.fromkeys(owner for _, owner in with_field))
    names = ", ".join(f"'{owner.name}'" for owner in owners)
    if tone and all(instance.tone is None for instance, _ in with_field):
        if tone == "image":
            problem = "choose an image for the tone, in the properties of the object"
        elif not request.tone_attribute:
            problem = "there is no color attribute: choose an attribute for the tone"
        else:
            listing = _attribute_listing(owners, ("FLOAT", *COLOR_TYPES))
            name = request.tone_attribute
            problem = f"there is no attribute '{name}' for the tone, only {listing}"
        raise RosyError(f"{names}: {problem}")
    if numbers is not None and all(instance.color_values is None for instance, _ in with_field):
        # Boolean attributes are not listed, as most of them are Blender's own.
        listing = _attribute_listing(owners, ("FLOAT", "INT", *COLOR_TYPES))
        problem = f"there is no attribute '{numbers}' for the colors, only {listing}"
        if not numbers:
            problem = f"choose an attribute for the colors, under Look > Color: {listing}"
        raise RosyError(f"{names}: {problem}")


def _attribute_listing(owners: Sequence[Object], types: Sequence[str]) -> str:
    """Return the names of all attributes of objects with a data type in `types`, as text for a message."""
    available = dict.fromkeys(
        attribute.name
        for owner in owners
        for attribute in owner.data.attributes
        if attribute.data_type in types
        and attribute.domain in ("POINT", "FACE", "CORNER")
        and not attribute.name.startswith(".")
    )
    return ", ".join(f"'{name}'" for name in available) or "no suitable one"


# --- reference renders -------------------------------------------------------------------------------


def reference_path(scene: Scene) -> Path:
    """Return the path of the reference render for the current frame of a scene.

    In the path that the user has chosen, a run of ``#`` is replaced by the frame number, padded with zeros to
    its length.

    Raises
    ------
    RosyError
        If no file is chosen.
    """
    pattern = scene.rosy.tone_picture
    if not pattern:
        raise RosyError("tone 'picture' needs a picture: choose a file under Look > Tone")
    filename = re.sub("#+", lambda match: f"{scene.frame_current:0{len(match[0])}d}", pattern)
    return Path(bpy.path.abspath(filename))


def input_files() -> list[str]:
    """Return the paths of the files that drawing reads, which RoSy must not replace.

    These are the open .blend file, what it links for its objects (libraries, caches of simulations, fonts and
    volumes), and the images and reference renders of tones.
    """
    blocks = [*bpy.data.libraries, *bpy.data.cache_files, *bpy.data.fonts, *bpy.data.volumes]
    blocks += [obj.rosy.tone_image for obj in bpy.data.objects if obj.rosy.tone_image is not None]
    paths = [bpy.path.abspath(block.filepath, library=block.library) for block in blocks]
    paths += [str(reference_path(scene)) for scene in bpy.data.scenes if scene.rosy.tone_picture]
    return [bpy.data.filepath, *paths]


def load_reference(
    scene: Scene, depsgraph: Depsgraph, camera: Object, picture_luminance: np.ndarray | None = None
) -> ReferenceRender:
    """Return the reference render from which looks with the tone "picture" take their tone.

    Parameters
    ----------
    scene : bpy.types.Scene
        The scene, at the frame of the reference render.
    depsgraph : bpy.types.Depsgraph
    camera : bpy.types.Object
        The camera that the reference render was rendered from.
    picture_luminance : (H, W) ndarray, optional
        The luminance of the reference render. By default it is read from the file.

    Raises
    ------
    RosyError
        If no file is chosen, the file cannot be read, or the picture does not
        have the aspect ratio of renders.
    """
    path = reference_path(scene)
    reference_camera = camera_of_object(scene, depsgraph, camera)
    if picture_luminance is None:
        picture_luminance = load_luminance(path)
    return ReferenceRender(picture_luminance, reference_camera, str(path))


def load_luminance(path: Path) -> np.ndarray:
    """Read the linear luminance of an image file with Blender: (H, W) float32, rows from the bottom.

    Raises
    ------
    RosyError
        If Blender cannot read the file, or it is not a regular file.
    """
    check_readable(path)
    try:
        image = bpy.data.images.load(str(path), check_existing=False)
    except RuntimeError as reason:
        message = str(reason).strip().splitlines()[-1].removeprefix("Error: ")
        raise RosyError(f"{path}: cannot be read: {message}") from None
    try:
        return image_luminance(image)
    except RosyError:
        raise RosyError(f"{path}: is not a picture that Blender can read") from None
    finally:
        bpy.data.images.remove(image)


def image_luminance(image: Image) -> np.ndarray:
    """Return the linear luminance of an image over white, (H, W) float32, rows from the bottom.

    Raises
    ------
    RosyError
        If the image has no pixels, or there is not enough memory.
    """
    width, height = image.size
    if not (width and height and len(image.pixels)):
        raise RosyError(f"image '{image.name}' has no pixels: check the path of its file")
    subject = f"image '{image.name}': a tone of {width} x {height} pixels"
    check_memory(LUMINANCE_BYTES * width * height, subject, "choose a smaller image")
    pixels = np.empty((height, width, 4), dtype=np.float32)
    image.pixels.foreach_get(pixels.reshape(-1))

    def block_luminance(rgba: np.ndarray) -> np.ndarray:
        alpha = rgba[..., 3:]
        if image.is_float:
            # Float images have premultiplied alpha.
            np.divide(rgba[..., :3], alpha, out=rgba[..., :3], where=alpha > 0)
        elif image.colorspace_settings.name != "Non-Color":
            rgba[..., :3] = to_linear(rgba[..., :3])
        return luminance(rgba)

    blocks = row_blocks(height, max(ROWS_PER_BLOCK // width, 1))
    return np.concatenate([block_luminance(pixels[block]) for block in blocks])
