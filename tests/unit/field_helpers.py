"""Surfaces, matrices and measures for tests of fields."""

from __future__ import annotations

import numpy as np
from conftest import ROOT
from scipy import sparse

from rosy_addon.field.field_io import load_field
from rosy_addon.field.representation import face_frames, to_representation
from rosy_addon.field.surface import build_surface

#: The folder of meshes of other programs, beside the repository.
MESHES = ROOT.parent / "shared" / "data" / "meshes"


def as_scipy(matrix):
    shape = len(matrix), matrix.column_count
    return sparse.csr_matrix((matrix.data, matrix.indices, matrix.indptr), shape=shape)


def bumpy(surface, amount=0.15, stretch=(1.0, 1.2, 1.5)):
    """A surface without symmetry, so that the smallest eigenvalue is simple."""
    x, y, z = surface.vertices.T
    out = 1 + amount * np.sin(3 * x + 1) * np.cos(2 * y) + 0.5 * amount * np.sin(4 * z + x)
    points = surface.vertices * out[:, None] * stretch
    return build_surface(points, surface.corner_vertex, surface.face_start)


def angle_differences(surface, first, second, degree):
    """(F,) angles between nearest members of two fields, given by vectors on the faces; radians."""
    x, y = face_frames(surface)
    z, w = (to_representation(vectors, x, y, degree) for vectors in (first, second))
    return np.abs(np.angle(z * w.conj())) / degree


def read_field(*arguments, **settings):
    """`load_field` without the note."""
    return load_field(*arguments, **settings).field
