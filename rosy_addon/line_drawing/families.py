"""Assign strokes to families, one for each of the M line directions of the field.

A line direction is a pair of opposite directions, or a single direction if the field has no opposite ones.
Each family becomes a layer, which can have its own pen and color. The line directions of neighboring
triangles are matched across the edges. A path around a singularity or a handle may connect different line
directions of a triangle. If there is no such path, the families are consistent over the whole surface.
Otherwise the family depends on the angle between the stroke and a guide direction.
"""

from dataclasses import replace

import numpy as np

from ..core.progress import progress, report
from ..field.connectivity import connected_components
from ..field.frames import dot, normalize
from ..field.representation import unit_complex
from .stroke_set import Strokes
from .tangent_mesh import TangentMesh, nearest_member, shared_edges

#: Guide directions in world space, in order of preference, if no camera gives one.
GUIDE_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def label_families(strokes: Strokes, mesh: TangentMesh, right: np.ndarray | None = None) -> Strokes:
    """Assign strokes to families by the line direction that they follow at their middle point.

    Parameters
    ----------
    strokes : Strokes
        Strokes as they were traced on `mesh`.
    mesh : TangentMesh
    right : (3,) array_like, optional
        Guide direction in world space, for example the x axis of a camera. It is used only if the families
        cannot be consistent over the surface.

    Returns
    -------
    Strokes
        The same strokes with `mesh.family_count` families, named "family 1" and so on. If the families are
        consistent over the surface, `global_labels` numbers them. Otherwise, in each triangle, the first
        family is nearest to the guide direction, and the others follow counter-clockwise.
    """
    report(0.0, "matching families")
    family_count = mesh.family_count
    names = tuple(f"family {index + 1}" for index in range(family_count))
    if family_count == 1 or not len(strokes):
        return replace(strokes, names=names)
    labels = global_labels(mesh)
    reference = reference_members(mesh)
    if labels is None:
        reference = _members_near_guide(mesh, right)
        labels = np.broadcast_to(np.arange(family_count), (len(reference), family_count))
    middle = (strokes.start[:-1] + strokes.start[1:]) // 2
    triangle = strokes.triangle[middle]
    member = mesh.to_frame(triangle, strokes.member[middle])
    slot = member_offset(member, reference[triangle], mesh.degree) % family_count
    return replace(strokes, family=labels[triangle, slot].astype(np.int32), names=names)


def reference_members(mesh: TangentMesh) -> np.ndarray:
    """Return (T,) complex128: one unit member of the field at the center of each triangle, in its frame.

    It is the member nearest to the x axis of the frame. If the field itself marks the direction of the first
    family (`TangentMesh.family_z`), it is a member in this direction.
    """
    near = np.ones(len(mesh.z), dtype=np.complex128)
    if mesh.family_z is not None:
        # The stored member follows the same line direction everywhere. Count from that direction.
        near = np.exp(1j * np.angle(mesh.family_z) * mesh.family_count / mesh.degree)
    return _members_at_centers(mesh, near)


def _members_at_centers(mesh: TangentMesh, near: np.ndarray) -> np.ndarray:
    """Return (T,) complex128: for each triangle, the unit member at its center that is nearest to a tangent.

    `near`, (T,) complex, holds the tangents in the frames of the triangles. Where the field is zero, the
    result is an arbitrary unit tangent.
    """
    z = mesh.z.sum(axis=1)
    return nearest_member(near, np.where(z != 0, z, 1), mesh.degree)


def member_offset(member: np.ndarray, reference: np.ndarray, degree: int) -> np.ndarray:
    """Return (n,) int64: by how many steps of 2 pi / N `member` is counter-clockwise from `reference`.

    The steps are from 0 to N - 1, where N is `degree`. Both arguments are members of the field, as complex
    numbers in the same frame.
    """
    angle = np.angle(member * reference.conj())
    return np.rint(angle * degree / (2 * np.pi)).astype(np.int64) % degree


def global_labels(mesh: TangentMesh) -> np.ndarray | None:
    """Return (T, M) int: the family of each line direction in each triangle, or None.

    Line directions are counted counter-clockwise from `reference_members`. If the field marks the direction
    of the first family (`TangentMesh.family_z`), this is family 0. Otherwise `_order_labels` numbers the
    families. None is returned if a path over the surface connects different line directions of a triangle, so
    that no consistent labels exist.
    """
    family_count, count = mesh.family_count, len(mesh.z)
    if mesh.family_z is not None:
        return np.broadcast_to(np.arange(family_count), (count, family_count))
    reference = reference_members(mesh)
    triangle, other, edge, _ = shared_edges(mesh)
    transported = reference[triangle] * mesh.edge_transport[triangle, edge]
    nearest = nearest_member(transported, mesh.z[other].sum(axis=1), mesh.degree)
    shift = member_offset(nearest, reference[other], mesh.degree)
    slots = np.arange(family_count)
    node = triangle[:, None] * family_count + slots
    other_node = other[:, None] * family_count + (slots + shift[:, None]) % family_count
    pairs = np.stack([node.ravel(), other_node.ravel()], axis=1)
    with progress(0.4, 0.8, "matching families"):
        component = connected_components(count * family_count, pairs)
    component = component.reshape(count, family_count)
    in_order = np.sort(component, axis=1)
    if (in_order[:, 1:] == in_order[:, :-1]).any():
        return None
    return _order_labels(mesh, component, reference)


def _order_labels(mesh: TangentMesh, component: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the family, 0 to M - 1, of each line direction, given the components of line directions.

    A component consists of the line directions that are matched across edges. In each connected part of the
    surface, the line directions of its first triangle are numbered counter-clockwise. Number 0 is nearest to
    the first of `GUIDE_AXES` that is not almost normal to the triangle. The number of a line direction is the
    family of its component.

    Parameters
    ----------
    mesh : TangentMesh
    component : (T, M) ndarray of int
        Connected component of each line direction in each triangle.
    reference : (T,) complex128 ndarray
        The `reference_members` of the mesh.

    Returns
    -------
    (T, M) int64 ndarray
        Family of each line direction in each triangle.
    """
    family_count = component.shape[1]
    family = np.full(int(component.max()) + 1, -1, dtype=np.int64)
    order = np.argsort(component[:, 0], kind="stable")
    _, first_triangle = np.unique(component[order].min(axis=1), return_index=True)
    shift = member_offset(_members_near_guide(mesh, None), reference, mesh.degree) % family_count
    for triangle in order[first_triangle]:
        components = component[triangle]
        if (family[components] >= 0).any():
            continue
        family[np.roll(components, -shift[triangle])] = np.arange(family_count)
    return np.maximum(family, 0)[component]


def _members_near_guide(mesh: TangentMesh, right: np.ndarray | None) -> np.ndarray:
    """Return (T,) complex128: the unit member of each triangle that is nearest to a guide direction.

    The guide direction is `right`, or the first of `GUIDE_AXES` that is not almost normal to the triangle. It
    is projected to the plane of the triangle. The result is in the frame of the triangle.
    """
    axes = GUIDE_AXES if right is None else np.concatenate([[np.asarray(right, float)], GUIDE_AXES])
    guide = np.zeros_like(mesh.normal)
    for axis in axes[::-1]:
        projected = axis - dot(mesh.normal, axis)[:, None] * mesh.normal
        is_usable = dot(projected, projected) > 0.1
        guide[is_usable] = normalize(projected[is_usable])
    guide_tangent = dot(guide, mesh.x) + 1j * dot(guide, mesh.y)
    return _members_at_centers(mesh, unit_complex(guide_tangent, otherwise=1))
