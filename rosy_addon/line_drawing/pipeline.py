"""Draw the mesh instances of a scene with strokes: from the spacing over tracing to clipping."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np

from ..annotation.arrow_marks import has_arrows
from ..annotation.singularity_marks import SingularityMarks, singularity_marks
from ..annotation.singularity_settings import shows_singularities
from ..core.cache import Cache
from ..core.errors import RosyError
from ..core.memory import check_memory
from ..core.progress import progress, report
from ..field.frames import transformed
from ..projection.camera import Camera
from ..projection.gbuffer import MeshInstance
from ..projection.pixel_blocks import part_of
from .arrowheads import arrowheads
from .crossings import with_crossing_gaps
from .families import label_families
from .mesh_in_view import MeshInView, mesh_in_view, seen_triangles, triangles_near, whole_mesh
from .outline import OUTLINE_KINDS, outline_strokes, visible_outline
from .spacing import (
    MAX_SPACING_RATIO,
    CornerSpacing,
    fan_vertices,
    lit_tone,
    spacing_by_curvature,
    spacing_by_tone,
    spacing_in_picture,
    values_at_points,
    weight_by_tone,
    with_vertices_of_fans,
)
from .stroke_ends import extend_free_ends, head_on_ends, mark_free_boundary_ends
from .stroke_set import Strokes
from .style import StrokeStyle
from .tangent_mesh import CREASE_ANGLE, TangentMesh, build_tangent_mesh
from .trace import trace_on_mesh
from .visibility import (
    DepthBuffer,
    clip_to_visible,
    in_frame,
    pixel_size,
    project_to_pixels,
    rasterize_depth,
    smooth,
)

#: Width of a tapered stroke at its end, as a fraction of the full width.
TIP_WIDTH = 0.15

#: If no vertex of a mesh instance is in the frame, spacings on it are not smaller than the spacing at this
#: fraction of its mean distance to the camera.
OFFSCREEN_DISTANCE_RATIO = 0.1

#: Smallest distance between strokes in a picture, in pixels. Visible runs that are shorter than a few pixels
#: are removed as artifacts, and strokes at smaller distances would hardly be longer.
MIN_SPACING_PIXELS = 0.5

#: Memory of tracing in bytes: a constant, plus `SQUARE_BYTES` for each family and each square of the surface
#: whose side is the spacing. The piece of a stroke that crosses the square has about 12 points of 16 float64
#: numbers.
TRACING_BYTES, SQUARE_BYTES = 40_000_000, 1500


@dataclass(frozen=True, eq=False)
class StrokeDrawing:
    """The strokes of all mesh instances in a drawing.

    Attributes
    ----------
    strokes : Strokes
        The S strokes. Families with the same name are merged across instances. The families of outlines are
        last.
    instance_index : (S,) int32 ndarray
        For each stroke, the index of its mesh instance in the sequence that was drawn.
    hidden : bool
        Whether parts that the camera does not see were kept.
    marks : SingularityMarks or None
        Marks of the singularities; None if the style does not show them.
    """

    strokes: Strokes
    instance_index: np.ndarray
    hidden: bool = False
    marks: SingularityMarks | None = None


@dataclass(frozen=True, eq=False)
class _View:
    """The camera, the style and the depth buffer of a drawing, which are the same for all instances.

    Attributes
    ----------
    camera : Camera
    style : StrokeStyle
    clips : bool
        Whether strokes are clipped to the frame.
    depth_buffer : DepthBuffer or None
        Depth buffer of all instances; None if hidden strokes are kept.
    """

    camera: Camera
    style: StrokeStyle
    clips: bool
    depth_buffer: DepthBuffer | None


def draw_instances(
    instances: Sequence[MeshInstance],
    camera: Camera,
    style: StrokeStyle,
    *,
    lights: Sequence[Any] = (),
    clip_to_frame: bool = True,
    cache: Cache | None = None,
) -> StrokeDrawing:
    """Cover mesh instances with strokes, and remove the parts that the camera does not see.

    Parameters
    ----------
    instances : sequence of MeshInstance
        Strokes are drawn on the instances with a field. All instances can hide strokes.
    camera : Camera
        Camera of the drawing. Its resolution also sets the length of a pixel.
    style : StrokeStyle
    lights : sequence of compositor.shading.Light
        Lights in camera space, from which the tone is computed. If there are none, the light is at the
        camera.
    clip_to_frame : bool
        Whether strokes are clipped to the frame if `style.hidden` is set. If it is not set, they are always
        clipped.
    cache : Cache, optional
        Cache for corner fields.

    Returns
    -------
    StrokeDrawing

    Raises
    ------
    RosyError
        If no instance has a field, a spacing is not valid, no stroke is visible, or strokes need
        more memory than there is.
    """
    cache = Cache() if cache is None else cache
    drawn = [index for index, instance in enumerate(instances) if instance.field is not None]
    if not drawn:
        raise RosyError("no object has a field: strokes need one")
    clips = clip_to_frame or not style.hidden
    if clips:
        drawn = [index for index in drawn if _is_in_view(instances[index].face_points(), camera)]
    depth_buffer = None
    if drawn and not style.hidden:
        with progress(0.01, 0.05, "finding visible strokes"):
            depth_buffer = rasterize_depth(instances, camera)
    view = _View(camera, style, clips, depth_buffer)
    parts = []
    for rank, index in enumerate(drawn):
        with progress(0.05 + 0.87 * rank / len(drawn), 0.05 + 0.87 * (rank + 1) / len(drawn)):
            strokes = _instance_strokes(instances[index], index, view, lights, cache)
        if strokes is not None:
            parts.append((index, strokes))
    if not parts:
        raise _no_visible_stroke(camera)
    # Families of different instances stay separate until the end. Each belongs to one instance.
    strokes = reduce(Strokes.concatenate, [lines for _, lines in parts])
    if not len(strokes) and not style.outline:
        raise RosyError("no stroke fits on the surface: reduce the spacing")
    if clips:
        with progress(0.92, 0.93):
            strokes = smooth(clip_to_visible(strokes, camera, depth_buffer), camera)
    if style.outline:
        with progress(0.93, 0.95):
            outlines = [(index, _outline(instances[index], index, view)) for index, _ in parts]
        strokes = reduce(Strokes.concatenate, [lines for _, lines in outlines], strokes)
        parts += outlines
    owner = np.array([index for index, _ in parts], dtype=np.int32)
    instance_of_family = np.repeat(owner, [len(lines.names) for _, lines in parts])
    heads = []
    if style.arrows:
        points_one_way = np.array([has_arrows(instance) for instance in instances])
        has_direction = points_one_way[instance_of_family[strokes.family]]
        has_direction &= strokes.member[strokes.start[:-1]].any(axis=1)  # not outlines
        heads = [arrowheads(strokes, style.arrows, has_direction)]
    if style.overshoot:
        with progress(0.95, 0.98):
            strokes = _overshoot(strokes, view)
    if not len(strokes):
        raise _no_visible_stroke(camera)
    strokes = Strokes.join([strokes, *heads])
    marks = None
    if shows_singularities(style):
        with progress(0.98, 1.0):
            marks = singularity_marks(instances, camera, style)
    owner = instance_of_family[strokes.family]
    return StrokeDrawing(_merge_families_by_name(strokes), owner, style.hidden, marks)


def _instance_strokes(
    instance: MeshInstance, index: int, view: _View, lights: Sequence[Any], cache: Cache
) -> Strokes | None:
    """Return the strokes of a mesh instance before clipping, or None if no stroke can be in view.

    `index` is the index of the instance in the depth buffer, and `lights` are in camera space.
    """
    style = view.style
    report(0.0, "computing the spacing")
    # Spacing and tone jump at sharp edges, so they are stored for smooth fans of corners, not for vertices.
    by_fan = with_vertices_of_fans(instance)
    tone = lit_tone(by_fan, view.camera, lights) if style.light != "none" else None
    # With a swell of 1, the tone changes only the widths, not the spacing.
    max_ratio = MAX_SPACING_RATIO ** (1 - style.swell)
    factor = np.ones(len(by_fan.surface.vertices))
    if tone is not None:
        factor = spacing_by_tone(tone, max_ratio)
    if style.curvature:
        with progress(0.01, 0.02):
            at_vertices = spacing_by_curvature(instance.surface, style.curvature)
        factor = factor * at_vertices[fan_vertices(instance.surface)]
    with progress(0.02, 0.08):
        crease_angle = None if style.cross_creases else CREASE_ANGLE
        mesh = build_tangent_mesh(instance, crease_angle=crease_angle, cache=cache)
    with progress(0.08, 0.1):
        seen = _part_to_trace(instance, index, mesh, factor[by_fan.surface.triangle_vertex], view)
    if seen is None:
        return None
    part, spacing = seen
    name = instance.surface.name
    needed = stroke_memory(part.mesh, spacing.values)
    subject = f"{name}: a drawing of strokes with this spacing"
    check_memory(needed, subject, "increase the spacing, or choose a smaller size")
    with progress(0.1, 0.9):
        strokes = part.on_whole_mesh(trace_on_mesh(part.mesh, spacing, name))
    strokes = mark_free_boundary_ends(strokes, mesh)
    if style.cross_creases:
        # Strokes may cross creases. Families are matched on a mesh without connections across creases.
        with progress(0.9, 0.92):
            mesh = build_tangent_mesh(instance, cache=cache)
    with progress(0.92, 0.95):
        strokes = label_families(strokes, mesh, view.camera.view[0, :3])
    if tone is not None:
        point_tone = values_at_points(strokes, by_fan.surface, tone)
        strokes = weight_by_tone(strokes, point_tone, style.layering, max_ratio)
    if style.gaps:
        with progress(0.95, 0.98):
            strokes = with_crossing_gaps(strokes, style.gaps)
    if style.taper:
        # Strokes reach creases and borders at full width, as they reach silhouettes. Ends that will be
        # extended are tapered after the extension.
        with progress(0.98, 1.0):
            ends = ~head_on_ends(strokes) & ~strokes.free_end_mask
        strokes = strokes.tapered(style.taper, TIP_WIDTH, ends)
    return strokes if style.overshoot else replace(strokes, free_ends=None)


def _part_to_trace(
    instance: MeshInstance, index: int, mesh: TangentMesh, factor: np.ndarray, view: _View
) -> tuple[MeshInView, CornerSpacing] | None:
    """Return the part of a mesh on which strokes are traced, and the spacing on it, or None.

    If strokes are clipped, the part is in the frame or near it. If hidden strokes are removed, it consists of
    the visible triangles and those near them. None is returned if the field is zero everywhere on the part.

    Parameters
    ----------
    instance, index
        Instance, and its index in the depth buffer.
    mesh : TangentMesh
        Tangent mesh of the instance, with T triangles.
    factor : (T, 3) float64 ndarray
        Factor at each corner by which tone and curvature change the spacing.
    view : _View
    """
    part = mesh_in_view(mesh, view.camera) if view.clips else whole_mesh(mesh)
    if not part.mesh.z.any():
        return None
    if view.clips and view.style.unit == "world":
        _check_distance(part.mesh, view, instance.surface.name)
    spacing = _corner_spacing(part.mesh, view)
    spacing = replace(spacing, values=spacing.values * part.corner_values(factor))
    if view.depth_buffer is not None:
        seen = seen_triangles(instance, index, view.depth_buffer)
        kept = triangles_near(part.mesh, seen[part.triangle], spacing.values)
        part, spacing = part.take(kept), part_of(spacing, kept)
    return (part, spacing) if part.mesh.z.any() else None


def _outline(instance: MeshInstance, index: int, view: _View) -> Strokes:
    """Return the outline of an instance. If strokes are clipped to the visible parts, so is the outline.

    `index` is the index of the instance in the depth buffer.
    """
    if view.clips:
        outline = visible_outline(instance, index, view.camera, view.depth_buffer)
        outline = smooth(outline, view.camera)
    else:
        outline = outline_strokes(instance, view.camera)
    return replace(outline, width=outline.width * view.style.outline)


def _overshoot(strokes: Strokes, view: _View) -> Strokes:
    """Extend free ends, clip the extensions to the frame, and taper these ends."""
    style, camera = view.style, view.camera
    strokes = extend_free_ends(strokes, camera, style.overshoot, view.depth_buffer)
    if view.clips:
        inside = in_frame(project_to_pixels(strokes.points, camera)[0], camera)
        strokes = strokes.runs_where(inside, free_at_removed=False)
    return strokes.tapered(style.taper, TIP_WIDTH, strokes.free_end_mask)


def _check_distance(mesh: TangentMesh, view: _View, surface_name: str) -> None:
    """Check that strokes whose distance is given in Blender units are not too near each other in the picture.

    Raises
    ------
    RosyError
        If strokes are less than `MIN_SPACING_PIXELS` apart where the surface is nearest to the camera. The
        message begins with `surface_name`.
    """
    nearest = float(pixel_size(mesh.points.reshape(-1, 3), view.camera).min())
    pixels = view.style.distance / nearest
    if pixels < MIN_SPACING_PIXELS:
        raise RosyError(
            f"{surface_name}: strokes would be {pixels:.1g} pixels apart: increase their distance or "
            "the size of the picture"
        )


def stroke_memory(mesh: TangentMesh, spacing: np.ndarray) -> float:
    """Return an estimate of the peak memory, in bytes, of tracing strokes on a mesh.

    Parameters
    ----------
    mesh : TangentMesh
    spacing : (T, 3) float64 ndarray
        Spacing at the corners, in world space.
    """
    squares = float((mesh.area / spacing.mean(axis=1) ** 2).sum())
    return TRACING_BYTES + SQUARE_BYTES * squares * mesh.family_count


def _corner_spacing(mesh: TangentMesh, view: _View) -> CornerSpacing:
    """Return the spacing at the corners of triangles, in world space, without effects of tone and curvature.

    If strokes are not clipped, the spacing outside the frame of a perspective camera is not smaller than
    the smallest spacing inside the frame. Otherwise the number of strokes near the camera would be unlimited.
    """
    camera, style = view.camera, view.style
    if style.unit == "world":
        return CornerSpacing(np.full(mesh.z.shape, style.distance))
    spacing = spacing_in_picture(mesh, camera, style.spacing)
    if view.clips or not camera.is_perspective:
        return spacing
    points, values = mesh.points.reshape(-1, 3), spacing.values
    inside = in_frame(project_to_pixels(points, camera)[0], camera)
    if inside.any():
        least = values.ravel()[inside].min()
    else:
        mean_distance = float(np.linalg.norm(points - camera.eye, axis=1).mean())
        ratio = OFFSCREEN_DISTANCE_RATIO if _is_in_view(points, camera) else 1.0
        least = style.spacing * ratio * mean_distance / camera.pixels_per_unit
    return replace(spacing, values=np.maximum(values, least))


def _is_in_view(points: np.ndarray, camera: Camera) -> bool:
    """Return whether a surface with the (n, 3) vertices `points` may be in view.

    It is not in view if all vertices are outside of the same plane of the view frustum. The far plane is not
    tested.
    """
    clip = transformed(points, camera.projection @ camera.view)
    w = clip[:, 3:]
    is_outside = np.concatenate([clip[:, :2] > w, clip[:, :3] < -w], axis=1)
    return not is_outside.all(axis=0).any()


def _no_visible_stroke(camera: Camera) -> RosyError:
    """Return the error for a camera that sees no stroke."""
    return RosyError(
        f"camera '{camera.name}': no stroke is visible: check the view, or draw hidden strokes too"
    )


def _merge_families_by_name(strokes: Strokes) -> Strokes:
    """Return strokes in which families of the same name are merged. The families of outlines are last."""
    # `dict.fromkeys` removes repeated names, and sorting keeps the order of the others.
    names = sorted(dict.fromkeys(strokes.names), key=OUTLINE_KINDS.__contains__)
    new_family = np.array([names.index(name) for name in strokes.names], dtype=np.int32)
    return replace(strokes, family=new_family[strokes.family], names=tuple(names))
