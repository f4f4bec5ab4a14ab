"""Find what disturbs fields on a mesh: faces of opposite orientations, and faces on top of each other."""

import numpy as np

from ..core.errors import counted
from .copied_faces import copies_note
from .surface import Surface


def count_inconsistent_edges(surface: Surface) -> int:
    """Count the inconsistent edges: those between two faces that disagree on which side is outward.

    Faces without area are ignored. A field is not continued across such an edge. Flipping faces removes
    inconsistent edges, except on nonorientable surfaces such as a Möbius strip.
    """
    edges = surface.edges
    degenerate = ~surface.face_normal.any(axis=1)[surface.corner_face]
    inconsistent = edges.face_count == 2
    inconsistent[edges.corner_edge[degenerate]] = False
    inconsistent[edges.interior] = False
    return int(np.count_nonzero(inconsistent))


def orientation_warning(surface: Surface) -> str:
    """Return the warning to show for inconsistently oriented faces; an empty string if there are none."""
    count = count_inconsistent_edges(surface)
    if not count:
        return ""
    return (
        f"{surface.name}: the faces at {counted(count, 'edge')} are oriented inconsistently, so the "
        "field is cut there: recalculate the normals (not possible for one-sided surfaces such as "
        "a Möbius strip)"
    )


def copies_warning(surface: Surface) -> str:
    """Return the warning to show for faces that lie on others; an empty string if there are none."""
    note = copies_note(surface.name, surface.vertices, surface.corner_vertex, surface.face_start)
    return note and f"{note}: merge vertices by distance, or delete one of each"
