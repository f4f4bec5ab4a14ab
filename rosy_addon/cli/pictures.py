"""The commands `render`, `turntable` and `texture`: draw pictures, videos and textures of a mesh file."""

from contextlib import suppress
from pathlib import Path
from typing import Any

from .. import api
from ..api.pictures import find_ffmpeg
from ..api.textures import UDIM_TOKEN, texture_look
from ..core.errors import RosyError
from ..rendering.turntable import NO_ENCODER, Encoder, check_video_path
from ..surface_texture.draw import CONTENTS, MAX_MARGIN, MAX_SIZE, MIN_SIZE
from .mesh_field import add_mesh_options, load_mesh_and_field
from .options import CommandParser, Options, add_subcommand, float_between, float_tuple, int_between
from .scene import import_blender
from .streams import print_line


def add_render_command(subparsers: Any) -> None:
    """Add the command `render`."""
    parser = add_subcommand(subparsers, run_render, api.render)
    add_mesh_options(parser)
    parser.add_output_option("OUT.png")
    parser.add_picture_options()
    text = "take the tone from a picture of the same mesh in the same view"
    parser.add_value("--tone-picture", "PICTURE.png", text, Path)


def run_render(options: Options) -> None:
    """Draw the field of a mesh file as a picture."""
    options.check_output(".png")
    arguments = options.picture_arguments(api.render, options.mesh)
    surface, field = load_mesh_and_field(options)
    api.render(surface, field, **arguments).save(options.output)


def add_turntable_command(subparsers: Any) -> None:
    """Add the command `turntable`."""
    parser = add_subcommand(subparsers, run_turntable, api.turntable)
    add_mesh_options(parser)
    parser.add_output_option("OUT.mp4|OUT.gif")
    text = "pictures in a full turn (%(default)d)"
    parser.add_value("--pictures", "N", text, int_between(2, 10_000))
    add_rate_option(parser)
    text = "leave the camera where it is: only streaks drift, as the setting flow says"
    parser.add_switch("--still", text)
    parser.add_picture_options()


def add_rate_option(parser: CommandParser) -> None:
    """Add the option --rate, the frame rate of a video."""
    parser.add_value("--rate", "N", "pictures per second (%(default)g)", float_between(0.1, 1000.0))


def run_turntable(options: Options) -> None:
    """Draw the field of a mesh file from all sides, as a video."""
    options.check_output()
    check_video_path(options.output)
    arguments = options.picture_arguments(api.turntable, options.mesh)
    encode = video_encoder(options)

    def announce(number: int) -> None:
        print_line(f"picture {number} of {options.pictures}")

    surface, field = load_mesh_and_field(options)
    arguments |= {"path": options.output, "encode": encode, "on_picture": announce}
    api.turntable(surface, field, **arguments)


def video_encoder(options: Options) -> Encoder | None:
    """Return an encoder (ffmpeg or Blender) if the output is an .mp4 file; None if it is a .gif.

    Raises
    ------
    RosyError
        If the output is an .mp4 file and there is no encoder.
    """
    if options.output.suffix.lower() != ".mp4":
        return None
    find_blender_encoder, encode = options.extras.find_blender_encoder, None
    if find_blender_encoder is not None and options.blender is not None:
        encode = find_blender_encoder(options.blender)
    encode = encode or find_ffmpeg()
    if encode is None:
        with suppress(ImportError):
            import_blender()
            from ..scene.video import encode_video as encode
    if encode is None and find_blender_encoder is not None:
        encode = find_blender_encoder(None)
    if encode is None:
        raise RosyError(f"{options.output}: {NO_ENCODER}")
    return encode


def add_texture_command(subparsers: Any) -> None:
    """Add the command `texture`."""
    parser = add_subcommand(subparsers, run_texture, api.texture)
    add_mesh_options(parser)
    text = f"{UDIM_TOKEN} in the name stands for the number of a tile: each has a file of its own"
    parser.add_output_option("OUT.png", text)
    text = "width and height in texels (%(default)d)"
    parser.add_value("--size", "N", text, int_between(MIN_SIZE, MAX_SIZE))
    text = "width of the margin around charts, in texels (%(default)d)"
    parser.add_value("--margin", "N", text, int_between(0, MAX_MARGIN))
    text = "direction to a lamp, in the axes of the mesh: draw its hatching as ink, and not thresholds for a shader"
    parser.add_value("--light-direction", "X,Y,Z", text, float_tuple(3, "X,Y,Z"))
    texts = [f"{name}: {text[0].lower()}{text[1:]}" for name, text in CONTENTS.items()]
    parser.add_argument("--content", choices=list(CONTENTS), help="; ".join(texts))
    parser.add_look_options()


def run_texture(options: Options) -> None:
    """Draw the field of a mesh file as a texture for its UV map."""
    options.check_output(".png")
    # Errors in the options are reported before the mesh is read.
    texture_look(options.requested_preset(), options.requested_settings())
    surface, field = load_mesh_and_field(options)
    arguments = options.api_arguments(api.texture, udim=UDIM_TOKEN in options.output.name)
    api.texture(surface, field, **arguments).save(options.output)
