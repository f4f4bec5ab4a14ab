"""A camera as two matrices and a frame of pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import RosyError
from ..field.frames import unit
from ..field.surface import Surface

#: The longest side of a picture, in pixels.
MAX_SIZE = 16384

#: Blender's default camera: millimetres of focal length and of sensor width.
DEFAULT_FOCAL, DEFAULT_SENSOR = 50.0, 36.0


def check_size(width: int, height: int) -> tuple[int, int]:
    """Return the size of a picture as two ints.

    Raises
    ------
    RosyError
        If a side is not a whole number of pixels from 1 to `MAX_SIZE`.
    """
    for side in (width, height):
        if int(side) != side or not 1 <= side <= MAX_SIZE:
            raise RosyError(f"size {width}x{height}: a side must be from 1 to {MAX_SIZE} pixels")
    return int(width), int(height)


@dataclass(frozen=True, eq=False)
class Camera:
    """Where the eye is and how it sees.

    Camera space is Blender's: x right, y up, looking down -z, in Blender units. Pixels are counted
    from the lower left: pixel (column c, row r) has its centre at (c + 0.5, r + 0.5) and the flat
    index ``r * width + c``.

    Attributes
    ----------
    view : (4, 4) float64 ndarray
        World to camera space, rigid.
    projection : (4, 4) float64 ndarray
        Camera to clip space, OpenGL's convention: visible is -w <= x, y, z <= w. Perspective if
        ``projection[3, 2]`` is not 0, orthographic otherwise. Kept scaled so that w is the depth
        along the camera's axis, or 1.
    width, height : int
        Size of the picture in pixels.
    name : str
        For messages and for naming what is baked.

    Raises
    ------
    RosyError
        If a matrix is not finite, the camera is mirrored, the view scales or shears, or the
        projection is neither perspective nor orthographic.
    """

    view: np.ndarray
    projection: np.ndarray
    width: int
    height: int
    name: str = "camera"

    def __post_init__(self) -> None:
        width, height = check_size(self.width, self.height)
        object.__setattr__(self, "width", width)
        object.__setattr__(self, "height", height)
        object.__setattr__(self, "view", _checked_view(self.view, self.name))
        object.__setattr__(self, "projection", _checked_projection(self.projection, self.name))

    @property
    def is_perspective(self) -> bool:
        """Whether rays meet in the eye."""
        return bool(self.projection[3, 2] != 0.0)

    @property
    def pixels_per_unit(self) -> float:
        """Pixels that a Blender unit across the camera's axis takes, at depth 1 if perspective.

        The geometric mean of both directions where pixels are not square.
        """
        scale = _determinant(self.projection) * self.width * self.height / 4
        return float(np.sqrt(scale))

    @property
    def eye(self) -> np.ndarray:
        """(3,) world space: where the rays of a perspective camera meet."""
        return -self.view[:3, :3].T @ self.view[:3, 3]

    def toward(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) unit directions from points in world space to this camera."""
        if not self.is_perspective:
            return np.broadcast_to(self.view[2, :3], points.shape)
        return unit(self.eye - points)

    def resized(self, width: int, height: int) -> Camera:
        """The same camera with other pixels."""
        return Camera(self.view, self.projection, width, height, self.name)

    def scaled(self, factor: int) -> Camera:
        """The same camera with so many times the pixels each way."""
        return self.resized(self.width * factor, self.height * factor)

    @property
    def across_axis(self) -> np.ndarray:
        """(2, 2): x and y in clip space to x and y at depth 1, or at any if orthographic."""
        # In closed form: linear algebra libraries wake all their threads for any system.
        (a, b), (c, d) = self.projection[:2, :2]
        return np.array([[d, -b], [-c, a]]) / _determinant(self.projection)


def _determinant(projection: np.ndarray) -> float:
    """Of how a projection maps x and y."""
    (a, b), (c, d) = projection[:2, :2]
    return float(a * d - b * c)


def _checked_matrix(matrix: np.ndarray, what: str, name: str) -> np.ndarray:
    matrix = np.array(matrix, dtype=np.float64)
    if matrix.shape != (4, 4):
        raise RosyError(f"camera '{name}': its {what} matrix is {matrix.shape}, not (4, 4)")
    if not np.isfinite(matrix).all():
        raise RosyError(f"camera '{name}': its {what} matrix is not finite")
    return matrix


def _checked_view(view: np.ndarray, name: str) -> np.ndarray:
    view = _checked_matrix(view, "view", name)
    turn = view[:3, :3]
    if np.cross(turn[0], turn[1]) @ turn[2] < 0:
        raise RosyError(f"camera '{name}' is mirrored: one of its scales is negative")
    rigid = np.allclose(turn @ turn.T, np.eye(3), atol=1e-3)
    if not rigid or not np.allclose(view[3], (0, 0, 0, 1), atol=1e-6):
        raise RosyError(f"camera '{name}': its view matrix is not a rotation and a shift")
    return view


def _checked_projection(projection: np.ndarray, name: str) -> np.ndarray:
    projection = _checked_matrix(projection, "projection", name)
    last, shift = projection[3], projection[:2]
    if last[2] < 0 and not last[[0, 1, 3]].any() and not shift[:, 3].any():
        projection = projection / -last[2]
    elif last[3] > 0 and not last[:3].any() and not shift[:, 2].any():
        projection = projection / last[3]
    else:
        raise RosyError(f"camera '{name}' is neither perspective nor orthographic")
    if _determinant(projection) <= 0:
        raise RosyError(f"camera '{name}' is mirrored or flat: its projection turns pictures over")
    return projection


def pixel_rays(camera: Camera, pixel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the rays through the centres of pixels meet the plane across the camera's axis.

    Parameters
    ----------
    camera : Camera
    pixel : (P,) ndarray of int
        Flat indices.

    Returns
    -------
    x, y : (P,) float64 ndarray
        Camera space, at depth 1 (z = -1) for a perspective camera, at any depth for an
        orthographic one.
    """
    row, column = np.divmod(pixel, camera.width)
    projection = camera.projection
    shift = projection[:2, 2] if camera.is_perspective else -projection[:2, 3]
    across = (2.0 / camera.width) * (column + 0.5) + (shift[0] - 1.0)
    upward = (2.0 / camera.height) * (row + 0.5) + (shift[1] - 1.0)
    inverse = camera.across_axis
    if inverse[0, 1] == 0 and inverse[1, 0] == 0:
        return inverse[0, 0] * across, inverse[1, 1] * upward
    return (
        inverse[0, 0] * across + inverse[0, 1] * upward,
        inverse[1, 0] * across + inverse[1, 1] * upward,
    )


def perspective_camera(
    view: np.ndarray,
    width: int,
    height: int,
    *,
    fov: float | None = None,
    focal: float = DEFAULT_FOCAL,
    sensor: float = DEFAULT_SENSOR,
    shift: tuple[float, float] = (0.0, 0.0),
    clip: tuple[float, float] = (0.1, 1000.0),
    name: str = "camera",
) -> Camera:
    """A perspective camera with square pixels.

    Parameters
    ----------
    view : (4, 4) ndarray
        World to camera space.
    width, height : int
        Pixels.
    fov : float, optional
        Angle of view over the longer side of the picture, in radians. Instead of `focal`.
    focal, sensor : float
        Focal length, and the length of the sensor along the longer side of the picture (Blender's
        sensor fit "auto"), in the same unit.
    shift : (float, float)
        Blender's lens shift, in units of the longer side.
    clip : (float, float)
        Nearest and farthest depth seen, in Blender units.
    name : str

    Raises
    ------
    RosyError
        If the size, angle, lens or clip range is impossible.
    """
    width, height = check_size(width, height)
    if fov is not None:
        if not 0 < fov < np.pi:
            raise RosyError(f"camera '{name}': an angle of view of {fov} is not between 0 and pi")
        half = np.tan(fov / 2)
    else:
        if not (focal > 0 and sensor > 0):
            raise RosyError(f"camera '{name}': focal length and sensor must be above 0")
        half = sensor / (2 * focal)
    near, far = clip
    if not 0 < near < far:
        raise RosyError(f"camera '{name}': clip range {near} to {far} is not 0 < start < end")
    longer = max(width, height)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = longer / (width * half), longer / (height * half)
    projection[0, 2], projection[1, 2] = (
        2 * shift[0] * longer / width,
        2 * shift[1] * longer / height,
    )
    projection[2, 2], projection[2, 3] = (
        -(far + near) / (far - near),
        -2 * far * near / (far - near),
    )
    projection[3, 2] = -1.0
    return Camera(view, projection, width, height, name)


def orthographic_camera(
    view: np.ndarray,
    width: int,
    height: int,
    *,
    scale: float = 6.0,
    shift: tuple[float, float] = (0.0, 0.0),
    clip: tuple[float, float] = (0.1, 1000.0),
    name: str = "camera",
) -> Camera:
    """An orthographic camera with square pixels.

    Parameters
    ----------
    view : (4, 4) ndarray
        World to camera space.
    width, height : int
        Pixels.
    scale : float
        Blender units along the longer side of the picture (Blender's orthographic scale).
    shift, clip, name
        As for `perspective_camera`; the clip range may begin behind the camera.

    Raises
    ------
    RosyError
        If the size, scale or clip range is impossible.
    """
    width, height = check_size(width, height)
    near, far = clip
    if not scale > 0:
        raise RosyError(f"camera '{name}': an orthographic scale of {scale} is not above 0")
    if not near < far:
        raise RosyError(f"camera '{name}': clip range {near} to {far} is not start < end")
    longer = max(width, height)
    projection = np.eye(4)
    projection[0, 0], projection[1, 1] = 2 * longer / (width * scale), 2 * longer / (height * scale)
    projection[0, 3], projection[1, 3] = (
        -2 * shift[0] * longer / width,
        -2 * shift[1] * longer / height,
    )
    projection[2, 2], projection[2, 3] = -2 / (far - near), -(far + near) / (far - near)
    return Camera(view, projection, width, height, name)


def look_at(
    eye: Sequence[float], target: Sequence[float], up: Sequence[float] = (0, 0, 1)
) -> np.ndarray:
    """(4, 4) float64 view matrix of an eye that looks at a target, `up` upright in the picture.

    Raises
    ------
    RosyError
        If eye and target are one point, or the eye looks along `up`.
    """
    eye, target, up = (np.asarray(point, dtype=np.float64) for point in (eye, target, up))
    back = eye - target
    right = np.cross(up, back)
    if not np.linalg.norm(back) > 0 or not np.linalg.norm(right) > 1e-9 * np.linalg.norm(back):
        raise RosyError(
            "a camera cannot look at the point it stands on, nor along its up direction"
        )
    back, right = back / np.linalg.norm(back), right / np.linalg.norm(right)
    return _view_from_axes(right, np.cross(back, right), back, eye)


def _view_from_axes(
    right: np.ndarray, up: np.ndarray, back: np.ndarray, eye: np.ndarray
) -> np.ndarray:
    view = np.eye(4)
    view[:3, :3] = [right, up, back]
    view[:3, 3] = -view[:3, :3] @ eye
    return view


def orbit_axes(azimuth: float, elevation: float) -> np.ndarray:
    """(3, 3) rows right, up and back of a camera that looks from a direction given in degrees.

    z is up. Azimuth 0, elevation 0 looks along +y (Blender's front view), azimuth 90 along -x
    (its right view), elevation 90 down along -z (its top view).
    """
    a, e = np.radians(azimuth), np.radians(elevation)
    right = np.array([np.cos(a), np.sin(a), 0.0])
    back = np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
    return np.array([right, np.cross(back, right), back])


def orbit_camera(
    bodies: Surface | np.ndarray | Sequence[Surface | np.ndarray],
    azimuth: float,
    elevation: float,
    width: int,
    height: int,
    *,
    perspective: bool = True,
    fov: float = 2 * np.arctan(DEFAULT_SENSOR / (2 * DEFAULT_FOCAL)),
    margin: float = 0.04,
    name: str = "view",
) -> Camera:
    """A camera that looks from a direction and has everything in its frame, as large as fits.

    Parameters
    ----------
    bodies : Surface, (V, 3) ndarray, or a sequence of them
        What to frame, in world space.
    azimuth, elevation : float
        Degrees, see `orbit_axes`.
    width, height : int
        Pixels.
    perspective : bool
    fov : float
        Angle of view over the longer side, radians.
    margin : float
        Share of the frame left free at each border.
    name : str

    Raises
    ------
    RosyError
        If the angles are not finite or there is nothing to look at.

    Notes
    -----
    A point at (u, v, w) along right, up and back is within the left and right borders of an eye at
    (eu, ev, ew) if |u - eu| <= k (ew - w), with k the tangent of half the angle of view. Both are
    linear in the eye, so the nearest eye follows from the largest k w + u and k w - u alone.
    """
    width, height = check_size(width, height)
    if not np.isfinite([azimuth, elevation]).all():
        raise RosyError(f"view {azimuth},{elevation}: azimuth and elevation must be finite degrees")
    axes = orbit_axes(azimuth, elevation)
    u, v, w = (_points(bodies) @ axes.T).T
    longer = max(width, height)
    free = 1 - 2 * margin
    size = max(np.ptp(u), np.ptp(v), np.ptp(w)) or 1.0
    if not perspective:
        scale = max(np.ptp(u) * longer / width, np.ptp(v) * longer / height) / free or size
        back = w.max() + size
        eye = np.array([(u.min() + u.max()) / 2, (v.min() + v.max()) / 2, back]) @ axes
        clip = (0.5 * size, back - w.min() + 0.5 * size)
        view = _view_from_axes(*axes, eye)
        return orthographic_camera(view, width, height, scale=scale, clip=clip, name=name)
    half = np.tan(fov / 2) * free
    centre, back = zip(
        *(
            _nearest_eye(along, w, half * side / longer)
            for along, side in ((u, width), (v, height))
        ),
        strict=True,
    )
    back = max(*back, w.max() + 1e-3 * size)
    eye = np.array([*centre, back]) @ axes
    clip = (0.5 * (back - w.max()), 2 * (back - w.min()) + size)
    view = _view_from_axes(*axes, eye)
    return perspective_camera(view, width, height, fov=fov, clip=clip, name=name)


def _nearest_eye(along: np.ndarray, back: np.ndarray, slope: float) -> tuple[float, float]:
    """Where, across and back, an eye stands that just sees all points between its two borders."""
    upper, lower = (slope * back + along).max(), (slope * back - along).max()
    return (upper - lower) / 2, (upper + lower) / (2 * slope)


def _points(bodies: Surface | np.ndarray | Sequence[Surface | np.ndarray]) -> np.ndarray:
    """(V, 3) all vertices that some face uses; of plain arrays, all points."""
    if isinstance(bodies, Surface) or (isinstance(bodies, np.ndarray) and bodies.ndim == 2):
        bodies = [bodies]
    points = [
        body.vertices[np.unique(body.corner_vertex)]
        if isinstance(body, Surface)
        else np.asarray(body, dtype=np.float64).reshape(-1, 3)
        for body in bodies
    ]
    if not sum(map(len, points)):
        raise RosyError("there is nothing to look at")
    return np.concatenate(points)
