"""Twelve scenes of an illustrator, drawn by RoSy and rendered in EEVEE and in Cycles at 1920 x 1080.

With RoSy installed:

    blender -b -P docs/scenes/scenes.py -- FOLDER [SCALE [SCENE ...]]

Each function is a scene: it adds objects with live modifiers, makes their fields, and bakes.
"""

import sys
from math import cos, pi, radians, sin
from pathlib import Path

import bpy
from mathutils import Matrix, Vector

sys.path.insert(0, str(Path(__file__).parent))
from stage import (
    add,
    bake,
    bevel,
    box,
    camera,
    collection,
    cut,
    empty_scene,
    lamp,
    lathe,
    link,
    make_fields,
    material,
    modify,
    polygons,
    prism,
    render,
    smooth,
)

BOTTLE = [
    (0, 0),
    (0.36, 0),
    (0.4, 0.06),
    (0.4, 0.95),
    (0.36, 1.1),
    (0.14, 1.3),
    (0.12, 1.6),
    (0.15, 1.62),
    (0.15, 1.7),
    (0.1, 1.7),
]
BOWL = [
    (0, 0),
    (0.3, 0),
    (0.3, 0.05),
    (0.62, 0.25),
    (0.8, 0.55),
    (0.84, 0.55),
    (0.68, 0.22),
    (0.3, 0.1),
    (0, 0.1),
]
PAWN = [
    (0, 0),
    (0.42, 0),
    (0.42, 0.1),
    (0.34, 0.16),
    (0.34, 0.22),
    (0.2, 0.34),
    (0.14, 0.75),
    (0.24, 0.82),
    (0.13, 0.88),
    (0.26, 1.05),
    (0.2, 1.25),
    (0, 1.32),
]
ROOK = [
    (0, 0),
    (0.46, 0),
    (0.46, 0.12),
    (0.36, 0.2),
    (0.26, 0.4),
    (0.22, 1.0),
    (0.34, 1.08),
    (0.34, 1.35),
    (0.25, 1.35),
    (0.25, 1.22),
    (0, 1.22),
]


def portrait():
    """Suzanne with a live Subdivision, engraved, by one lamp."""
    suzanne = smooth(add("monkey", rotation=(radians(-12), 0, radians(18))), 3)
    camera((0.3, -7.2, 0.5), (0, 0, -0.02), 62)
    lamp("AREA", (-3, -4, 3.5), 500, size=1.0)
    make_fields(suzanne)
    bake("engraving")


def _house(half_width, eaves, ridge, half_depth):
    """A house whose gables are polygons of five corners."""
    gable = [
        (-half_width, 0),
        (half_width, 0),
        (half_width, eaves),
        (0, ridge),
        (-half_width, eaves),
    ]
    return prism("House", *([(x, y, z) for x, z in gable] for y in (half_depth, -half_depth)))


def building():
    """A house with live Boolean windows and bevels, and gables of five corners, in the sun."""
    house = _house(1.6, 2.2, 3.5, 2.4)
    windows = [box(0.5, 0.5, 0.75, at=(x, -2.4, z)) for x in (-0.85, 0.85) for z in (0.85, 1.95)]
    windows += [box(0.5, 0.5, 0.75, at=(1.6, y, 1.2)) for y in (-1.6, -0.5, 0.6, 1.7)]
    windows += [
        box(0.6, 0.5, 1.4, at=(0, -2.4, 0.6)),
        add("cylinder", radius=0.28, depth=0.5, location=(0, -2.4, 2.75), rotation=(pi / 2, 0, 0)),
    ]
    bevel(cut(house, *windows), 0.04)
    chimney = bevel(box(0.4, 0.4, 1.2, at=(0.8, 0.9, 3.2)), 0.03)
    wall = bevel(box(5, 0.15, 0.6, at=(4.3, -2.3, 0.3)), 0.04)
    ground = box(30, 30, 0.1, at=(0, 0, -0.05))
    camera((6.2, -8.4, 2.9), (0.9, 0, 1.35), 38)
    lamp("SUN", (7, -2.5, 5), 3, angle=0.01)
    make_fields(house, chimney, wall, ground)
    bake("pen-and-ink")


#: Joints of a mannequin's left half: position, radius, the joint before it, and the bone that moves it.
JOINTS = {
    "pelvis": ((0, 0, 1.0), 0.145, None, "spine"),
    "chest": ((0, 0, 1.42), 0.16, "pelvis", "spine"),
    "neck": ((0, 0, 1.56), 0.055, "chest", "head"),
    "face": ((0, -0.02, 1.7), 0.115, "neck", "head"),
    "crown": ((0, -0.01, 1.82), 0.09, "face", "head"),
    "shoulder": ((0.2, 0, 1.43), 0.075, "chest", "arm.L"),
    "elbow": ((0.48, 0, 1.43), 0.052, "shoulder", "hand.L"),
    "hand": ((0.78, 0, 1.43), 0.035, "elbow", "hand.L"),
    "hip": ((0.11, 0, 0.92), 0.1, "pelvis", "leg.L"),
    "knee": ((0.13, -0.02, 0.5), 0.065, "hip", "foot.L"),
    "ankle": ((0.14, 0.03, 0.08), 0.048, "knee", "foot.L"),
    "toe": ((0.15, -0.16, 0.04), 0.036, "ankle", "foot.L"),
}

#: First and last joint of each bone of the left half, and the bone before it.
BONES = {
    "spine": ("pelvis", "chest", None),
    "head": ("neck", "crown", "spine"),
    "arm.L": ("shoulder", "elbow", "spine"),
    "hand.L": ("elbow", "hand", "arm.L"),
    "leg.L": ("hip", "knee", None),
    "foot.L": ("knee", "ankle", "leg.L"),
}


def _rig(pose):
    """An armature of both halves, whose bones point in the directions of a pose."""
    rig = link(bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig")))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for name, (first, last, before) in BONES.items():
        for side, mirror in ((".L", 1), (".R", -1)) if "." in name else (("", 1),):
            bone = rig.data.edit_bones.new(name.replace(".L", side))
            bone.head, bone.tail = (
                (mirror * x, y, z) for x, y, z in (JOINTS[first][0], JOINTS[last][0])
            )
            bone.parent = rig.data.edit_bones[before.replace(".L", side)] if before else None
    bpy.ops.object.mode_set(mode="POSE")
    for bone in rig.pose.bones:
        if bone.name in pose:
            rest = bone.bone.matrix_local
            turn = (bone.bone.tail_local - bone.bone.head_local).rotation_difference(
                Vector(pose[bone.name])
            )
            bone.matrix = (
                Matrix.Translation(bone.head) @ (turn.to_matrix() @ rest.to_3x3()).to_4x4()
            )
            bpy.context.view_layer.update()
    bpy.ops.object.mode_set(mode="OBJECT")
    return rig


def _mannequin(at, pose):
    """Half a skeleton with live Mirror, Armature, Skin and Subdivision."""
    number = {name: index for index, name in enumerate(JOINTS)}
    mesh = bpy.data.meshes.new("Mannequin")
    edges = [(number[before], number[name]) for name, (_, _, before, _) in JOINTS.items() if before]
    mesh.from_pydata([place for place, *_ in JOINTS.values()], edges, [])
    figure = link(bpy.data.objects.new("Mannequin", mesh))
    rig = _rig(pose)
    for bone in rig.data.bones:
        figure.vertex_groups.new(name=bone.name)
    modify(figure, "MIRROR", use_clip=True)
    modify(figure, "ARMATURE", object=rig)
    modify(figure, "SKIN", use_smooth_shade=True)
    for name, (_, radius, _, bone) in JOINTS.items():
        figure.vertex_groups[bone].add([number[name]], 1.0, "REPLACE")
        mesh.skin_vertices[0].data[number[name]].radius = radius, radius
    mesh.skin_vertices[0].data[0].use_root = True
    figure.parent, rig.location = rig, at
    rig.hide_set(True)
    return smooth(figure, 2)


def dancers():
    """A mirrored, subdivided, rigged mannequin in three poses."""
    poses = [
        {
            "spine": (0.08, 0, 1),
            "arm.L": (0.5, -0.2, 0.8),
            "hand.L": (-0.3, -0.2, 0.9),
            "arm.R": (-0.7, 0.1, -0.7),
            "hand.R": (0.7, -0.3, -0.6),
            "leg.R": (-0.3, -0.15, -0.9),
            "foot.R": (-0.2, 0.1, -1),
        },
        {
            "spine": (0.1, -0.3, 1),
            "arm.L": (0.4, 0.5, -0.7),
            "hand.L": (0.5, -0.3, -0.6),
            "arm.R": (-0.5, -0.6, -0.5),
            "hand.R": (-0.1, -0.6, 0.7),
            "leg.L": (0.3, -0.6, -0.6),
            "foot.L": (0.1, 0.5, -0.9),
            "leg.R": (-0.3, 0.4, -0.9),
            "foot.R": (-0.4, 0.9, -0.5),
        },
        {
            "spine": (-0.2, 0, 1),
            "head": (-0.3, -0.1, 1),
            "arm.L": (0.9, 0, 0.5),
            "hand.L": (0.9, -0.1, 0.7),
            "arm.R": (-0.9, -0.1, 0.3),
            "hand.R": (-0.7, -0.2, 0.7),
            "leg.L": (0.9, 0.1, -0.5),
            "foot.L": (0.9, 0.1, -0.2),
        },
    ]
    figures = [
        _mannequin((1.25 * (i - 1), 0.25 * (i % 2), 0), pose) for i, pose in enumerate(poses)
    ]
    ground = box(20, 8, 0.1, at=(0, 1.5, -0.05))
    camera((0.3, -6.6, 1.35), (0.1, 0, 0.98), 56)
    lamp("SUN", (-4, -3, 5), 3, angle=0.02)
    make_fields(*figures, ground)
    bake("cross-hatch")


def street():
    """A street of instances that Geometry Nodes makes of one house, at random sizes."""
    house = _house(1, 2, 3, 1)
    openings = [box(0.45, 3, 0.6, at=(x, 0, 1.35)) for x in (-0.5, 0.5)]
    openings += [box(0.5, 3, 1.0, at=(0, 0, 0.4)), box(3, 0.5, 0.6, at=(0, 0, 1.35))]
    for opening in openings:
        opening.parent = house
    cut(house, *openings)
    bevel(house, 0.03)
    tree = bpy.data.node_groups.new("Street", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    grid, info, put, out, size, position = (
        tree.nodes.new(kind)
        for kind in (
            "GeometryNodeMeshGrid",
            "GeometryNodeObjectInfo",
            "GeometryNodeInstanceOnPoints",
            "NodeGroupOutput",
            "FunctionNodeRandomValue",
            "FunctionNodeRandomValue",
        )
    )
    for name, value in {"Size X": 8, "Size Y": 24, "Vertices X": 2, "Vertices Y": 9}.items():
        grid.inputs[name].default_value = value
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = house, True
    size.data_type = position.data_type = "FLOAT_VECTOR"
    size.inputs[0].default_value, size.inputs[1].default_value = (0.9, 0.9, 0.8), (1.3, 1.2, 1.8)
    position.inputs[0].default_value, position.inputs[1].default_value = (0, 0, 1.3), (0, 0, 1.8)
    for source, target in (
        (grid.outputs[0], put.inputs["Points"]),
        (info.outputs["Geometry"], put.inputs["Instance"]),
        (size.outputs[0], put.inputs["Scale"]),
        (position.outputs[0], put.inputs["Rotation"]),
        (put.outputs[0], out.inputs[0]),
    ):
        tree.links.new(source, target)
    row = modify(polygons("Street", [(0, 0, 0)], []), "NODES", node_group=tree)
    row.location.y = 8
    house.location = 0, -60, 0
    ground = box(60, 80, 0.1, at=(0, 10, -0.05))
    camera((0.8, -9.5, 1.9), (-0.4, 6, 1.6), 30)
    lamp("SUN", (-6, -5, 6), 3, angle=0.01)
    make_fields(house, ground)
    bake("pen-and-ink")


def poster():
    """A head in ink over her own material; the floor and wall behind her are engraved."""
    suzanne = smooth(
        add("monkey", location=(0, 0, 1.0), rotation=(radians(-8), 0, radians(-22))), 3
    )
    material(suzanne, (0.8, 0.28, 0.12))
    plinth = bevel(
        add("cylinder", vertices=64, radius=0.9, depth=0.5, location=(0, 0, -0.1)), 0.05, 3
    )
    material(plinth, (0.75, 0.7, 0.6))
    floor, wall = box(16, 9, 0.1, at=(0, 1.5, -0.4)), box(16, 0.1, 8, at=(0, 3, 3))
    for obj in (floor, wall):
        material(obj, (0.62, 0.68, 0.6), 1.0)
    camera((0.2, -6.4, 1.5), (0, 0, 0.95), 50)
    lamp("AREA", (-3, -4, 4.5), 900, size=1.2, to=(0, 0, 0.8))
    make_fields(suzanne, plinth, floor, wall)
    collection("Background", "engraving", floor, wall)
    bake("pen-and-ink", over_material=True)


def glass():
    """A bottle of glass before an engraved vase: the hatching is seen through it."""
    bottle = lathe("Bottle", BOTTLE, at=(-0.35, -1.0, 0))
    material(bottle, (0.85, 0.95, 0.9), 0.02, 1.0)
    vase = lathe(
        "Vase",
        [
            (0, 0),
            (0.4, 0),
            (0.7, 0.5),
            (0.72, 0.9),
            (0.4, 1.4),
            (0.3, 1.6),
            (0.45, 1.8),
            (0.4, 1.8),
            (0.22, 1.6),
            (0.2, 1.4),
        ],
        at=(0.3, 0.6, 0),
    )
    ball = smooth(
        add("uv_sphere", radius=0.4, location=(1.3, -0.5, 0.4), segments=48, ring_count=24), 0
    )
    table, wall = box(12, 6, 0.1, at=(0, 0.5, -0.05)), box(12, 0.1, 6, at=(0, 3, 2.5))
    camera((0.1, -6.6, 1.7), (0.25, 0, 0.82), 52)
    lamp("AREA", (-3, -3, 4), 600, size=1.0)
    make_fields(vase, ball, table, wall)
    bake("engraving")


def still_life():
    """A bowl, a bottle and fruit by three lamps of 400 W."""
    bottle, bowl = lathe("Bottle", BOTTLE, at=(-0.9, 0.5, 0)), lathe("Bowl", BOWL, at=(0.35, 0, 0))
    places = (
        (0.2, -0.1, 0.42),
        (0.62, 0.1, 0.43),
        (0.3, 0.3, 0.44),
        (-0.6, -0.7, 0.26),
        (1.3, -0.6, 0.26),
    )
    fruit = [
        smooth(add("uv_sphere", radius=0.27, location=at, segments=40, ring_count=20), 0)
        for at in places
    ]
    table = box(12, 7, 0.1, at=(0, 1, -0.05))
    camera((0.1, -6.0, 2.3), (0.15, 0, 0.6), 52)
    for at in ((-3, -2, 3), (2.5, -3, 2.5), (0.5, 3, 3.5)):
        lamp("POINT", at, 400, shadow_soft_size=0.2)
    make_fields(bottle, bowl, *fruit, table)
    bake("cross-hatch")


def machine():
    """A flange, a gear and a nut with live Booleans and bevels."""

    def rod(radius, depth, at, sides=64):
        return add("cylinder", vertices=sides, radius=radius, depth=depth, location=at)

    flange = cut(rod(1.2, 0.3, (0, 0, 0.15), 96), rod(0.6, 1.3, (0, 0, 0.75)), by="UNION")
    angles = [i * pi / 4 for i in range(8)]
    holes = [rod(0.12, 2, (0.92 * cos(a), 0.92 * sin(a), 0), 24) for a in angles]
    bevel(cut(flange, rod(0.42, 4, (0, 0, 0)), *holes), 0.03, 3)
    outline = [((1.05 if i % 4 < 2 else 0.82), i * pi / 28) for i in range(56)]
    rings = ([(2.4 + r * cos(a), 0.3 + r * sin(a), z) for r, a in outline] for z in (0, 0.4))
    gear = bevel(cut(prism("Gear", *rings), rod(0.3, 2, (2.4, 0.3, 0), 48)), 0.025)
    nut = rod(0.5, 0.45, (1.2, -1.5, 0.23), 6)
    bevel(cut(nut, rod(0.28, 2, (1.2, -1.5, 0), 48)), 0.04, 3)
    table = box(20, 14, 0.1, at=(1, 1, -0.05))
    camera((0.0, -5.6, 4.0), (1.1, -0.1, 0.25), 50)
    lamp("AREA", (-3, -3, 5), 700, size=0.8)
    make_fields(flange, gear, nut, table)
    bake("pen-and-ink")


def hills():
    """A landscape of a displaced grid, in low sun, as a woodcut."""
    land = add("grid", x_subdivisions=160, y_subdivisions=160, size=16)
    clouds = bpy.data.textures.new("Clouds", "CLOUDS")
    clouds.noise_scale, clouds.noise_depth = 3.5, 1
    smooth(modify(land, "DISPLACE", texture=clouds, strength=4.5, mid_level=0.5), 1)
    camera((0, -9.5, 3.4), (0, 0, 0.1), 35)
    lamp("SUN", (-6, 2, 3), 3, angle=0.01)
    make_fields(land)
    bake("woodcut")


def temple():
    """Fluted columns by live Arrays on steps, engraved."""
    sides = 40
    circle = [(0.36 - 0.03 * (i % 2), i * 2 * pi / sides) for i in range(sides)]
    rings = (
        [(f * r * cos(a), f * r * sin(a), z) for r, a in circle] for z, f in ((0, 1), (3, 0.85))
    )
    column = prism("Column", *rings)
    column.location = -3, 0, 0.45
    tops = [bevel(box(0.95, 0.95, 0.16, at=(-3, 0, z)), 0.03) for z in (0.37, 3.53)]
    for obj in (column, *tops):
        for count, offset in ((5, (1.5, 0, 0)), (2, (0, 2.6, 0))):
            array = modify(obj, "ARRAY", count=count, constant_offset_displace=offset).modifiers[-1]
            array.use_relative_offset, array.use_constant_offset = False, True
    steps = [
        box(8.2 - 0.5 * i, 4.6 - 0.5 * i, 0.15, at=(0, 1.3, -0.1 + 0.15 * i)) for i in range(3)
    ]
    beam = box(7.2, 3.6, 0.5, at=(0, 1.3, 3.86))
    gable = (-3.8, 4.11), (3.8, 4.11), (0, 5.3)
    roof = prism("Roof", *([(x, y, z) for x, z in gable] for y in (3.2, -0.6)))
    ground = box(60, 40, 0.1, at=(0, 5, -0.22))
    camera((-6.0, -10.6, 1.9), (-0.1, 0.6, 2.4), 34)
    lamp("SUN", (-7, -5, 6), 3, angle=0.01)
    make_fields(column, *tops, *steps, beam, roof, ground)
    bake("engraving", outline=2)


def chess():
    """Chessmen turned by live Screw modifiers, in charcoal."""
    men = [
        lathe("Pawn", PAWN, at=(x, y, 0))
        for x, y in ((-1.6, 0), (-0.4, 0.9), (0.9, -0.6), (2.0, 0.6))
    ]
    men += [lathe("Rook", ROOK, at=at) for at in ((0.5, 1.4, 0), (-1.3, 1.8, 0))]
    fallen = lathe("Fallen", PAWN, at=(-0.5, -0.9, 0.3))
    fallen.rotation_euler = radians(82), 0, radians(60)
    board = box(9, 9, 0.1, at=(0, 0.5, -0.05))
    camera((0.4, -5.6, 2.3), (0.2, 0.2, 0.55), 50)
    lamp("AREA", (-4, -1, 3.5), 700, size=0.6)
    make_fields(*men, fallen, board)
    bake("charcoal")


def knot():
    """A trefoil knot, a converted curve, with a field along its curvature."""
    curve = bpy.data.curves.new("Knot", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.bevel_resolution = "3D", 0.42, 8
    spline = curve.splines.new("NURBS")
    spline.points.add(47)
    for point, t in zip(spline.points, [2 * pi * i / 48 for i in range(48)], strict=True):
        point.co = sin(t) + 2 * sin(2 * t), cos(t) - 2 * cos(2 * t), -1.1 * sin(3 * t), 1
    spline.use_cyclic_u = True
    made = link(bpy.data.objects.new("Knot", curve))
    bpy.context.view_layer.objects.active = made
    made.select_set(True)
    bpy.ops.object.convert(target="MESH")
    knot = bpy.context.object
    knot.rotation_euler = radians(68), 0, 0
    camera((0, -13, 1.0), (0, 0, -0.2), 50)
    lamp("AREA", (-4, -5, 5), 900, size=1.0)
    make_fields(knot, kind="curvature")
    bake("plaid")


SCENES = (
    portrait,
    building,
    dancers,
    street,
    poster,
    glass,
    still_life,
    machine,
    hills,
    temple,
    chess,
    knot,
)


def main(folder: str, scale: str = "1", *names: str) -> None:
    for make in SCENES:
        if names and make.__name__ not in names:
            continue
        empty_scene(float(scale))
        make()
        for engine in ("eevee", "cycles"):
            render(str(Path(folder).resolve() / f"{make.__name__}-{engine}.png"), engine)


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :])
