"""`texture`: draw a field as a texture for the UV map of a surface."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..compositor.flow import Drift
from ..compositor.look import Look, is_hatched
from ..compositor.picture import Picture, check_png_path
from ..compositor.shading import Light
from ..core.color import to_linear
from ..core.errors import RosyError
from ..core.file_io import replacing
from ..field.field import Field
from ..field.frames import unit_direction
from ..field.surface import Surface
from ..image_io.png import png_bytes
from ..projection.gbuffer import MeshInstance
from ..surface_texture.draw import CONTENTS, DEFAULT_MARGIN, DEFAULT_SIZE, draw_texture
from .field import warn
from .generators import uv_map
from .pictures import preset_look, upright_instance

#: Placeholder in a file name for the number of the UDIM tile, as in Blender.
UDIM_TOKEN = "<UDIM>"


class Texture:
    """A texture for the UV map of a surface. A notebook shows its first tile.

    A texture of hatching does not hold ink, but thresholds, from which a shader can draw the hatching for
    any light. Hatching has up to three layers of lines, whose lines get wider in darker tones. Red, green
    and blue are the thresholds of the first, second and third layer. From the tone, a shader computes which
    fraction of the paper a layer must cover. It draws ink where the threshold is below this fraction.
    Thresholds are data without a color space.

    Attributes
    ----------
    tiles : dict of int to Picture
        The pictures, by the numbers of their UDIM tiles. A texture without UDIM tiles has one picture, with
        the number 1001.
    overlap : float
        Fraction of the area of the UV map that is covered by more than one chart. There, several parts of
        the surface show the same texels.

    Examples
    --------
    >>> import rosyfields as rf
    >>> corners, uv = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0], [1, 0], [0, 1]]
    >>> triangle = rf.Surface(corners, [[0, 1, 2]], uv=uv)
    >>> texture = rf.texture(triangle, rf.along_uv(triangle), size=32)
    >>> texture.tiles
    {1001: <Picture: 32 x 32 pixels>}
    >>> texture.save("triangle.png")
    """

    def __init__(self, tiles: dict[int, Picture], overlap: float) -> None:
        self.tiles = tiles
        self.overlap = overlap

    def __repr__(self) -> str:
        size = self._first().rgba.shape[0]
        tiles = "" if len(self.tiles) == 1 else f", {len(self.tiles)} tiles"
        return f"<Texture: {size} x {size} texels{tiles}>"

    def _repr_png_(self) -> bytes:
        return self._first()._repr_png_()

    def _first(self) -> Picture:
        return self.tiles[min(self.tiles)]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write 8-bit ``.png`` files.

        Parameters
        ----------
        path : path-like
            ``<UDIM>`` in the name of the file stands for the number of the tile, as in Blender. All tiles are
            written, or none. If the path of a tile is a symbolic link, the link is replaced, not its target.

        Raises
        ------
        RosyError
            If the name does not end in ``.png``, it has no ``<UDIM>`` although there are several tiles, or a
            file cannot be written.
        """
        path = Path(path)
        if UDIM_TOKEN not in path.name:
            if len(self.tiles) > 1:
                raise RosyError(
                    f"{path}: the name of the file has no {UDIM_TOKEN} for the number of the tile"
                )
            self._first().save(path)
            return
        check_png_path(path)
        names = [path.name.replace(UDIM_TOKEN, str(number)) for number in self.tiles]
        with replacing(*map(path.with_name, names)) as temporaries:
            for temporary, picture in zip(temporaries, self.tiles.values(), strict=True):
                temporary.write_bytes(png_bytes(picture.rgba))


def texture(
    surface: Surface,
    field: Field | None = None,
    *,
    size: int = DEFAULT_SIZE,
    margin: int = DEFAULT_MARGIN,
    udim: bool = False,
    light_direction: ArrayLike | None = None,
    content: str = "look",
    flow_phase: float = 0.0,
    preset: str | os.PathLike[str] | None = None,
    color_values: str | ArrayLike | None = None,
    **settings: Any,
) -> Texture:
    """Draw a field as a texture for the UV map of a surface.

    Streamlines are traced on the surface, so no seams are visible, and lines have the same width on all
    charts. Light is left to the renderer that shows the texture. A texture of hatching has thresholds for a
    shader; see `Texture`.

    Parameters
    ----------
    surface : Surface
        The surface must have a UV map.
    field : Field, optional
        By default a field of degree 4 along the form of the surface; see `form`.
    size : int
        Width and height in texels.
    margin : int
        Width of the margin around charts, in texels. It avoids seams in mipmaps of the texture.
    udim : bool
        Whether each tile of the UV map has a picture of its own. Otherwise there is one
        picture, which repeats outside of the unit square.
    light_direction : (3,) array_like, optional
        Direction to a lamp, in the coordinates of the mesh. If it is given, hatching is drawn as ink in the
        light of this lamp, for renderers that have no shader for thresholds.
    content : {"look", "anisotropy", "flow"}
        What the texture shows. "look" is the picture of the look. The others are maps of the direction of
        the field that is nearest to the setting `guiding_angle`. Red and green are the components of this
        direction, from -1 to 1. In an anisotropy map (as in glTF) they are along the tangent and the
        bitangent, in a flow map along u and v. Blue is 1, or 0 where the field is undefined.
    flow_phase : float
        For a look with the setting `flow`, whose streaks drift and fade in a cycle: the phase in this cycle,
        0 to 1.
    preset : str or path-like, optional
        Name of a preset, or a ``.json`` file; see `list_presets`.
    color_values : str or (F,), (V,) or (C,) array_like, optional
        Values at faces, vertices or corners, or the name of an array. Streaks are colored by them with the
        color map; see `render`. Hatching cannot show them.
    **settings
        Settings of the look, after the preset: ``line_width=3, seed=3``. In these, a pixel is 1/1024 of the
        square root of the area of the surface, for any size of the texture. With ``unit="scene"`` and
        ``unit_size=0.002``, a length of 1 is 0.002 units of length of the mesh.

    Returns
    -------
    Texture

    Warns
    -----
    RosyWarning
        If charts overlap.

    Raises
    ------
    RosyError
        If there is no UV map, nothing can be drawn with it, a setting, the preset or the color values are
        invalid, or there is not enough memory.

    Examples
    --------
    >>> import rosyfields as rf
    >>> square = rf.Surface(
    ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    ...     [[0, 1, 2, 3]],
    ...     uv=[[0, 0], [1, 0], [1, 1], [0, 1]],
    ... )
    >>> rf.texture(square, rf.along_axis(square, (1, 1, 0), degree=2), size=64)
    <Texture: 64 x 64 texels>
    """
    look = texture_look(preset, settings, color_values is not None)
    if content not in CONTENTS:
        raise RosyError(f"content must be one of {', '.join(CONTENTS)}, not '{content}'")
    if not 0 <= flow_phase <= 1:
        raise RosyError(f"flow_phase must be a number from 0 to 1, not {flow_phase}")
    uv = uv_map(surface)
    instance = upright_instance(surface, field, color_values)
    lights = None if light_direction is None else [_lamp(light_direction, instance)]
    layout: dict[str, Any] = {"margin": margin, "is_udim": udim, "content": content}
    drawn = draw_texture(instance, uv, look, size, drift=Drift(flow_phase), lights=lights, **layout)
    warn(drawn.overlap_note(surface.name))
    tiles = {}
    for number, rgba in drawn.tiles().items():
        if drawn.is_data:  # display values, as pictures are saved
            rgba = np.concatenate([to_linear(rgba[..., :3]), rgba[..., 3:]], axis=-1)
        tiles[number] = Picture(rgba)
    return Texture(tiles, drawn.overlap)


def _lamp(light_direction: ArrayLike, instance: MeshInstance) -> Light:
    """Return a lamp in world space, given the direction to it in the coordinates of the mesh of `instance`.

    Raises
    ------
    RosyError
        If the direction is not three finite numbers, or all of them are 0.
    """
    direction = unit_direction(light_direction)
    if direction is None:
        raise RosyError(
            "light_direction must be three numbers, the direction to a lamp: not all of them 0"
        )
    world = np.asarray(instance.matrix)[:3, :3] @ direction
    return Light("sun", world / np.linalg.norm(world), np.ones(3), 1.0)


def texture_look(
    preset: str | os.PathLike[str] | None, settings: dict[str, Any], has_color_values: bool = False
) -> Look:
    """Return the look of a texture: a preset with some settings changed.

    `has_color_values` says whether there are values for the color map, by which streaks are then colored.

    Raises
    ------
    RosyError
        If a setting is invalid, or there are values for the color map although the look is
        one of hatching.
    """
    look = preset_look(preset).with_settings(settings)
    if has_color_values and is_hatched(look):
        raise RosyError("textures of hatching show no numbers as colors: choose the ink 'soft'")
    return replace(look, hue="values") if has_color_values else look
