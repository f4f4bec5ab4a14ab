"""RoSy: draw N-way rotational symmetry fields on meshes, as LIC pictures and hatching.

A package imports only from those above it::

    core                  errors, progress, settings, files, memory: what all others import
    field                 surfaces and fields: formats, generation, analysis, editing
    projection            cameras, rasterizer, G-buffer and shadow maps
    compositor            pictures from G-buffers
    line_drawing          streamlines on surfaces, as strokes
    surface_texture       textures of the surface, for UV maps
    worker                jobs, and the helper processes that compute for them
    rendering, image_io   pictures of views, drawn with numpy; image files
    gpu, preset_files     the renderer on the graphics card; stored looks and stroke settings
    scene                 reading and writing Blender data
    jobs                  baking, strokes, animations: read the scene, draw, apply
    viewport              the live preview in the 3D view
    ui                    properties, panels, preferences and overlay
    api                   the functions for scripts and notebooks
    cli                   the command line

``core``, ``field``, ``projection``, ``compositor``, ``line_drawing``, ``surface_texture``, ``worker``, ``rendering``,
``image_io`` and ``preset_files`` do not import bpy and need only numpy. The public names are those of `api`. They are
loaded when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

# ruff: noqa: F403, F405
if TYPE_CHECKING:
    from .api import *

__all__ = [
    "Comparison",
    "Difference",
    "Drawing",
    "Field",
    "Picture",
    "RosyError",
    "RosyWarning",
    "Singularities",
    "Surface",
    "Texture",
    "along_axis",
    "along_uv",
    "ambient_occlusion",
    "compare",
    "curvature",
    "features",
    "figure",
    "film",
    "form",
    "from_angles",
    "from_array",
    "from_directions",
    "from_representation",
    "from_tensors",
    "from_vectors",
    "guided",
    "list_presets",
    "prescribed",
    "read_field",
    "render",
    "save_figures",
    "smoothest",
    "strokes",
    "texture",
    "turntable",
]


def __getattr__(name: str) -> Any:
    """Load the public names when one of them is used."""
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    from . import api

    for public_name in __all__:
        globals()[public_name] = getattr(api, public_name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
