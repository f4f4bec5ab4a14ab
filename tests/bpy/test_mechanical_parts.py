"""Fields along the form of mechanical parts, made by Blender's booleans and bevels."""

from functools import reduce

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix
from objects import link
from rosy.rosy_addon.field.analysis import dirichlet_energy
from rosy.rosy_addon.field.generate import generate
from rosy.rosy_addon.field.singularities import find_singularities
from rosy.rosy_addon.field.surface import build_surface
from rosy.rosy_addon.scene.meshes import mesh_surface
from scenes import depsgraph

TURN = Matrix.Rotation(np.pi / 2, 4, "Y"), Matrix.Rotation(np.pi / 2, 4, "X"), Matrix.Identity(4)


def solid(make, matrix, at, **options):
    """An object made by an operator of bmesh."""
    mesh, edited = bpy.data.meshes.new("part"), bmesh.new()
    make(edited, matrix=Matrix.Translation(at) @ matrix, **options)
    edited.to_mesh(mesh)
    edited.free()
    return link(bpy.data.objects.new("part", mesh))


def rod(radius, length, axis=2, at=(0, 0, 0), sides=40, end=None):
    """A cylinder, or a cone with the radius `end` at its other end."""
    radii = {"radius1": radius, "radius2": radius if end is None else end}
    options = {"cap_ends": True, "segments": sides, "depth": length, **radii}
    return solid(bmesh.ops.create_cone, TURN[axis], at, **options)


def block(*size, at=(0, 0, 0)):
    return solid(bmesh.ops.create_cube, Matrix.Diagonal((*size, 1)), at, size=1)


def ball(radius):
    options = {"u_segments": 40, "v_segments": 20, "radius": radius}
    return solid(bmesh.ops.create_uvsphere, TURN[2], (0, 0, 0), **options)


def modified(obj, kind, **options):
    modifier = obj.modifiers.new(kind, kind)
    for name, value in options.items():
        setattr(modifier, name, value)
    obj.data = bpy.data.meshes.new_from_object(obj.evaluated_get(depsgraph()))
    obj.modifiers.clear()
    return obj


def divided(obj):
    """Triangles without slivers, each divided into 16."""
    edited = bmesh.new()
    edited.from_mesh(obj.data)
    for _ in range(2):
        bmesh.ops.dissolve_degenerate(edited, dist=5e-3, edges=edited.edges)
        bmesh.ops.triangulate(edited, faces=edited.faces)
    edited.to_mesh(obj.data)
    edited.free()
    return modified(obj, "SUBSURF", subdivision_type="SIMPLE", levels=2)


def boolean(operation):
    def combine(first, second):
        return modified(first, "BOOLEAN", operation=operation, object=second)

    return lambda *objects: reduce(combine, objects)


union, without, common = map(boolean, ("UNION", "DIFFERENCE", "INTERSECT"))


def flange():
    turns = np.arange(6) * np.pi / 3
    holes = [rod(0.2, 2, at=(1.5 * np.cos(a), 1.5 * np.sin(a), 0), sides=20) for a in turns]
    return without(union(rod(2, 0.4, sides=64), rod(0.8, 2, at=(0, 0, 1))), rod(0.6, 6), *holes)


def tee():
    rings = rod(0.9, 0.3, at=(0, 0, 2)), rod(0.9, 0.3, at=(0, 0, -2)), rod(0.9, 0.3, 0, (2, 0, 0))
    pipes = union(rod(0.6, 4), rod(0.6, 2, 0, (1, 0, 0)), *rings)
    return without(pipes, rod(0.45, 5), rod(0.45, 3, 0, (1.5, 0, 0)))


def valve():
    return without(union(ball(1), rod(0.5, 3, 0), rod(0.3, 1.4, at=(0, 0, 1))), rod(0.35, 4, 0))


def housing():
    body = union(block(3, 2, 1.2), rod(0.6, 0.6, at=(0, 0, 0.8)))
    body = without(body, block(2.6, 1.6, 1.2, at=(0, 0, -0.2)), rod(0.4, 3))
    return modified(body, "BEVEL", width=0.06, segments=2)


def nut():
    return without(common(rod(1, 0.8, sides=6), rod(1, 0.8, end=0.95, sides=64)), rod(0.5, 3))


def crossing_cylinders():
    return union(*(rod(0.5, 3, axis) for axis in range(3)))


def gear():
    size = Matrix.Translation((1.55, 0, 0)) @ Matrix.Diagonal((0.5, 0.36, 0.5, 1))
    turns = [Matrix.Rotation(k * np.pi / 6, 4, "Z") @ size for k in range(12)]
    teeth = [solid(bmesh.ops.create_cube, turn, (0, 0, 0), size=1) for turn in turns]
    return without(union(rod(1.45, 0.5, sides=72), *teeth), rod(0.4, 2))


def slotted_block():
    slot = block(0.5, 3, 0.6, at=(0, 0, 0.4)), block(0.9, 3, 0.25, at=(0, 0, 0.1))
    body = without(block(2, 2, 1.2), *slot, rod(0.2, 3, 0, (0, 0.5, -0.3)))
    return modified(body, "BEVEL", width=0.05, segments=3)


def stepped_shaft():
    steps = rod(0.35, 1, at=(0, 0, 1)), rod(0.7, 0.3, at=(0, 0, -0.6))
    body = union(rod(0.5, 1.2), *steps, rod(0.35, 1, end=0.25, at=(0, 0, -1.2)))
    body = without(body, block(0.15, 1, 0.5, at=(0, 0.5, 0.1)))
    return modified(body, "BEVEL", width=0.03, segments=2)


PARTS = crossing_cylinders, nut, flange, tee, valve, housing, gear, slotted_block, stepped_shaft


def measured(part, kind):
    """The number of singularities of a field of crosses on a part, and its energy."""
    surface = mesh_surface(part.data)
    surface = build_surface(surface.vertices, surface.corner_vertex, surface.face_start)
    field = generate(surface, kind, 4)
    return len(find_singularities(surface, field)[0]), dirichlet_energy(surface, field)


@pytest.mark.parametrize("is_divided", [False, True])
@pytest.mark.parametrize("make", PARTS)
def test_the_form_has_few_singularities(make, is_divided):
    """At most a tenth more than a field along the sharp edges alone, at about the same energy.

    The polygons of a boolean are too large for energies.
    """
    part = divided(make()) if is_divided else make()
    (count, energy), (most, largest) = (measured(part, kind) for kind in ("form", "features"))
    assert count <= 1.1 * most
    if is_divided:
        assert energy <= 1.1 * largest


@pytest.mark.parametrize("make", [tee, gear])
def test_steps_of_voxels_are_not_followed(make):
    """Remeshing turns sharp edges into steps. A field along all of them has singularities at each step."""
    part = make()
    part = modified(part, "REMESH", mode="VOXEL", voxel_size=max(part.dimensions) / 100)
    assert measured(part, "form")[0] <= 0.2 * measured(part, "features")[0]


def test_angles_that_are_too_large_end_the_search():
    """Around the teeth, a field without singularities would turn too far. Resistances rose until numbers overflowed."""
    surface = mesh_surface(gear().data)
    starts, random = surface.face_start, np.random.default_rng(5)
    faces = np.split(surface.corner_vertex, starts[1:-1])
    turned = np.concatenate([np.roll(face, random.integers(len(face))) for face in faces])
    with np.errstate(over="raise", invalid="raise"):
        field = generate(build_surface(surface.vertices, turned, starts), "smoothest", 4)
    assert np.isfinite(field.vectors).all()
