"""Assign strokes to families: the M lines that the field has at each point.

Each family becomes a layer, which can have its own pen and color. Lines of neighboring triangles
are matched across the edges. A path around a singularity or a handle may connect different lines of
a triangle. If there is no such path, the families are consistent over the whole surface. Otherwise
the family depends on the angle between the stroke and a guide direction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.progress import progress, report
from ..field.connectivity import connected_components
from ..field.frames import dot, normalize
from .stroke_set import Strokes
from .tangent_mesh import TangentMesh, nearest_member, shared_edges, unit

#: Guide directions in world space, in order of preference, if no camera gives one.
GUIDE_AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def label_families(strokes: Strokes, mesh: TangentMesh, right: np.ndarray | None = None) -> Strokes:
    """Assign strokes to families by the line that they follow at their middle point.

    Parameters
    ----------
    strokes : Strokes
        As they were traced on `mesh`.
    mesh : TangentMesh
    right : (3,) array_like, optional
        Guide direction in world space, for example the x axis of a camera. It is used only if no
        consistent labels exist.

    Returns
    -------
    Strokes
        With `mesh.family_count` families. Family 1 is the one nearest to the guide direction; the
        others follow counter-clockwise.
    """
    report(0.0, "matching families")
    family_count = mesh.family_count
    names = tuple(f"family {index + 1}" for index in range(family_count))
    if family_count == 1 or not len(strokes):
        return replace(strokes, names=names)
    labels = global_labels(mesh)
    reference = reference_members(mesh)
    if labels is None:
        reference = _members_near_guide(mesh, reference, right)
        labels = np.broadcast_to(np.arange(family_count), (len(reference), family_count))
    report(0.9, "matching families")
    middle = (strokes.start[:-1] + strokes.start[1:]) // 2
    triangle = strokes.triangle[middle]
    member = mesh.to_frame(triangle, strokes.member[middle])
    family_slot = member_offset(member, reference[triangle], mesh.degree) % family_count
    family = labels[triangle, family_slot].astype(np.int32)
    return replace(strokes, family=family, names=names)


def reference_members(mesh: TangentMesh) -> np.ndarray:
    """Return (T,) complex128: one unit member at the center of each triangle, in its frame.

    It is the member nearest to the x axis of the frame. If the field labels one line consistently
    (`TangentMesh.family_z`), it is a member on that line.
    """
    near = np.ones(len(mesh.z), dtype=np.complex128)
    if mesh.family_z is not None and (mesh.family_z != 0).any():
        # The stored member is on the same line everywhere. Count from that line.
        near = np.exp(1j * np.angle(mesh.family_z) * mesh.family_count / mesh.degree)
    return _members_at_centers(mesh, near)


def _members_at_centers(mesh: TangentMesh, near: np.ndarray) -> np.ndarray:
    """Return (T,) complex128: the members at the centers of triangles that are nearest to others.

    The member where the field is zero is any.
    """
    z = mesh.z.sum(axis=1)
    return nearest_member(near, np.where(z != 0, z, 1), mesh.degree)


def member_offset(member: np.ndarray, reference: np.ndarray, degree: int) -> np.ndarray:
    """Return (n,) int64: the number of members from `reference` counter-clockwise to `member`."""
    angle = np.angle(member * reference.conj())
    return np.rint(angle * degree / (2 * np.pi)).astype(np.int64) % degree


def global_labels(mesh: TangentMesh) -> np.ndarray | None:
    """Return (T, M) int: the family of each line in each triangle, if consistent labels exist.

    Lines are counted counter-clockwise from `reference_members`. Returns None if different lines of
    a triangle are connected by a path over the surface.
    """
    label = "matching families"
    report(0.0, label)
    family_count, count = mesh.family_count, len(mesh.z)
    if mesh.family_z is not None and (mesh.family_z != 0).any():
        return np.broadcast_to(np.arange(family_count), (count, family_count))
    reference = reference_members(mesh)
    triangle, other, edge, _ = shared_edges(mesh)
    report(0.2, label)
    transported = reference[triangle] * mesh.edge_transport[triangle, edge]
    shift = member_offset(
        nearest_member(transported, mesh.z[other].sum(axis=1), mesh.degree),
        reference[other],
        mesh.degree,
    )
    slots = np.arange(family_count)
    node = triangle[:, None] * family_count + slots
    other_node = other[:, None] * family_count + (slots + shift[:, None]) % family_count
    pairs = np.stack([node.ravel(), other_node.ravel()], axis=1)
    with progress(0.4, 0.8, label):
        component = connected_components(count * family_count, pairs)
    component = component.reshape(count, family_count)
    for a in range(family_count):
        for b in range(a):
            if (component[:, a] == component[:, b]).any():
                return None
    return _order_labels(mesh, component, reference)


def _order_labels(mesh: TangentMesh, component: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Number the components of the covering from 0 in each connected part of the surface.

    The order is that of the lines in the first triangle of the part, counter-clockwise from the
    line nearest to the guide direction.

    Parameters
    ----------
    mesh : TangentMesh
    component : (T, M) ndarray of int
        Connected component of each line in each triangle.
    reference : (T,) complex128 ndarray
        `reference_members` of the mesh.

    Returns
    -------
    (T, M) int64 ndarray
    """
    family_count = component.shape[1]
    family = np.full(int(component.max()) + 1, -1, dtype=np.int64)
    order = np.argsort(component[:, 0], kind="stable")
    _, first_triangle = np.unique(component[order].min(axis=1), return_index=True)
    guided = _members_near_guide(mesh, reference, None)
    shift = member_offset(guided, reference, mesh.degree) % family_count
    for triangle in order[first_triangle]:
        components = component[triangle]
        if (family[components] >= 0).any():
            continue
        family[np.roll(components, -shift[triangle])] = np.arange(family_count)
    return np.maximum(family, 0)[component]


def _members_near_guide(
    mesh: TangentMesh, reference: np.ndarray, right: np.ndarray | None
) -> np.ndarray:
    """Return (T,) complex128: the members nearest to the guide direction in the triangle planes.

    The guide is `right`, or the first of `GUIDE_AXES` that is not almost normal to the triangle.
    """
    axes = GUIDE_AXES if right is None else np.concatenate([[np.asarray(right, float)], GUIDE_AXES])
    guide = np.zeros_like(mesh.normal)
    for axis in axes[::-1]:
        projected = axis - dot(mesh.normal, axis)[:, None] * mesh.normal
        is_usable = dot(projected, projected) > 0.1
        guide[is_usable] = normalize(projected[is_usable])
    guide_tangent = dot(guide, mesh.x) + 1j * dot(guide, mesh.y)
    return _members_at_centers(mesh, unit(guide_tangent, np.ones_like(guide_tangent)))
