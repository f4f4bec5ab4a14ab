"""Cameras: view and projection matrices, pixel rays, and cameras that frame given objects."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import RosyError
from ..field.frames import normalize

#: Largest width or height of a picture, in pixels.
MAX_SIDE_PIXELS = 16384

#: Angle of view over the longer side of the picture, in radians, of Blender's default camera: it has a lens
#: of 50 mm and a sensor of 36 mm.
DEFAULT_FOV = float(2 * np.arctan(36 / (2 * 50)))

#: Fraction of the frame that stays empty at each border, where a camera frames points.
DEFAULT_MARGIN = 0.04


def check_size(width: int, height: int) -> tuple[int, int]:
    """Return the size of a picture as two ints.

    Raises
    ------
    RosyError
        If a side is not a whole number of pixels from 1 to `MAX_SIDE_PIXELS`.
    """
    for side in (width, height):
        if int(side) != side or not 1 <= side <= MAX_SIDE_PIXELS:
            raise RosyError(
                f"size {width}x{height}: a side must be from 1 to {MAX_SIDE_PIXELS} pixels"
            )
    return int(width), int(height)


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera: view matrix, projection matrix and picture size.

    Camera space is Blender's: x right, y up, looking down -z, in Blender units. Pixels are counted
    from the lower left: pixel (column c, row r) has its center at (c + 0.5, r + 0.5) and the flat
    index ``r * width + c``.

    Attributes
    ----------
    view : (4, 4) float64 ndarray
        World to camera space, a rotation and a translation.
    projection : (4, 4) float64 ndarray
        Camera to clip space in OpenGL's convention: the visible range is -w <= x, y, z <= w. The
        camera is perspective if ``projection[3, 2]`` is not 0, and orthographic otherwise. The
        matrix is scaled on construction so that w is the depth along the camera axis (perspective)
        or 1 (orthographic).
    width, height : int
        Size of the picture in pixels.
    name : str
        Used in messages and in the names of baked pictures.
    picture_share : float
        Width of the finished picture as a fraction of `width`. It is not 1 in 3D views that show more or less
        than the frame of a camera.

    Raises
    ------
    RosyError
        If the size is invalid, a matrix is not 4 x 4 or not finite, the camera is mirrored, the
        view scales or shears, or the projection is neither perspective nor orthographic.
    """

    view: np.ndarray
    projection: np.ndarray
    width: int
    height: int
    name: str = "camera"
    picture_share: float = 1.0

    def __post_init__(self) -> None:
        width, height = check_size(self.width, self.height)
        view = _validated_view(self.view, self.name)
        projection = _validated_projection(self.projection, self.name)
        vars(self).update(width=width, height=height, view=view, projection=projection)

    @property
    def key(self) -> Hashable:
        """Key for caches: equal for two cameras that differ only in their names."""
        return self.view.tobytes(), self.projection.tobytes(), *self.size, self.picture_share

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, in pixels."""
        return self.width, self.height

    @property
    def is_perspective(self) -> bool:
        """Whether the camera is perspective, not orthographic."""
        return bool(self.projection[3, 2] != 0.0)

    @property
    def pixels_per_unit(self) -> float:
        """Pixels per Blender unit, perpendicular to the camera axis.

        A perspective camera has this scale at depth 1, an orthographic camera at any depth. If pixels are
        not square, it is the geometric mean of the horizontal and the vertical scale.
        """
        return float(np.sqrt(_xy_determinant(self.projection) * self.width * self.height / 4))

    @property
    def eye(self) -> np.ndarray:
        """Position of a perspective camera in world space, (3,) float64."""
        return -self.view[:3, :3].T @ self.view[:3, 3]

    def view_directions(self, points: np.ndarray) -> np.ndarray:
        """Return (..., 3) unit directions, in world space, from (..., 3) points to this camera.

        All directions of an orthographic camera are equal.
        """
        if not self.is_perspective:
            return np.broadcast_to(self.view[2, :3], points.shape)
        return normalize(self.eye - points)

    def depths(self, points: np.ndarray) -> np.ndarray:
        """Return the (...) depths of (..., 3) points in world space, along the axis of this camera."""
        return -(points @ self.view[2, :3] + self.view[2, 3])

    def pixel_sizes(self, depth: np.ndarray) -> np.ndarray:
        """Return the (n,) sides of a pixel in world space at (n,) depths, perpendicular to the camera axis."""
        return (depth if self.is_perspective else np.ones_like(depth)) / self.pixels_per_unit

    def resized(self, width: int, height: int) -> Camera:
        """Return a camera with the same matrices and another picture size, in pixels.

        It shows the same part of the scene. If the ratio of the sides changes, pixels are not square.
        """
        return replace(self, width=width, height=height)

    def scaled(self, factor: int) -> Camera:
        """Return the same camera with `factor` times the width and height in pixels."""
        return self.resized(self.width * factor, self.height * factor)

    @property
    def to_world(self) -> np.ndarray:
        """Inverse of the view matrix, (4, 4) float64: from camera space to world space."""
        return _view_from_axes(self.view[:3, :3].T, self.view[:3, 3])

    @property
    def view_to_pixels(self) -> np.ndarray:
        """The (2, 2) float64 map from displacements parallel to the picture to displacements on screen.

        Displacements on screen are in pixels, divided by `pixels_per_unit`. So the map is the identity for
        a usual camera with square pixels.
        """
        scaled = self.projection[:2, :2] * [[self.width], [self.height]]
        return scaled / (2 * self.pixels_per_unit)

    @property
    def clip_to_camera_xy(self) -> np.ndarray:
        """Inverse of the upper left (2, 2) part of the projection matrix.

        It maps x and y of clip space, after the lens shift is removed, to x and y of camera space. They
        are coordinates at depth 1 for a perspective camera, and at any depth for an orthographic one.
        """
        # In closed form, because linear algebra libraries start all their threads for any system.
        (a, b), (c, d) = self.projection[:2, :2]
        return np.array([[d, -b], [-c, a]]) / _xy_determinant(self.projection)


def _xy_determinant(projection: np.ndarray) -> float:
    """Return the determinant of the upper left (2, 2) part of a projection matrix, which maps x and y."""
    (a, b), (c, d) = projection[:2, :2]
    return float(a * d - b * c)


def _validated_matrix(matrix: np.ndarray, matrix_kind: str, name: str) -> np.ndarray:
    """Return a float64 copy of a matrix, or raise `RosyError` if it is not 4 x 4 and finite."""
    matrix = np.array(matrix, dtype=np.float64)
    if matrix.shape != (4, 4):
        raise RosyError(
            f"camera '{name}': its {matrix_kind} matrix must have the shape (4, 4), not {matrix.shape}"
        )
    if not np.isfinite(matrix).all():
        raise RosyError(f"camera '{name}': its {matrix_kind} matrix is not finite")
    return matrix


def _validated_view(view: np.ndarray, name: str) -> np.ndarray:
    """Return the view matrix, or raise `RosyError` if it is not a rotation and a translation."""
    view = _validated_matrix(view, "view", name)
    rotation = view[:3, :3]
    if np.cross(rotation[0], rotation[1]) @ rotation[2] < 0:
        raise RosyError(f"camera '{name}' is mirrored: make its scale positive")
    is_rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3)
    if not is_rigid or not np.allclose(view[3], (0, 0, 0, 1), atol=1e-6):
        raise RosyError(f"camera '{name}': its view matrix must be a rotation and a translation")
    return view


def _validated_projection(projection: np.ndarray, name: str) -> np.ndarray:
    """Return the projection matrix, scaled so that w is depth or 1. Raise `RosyError` if it is invalid."""
    projection = _validated_matrix(projection, "projection", name)
    w_row, xy_rows = projection[3], projection[:2]
    if w_row[2] < 0 and not w_row[[0, 1, 3]].any() and not xy_rows[:, 3].any():
        projection = projection / -w_row[2]
    elif w_row[3] > 0 and not w_row[:3].any() and not xy_rows[:, 2].any():
        projection = projection / w_row[3]
    else:
        raise RosyError(f"camera '{name}' is neither perspective nor orthographic")
    if _xy_determinant(projection) <= 0:
        raise RosyError(f"camera '{name}': its projection is mirrored or flat")
    return projection


def pixel_rays(camera: Camera, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rays through the centers of pixels, each given by x and y in camera space.

    Parameters
    ----------
    camera : Camera
    pixel : (P,) ndarray of int
        Flat indices.

    Returns
    -------
    x, y : (P,) float64 ndarray
        For a perspective camera, the intersection with the plane at depth 1 (z = -1). For an
        orthographic camera, the position of the ray, which is the same at any depth.
    """
    row, column = np.divmod(pixel, camera.width)
    projection = camera.projection
    shift = projection[:2, 2] if camera.is_perspective else -projection[:2, 3]
    clip_x = (2.0 / camera.width) * (column + 0.5) + (shift[0] - 1.0)
    clip_y = (2.0 / camera.height) * (row + 0.5) + (shift[1] - 1.0)
    clip_to_camera = camera.clip_to_camera_xy
    if clip_to_camera[0, 1] == 0 and clip_to_camera[1, 0] == 0:
        return clip_to_camera[0, 0] * clip_x, clip_to_camera[1, 1] * clip_y
    return (
        clip_to_camera[0, 0] * clip_x + clip_to_camera[0, 1] * clip_y,
        clip_to_camera[1, 0] * clip_x + clip_to_camera[1, 1] * clip_y,
    )


def z_at_depth(camera: Camera, x: np.ndarray, y: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return z in camera space of points on pixel rays, given their depth z / w in clip space.

    `x` and `y` are the rays as in `pixel_rays`: in camera space, at depth 1 under perspective.
    """
    m_x, m_y, m_z, m_w = camera.projection[2]
    if camera.is_perspective:
        # Solves (-m_x x - m_y y + m_z) z + m_w = -z depth for z.
        return -m_w / (depth + (m_z - m_x * x - m_y * y))
    return (depth - m_w - m_x * x - m_y * y) / m_z


def perspective_camera(
    view: np.ndarray,
    width: int,
    height: int,
    *,
    fov: float = DEFAULT_FOV,
    clip: tuple[float, float] = (0.1, 1000.0),
    name: str = "camera",
) -> Camera:
    """Return a perspective camera with square pixels.

    Parameters
    ----------
    view : (4, 4) ndarray
        World to camera space.
    width, height : int
        Pixels.
    fov : float
        Angle of view over the longer side of the picture, in radians.
    clip : (float, float)
        Depths of the near and the far plane, in Blender units.
    name : str

    Raises
    ------
    RosyError
        If the size, angle or clip range is impossible.
    """
    size = np.array(check_size(width, height))
    if not 0 < fov < np.pi:
        raise RosyError(f"camera '{name}': the field of view must be between 0 and pi, not {fov}")
    near, far = clip
    if not 0 < near < far:
        raise RosyError(f"camera '{name}': the clip range {near} to {far} must be 0 < start < end")
    projection = np.zeros((4, 4))
    projection[[0, 1], [0, 1]] = size.max() / (size * np.tan(fov / 2))
    projection[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
    projection[3, 2] = -1.0
    return Camera(view, projection, width, height, name)


def orthographic_camera(
    view: np.ndarray,
    width: int,
    height: int,
    *,
    scale: float = 6.0,
    clip: tuple[float, float] = (0.1, 1000.0),
    name: str = "camera",
) -> Camera:
    """Return an orthographic camera with square pixels.

    Parameters
    ----------
    view : (4, 4) ndarray
        World to camera space.
    width, height : int
        Pixels.
    scale : float
        Blender units along the longer side of the picture (Blender's orthographic scale).
    clip : (float, float)
        Depths of the near and the far plane, in Blender units. The near plane may be behind the camera.
    name : str

    Raises
    ------
    RosyError
        If the size, scale or clip range is impossible.
    """
    size = np.array(check_size(width, height))
    near, far = clip
    if not scale > 0:
        raise RosyError(f"camera '{name}': the orthographic scale must be above 0, not {scale}")
    if not near < far:
        raise RosyError(f"camera '{name}': the clip range {near} to {far} must be start < end")
    projection = np.eye(4)
    projection[[0, 1], [0, 1]] = 2 * size.max() / (size * scale)
    projection[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
    return Camera(view, projection, width, height, name)


def look_at(
    eye: Sequence[float], target: Sequence[float], up: Sequence[float] = (0, 0, 1)
) -> np.ndarray:
    """Return the (4, 4) float64 view matrix of a camera at `eye` that looks at `target`.

    Parameters
    ----------
    eye, target : sequence of 3 float
        Points in world space.
    up : sequence of 3 float
        World direction that points up in the picture.

    Raises
    ------
    RosyError
        If `eye` and `target` are equal, or the camera looks along `up`.
    """
    eye, target, up = (np.asarray(point, dtype=np.float64) for point in (eye, target, up))
    back = eye - target
    right = np.cross(up, back)
    if not np.linalg.norm(back) > 0 or not np.linalg.norm(right) > 1e-9 * np.linalg.norm(back):
        raise RosyError("a camera cannot look at its own position, or along its up direction")
    back, right = back / np.linalg.norm(back), right / np.linalg.norm(right)
    return _view_from_axes(np.array([right, np.cross(back, right), back]), eye)


def _view_from_axes(axes: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return the (4, 4) view matrix of a camera at the point `eye` in world space.

    The rows of `axes`, (3, 3), are unit vectors in world space: right, up and back, as seen by the camera.
    """
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = axes, -axes @ eye
    return view


def orbit_basis(azimuth: float, elevation: float) -> np.ndarray:
    """Return the axes of a camera, given angles in degrees: (3, 3), with the rows right, up and back.

    They are unit vectors in world space.

    World z is up. Azimuth 0, elevation 0 looks along +y (Blender's front view), azimuth 90 along -x
    (its right view), elevation 90 down along -z (its top view).
    """
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([np.cos(a), np.sin(a), 0.0])
    back = np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
    return np.array([right, np.cross(back, right), back])


def orbit_camera(
    points: np.ndarray,
    azimuth: float,
    elevation: float,
    width: int,
    height: int,
    *,
    perspective: bool = True,
    margin: float = DEFAULT_MARGIN,
) -> Camera:
    """Return a camera in a given direction that frames all points, as large as possible.

    Parameters
    ----------
    points : (V, 3) ndarray
        World space.
    azimuth, elevation : float
        Direction of the camera in degrees: (0, 0) looks along +y, (0, 90) down; see `orbit_basis`.
    width, height : int
        Pixels.
    perspective : bool
        Whether the camera is perspective, with the angle of view `DEFAULT_FOV`. Otherwise, it is
        orthographic.
    margin : float
        Fraction of the frame that stays empty at each border.

    Raises
    ------
    RosyError
        If the angles are not finite or there are no points.

    Notes
    -----
    Let a point have the coordinates (u, v, w) along right, up and back, and the eye (eu, ev, ew).
    The point is between the left and the right border if |u - eu| <= k (ew - w), where k is the
    tangent of half the angle of view. These are two inequalities that are linear in the eye
    position, so the nearest possible eye follows from the largest k w + u and the largest k w - u
    over all points.
    """
    width, height = check_size(width, height)
    if not np.isfinite([azimuth, elevation]).all():
        raise RosyError(
            f"view {azimuth},{elevation}: azimuth and elevation must be finite numbers of degrees"
        )
    if not len(points):
        raise RosyError("there are no vertices to frame")
    basis = orbit_basis(azimuth, elevation)
    u, v, w = (np.asarray(points, dtype=np.float64) @ basis.T).T
    longer_side = max(width, height)
    frame_fraction = 1 - 2 * margin
    extent = max(np.ptp(u), np.ptp(v), np.ptp(w)) or 1.0
    if not perspective:
        scale = max(np.ptp(u) * longer_side / width, np.ptp(v) * longer_side / height)
        scale = scale / frame_fraction or extent
        back = w.max() + extent
        eye = np.array([(u.min() + u.max()) / 2, (v.min() + v.max()) / 2, back]) @ basis
        clip = (0.5 * extent, back - w.min() + 0.5 * extent)
        view = _view_from_axes(basis, eye)
        return orthographic_camera(view, width, height, scale=scale, clip=clip, name="view")
    center, back = [], w.max() + 1e-3 * extent
    for coordinate, side in ((u, width), (v, height)):
        slope = np.tan(DEFAULT_FOV / 2) * frame_fraction * side / longer_side
        upper, lower = (slope * w + coordinate).max(), (slope * w - coordinate).max()
        center.append((upper - lower) / 2)
        back = max(back, (upper + lower) / (2 * slope))
    eye = np.array([*center, back]) @ basis
    clip = (0.5 * (back - w.max()), 2 * (back - w.min()) + extent)
    return perspective_camera(_view_from_axes(basis, eye), width, height, clip=clip, name="view")


def framing_points(
    points: np.ndarray,
    azimuth: float,
    elevation: float,
    width: int,
    height: int,
    *,
    perspective: bool = True,
) -> np.ndarray:
    """Return the few points that determine the result of `orbit_camera`.

    The camera that frames these points frames all of the given points. So the framing of a long
    animation can be computed frame by frame, without keeping all of its points.

    Parameters
    ----------
    points : (V, 3) ndarray
        World space; at least one.
    azimuth, elevation : float
        Direction of the camera in degrees, as in `orbit_basis`.
    width, height : int
        Pixels.
    perspective : bool
        Whether the camera is perspective. The result is valid for the default margin of `orbit_camera`.

    Returns
    -------
    (n, 3) ndarray
        At most 10 of the points.
    """
    u, v, w = (points @ orbit_basis(azimuth, elevation).T).T
    extremes = [u, -u, v, -v, w, -w]
    if perspective:
        slope = np.tan(DEFAULT_FOV / 2) * (1 - 2 * DEFAULT_MARGIN)
        for coordinate, side in ((u, width), (v, height)):
            back = slope * side / max(width, height) * w
            extremes += [back + coordinate, back - coordinate]
    return points[np.unique([np.argmax(values) for values in extremes])]
