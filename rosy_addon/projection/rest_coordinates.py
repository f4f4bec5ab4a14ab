"""Positions of the pixels of a G-buffer on the rest shapes of the meshes.

Points of the surface keep these positions when the mesh is transformed or deformed.
"""

from dataclasses import dataclass

import numpy as np

from ..core.progress import report
from ..field.polygon_arrays import box_corners
from ..field.surface import Surface
from .camera import Camera
from .gbuffer import GBuffer, MeshInstance
from .project import clip_vertices

#: Text that the user sees while this step runs.
LABEL = "finding points on the surface"

#: Distance of a mesh from its object's origin, in multiples of its size, beyond which positions are
#: taken relative to the mesh: float32 would be too coarse for them.
FAR_RATIO = 1000

#: Range to which barycentric coordinates are clamped. On a triangle that is seen edge-on, a pixel
#: can reach far beyond the triangle.
BARYCENTRIC_RANGE = (-4, 5)


@dataclass(frozen=True, eq=False)
class RestCoordinates:
    """Positions on the rest shapes of the meshes, at the centers of P pixels and at offsets from the centers.

    Attributes
    ----------
    weights, weights_dx, weights_dy : (3, P) float32 ndarray
        Homogeneous barycentric coordinates at the pixel center, with sum 1, and their changes to the next
        pixel on the right and to the next pixel above, in the plane of the triangle. Divided by their sum,
        they are perspective-correct.
    rest_corners : (3, 3, P) float32 ndarray
        The corners of the triangle in the rest shape, in object space, or relative to a point near the mesh
        (see `rest_positions`). The first axis is the corner, the second the component.
    pixel_size : (P,) float32 ndarray
        Width of a pixel at the depth of the surface, parallel to the picture, in units of object
        space.
    """

    weights: np.ndarray
    weights_dx: np.ndarray
    weights_dy: np.ndarray
    rest_corners: np.ndarray
    pixel_size: np.ndarray

    def at_offset(self, dx: float, dy: float) -> np.ndarray:
        """Return the (3, P) float32 rest positions at an offset from the pixel centers.

        `dx` and `dy` are in pixels, to the right and up. The position is in the plane of the
        visible triangle of each pixel.
        """
        weight = self.weights + np.float32(dx) * self.weights_dx
        weight += np.float32(dy) * self.weights_dy
        total = weight.sum(axis=0)
        total[np.abs(total) < 1e-30] = 1
        weight /= total
        np.clip(weight, *BARYCENTRIC_RANGE, out=weight)
        return sum(w * corner for w, corner in zip(weight, self.rest_corners, strict=True))


def rest_coordinates(gbuffer: GBuffer) -> RestCoordinates:
    """Compute the positions of the pixels of a G-buffer on the rest shapes.

    Parameters
    ----------
    gbuffer : GBuffer

    Returns
    -------
    RestCoordinates
    """
    report(0.0, LABEL)
    count = len(gbuffer.pixel)
    shapes = (3, count), (3, count), (3, count), (3, 3, count), count
    coordinates = RestCoordinates(*(np.empty(shape, dtype=np.float32) for shape in shapes))
    for _, instance, blocks, (start, stop) in gbuffer.instance_blocks():
        rest = rest_positions(instance.surface)
        screen = _screen_vertices(gbuffer.camera, instance)
        for number, block in enumerate(blocks):
            report(start + (stop - start) * number / len(blocks), LABEL)
            _fill_pixels(coordinates, gbuffer, instance, rest, screen, block)
    return coordinates


def rest_positions(surface: Surface) -> np.ndarray:
    """Return the positions of the vertices in the rest shape.

    The rest shape is `Surface.rest_vertices`, or `Surface.vertices` if that is None.

    Returns
    -------
    (V, 3) float64 ndarray
        Positions in object space. If the mesh is farther from the origin than `FAR_RATIO` times its size,
        they are relative to a point near the center of its bounding box. The coordinates of this point are
        multiples of s, the size of the mesh rounded up to a power of 2.
    """
    rest = surface.in_rest_shape().vertices
    corners = box_corners(rest[surface.used_vertices])
    size = np.ptp(corners, axis=0).max()
    if np.abs(corners).max() <= FAR_RATIO * size:
        return rest
    # On a grid, so that slight changes of the mesh do not move the point.
    spacing = np.exp2(np.ceil(np.log2(max(size, np.finfo(np.float64).tiny))))
    return rest - np.round(corners.mean(axis=0) / spacing) * spacing


def _screen_vertices(camera: Camera, instance: MeshInstance) -> np.ndarray:
    """Return (3, V) float64 homogeneous screen coordinates of vertices: x w and y w in pixels, and w."""
    x, y, _, w = clip_vertices(instance, camera)
    return np.stack([(x + w) * (0.5 * camera.width), (y + w) * (0.5 * camera.height), w])


def _fill_pixels(
    coordinates: RestCoordinates,
    gbuffer: GBuffer,
    instance: MeshInstance,
    rest: np.ndarray,
    screen: np.ndarray,
    pixels: slice | np.ndarray,
) -> None:
    """Compute the coordinates at some pixels of one mesh instance, in place.

    `rest` holds the (V, 3) vertices of the instance in the rest shape, and `screen` their (3, V) homogeneous
    screen coordinates. `pixels` are indices into the G-buffer.
    """
    camera, surface = gbuffer.camera, instance.surface
    vertices = surface.triangle_vertex.take(gbuffer.triangle[pixels], axis=0).T
    row, column = np.divmod(gbuffer.pixel[pixels], np.int32(camera.width))
    row, column = row + 0.5, column + 0.5
    offsets = []
    for corner, out in zip(vertices, coordinates.rest_corners, strict=True):
        # Homogeneous offset from the pixel center, in pixels times w.
        x, y, w = (values.take(corner) for values in screen)
        x -= column * w
        y -= row * w
        offsets.append((x, y, w))
        out[:, pixels] = rest.take(corner, axis=0).T
    # Homogeneous edge functions are linear on screen, so their derivatives are constant.
    weights, weights_dx, weights_dy = [], [], []
    for edge in range(3):
        (bx, by, bw), (cx, cy, cw) = offsets[(edge + 1) % 3], offsets[(edge + 2) % 3]
        weights.append(bx * cy - cx * by)
        weights_dx.append(cw * by - bw * cy)
        weights_dy.append(bw * cx - cw * bx)
    # Their sum is 1 at the pixel center, for single precision.
    total = weights[0] + weights[1]
    total += weights[2]
    total[total == 0] = 1
    np.divide(1, total, out=total)
    targets = coordinates.weights, coordinates.weights_dx, coordinates.weights_dy
    for target, values in zip(targets, (weights, weights_dx, weights_dy), strict=True):
        for edge, value in enumerate(values):
            value *= total
            target[edge, pixels] = value
    depth = -gbuffer.position[pixels, 2] if camera.is_perspective else 1.0
    scale = camera.pixels_per_unit * matrix_scale(instance.matrix)
    coordinates.pixel_size[pixels] = depth / scale


def matrix_scale(matrix: np.ndarray) -> float:
    """Return the mean scale of a (4, 4) matrix: the cube root of the factor by which it scales volumes.

    If the matrix is singular, return 1.
    """
    linear = np.asarray(matrix, dtype=np.float64)[:3, :3]
    return float(np.cbrt(abs(np.cross(linear[0], linear[1]) @ linear[2]))) or 1.0
