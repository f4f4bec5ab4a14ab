"""Draw pictures with `render` and videos with `turntable`, and compute tones with `ambient_occlusion`."""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compositor.look import Look
from ..compositor.picture import Picture
from ..compositor.target_tone import ReferenceRender
from ..core.cache import Cache
from ..core.color import LUMINANCE_WEIGHTS, luminance, to_linear
from ..core.errors import RosyError
from ..field.field import Field, check_same_surface
from ..field.surface import Surface
from ..image_io.png import read_png
from ..preset_files.store import default_user_folder, load_preset, preset_files, read_preset
from ..projection.ambient_occlusion import DIRECTION_COUNT
from ..projection.ambient_occlusion import ambient_occlusion as corner_occlusion
from ..projection.camera import check_size, orbit_camera
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from ..rendering import turntable as turntable_video
from ..rendering.draw import draw_picture
from ..rendering.mesh_view import mesh_instance
from ..rendering.turntable import Encoder
from ..rendering.view_input import ViewInput
from .generators import form, uv_map

#: Azimuth and elevation of the default view in degrees: from the front left, looking slightly down.
DEFAULT_VIEW = (-25.0, 20.0)

#: Default width and height in pixels of a picture, and of a video.
DEFAULT_SIZE, DEFAULT_VIDEO_SIZE = (1024, 1024), (512, 512)

#: Number of samples per pixel along each axis, unless the preset sets it. Pictures of scenes need fewer, as
#: the renderer smooths their edges.
SUPERSAMPLING = 2

#: Value of `Look.tone` for each argument of `render` that gives a tone.
TONE_SOURCES = {"tone_values": "attribute", "tone_image": "image", "tone_picture": "picture"}

#: Name of the vertex attribute whose tone is the luminance of the vertex colors: Blender's name of colors.
VERTEX_COLOR = "Color"


def list_presets() -> dict[str, str]:
    """Return the descriptions of all presets by name: the presets of RoSy and your own.

    Examples
    --------
    >>> import rosyfields as rf
    >>> "engraving" in rf.list_presets()
    True
    """
    found = {}
    for key, path in preset_files(default_user_folder()).items():
        with suppress(RosyError):
            found[key] = read_preset(path).description
    return found


def ambient_occlusion(surface: Surface, directions: int = DIRECTION_COUNT) -> NDArray[np.float32]:
    """Return the ambient occlusion at the corners of a surface, as a tone for `render`.

    Parameters
    ----------
    surface : Surface
    directions : int
        Number of light directions, spread evenly over the sphere.

    Returns
    -------
    (C,) float32 ndarray
        Visible fraction of the hemisphere over each corner, weighted by the cosine of the angle to the
        normal: 1 is fully open, 0 fully occluded. Corners are listed face by face.

    Raises
    ------
    RosyError
        If `directions` is less than 1.

    Examples
    --------
    >>> import rosyfields as rf
    >>> square = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> rf.ambient_occlusion(square, directions=16)
    array([1., 1., 1., 1.], dtype=float32)
    """
    return corner_occlusion([mesh_instance(surface)], 0, directions)


def render(
    surface: Surface,
    field: Field | None = None,
    *,
    view: tuple[float, float] = DEFAULT_VIEW,
    size: tuple[int, int] = DEFAULT_SIZE,
    orthographic: bool = False,
    preset: str | os.PathLike[str] | None = None,
    color_values: str | ArrayLike | None = None,
    tone_values: str | ArrayLike | None = None,
    tone_image: str | os.PathLike[str] | ArrayLike | Picture | None = None,
    tone_picture: str | os.PathLike[str] | ArrayLike | Picture | None = None,
    workers: int = 0,
    **settings: Any,
) -> Picture:
    """Draw a field as a picture. The mesh fills the frame.

    Parameters
    ----------
    surface : Surface
    field : Field, optional
        By default a field of degree 4 along the form of the surface; see `form`.
    view : (float, float)
        Azimuth and elevation in degrees: (0, 0) is from the front, (90, 0) from the right, (0, 90)
        from above.
    size : (int, int)
        Width and height in pixels.
    orthographic : bool
        Orthographic projection instead of perspective.
    preset : str or path-like, optional
        Name of a preset, or a ``.json`` file; see `list_presets`.
    color_values : str or (F,), (V,) or (C,) array_like, optional
        Values at the faces, vertices or corners, such as the angle between two fields. Lines are colored by
        them through the setting `color_map`. NaN means that there is no value. A string names an array of
        `Surface.face_data` or `Surface.vertex_data`. If there are as many faces as vertices, the values
        belong to the faces. The setting `color_range` has the values at both ends of the color map.
    tone_values : str or (V,) or (C,) array_like, optional
        For hatching: linear tones at the vertices or corners, such as the result of `ambient_occlusion`. 0
        is dark and 1 is light. A string names an array of `Surface.vertex_data`. The name "Color" stands for
        the luminance of the vertex colors of a ``.ply`` file or of a mesh of trimesh or Open3D.
    tone_image : path-like, array_like or Picture, optional
        For hatching: an image for the UV map of the surface. Its luminance is the tone. An array holds sRGB
        display values, as uint8 or from 0 to 1, in rows from the top: (H, W), (H, W, 3) or (H, W, 4).
    tone_picture : path-like, array_like or Picture, optional
        For hatching: a picture of the surface from the same view, as a file, array or `Picture` like
        `tone_image`. Its luminance is the tone.
    workers : int
        Number of processes that draw a large picture together. 0 means one for each processor core. The
        picture does not depend on it.
    **settings
        Settings of the look, after the preset: ``length=120, seed=3``. See the page of looks.

    Returns
    -------
    Picture
        Transparent where there is no surface. The same arguments give the same bytes.

    Raises
    ------
    RosyError
        If a setting, the preset, the size or the view is invalid, the field is on another surface, or there
        is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> square = rf.Surface([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2, 3]])
    >>> field = rf.along_axis(square, (1, 1, 0), degree=2)
    >>> rf.render(square, field, view=(0, 90), size=(64, 64), preset="engraving")
    <Picture: 64 x 64 pixels>
    """
    sources: dict[str, Any] = {"tone_values": tone_values, "tone_image": tone_image}
    sources["color_values"] = color_values
    look = picture_look(surface.name, preset, settings, tone_picture=tone_picture, **sources)
    pixels = None if tone_picture is None else _image_luminance(tone_picture)
    instance = upright_instance(surface, field, **sources)
    points, frame = instance.face_points(), (*view, *check_size(*size))
    camera = orbit_camera(points, *frame, perspective=not orthographic)
    reference = None
    if pixels is not None:
        name = tone_picture if isinstance(tone_picture, (str, os.PathLike)) else "tone_picture"
        reference = ReferenceRender(pixels, camera, str(name))
    return draw_picture(ViewInput((instance,), camera, look, reference=reference), workers=workers)


def turntable(
    surface: Surface,
    field: Field | None = None,
    *,
    path: str | os.PathLike[str],
    pictures: int = 72,
    rate: float = 24.0,
    still: bool = False,
    view: tuple[float, float] = DEFAULT_VIEW,
    size: tuple[int, int] = DEFAULT_VIDEO_SIZE,
    orthographic: bool = False,
    preset: str | os.PathLike[str] | None = None,
    color_values: str | ArrayLike | None = None,
    tone_values: str | ArrayLike | None = None,
    tone_image: str | os.PathLike[str] | ArrayLike | Picture | None = None,
    workers: int = 0,
    encode: Encoder | None = None,
    on_picture: Callable[[int], None] | None = None,
    **settings: Any,
) -> Path:
    """Draw a field from all sides, as a video.

    Parameters
    ----------
    surface : Surface
    field : Field, optional
        By default a field of degree 4 along the form of the surface; see `form`.
    path : path-like
        Path of a ``.gif`` file, or of an ``.mp4`` file if there is an encoder.
    pictures : int
        Number of pictures in a full turn, 2 or more.
    rate : float
        Pictures per second.
    still : bool
        Keep the camera at the first view. The look must then have the setting `flow` above 0, so that
        streaks drift.
    view : (float, float)
        Azimuth of the first picture, and elevation, in degrees.
    size : (int, int)
        Width and height in pixels.
    orthographic : bool
        Orthographic projection instead of perspective.
    preset : str or path-like, optional
        Name of a preset of the look, or a ``.json`` file; see `list_presets`.
    color_values, tone_values, tone_image
        Values for the color map, and tones or an image of tones for hatching, as in `render`.
    workers : int
        Number of processes that draw a large picture together. 0 means one for each processor core.
    encode : function, optional
        Function that encodes the pictures in a folder as an ``.mp4`` file; its arguments are described by
        `rendering.turntable.Encoder`. By default ffmpeg, if it is installed.
    on_picture : function, optional
        Function that is called before each picture is drawn, with its number, from 1.
    **settings
        Settings of the look, after the preset: ``length=120, seed=3``.

    Returns
    -------
    Path
        Path of the video file. It is written after the last picture is drawn.

    Raises
    ------
    RosyError
        For the same reasons as `render`, or if the video cannot be written.

    Examples
    --------
    >>> import rosyfields as rf
    >>> torus = rf.Surface("torus.obj")
    >>> rf.turntable(torus, path="torus.gif", pictures=2, size=(32, 32)).name
    'torus.gif'

    A loop in which the streaks of a vector field drift:

    >>> field = rf.along_axis(torus, (0, 0, 1), degree=1)
    >>> rf.turntable(torus, field, path="flow.gif", pictures=2, size=(32, 32), still=True, flow=2).name
    'flow.gif'
    """
    path = Path(path)
    encode = default_encoder(path, encode)
    if pictures < 2 or not rate > 0:
        raise RosyError(f"{path}: a turntable needs 2 or more pictures, and a rate above 0")
    sources: dict[str, Any] = {"tone_values": tone_values, "tone_image": tone_image}
    sources["color_values"] = color_values
    look = picture_look(surface.name, preset, settings, **sources)
    turntable_video.check_still(look, still, surface.name)
    instance = upright_instance(surface, field, **sources)
    views = turntable_video.turntable_views(
        instance, look, pictures, check_size(*size), view, perspective=not orthographic, still=still
    )
    draw = partial(turntable_video.draw_next, cache=Cache(), keep_gbuffers=still, workers=workers)
    return turntable_video.turntable(draw, views, pictures, path, rate, encode, on_picture)


def picture_look(
    name: str, preset: str | os.PathLike[str] | None, settings: Mapping[str, Any], **sources: Any
) -> Look:
    """Return the look of a picture of a surface that is not in a scene of Blender.

    Parameters
    ----------
    name : str
        Name of the surface, for messages.
    preset : str or path-like or None
        Name of a preset, or a file.
    settings : mapping of str to object
        Settings of `Look`, by name. They take precedence over the settings of the preset.
    **sources
        The arguments `color_values`, `tone_values`, `tone_image` and `tone_picture` of `render`. Here it
        matters only which of them are not None.

    Raises
    ------
    RosyError
        If a setting is invalid, or more than one tone source is given.
    """
    look = preset_look(preset)
    if look.supersampling == Look().supersampling:
        look = replace(look, supersampling=SUPERSAMPLING)
    look = look.with_settings(dict(settings))
    tones = [tone for key, tone in TONE_SOURCES.items() if sources.get(key) is not None]
    if len(tones) > 1:
        raise RosyError(f"{name}: choose one source of the tone, {' or '.join(tones)}")
    look = replace(look, hue="values") if sources.get("color_values") is not None else look
    return replace(look, tone=tones[0]) if tones else look


def preset_look(preset: str | os.PathLike[str] | None) -> Look:
    """Return the look of a preset. If `preset` is None, return the default look."""
    return Look() if preset is None else load_preset(Path(preset), default_user_folder()).look


def default_encoder(path: Path, encode: Encoder | None) -> Encoder | None:
    """Return `encode`. If it is None and the file is an .mp4, return ffmpeg, or None without ffmpeg.

    Raises
    ------
    RosyError
        If the file name does not have the suffix of a video.
    """
    turntable_video.check_video_path(path)
    return find_ffmpeg() if encode is None and path.suffix.lower() == ".mp4" else encode


def find_ffmpeg() -> Encoder | None:
    """Return the encoder ffmpeg. None if it is not installed, or if this is the extension for Blender."""
    try:
        from ..external.ffmpeg import find_encoder
    except ImportError:  # the extension for Blender
        return None
    return find_encoder()


def upright_instance(
    surface: Surface,
    field: Field | None,
    color_values: str | ArrayLike | None = None,
    tone_values: str | ArrayLike | None = None,
    tone_image: str | os.PathLike[str] | ArrayLike | Picture | None = None,
) -> MeshInstance:
    """Return a surface with a field as a mesh instance, with its upward axis along z of world space.

    By default, the field is one of degree 4 along the form of the surface. `color_values` are values for the
    color map at faces, vertices or corners. `tone_values` are tones at vertices or corners, and `tone_image`
    is an image of tones for the UV map, used if there are no `tone_values`. All have the forms of `render`.
    """
    tone = _surface_tone(surface, tone_values, tone_image)
    numbers = corner_numbers(surface, color_values)
    field = form(surface) if field is None else field
    check_same_surface(surface, field)
    return mesh_instance(surface, field, tone, numbers)


def corner_numbers(surface: Surface, values: str | ArrayLike | None) -> NDArray[np.float32] | None:
    """Return the values for the color map at the corners of a surface; NaN where they are not finite.

    Parameters
    ----------
    surface : Surface
    values : str or (F,), (V,) or (C,) array_like or None
        The argument `color_values` of `render`.

    Returns
    -------
    (C,) float32 ndarray or None
        None if `values` is None.

    Raises
    ------
    RosyError
        If there is not one value for each face, vertex or corner, or no array has the given name.
    """
    if values is None:
        return None
    if isinstance(values, str):
        # An array of faces takes precedence over an array of vertices with the same name.
        data = {**surface.face_data, **surface.vertex_data, **surface.face_data}
        kinds = "attribute", "attributes of faces or vertices"
        values = _named_array(surface, values, data, *kinds)
    numbers = _at_corners(surface, values, "color_values", may_be_of_faces=True)
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers


def _at_corners(
    surface: Surface, values: ArrayLike, name: str, *, may_be_of_faces: bool = False
) -> NDArray[np.float32]:
    """Return (C,) values at the corners, given values at the vertices, corners or (if allowed) faces.

    Raises
    ------
    RosyError
        If the values are not numbers, or their number does not fit. The message begins with `name`, the name
        of the argument.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise RosyError(f"{surface.name}: {name} must be numbers") from None
    corners = np.arange(len(surface.corner_vertex))
    domains = [
        ("face", surface.face_count, surface.corner_face),
        ("vertex", len(surface.vertices), surface.corner_vertex),
        ("corner", len(corners), corners),
    ][0 if may_be_of_faces else 1 :]
    for _, count, element in domains:
        if array.shape == (count,):
            numbers: NDArray[np.float32] = array[element].astype(np.float32)
            return numbers
    expected = ", or ".join(f"{count:,} numbers, one for each {each}" for each, count, _ in domains)
    raise RosyError(
        f"{surface.name}: {name} must be {expected}, not an array of shape {array.shape}"
    )


def _named_array(
    surface: Surface, name: str, data: Mapping[str, NDArray[Any]], kind: str, kinds: str
) -> NDArray[Any]:
    """Return an array by name. `kind` and `kinds` are the words for one or several arrays in messages."""
    if name in data:
        return data[name]
    if not data:
        raise RosyError(f"{surface.name}: has no {kinds}; of mesh files, only .ply files have any")
    available = ", ".join(f"'{key}'" for key in data)
    raise RosyError(f"{surface.name}: there is no {kind} '{name}', only: {available}")


def _surface_tone(
    surface: Surface,
    values: str | ArrayLike | None,
    image: str | os.PathLike[str] | ArrayLike | Picture | None,
) -> SurfaceTone | None:
    """Return the tone from values at vertices or corners, or from an image on the UV map.

    None if neither is given.
    """
    if values is not None:
        if isinstance(values, str):
            values = _named_tone(surface, values)
        tone = _at_corners(surface, values, "tone_values")
        if not np.isfinite(tone).all():
            raise RosyError(f"{surface.name}: tone_values has values that are not finite")
        return SurfaceTone(tone[:, None])
    if image is not None:
        return SurfaceTone(uv_map(surface).astype(np.float32), _image_luminance(image))
    return None


def _named_tone(surface: Surface, name: str) -> NDArray[Any]:
    """Return (V,) tones: the vertex attribute `name`; for "Color", the linear luminance of vertex colors."""
    data = surface.vertex_data
    rgb = [data.get(channel) for channel in ("red", "green", "blue")]
    if name == VERTEX_COLOR and all(channel is not None for channel in rgb):
        return to_linear(np.stack(rgb, axis=1)) @ LUMINANCE_WEIGHTS  # type: ignore[arg-type]
    values = _named_array(surface, name, data, "vertex attribute", "vertex attributes")
    if not np.isfinite(values).all():
        raise RosyError(
            f"{surface.name}: the vertex attribute '{name}' has values that are not finite"
        )
    return values


def _image_luminance(image: str | os.PathLike[str] | ArrayLike | Picture) -> NDArray[np.float32]:
    """Return the linear luminance of an image, (H, W), with the bottom row first.

    The image is a picture, a .png file, or an array of sRGB display values, uint8 or from 0 to 1, with the
    top row first: (H, W), (H, W, 3) or (H, W, 4).
    """
    if isinstance(image, Picture):
        return luminance(image.rgba)
    if isinstance(image, (str, os.PathLike)):
        return luminance(read_png(image))
    array = np.asarray(image)
    if array.ndim not in (2, 3) or (array.ndim == 3 and array.shape[2] not in (3, 4)):
        raise RosyError(
            f"an image must have the shape (H, W), (H, W, 3) or (H, W, 4), not {array.shape}"
        )
    if array.ndim == 2:
        array = np.repeat(array[..., None], 3, axis=2)
    scale = 255.0 if array.dtype == np.uint8 else 1.0
    linear = to_linear(np.asarray(array[::-1, :, :3], dtype=np.float32) / scale)
    alpha = array[::-1, :, 3:] / scale if array.shape[2] == 4 else np.ones_like(linear[..., :1])
    return luminance(np.concatenate([linear, alpha], axis=2).astype(np.float32))
