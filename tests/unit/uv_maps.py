"""UV maps of the torus of `shapes`, and the colors of a texture at points of a surface."""

import numpy as np
from scipy.ndimage import map_coordinates


def torus_uv(columns: int = 96, rows: int = 48, width: float = 0.9) -> np.ndarray:
    """(C, 2) coordinates of a single chart, which is cut along two circles."""
    column, row = np.divmod(np.arange(columns * rows), rows)
    steps = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    u = (column[:, None] + steps[:, 0]) / columns
    v = (row[:, None] + steps[:, 1]) / rows
    # The large circle is 2.5 times as long as the small one.
    return np.stack([0.05 + width * u, 0.05 + 0.4 * width * v], axis=2).reshape(-1, 2)


def patches_uv(seed: int, columns: int = 96, rows: int = 48, patch: int = 12) -> np.ndarray:
    """(C, 2) coordinates of square charts, each at a random angle, half of them mirrored."""
    rng = np.random.default_rng(seed)
    column, row = np.divmod(np.arange(columns * rows), rows)
    chart = column // patch * (rows // patch) + row // patch
    count = int(chart.max()) + 1
    steps = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    # The aspect of a face is that at the middle of the tube.
    x = (column % patch)[:, None] + steps[:, 0] - patch / 2
    y = ((row % patch)[:, None] + steps[:, 1] - patch / 2) * 0.8
    local = (x + 1j * y * rng.choice([-1, 1], count)[chart][:, None]) / (2**0.5 * patch)
    local *= np.exp(2j * np.pi * rng.random(count))[chart][:, None]
    side = int(np.ceil(count**0.5))
    place = np.arange(count) % side + 0.5 + 1j * (np.arange(count) // side + 0.5)
    uv = (place[chart][:, None] + 0.98 * local) / side
    return np.stack([uv.real, uv.imag], axis=2).reshape(-1, 2)


def surface_points(surface, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """(n,) triangles and (n, 3) barycentric coordinates of random points."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet((1, 1, 1), count)
    return rng.integers(0, len(surface.triangles), count), weights


def colors_at(image: np.ndarray, surface, uv: np.ndarray, points) -> np.ndarray:
    """(n,) colors of the red channel at points, interpolated as a renderer does."""
    triangle, weights = points
    place = np.einsum("nk,nki->ni", weights, uv[surface.triangles[triangle]])
    row_and_column = place.T[::-1] * [[image.shape[0]], [image.shape[1]]] - 0.5
    return map_coordinates(image[..., 0], row_and_column, order=1, mode="grid-wrap")
