"""The functions and classes for scripts and notebooks; the commands for mesh files use them as well.

Angles are in radians, except those of a view, which are in degrees.

    surface      `Surface`: a mesh from arrays, a file or another library
    field        `Field`: a field on a surface; fields from arrays and files
    generators   fields that are computed
    pictures     pictures and turntables
    films        films of fields that change with time
    comparison   how fields differ
    figures      fields side by side, with their keys
    drawings     strokes
    textures     textures
"""

from ..errors import RosyError, RosyWarning
from .comparison import Comparison, compare
from .drawings import Drawing, strokes
from .field import (
    Difference,
    Field,
    Singularities,
    from_angles,
    from_array,
    from_directions,
    from_representation,
    from_tensors,
    from_vectors,
    read_field,
)
from .figures import figure, save_figures
from .films import film
from .generators import (
    along_axis,
    along_uv,
    curvature,
    features,
    form,
    guided,
    prescribed,
    smoothest,
)
from .pictures import Picture, ambient_occlusion, list_presets, render, turntable
from .surface import Surface
from .textures import Texture, texture

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
