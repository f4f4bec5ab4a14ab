"""Find the singularities of fields in a picture, and define the style of their dots.

The area of a dot is proportional to the index. Its color shows the sign of the index. The colors, orange and
blue, can be told apart with all types of color vision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..core.cache import Cache, cached
from ..core.progress import progress
from ..field.singularities import find_singularities
from ..field.singularity_changes import CLUSTER_REACH, cluster_singularities
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import part_of
from ..projection.visible_vertices import project_vertices
from .singularity_settings import shows_clusters, shows_hidden_singularities, shows_indices

#: Display colors of dots by the sign of the index, and display color of their outlines.
COLOR_BY_SIGN, OUTLINE_COLOR = {1: "#eb5a14", -1: "#2864eb"}, "#141414"

#: Width of the outline of a dot, as a multiple of the diameter of a dot of index 1 / N.
OUTLINE = 0.2

#: Opacity of the dots of hidden singularities.
HIDDEN_OPACITY = 0.3


@dataclass(frozen=True)
class Dot:
    """A dot of a singularity: center, radius without outline, width of the outline, in pixels; and index.

    Coordinates are measured from the lower left corner of the frame. The index is in units of 1 / N.
    """

    x: float
    y: float
    radius: float
    outline: float
    index: int


@dataclass(frozen=True, eq=False)
class SingularityMarks:
    """K singularities in a picture, which are drawn as dots.

    Attributes
    ----------
    position : (K, 2) float64 ndarray
        Positions in the picture, pixels from the lower left.
    index : (K,) int ndarray
        Singularity indices in units of 1 / N.
    degree : (K,) int ndarray
        Degrees N of their fields.
    depth : (K,) float64 ndarray
        Depths along the axis of the camera, in Blender units. Near dots are drawn over far ones.
    is_visible : (K,) bool ndarray
        Whether the camera sees the singularity. Dots of hidden singularities are fainter, below all others
        and without labels.
    frame : (int, int)
        Width and height of the picture, pixels.
    size : float
        Diameter of the dot of an index of 1 / N, pixels.
    has_labels : bool
        Whether indices are written beside dots.
    """

    position: np.ndarray
    index: np.ndarray
    degree: np.ndarray
    depth: np.ndarray
    is_visible: np.ndarray
    frame: tuple[int, int]
    size: float = 9.0
    has_labels: bool = False

    def __len__(self) -> int:
        return len(self.index)

    def in_drawing_order(self) -> SingularityMarks:
        """Return the singularities in the order in which their dots are drawn: hidden and far ones first."""
        return part_of(self, np.lexsort((-self.depth, self.is_visible)))

    @property
    def radius(self) -> np.ndarray:
        """(K,) float64: radii of the dots without their outlines, pixels."""
        return dot_diameters(self.index, self.size) / 2


def dot_diameters(index: np.ndarray, size: float) -> np.ndarray:
    """Return the diameters of dots without their outlines, in the unit of `size`.

    Parameters
    ----------
    index : (K,) int ndarray
        Singularity indices in units of 1 / N.
    size : float
        Diameter of the dot of an index of 1 / N.
    """
    return size * np.sqrt(np.abs(index))


def singularity_marks(
    instances: Sequence[MeshInstance],
    camera: Camera,
    settings: Any,
    clip_planes: np.ndarray | None = None,
    cache: Cache | None = None,
) -> SingularityMarks:
    """Find the singularities of the fields of mesh instances in the view of a camera.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Instances without a field can only hide singularities.
    camera : Camera
    settings : Look or StrokeStyle
        Only the settings `singularity_dots` and `singularity_size` are read. They select the singularities
        and the style of their dots.
    clip_planes : (6, 4) float64 ndarray, optional
        Planes (a, b, c, d) in world space. Points with a x + b y + c z + d < 0 are cut away.
    cache : Cache, optional
        Cache for the singularities of fields.

    Returns
    -------
    SingularityMarks
    """
    cache = Cache() if cache is None else cache
    vertices, indices, degrees = [], [], []
    for number, instance in enumerate(instances):
        vertex = index = np.empty(0, dtype=np.int32)
        if instance.field is not None:
            part = 0.5 / len(instances)
            with progress(number * part, (number + 1) * part):
                vertex, index = shown_singularities(instance, settings, cache)
            degrees.append(np.full(len(vertex), instance.field.degree))
        vertices.append(vertex)
        indices.append(index)
    with progress(0.5, 1.0):
        projected = project_vertices(instances, camera, vertices, clip_planes)
    kept = projected.is_in_view if shows_hidden_singularities(settings) else projected.is_visible
    index, degree = np.concatenate(indices), np.concatenate(degrees)
    position, depth, is_visible = projected.position, projected.depth, projected.is_visible
    style = camera.size, settings.singularity_size, shows_indices(settings)
    marks = SingularityMarks(position, index, degree, depth, is_visible, *style)
    return part_of(marks, kept)


def shown_singularities(
    instance: MeshInstance, settings: Any, cache: Cache
) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and the indices of the dots of an instance: its singularities, or clusters of them.

    A cluster is explained in `cluster_singularities`. The instance must have a field. All deformations of a
    mesh have the same singularities. The result is a pair of (K,) int32 arrays; indices are in units of 1 / N.
    `settings` is a look or a stroke style.
    """
    surface = instance.surface.in_rest_shape()
    key = instance.surface.rest_shape_key, instance.field
    create = partial(find_singularities, surface, instance.field)
    found = cached(cache, create, "singularities", *key)
    if not shows_clusters(settings):
        return found
    create = partial(cluster_singularities, surface, *found, CLUSTER_REACH * surface.extent)
    return cached(cache, create, "clusters", *key)
