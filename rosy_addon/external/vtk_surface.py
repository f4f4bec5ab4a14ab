"""`surface_arrays`: extract the surface of VTK datasets, as polygons with arrays."""

import itertools
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core.cache import content_hash
from ..core.errors import RosyError, counted
from ..field.formats.polygons import Polygons, offsets_from_sizes
from ..field.frames import dot
from ..field.mesh_arrays import MeshArrays
from ..field.polygon_arrays import face_area_vectors, mean_per_face

#: VTK's types of surface cells, with the number of their corners. None: all points of the cell are corners.
_STRIP, _PIXEL, _QUADRATIC_POLYGON = 6, 8, 36
_CORNERS_OF_SURFACE_CELL: dict[int, int | None] = {
    **dict.fromkeys((_STRIP, 7, _QUADRATIC_POLYGON)),
    **dict.fromkeys((5, 22, 34, 69, 76), 3),
    **dict.fromkeys((_PIXEL, 9, 23, 28, 30, 70, 77), 4),
}

#: VTK's types of volume cells. For each: the type of the linear cell of the same shape, and the number of its
#: corners, which are the first points of the cell.
_POLYHEDRON = 42
_LINEAR_VOLUME_CELL: dict[int, tuple[int, int]] = {
    **dict.fromkeys((10, 24, 71, 78), (10, 4)),
    11: (11, 8),
    **dict.fromkeys((12, 25, 29, 33, 72, 79), (12, 8)),
    **dict.fromkeys((13, 26, 31, 32, 73, 80), (13, 6)),
    **dict.fromkeys((14, 27, 37, 74, 81), (14, 5)),
    15: (15, 10),
    16: (16, 12),
}

#: Names of arrays with which VTK describes the data structure. They are no results of a simulation.
_INTERNAL_ARRAYS = (
    *("vtkOriginalPointIds", "vtkOriginalCellIds", "vtkGhostType", "vtkGhostLevels"),
    *("PointMergeMap", "gmsh:dim_tags"),
)


def surface_arrays(datasets: list, name: str, has_parts: bool, repeats_blocks: bool) -> MeshArrays:
    """Return the surface of the datasets of a time step, with the arrays at its points and cells.

    Parameters
    ----------
    datasets : list of pyvista.DataSet or pyvista.MultiBlock
        The datasets of the step. If there are several, they are parts of one mesh.
    name : str
        Name of the step, for messages.
    has_parts : bool
        Whether a dataset consists of parts, so that points along the cuts occur in several parts.
    repeats_blocks : bool
        Whether a dataset may contain the same block several times.

    Raises
    ------
    RosyError
        If there is no mesh, or it has no surface.
    """
    grid = _joined_grid(datasets, name, has_parts, repeats_blocks)
    polygons, points, cells = _surface_polygons(grid, name)
    point_arrays, cell_arrays = _arrays(grid.point_data, points), _arrays(grid.cell_data, cells)
    uv = grid.point_data.active_texture_coordinates
    uv = None if uv is None or uv.shape[1] != 2 else np.asarray(uv)[points]
    return MeshArrays(*polygons, uv, point_arrays, cell_arrays)


def _joined_grid(datasets: list[Any], name: str, has_parts: bool, repeats_blocks: bool) -> Any:
    """Join the datasets of a time step, or their blocks, to one unstructured grid.

    If `has_parts` is true, points at the same position are merged. If `repeats_blocks` is true, copies of a
    block are left out. `name` is the name of the step, for messages.
    """
    import pyvista

    dataset = datasets[0] if len(datasets) == 1 else pyvista.MultiBlock(datasets)
    if isinstance(dataset, pyvista.MultiBlock):
        has_parts = True
        blocks = _blocks(dataset)
        if repeats_blocks:
            blocks = _without_copies(blocks)
        dataset = pyvista.MultiBlock(blocks).combine() if blocks else pyvista.UnstructuredGrid()
    if not isinstance(dataset, pyvista.DataSet):
        raise RosyError(f"{name}: contains no mesh")
    grid = dataset.cast_to_unstructured_grid()
    if "vtkGhostType" in grid.cell_data:
        grid = grid.remove_ghost_cells()
    if has_parts and grid.n_cells:
        grid = grid.clean(tolerance=0.0, remove_unused_points=False, average_point_data=False)
    return grid


def _blocks(dataset: Any) -> list[Any]:
    """Return all meshes in nested blocks that have cells."""
    blocks = []
    for block in dataset:
        if hasattr(block, "combine"):
            blocks += _blocks(block)
        elif block is not None and getattr(block, "n_cells", 0):
            blocks.append(block)
    return blocks


def _without_copies(blocks: list[Any]) -> list[Any]:
    """Return the blocks of a dataset, each only once.

    If the steps of an .xdmf file refer to a common grid, VTK returns this grid as an additional block.
    """
    kept: dict[bytes, Any] = {}
    for block in blocks:
        cells = np.asarray(block.cast_to_unstructured_grid().cells)
        kept.setdefault(content_hash(np.asarray(block.points), cells), block)
    return list(kept.values())


def _arrays(attributes: Any, index: np.ndarray) -> dict[str, np.ndarray]:
    """Return the numeric arrays of points or cells, by name, with the rows that `index` selects.

    Tensors whose components have names are matrices; see `_as_matrices`.
    """
    normals, uv = attributes.active_normals_name, attributes.active_texture_coordinates_name
    skipped = {*_INTERNAL_ARRAYS, normals, uv}
    arrays = {}
    for name, values in attributes.items():
        rows = np.asarray(values)
        if name not in skipped and rows.dtype.kind in "fiu":
            array = attributes.VTKObject.GetAbstractArray(name)
            components = range(array.GetNumberOfComponents())
            names = [array.GetComponentName(k) or "" for k in components]
            arrays[name] = _as_matrices(rows, names)[index]
    return arrays


def _as_matrices(rows: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Convert rows of named tensor components to 3 x 3 matrices, stored row by row.

    The name of a component of a tensor ends in two axes, such as ``XY`` or ``SIXY``, or in two digits, such as
    ``S12``. Three or four components are a tensor in the plane of x and y; its other elements are 0.

    Parameters
    ----------
    rows : (n, ...) ndarray
    names : sequence of str
        The name of each component.

    Returns
    -------
    (n, 9) ndarray
        The matrices. If not all names are names of tensor components, `rows` itself.
    """
    digits = str.maketrans("123", "XYZ")
    pairs = [tuple(re.findall("[XYZ]", name.upper().translate(digits))[-2:]) for name in names]
    axes = {3: "XY", 4: "XY", 6: "XYZ", 9: "XYZ"}.get(len(names), "")
    entries = []
    for pair in itertools.product("XYZ", repeat=2):
        found = [k for k, named in enumerate(pairs) if named in (pair, pair[::-1])]
        exact = [k for k in found if pairs[k] == pair]
        if not found and set(pair) <= set(axes):
            return rows
        entries.append((exact or found or [-1])[0])
    if not axes or set(entries) - {-1} != set(range(len(names))):
        return rows
    return np.pad(rows, ((0, 0), (0, 1)))[:, entries]


def _surface_polygons(grid: Any, name: str) -> tuple[Polygons, np.ndarray, np.ndarray]:
    """Return the surface of an unstructured grid.

    Returns
    -------
    polygons : Polygons
    points : (V,) int64 ndarray
        Index of the point of each vertex, ascending.
    cells : (F,) int64 ndarray
        Index of the cell of each face, ascending.
    """
    cell_types = np.asarray(grid.celltypes)
    if not len(cell_types):
        raise RosyError(f"{name}: contains no cells")
    if np.isin(cell_types, list(_CORNERS_OF_SURFACE_CELL)).any():
        corner_point, face_start, cells = _surface_cells(grid, cell_types)
    elif np.isin(cell_types, [*_LINEAR_VOLUME_CELL, _POLYHEDRON]).any():
        corner_point, face_start, cells = _boundary(grid, cell_types)
    else:
        found = counted(len(cell_types), "cell")
        raise RosyError(f"{name}: has no surface: none of its {found} is a face or a volume")
    points, corner_vertex = np.unique(corner_point, return_inverse=True)
    return Polygons(np.asarray(grid.points)[points], corner_vertex, face_start), points, cells


def _surface_cells(grid: Any, cell_types: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the surface cells of a grid as polygons, in the order of the cells.

    Returns
    -------
    corner_point : (C,) int64 ndarray
        Index of the point at each corner.
    face_start : (F + 1,) int64 ndarray
        Index of the first corner of each face, and the number of corners C at the end.
    face_cell : (F,) int64 ndarray
        Index of the cell of each face.
    """
    connectivity, offset = np.asarray(grid.cell_connectivity), np.asarray(grid.offset)
    corner_count = np.diff(offset)
    for cell_type, count in _CORNERS_OF_SURFACE_CELL.items():
        if count is not None:
            corner_count[cell_types == cell_type] = count
    corner_count[cell_types == _QUADRATIC_POLYGON] //= 2
    cells = np.flatnonzero(np.isin(cell_types, list(_CORNERS_OF_SURFACE_CELL)))
    is_strip = cell_types[cells] == _STRIP
    faces_of_cell = np.where(is_strip, np.maximum(corner_count[cells] - 2, 0), 1)
    face_cell = np.repeat(cells, faces_of_cell)
    in_strip = np.repeat(is_strip, faces_of_cell)
    rank = _ranks(offsets_from_sizes(faces_of_cell))
    face_start = offsets_from_sizes(np.where(in_strip, 3, corner_count[face_cell]))
    sizes = np.diff(face_start)
    position = _ranks(face_start)
    # In a strip, every other triangle is clockwise. A pixel cell lists its points row by row, not around it.
    is_turned = np.repeat(in_strip & (rank % 2 == 1), sizes) & (position > 0)
    position = np.where(is_turned, 3 - position, position)
    position += np.repeat(np.where(in_strip, rank, 0), sizes)
    in_pixel = np.repeat(cell_types[face_cell] == _PIXEL, sizes) & (position > 1)
    position = np.where(in_pixel, 5 - position, position)
    corner_point = connectivity[np.repeat(offset[face_cell], sizes) + position]
    return corner_point.astype(np.int64), face_start, face_cell


def _boundary(grid: Any, cell_types: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the boundary of the volume cells of a grid as polygons.

    The result has the points at the corners, the first corner of each face, and the volume cell behind each
    face, as in `_surface_cells`.
    """
    import pyvista
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    volume_cells = np.arange(len(cell_types))
    if not (cell_types == _POLYHEDRON).any():
        # VTK mixes up the points of second-order cells, so cells are made linear first.
        volume_cells, grid = _linear_volume_cells(grid, cell_types)
    surface_filter = vtkDataSetSurfaceFilter()
    surface_filter.SetInputData(grid)
    surface_filter.PassThroughPointIdsOn()
    surface_filter.PassThroughCellIdsOn()
    surface_filter.SetNonlinearSubdivisionLevel(0)
    surface_filter.Update()
    surface = pyvista.wrap(surface_filter.GetOutput()).cast_to_unstructured_grid()
    corner, face_start, face_cell = _surface_cells(surface, np.asarray(surface.celltypes))
    corner_point = np.asarray(surface.point_data["vtkOriginalPointIds"])[corner].astype(np.int64)
    surface_cell = np.asarray(surface.cell_data["vtkOriginalCellIds"])[face_cell]
    face_cell = volume_cells[surface_cell]
    points = np.asarray(grid.points, dtype=np.float64)
    cell_points = points[np.asarray(grid.cell_connectivity)]
    cell_center = mean_per_face(cell_points, np.asarray(grid.offset))[surface_cell]
    # Cells may be inside out. So each face is oriented to point away from the center of its cell.
    outward = mean_per_face(points[corner_point], face_start) - cell_center
    area_vectors = face_area_vectors(*Polygons(points, corner_point, face_start))
    is_inward = dot(area_vectors, outward) < 0
    # The order in which VTK returns faces is not documented, so they are sorted.
    smallest = np.minimum.reduceat(corner_point, face_start[:-1])
    total = np.add.reduceat(corner_point, face_start[:-1])
    order = np.lexsort((total, smallest, face_cell))
    sizes = np.diff(face_start)[order]
    ordered_start = offsets_from_sizes(sizes)
    position = _ranks(ordered_start)
    mirrored = np.where(position > 0, np.repeat(sizes, sizes) - position, 0)
    position = np.where(np.repeat(is_inward[order], sizes), mirrored, position)
    corner_point = corner_point[np.repeat(face_start[:-1][order], sizes) + position]
    return corner_point, ordered_start, face_cell[order]


def _ranks(start: np.ndarray) -> np.ndarray:
    """Return the position of each element in its run.

    `start` has the index of the first element of each run, and the number of elements at the end.
    """
    return np.arange(start[-1]) - np.repeat(start[:-1], np.diff(start))


def _linear_volume_cells(grid: Any, cell_types: np.ndarray) -> tuple[np.ndarray, Any]:
    """Return the indices of the volume cells of a grid, and a grid of these cells with only their corners."""
    import pyvista

    cells = np.flatnonzero(np.isin(cell_types, list(_LINEAR_VOLUME_CELL)))
    linear_type = np.zeros(len(cells), dtype=np.uint8)
    sizes = np.zeros(len(cells), dtype=np.int64)
    for cell_type, (linear, count) in _LINEAR_VOLUME_CELL.items():
        is_type = cell_types[cells] == cell_type
        linear_type[is_type], sizes[is_type] = linear, count
    # In this array, the number of points of a cell comes before its points.
    start = offsets_from_sizes(sizes + 1)
    first = np.repeat(np.asarray(grid.offset)[cells], sizes + 1)
    position = np.maximum(_ranks(start) - 1, 0)
    connectivity = np.asarray(grid.cell_connectivity)[first + position]
    connectivity[start[:-1]] = sizes
    return cells, pyvista.UnstructuredGrid(connectivity, linear_type, np.asarray(grid.points))
