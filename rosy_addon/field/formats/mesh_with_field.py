"""Write a mesh with directions, magnitudes and singularities of its field: `.vtp`, `.vtu`, `.ply`, `.npz`."""

import base64
import io

import numpy as np

from ..directional_field import stored_directions
from ..rosy_field import RosyField
from ..singularities import find_singularities
from ..surface import Surface

#: The beginning of the names of the arrays of directions, which are counted from 1.
DIRECTION = "direction_"

#: VTK's names of number types, by numpy's codes, and VTK's codes of three cell types.
_VTK_TYPES = {"f8": "Float64", "i8": "Int64", "u1": "UInt8"}
_TRIANGLE, _POLYGON, _QUAD = 5, 7, 9

_VTK_FILE = """<?xml version="1.0"?>
<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64"><{kind}>
<Piece NumberOfPoints="{points}" NumberOf{cells}="{faces}">
<Points>
{positions}</Points>
<{cells}>
{topology}</{cells}>
<PointData>
{point_data}</PointData>
<CellData>
{cell_data}</CellData>
</Piece></{kind}></VTKFile>
"""


def field_arrays(surface: Surface, field: RosyField) -> tuple[dict[str, np.ndarray], ...]:
    """Return the arrays that describe a field at the faces, and those at the vertices, by name.

    Returns
    -------
    face_arrays : dict of str to (F, 3) or (F,) float64 ndarray
        "direction_1" to "direction_N", and "magnitude".
    vertex_arrays : dict of str to (V,) float64 ndarray
        "singularity": the index of each vertex, a multiple of 1/N.
    """
    rows = stored_directions(surface, field)
    face_arrays = {f"{DIRECTION}{k + 1}": rows[:, k] for k in range(field.degree)}
    face_arrays["magnitude"] = field.magnitude
    index = np.zeros(len(surface.vertices))
    vertices, indices = find_singularities(surface, field)
    index[vertices] = indices / field.degree
    return face_arrays, {"singularity": index}


def vtk_bytes(surface: Surface, field: RosyField, suffix: str) -> bytes:
    """Return the contents of a VTK file with a mesh and its field; `suffix` is ".vtp" or ".vtu"."""
    face_arrays, vertex_arrays = field_arrays(surface, field)
    connectivity, offsets = (a.astype("<i8") for a in (surface.corner_vertex, surface.face_start))
    topology = {"connectivity": connectivity, "offsets": offsets[1:]}
    kind, cells = "PolyData", "Polys"
    if suffix == ".vtu":
        kind, cells = "UnstructuredGrid", "Cells"
        sizes = np.diff(surface.face_start)
        types = np.select([sizes == 3, sizes == 4], [_TRIANGLE, _QUAD], _POLYGON)
        topology["types"] = types.astype("u1")
    arrays = {"positions": {"Points": surface.vertices}, "topology": topology}
    arrays |= {"point_data": vertex_arrays, "cell_data": face_arrays}
    texts: dict[str, object] = {key: _vtk_arrays(each) for key, each in arrays.items()}
    texts |= {"points": len(surface.vertices), "faces": surface.face_count}
    return _VTK_FILE.format(kind=kind, cells=cells, **texts).encode("ascii")


def _vtk_arrays(arrays: dict[str, np.ndarray]) -> str:
    """Return arrays as elements of VTK's XML: in base64, the number of bytes of an array and its values."""
    elements = []
    for name, values in arrays.items():
        data = np.ascontiguousarray(values).tobytes()
        text = base64.b64encode(len(data).to_bytes(8, "little") + data).decode("ascii")
        kind = _VTK_TYPES[values.dtype.str[1:]]
        components = f'NumberOfComponents="{values.shape[1]}" ' if values.ndim > 1 else ""
        elements.append(
            f'<DataArray type="{kind}" Name="{name}" {components}format="binary">\n'
            f"{text}\n</DataArray>\n"
        )
    return "".join(elements)


def ply_bytes(surface: Surface, field: RosyField) -> bytes:
    """Return the contents of a binary `.ply` file. A vector is three properties NAME_x, NAME_y and NAME_z."""
    face_arrays, vertex_arrays = field_arrays(surface, field)
    corners = {name: surface.vertices[:, k] for k, name in enumerate("xyz")}
    vertices = _table({**corners, **vertex_arrays})
    values = _table(face_arrays)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property double {name}" for name in vertices.dtype.names]
    header += [f"element face {len(values)}", "property list int int vertex_indices"]
    header += [f"property double {name}" for name in values.dtype.names]
    text = "\n".join([*header, "end_header\n"]).encode("ascii")
    return text + vertices.tobytes() + _ply_faces(surface, values)


def _table(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Return arrays as one structured array, with a column for each component of a vector."""
    columns = {}
    for name, values in arrays.items():
        if values.ndim == 1:
            columns[name] = values
        else:
            columns.update((f"{name}_{axis}", values[:, k]) for k, axis in enumerate("xyz"))
    table = np.empty(len(next(iter(columns.values()))), [(name, "<f8") for name in columns])
    for name, values in columns.items():
        table[name] = values
    return table


def _ply_faces(surface: Surface, values: np.ndarray) -> bytes:
    """Return the rows of the faces of a binary `.ply` file: the count of corners, their vertices, and values.

    `values` is a structured array with a row for each face: the properties that follow the vertices.
    """
    sizes = np.diff(surface.face_start)
    row_bytes = 4 + 4 * sizes + values.dtype.itemsize
    starts = np.cumsum(row_bytes) - row_bytes
    data = np.empty(int(row_bytes.sum()), dtype=np.uint8)
    for size in np.unique(sizes).tolist():
        faces = np.flatnonzero(sizes == size)
        columns = [("count", "<i4"), ("corners", "<i4", (size,)), ("values", values.dtype)]
        rows = np.empty(len(faces), columns)
        rows["count"] = size
        rows["corners"] = surface.corner_vertex[surface.face_start[faces, None] + np.arange(size)]
        rows["values"] = values[faces]
        raw = rows.view(np.uint8).reshape(len(faces), rows.dtype.itemsize)
        data[starts[faces, None] + np.arange(rows.dtype.itemsize)] = raw
    return data.tobytes()


def npz_bytes(surface: Surface, field: RosyField) -> bytes:
    """Return the contents of an `.npz` file: the mesh, the (F, N, 3) directions and the singularities.

    Faces of different sizes are stored as `corner_vertex` and `face_start`; see `polygons.Polygons`.
    """
    vertices, indices = find_singularities(surface, field)
    mesh = {"faces": surface.faces}
    if isinstance(mesh["faces"], list):
        mesh = {"corner_vertex": surface.corner_vertex, "face_start": surface.face_start}
    file = io.BytesIO()
    np.savez(
        file,
        vertices=surface.vertices,
        **mesh,
        degree=np.array(field.degree),
        directions=stored_directions(surface, field),
        magnitude=field.magnitude,
        singular_vertices=vertices,
        singular_indices=indices,
    )
    return file.getvalue()
