"""Make the input of a renderer for a mesh that is not in a scene of Blender, such as a mesh from a file."""

from __future__ import annotations

import numpy as np

from ..compositor.look import Look
from ..compositor.target_tone import ReferenceRender
from ..core.errors import RosyError
from ..field.rosy_field import RosyField
from ..field.surface import Surface
from ..field.up_axis import UP_AXIS_MATRIX
from ..projection.camera import orbit_camera
from ..projection.gbuffer import MeshInstance
from ..projection.surface_tone import SurfaceTone
from .view_input import ViewInput


def mesh_instance(
    surface: Surface,
    field: RosyField | None = None,
    tone: SurfaceTone | None = None,
    color_values: np.ndarray | None = None,
) -> MeshInstance:
    """Return a surface as a mesh instance, rotated so that its upward axis is the z axis of world space.

    Parameters
    ----------
    surface : Surface
        The mesh. `Surface.up` is its upward axis.
    field : RosyField, optional
        Field on the faces. Without a field the mesh only hides what is behind it.
    tone : SurfaceTone, optional
        How light or dark the surface is drawn.
    color_values : (C,) float32 ndarray, optional
        Values for the color map, at the C corners of the mesh.
    """
    return MeshInstance(surface, UP_AXIS_MATRIX[surface.up], field, tone, color_values)


def mesh_view(
    instance: MeshInstance,
    look: Look,
    view_angles: tuple[float, float],
    size: tuple[int, int],
    *,
    perspective: bool = True,
    reference_luminance: np.ndarray | None = None,
    reference_name: str = "",
) -> ViewInput:
    """Return the input for a picture of one mesh, from a camera in whose frame the mesh just fits.

    Parameters
    ----------
    instance : MeshInstance
    look : Look
    view_angles : (float, float)
        Azimuth and elevation of the camera in degrees; see `orbit_camera`.
    size : (int, int)
        Width and height of the picture in pixels.
    perspective : bool
        Whether the camera is perspective. If not, it is orthographic.
    reference_luminance : (H, W) ndarray, optional
        Linear luminance of a picture from the same view. A look with the tone "picture" takes its tone from
        it.
    reference_name : str
        Name of that picture in messages.

    Raises
    ------
    RosyError
        If the look uses the lights of a scene, or the size or the angles are impossible.
    """
    check_light(look.light, instance.surface.name)
    camera = orbit_camera(instance.face_points(), *view_angles, *size, perspective=perspective)
    reference = None
    if reference_luminance is not None:
        reference = ReferenceRender(reference_luminance, camera, reference_name)
    return ViewInput((instance,), camera, look, reference=reference)


def check_light(light: str, name: str) -> None:
    """Check that a look or style does not ask for the lights of a scene, for a mesh that is not in one.

    Parameters
    ----------
    light : str
        `Look.light` or `StrokeStyle.light`.
    name : str
        Name of the mesh in the message.

    Raises
    ------
    RosyError
        If the light is "scene".
    """
    if light == "scene":
        raise RosyError(
            f"{name}: has no lights, because it is not in a scene: choose the light 'headlight' or 'lamp'"
        )
