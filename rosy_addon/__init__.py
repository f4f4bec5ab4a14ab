"""RoSy: draw N-way rotational symmetry fields on meshes, as LIC pictures and hatching.

A subpackage imports only from the subpackages above it::

    core                  errors, progress, settings, files, memory, color
    image_io              PNG and GIF files
    field                 surfaces and fields: formats, generation, analysis, editing
    projection            cameras, rasterizer, G-buffer and shadow maps
    annotation            singularities, arrowheads and keys over pictures
    compositor            pictures from G-buffers
    line_drawing          streamlines on surfaces, as strokes
    surface_texture       textures of the surface, for UV maps
    preset_files          stored looks
    worker                jobs, and the helper processes that compute for them
    rendering             pictures of views, drawn with numpy
    external              adapters to other libraries; only in the Python package
    gpu                   the renderer on the graphics card
    scene                 reading and writing Blender data
    jobs                  baking, strokes, animations: read the scene, draw, apply
    viewport              the live preview in the 3D view
    api                   the functions for scripts and notebooks
    ui                    properties, panels, preferences and overlay
    cli                   the command line
    extras                the command line of the Python package

Only ``scene``, ``jobs``, ``viewport``, ``ui``, ``cli`` and a file of ``gpu`` import Blender's modules. The public
names come from `api`, which is loaded when one of them is first used.
"""

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
    """Return a public name. When the first one is used, load all of them from `api`."""
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    from . import api

    for public_name in __all__:
        globals()[public_name] = getattr(api, public_name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
