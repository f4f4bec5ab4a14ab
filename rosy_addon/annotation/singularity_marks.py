"""The singularities of fields in a picture, and the style of their dots.

The area of a dot is proportional to its index. Its color shows the sign: orange and blue differ for all
kinds of color vision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..core.cache import Cache
from ..core.progress import progress
from ..field.singularities import find_singularities
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import part_of
from ..projection.visible_vertices import project_vertices
from .singularity_settings import shows_hidden_singularities, shows_indices

#: Display colors by the sign of the index, and of the outline of dots.
COLOR_BY_SIGN, OUTLINE_COLOR = {1: "#eb5a14", -1: "#2864eb"}, "#141414"

#: Width of the outline of a dot, in diameters of a dot of index 1 / N.
OUTLINE = 0.2

#: Opacity of the dots of hidden singularities.
HIDDEN_OPACITY = 0.3


@dataclass(frozen=True, eq=False)
class SingularityMarks:
    """K singularities in a picture.

    Attributes
    ----------
    position : (K, 2) float64 ndarray
        Pixels from the lower left.
    index : (K,) int ndarray
        In units of 1 / N.
    degree : (K,) int ndarray
        N.
    depth : (K,) float64 ndarray
        Nearer dots are drawn over farther ones.
    is_visible : (K,) bool ndarray
        Hidden dots are drawn faded, below all others and without labels.
    frame : (int, int)
        Width and height of the picture, pixels.
    size : float
        Diameter of a dot of index 1 / N, pixels.
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

    def part(self, chosen: np.ndarray) -> SingularityMarks:
        """Return the marks that a mask or indices choose."""
        return part_of(self, chosen)

    def in_drawing_order(self) -> SingularityMarks:
        """Return the marks in the order in which they are drawn."""
        return self.part(np.lexsort((-self.depth, self.is_visible)))

    @property
    def radius(self) -> np.ndarray:
        """(K,) radii without outlines, pixels."""
        return dot_diameters(self.index, self.size) / 2


def dot_diameters(index: np.ndarray, size: float) -> np.ndarray:
    """Return the diameters of dots without their outlines, in the unit of `size`.

    Parameters
    ----------
    index : (K,) int ndarray
        In units of 1 / N.
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
    """Find the singularities of fields in a view.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Instances without a field only hide singularities.
    camera : Camera
    settings : Look or StrokeStyle
        Which singularities are drawn, and how. Only the settings of `singularity_settings` are read.
    clip_planes : (6, 4) float64 ndarray, optional
        World space. The negative side of each plane is cut away.
    cache : Cache, optional
        Stores the singularities of fields.

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
                vertex, index = cached_singularities(instance, cache)
            degrees.append(np.full(len(vertex), instance.field.degree))
        vertices.append(vertex)
        indices.append(index)
    with progress(0.5, 1.0):
        projected = project_vertices(instances, camera, vertices, clip_planes)
    kept = projected.is_in_view if shows_hidden_singularities(settings) else projected.is_visible
    marks = SingularityMarks(
        projected.position,
        np.concatenate(indices),
        np.concatenate(degrees),
        projected.depth,
        projected.is_visible,
        (camera.width, camera.height),
        settings.singularity_size,
        shows_indices(settings),
    )
    return marks.part(kept)


def cached_singularities(instance: MeshInstance, cache: Cache) -> tuple[np.ndarray, np.ndarray]:
    """Find the singularities of an instance with a field, or return them from the cache.

    All deformations of a mesh have the same singularities. See `field.singularities.find_singularities`.
    """
    surface, field = instance.surface, instance.field
    return cache.get_or_create(
        ("singularities", surface.rest_shape_key, field),
        partial(find_singularities, surface.in_rest_shape(), field),
    )
