"""Functions and classes for scripts, notebooks and the commands for mesh files.

Angles are in radians, except for the angles of a view, which are in degrees.

    field        makes fields from arrays and files
    generators   computes fields from surfaces and guides
    pictures     draws pictures and turntables (videos of a camera that orbits a mesh)
    films        draws videos of fields that change with time
    comparison   measures how fields differ
    figures      draws fields side by side, with keys (legends); `figure_panels` draws the pictures
    drawings     draws strokes: evenly spaced lines along a field
    textures     draws textures for UV maps

`Surface` and `Field` are classes of the subpackage `field`. `Picture` is a class of `compositor`. The names
that are imported here are public; `rosy_addon.__all__` lists them.
"""

from ..compositor.picture import Picture as Picture
from ..core.errors import RosyError as RosyError
from ..core.errors import RosyWarning as RosyWarning
from ..field.field import Difference as Difference
from ..field.field import Field as Field
from ..field.field import Singularities as Singularities
from ..field.surface import Surface as Surface
from .comparison import Comparison as Comparison
from .comparison import compare as compare
from .drawings import Drawing as Drawing
from .drawings import strokes as strokes
from .field import from_angles as from_angles
from .field import from_array as from_array
from .field import from_directions as from_directions
from .field import from_representation as from_representation
from .field import from_tensors as from_tensors
from .field import from_vectors as from_vectors
from .field import read_field as read_field
from .figures import figure as figure
from .figures import save_figures as save_figures
from .films import film as film
from .generators import along_axis as along_axis
from .generators import along_uv as along_uv
from .generators import curvature as curvature
from .generators import features as features
from .generators import form as form
from .generators import guided as guided
from .generators import prescribed as prescribed
from .generators import smoothest as smoothest
from .pictures import ambient_occlusion as ambient_occlusion
from .pictures import list_presets as list_presets
from .pictures import render as render
from .pictures import turntable as turntable
from .textures import Texture as Texture
from .textures import texture as texture
