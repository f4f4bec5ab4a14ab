"""Find faces that lie on others, such as the second side of a two-sided sheet."""

import numpy as np

from ..core.errors import counted

#: Difference of successive states of the generator SplitMix64.
SPLIT_MIX_GAMMA = np.uint64(0x9E3779B97F4A7C15)


def copied_faces(
    vertices: np.ndarray, corner_vertex: np.ndarray, face_start: np.ndarray
) -> np.ndarray:
    """Return (F,) bool: which faces have the same corner positions as an earlier face, in any order.

    The mesh is given by (V, 3) positions, the (C,) vertices of the corners, and the (F + 1,) first corners of
    the faces, and C.
    """
    # A 64-bit hash of each position: the same positions have the same one, and 0.0 equals -0.0.
    bits = (np.asarray(vertices, dtype=np.float64) + 0.0).view(np.uint64)
    key = np.zeros(len(bits), dtype=np.uint64)
    for column in bits.T:
        key = split_mix(key ^ column)
    is_copy = np.ones(len(face_start) - 1, dtype=bool)
    total = np.add.reduceat(key[corner_vertex], face_start[:-1])
    is_copy[np.unique(total, return_index=True)[1]] = False
    return is_copy


def copies_note(name: str, *polygons: np.ndarray) -> str:
    """Return a note for the user about the copied faces of a mesh; an empty string if there are none.

    `name` is the name of the mesh in the note. `polygons` are the arguments of `copied_faces`.
    """
    is_copy = copied_faces(*polygons)
    if not is_copy.any():
        return ""
    return (
        f"{name}: {counted(int(is_copy.sum()), 'face')} of {len(is_copy):,} lie on others with the same corners, "
        "so singularities there are false and lines are drawn twice"
    )


def split_mix(key: np.ndarray) -> np.ndarray:
    """Return a hash of each uint64 number: SplitMix64's output for that state (Steele et al., OOPSLA 2014).

    For the multiples 0, 1, 2 and so on of `SPLIT_MIX_GAMMA`, the hashes are a pseudorandom sequence.
    """
    return scrambled(key + SPLIT_MIX_GAMMA)


def scrambled(key: np.ndarray) -> np.ndarray:
    """Return uint64 numbers whose bits depend on all bits of the given ones: the last step of `split_mix`."""
    key = (key ^ key >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ key >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return key ^ key >> np.uint64(31)
