"""The axis that points up in mesh files of each format. In world space, z points up."""

import numpy as np

#: The matrix from mesh space to world space, for each upward axis of a mesh.
UP_AXIS_MATRIX = {
    "y": np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]),
    "z": np.eye(4),
}

#: The upward axis of mesh files by file suffix, where it is not z. Blender's importers assume the same axes.
UP_AXIS_BY_SUFFIX = dict.fromkeys((".obj", ".off", ".om", ".glb", ".gltf"), "y")
