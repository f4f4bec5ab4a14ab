"""Draw a cross field on a twisted torus: field.png. It needs the package, `pip install rosyfields`."""

import numpy as np
import rosyfields as rf

n = np.arange(120 * 48).reshape(120, 48)
u, v = n // 48 * np.pi / 60, n % 48 * np.pi / 24
radius = 0.45 + 0.1 * np.cos(4 * v + 4 * u)
ring = 1 + radius * np.cos(v)
points = np.stack([ring * np.cos(u), ring * np.sin(u), radius * np.sin(v)], axis=-1)
quads = np.stack([n, np.roll(n, -1, 0), np.roll(n, (-1, -1), (0, 1)), np.roll(n, -1, 1)], axis=-1)
surface = rf.Surface(points.reshape(-1, 3), quads.reshape(-1, 4))
rf.render(surface, rf.smoothest(surface, degree=4), view=(-25, 45)).save("field.png")
