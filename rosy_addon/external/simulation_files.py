"""Meshes with arrays in the files of simulations, read with pyvista and meshio.

Every file becomes a `SimulationMesh`: the polygons of a surface, with arrays at its points and cells.
`field.array_field` makes a field from one of the arrays.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from ..core.errors import RosyError, counted
from ..core.file_io import check_readable, open_file, read_bytes
from ..field.formats.polygons import Polygons, offsets_from_sizes
from ..field.frames import dot
from ..field.polygon_arrays import face_area_vectors, mean_per_face

#: Files that VTK reads, and among them those that may hold several steps of time.
VTK_SUFFIXES = (".vtk", ".vtu", ".vtp", ".vts", ".vtr", ".vti", ".vtm", ".pvtu", ".pvtp")
XDMF_SUFFIXES = (".xdmf", ".xmf")
EXODUS_SUFFIXES = (".exo", ".ex2", ".e", ".g")

#: Files that meshio reads. VTK reads other files with the name .inp.
MESHIO_SUFFIXES = (".msh", ".med", ".inp")

#: Files that list the files of a series.
SERIES_SUFFIXES = (".pvd", ".series")

SUFFIXES = (*VTK_SUFFIXES, *XDMF_SUFFIXES, *EXODUS_SUFFIXES, *MESHIO_SUFFIXES, *SERIES_SUFFIXES)

#: Files whose parts repeat the points along the cuts between them.
_PARTED_SUFFIXES = (".pvtu", ".pvtp")

#: VTK's cell types. Surface cells have this number of corners, or None: all points are corners.
_STRIP, _PIXEL, _QUADRATIC_POLYGON = 6, 8, 36
_CORNERS_OF_SURFACE_CELL: dict[int, int | None] = {
    **dict.fromkeys((_STRIP, 7, _QUADRATIC_POLYGON)),
    **dict.fromkeys((5, 22, 34, 69, 76), 3),
    **dict.fromkeys((_PIXEL, 9, 23, 28, 30, 70, 77), 4),
}

#: Volume cells: the linear cell of the same shape, and the number of its corners, which come first.
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

#: Arrays that describe the data structure.
_INTERNAL_ARRAYS = (
    *("vtkOriginalPointIds", "vtkOriginalCellIds", "vtkGhostType", "vtkGhostLevels"),
    *("PointMergeMap", "gmsh:dim_tags"),
)

#: The first bytes of an HDF5 file.
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True, eq=False)
class SimulationMesh:
    """A surface with arrays, from the file of a simulation.

    Attributes
    ----------
    name : str
        The path of the file, for messages.
    polygons : Polygons
        Their vertices are the points that a face uses, in the order of the file.
    point_arrays, cell_arrays : dict of str to (n, ...) ndarray
        Numbers at the V vertices and the F faces, with the dtype of the file.
    time : float or None
        The time of the step; None if the file does not state it.
    note : str
        What the user should know about how the file was read; may be empty.
    """

    name: str
    polygons: Polygons
    point_arrays: dict[str, np.ndarray]
    cell_arrays: dict[str, np.ndarray]
    time: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Step:
    """One step of a series.

    Attributes
    ----------
    paths : tuple of Path
        The files of the step; several if it is stored in parts.
    index : int or None
        Number of the step in a file that holds several, from 0.
    time : float or None
    """

    paths: tuple[Path, ...]
    index: int | None = None
    time: float | None = None

    @property
    def name(self) -> str:
        """The name of the step for messages, such as "flow.xdmf, step 3"."""
        name = str(self.paths[0])
        return name if self.index is None else f"{name}, step {self.index + 1}"

    def read(self) -> SimulationMesh:
        """Read the mesh of the step."""
        datasets = [_read_dataset(path, self.index) for path in self.paths]
        with _reporting(self.paths[0]):
            grid = _joined_grid(datasets, self.paths[0], self.name)
            polygons, points, cells = _surface_polygons(grid, self.name)
            point_arrays = _arrays(grid.point_data, points)
            cell_arrays = _arrays(grid.cell_data, cells)
        return SimulationMesh(self.name, polygons, point_arrays, cell_arrays, self.time)


# Reading files


def read_simulation(path: str | os.PathLike[str], step: int | None = None) -> SimulationMesh:
    """Read the surface in the file of a simulation.

    ==================================  =======================================================
    ``.vtk``                            VTK's legacy format, any dataset
    ``.vtu .vtp .vts .vtr .vti .vtm``   VTK's XML formats
    ``.pvtu .pvtp``                     the same in parts, which are joined
    ``.xdmf .xmf``                      XDMF, with the numbers in XML or HDF5
    ``.exo .ex2 .e .g``                 Exodus II
    ``.msh``                            Gmsh
    ``.med``                            Salome
    ``.inp``                            Abaqus, the mesh only
    ``.pvd .series``                    lists of files, one for each step
    ==================================  =======================================================

    If a file has surface cells, the mesh consists of these. Otherwise it is the boundary of the
    volume cells; a face then has the values of the cell behind it. Cells of second and higher order
    are reduced to their corners, triangle strips are split. Of a file with several blocks, the arrays
    that all blocks have are kept. VTK's normals and texture coordinates are not read as arrays.

    Parameters
    ----------
    path : path-like
    step : int, optional
        Number of the step in a file with several, from 1. The last one by default.

    Returns
    -------
    SimulationMesh

    Raises
    ------
    RosyError
        If the file is missing, damaged or of another kind, has no surface or no such step, or the
        libraries that read it are not installed.

    Examples
    --------
    >>> mesh = read_simulation("flow.vtu")
    >>> sorted(mesh.point_arrays)
    ['p', 'velocity']
    """
    path = Path(path)
    steps = list_steps([path])
    if step is not None and not 1 <= step <= len(steps):
        raise RosyError(f"{path}: has no step {step}, only {counted(len(steps), 'step')}, from 1")
    number = len(steps) if step is None else step
    mesh = steps[number - 1].read()
    if len(steps) == 1 or step is not None:
        return mesh
    time = "" if mesh.time is None else f", time {mesh.time:g}"
    return replace(mesh, note=f"{path}: the last of {len(steps)} steps was read{time}")


def list_steps(paths: Sequence[str | os.PathLike[str]]) -> list[Step]:
    """Return the steps of a series, without reading their meshes.

    Parameters
    ----------
    paths : sequence of path-like
        Files of one step or several. If their names differ only in numbers, the numbers determine
        the order; otherwise they stay in the given order.

    Returns
    -------
    list of Step

    Raises
    ------
    RosyError
        As of `read_simulation`, or if a list of files is empty.
    """
    steps = [step for path in in_order([Path(path) for path in paths]) for step in _steps_of(path)]
    for step in steps:
        for path in step.paths:
            check_readable(path)
    return steps


def simulation_steps(
    paths: Sequence[str | os.PathLike[str]],
) -> Iterator[tuple[Step, SimulationMesh]]:
    """Iterate over the steps of a series with their meshes.

    A mesh is read when it is asked for, and is not kept.

    Examples
    --------
    >>> for step, mesh in simulation_steps(["flow.pvd"]):
    ...     print(step.time, mesh.polygons.face_count)
    """
    return ((step, step.read()) for step in list_steps(paths))


def in_order(paths: list[Path]) -> list[Path]:
    """Return paths sorted by the numbers in their names, if nothing else differs."""
    parts = [re.split(r"(\d+)", str(path)) for path in paths]
    if len({tuple(part[::2]) for part in parts}) > 1:
        return paths
    return sorted(paths, key=lambda path: [int(n) for n in re.findall(r"\d+", str(path))])


def _steps_of(path: Path) -> list[Step]:
    """Return the steps of one file."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        *others, last = SUFFIXES
        raise RosyError(
            f"{path}: is not a file of a simulation: its name must end in {', '.join(others)} or {last}"
        )
    check_readable(path)
    if suffix in SERIES_SUFFIXES:
        return _listed_steps(path)
    times: Sequence[float] = ()
    if suffix in (*XDMF_SUFFIXES, *EXODUS_SUFFIXES):
        with _reporting(path):
            times = _times(_time_reader(path))
    if len(times) > 1:
        return [Step((path,), index, float(time)) for index, time in enumerate(times)]
    return [Step((path,), time=float(times[0]) if len(times) else None)]


def _listed_steps(path: Path) -> list[Step]:
    """Return the steps of a .pvd or .series file of ParaView. Files of one time are one step."""
    text = read_bytes(path)
    try:
        if path.suffix.lower() == ".pvd":
            datasets = ElementTree.fromstring(text).iter("DataSet")
            entries = [(entry.get("timestep", "0"), entry.attrib["file"]) for entry in datasets]
        else:
            entries = [(entry["time"], entry["name"]) for entry in json.loads(text)["files"]]
        parts: dict[float, list[Path]] = {}
        for time, name in entries:
            parts.setdefault(float(time), []).append(path.parent / name)
    except (ElementTree.ParseError, ValueError, TypeError, KeyError, RecursionError):
        raise RosyError(f"{path}: is damaged, or not one of ParaView's lists of files") from None
    if not parts:
        raise RosyError(f"{path}: lists no files")
    return [Step(tuple(files), time=time) for time, files in sorted(parts.items())]


def _time_reader(path: Path) -> Any:
    """Return VTK's reader of a file with steps of time, after it has read what there is."""
    if path.suffix.lower() in XDMF_SUFFIXES:
        from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

        _check_hdf5_files(path)
        reader = vtkXdmfReader()
    else:
        from vtkmodules.vtkIOExodus import vtkExodusIIReader

        reader = vtkExodusIIReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    if path.suffix.lower() in EXODUS_SUFFIXES:
        for kind in (reader.NODAL, reader.ELEM_BLOCK):
            reader.SetAllArrayStatus(kind, 1)
    return reader


def _check_hdf5_files(path: Path) -> None:
    """Check the files that an .xdmf file refers to. VTK crashes without them.

    Raises
    ------
    RosyError
        If one of them is missing, or is not an HDF5 file.
    """
    try:
        items = ElementTree.fromstring(read_bytes(path)).iter("DataItem")
        texts = [item.text or "" for item in items if item.get("Format", "").upper() == "HDF"]
    except ElementTree.ParseError as error:
        raise RosyError(f"{path}: cannot be read: {error}") from None
    for name in dict.fromkeys(text.strip().rpartition(":")[0] for text in texts):
        hdf5 = path.parent / name
        with open_file(hdf5) as file:
            if file.read(len(_HDF5_SIGNATURE)) != _HDF5_SIGNATURE:
                raise RosyError(f"{hdf5}: is not an HDF5 file, but {path} refers to it")


def _times(reader: Any) -> Sequence[float]:
    """Return the times in a file; empty if it states none."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    return reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()


def _read_dataset(path: Path, index: int | None) -> Any:
    """Return the contents of a file as one of pyvista's datasets."""
    suffix = path.suffix.lower()
    check_readable(path)
    with _reporting(path):
        import pyvista

        if suffix in MESHIO_SUFFIXES:
            import meshio

            return pyvista.from_meshio(meshio.read(path))
        if suffix in VTK_SUFFIXES:
            return pyvista.read(str(path))
        reader = _time_reader(path)
        times = _times(reader)
        if len(times):
            reader.UpdateTimeStep(times[index or 0])
        else:
            reader.Update()
        return pyvista.wrap(reader.GetOutputDataObject(0))


def _missing(path: Path, error: ModuleNotFoundError) -> RosyError:
    """Return the error for a library that is not installed."""
    return RosyError(f"{path}: needs {error.name}: pip install rosyfields[io]")


@contextlib.contextmanager
def _reporting(path: Path) -> Iterator[None]:
    """Report what the libraries raise or print as an error of one line, or not at all.

    VTK and the libraries below it print errors and continue. meshio prints them and exits.
    """
    try:
        import pyvista
    except ModuleNotFoundError as error:
        raise _missing(path, error) from None
    catcher = pyvista.VtkErrorCatcher(send_to_logging=False)
    reason = None
    with _discarded_output() as printed:
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"), catcher:
                warnings.simplefilter("ignore")
                yield
        except (RosyError, MemoryError):
            raise
        except ModuleNotFoundError as error:
            raise _missing(path, error) from None
        except (Exception, SystemExit) as error:
            text = "" if isinstance(error, SystemExit) else str(error)
            reason = text or printed() or type(error).__name__
    alerts = [event.alert for event in catcher.events if event.kind.upper().startswith("ERR")]
    if alerts:
        # Messages with addresses say only which part of VTK failed.
        telling = [alert for alert in alerts if "(0x" not in alert]
        reason = (telling or ["it is damaged, or another kind of file"])[0]
    if reason is not None:
        line = next((line for line in reason.splitlines() if line.strip()), "no reason was given")
        raise RosyError(f"{path}: cannot be read: {line.strip()[:200]}")


@contextlib.contextmanager
def _discarded_output() -> Iterator[Any]:
    """Discard what is printed to the standard streams, also by C libraries.

    Yields
    ------
    function
        Returns what Python code printed so far.
    """
    text = io.StringIO()
    with contextlib.ExitStack() as stack:
        null = stack.enter_context(open(os.devnull, "wb"))
        for stream, number in ((sys.stdout, 1), (sys.stderr, 2)):
            with contextlib.suppress(OSError, AttributeError):
                stream.flush()
            with contextlib.suppress(OSError):
                copy = os.dup(number)
                stack.callback(os.close, copy)
                stack.callback(os.dup2, copy, number)
                os.dup2(null.fileno(), number)
        stack.enter_context(contextlib.redirect_stdout(text))
        stack.enter_context(contextlib.redirect_stderr(text))
        yield text.getvalue


# From datasets to polygons


def _joined_grid(datasets: list[Any], path: Path, name: str) -> Any:
    """Return the unstructured grid of the datasets of a step; several are its parts."""
    import pyvista

    dataset = datasets[0] if len(datasets) == 1 else pyvista.MultiBlock(datasets)
    has_parts = path.suffix.lower() in _PARTED_SUFFIXES
    if isinstance(dataset, pyvista.MultiBlock):
        has_parts = True
        blocks = _blocks(dataset)
        if path.suffix.lower() in XDMF_SUFFIXES:
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
    """Return the meshes with cells in nested blocks."""
    blocks = []
    for block in dataset:
        if hasattr(block, "combine"):
            blocks += _blocks(block)
        elif block is not None and getattr(block, "n_cells", 0):
            blocks.append(block)
    return blocks


def _without_copies(blocks: list[Any]) -> list[Any]:
    """Return the blocks without the repeated ones.

    VTK returns the grid that the steps of an .xdmf file refer to as a further block.
    """
    kept: list[Any] = []
    for block in blocks:
        if not any(
            block.n_cells == other.n_cells
            and np.array_equal(block.points, other.points)
            and np.array_equal(
                block.cast_to_unstructured_grid().cells, other.cast_to_unstructured_grid().cells
            )
            for other in kept
        ):
            kept.append(block)
    return kept


def _arrays(attributes: Any, index: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of numbers at some points or cells."""
    skipped = {
        *_INTERNAL_ARRAYS,
        attributes.active_normals_name,
        attributes.active_texture_coordinates_name,
    }
    return {
        name: np.asarray(values)[index]
        for name, values in attributes.items()
        if name not in skipped and np.asarray(values).dtype.kind in "fiu"
    }


def _surface_polygons(grid: Any, name: str) -> tuple[Polygons, np.ndarray, np.ndarray]:
    """Return the surface of an unstructured grid.

    Returns
    -------
    polygons : Polygons
    points : (V,) int64 ndarray
        The point of each vertex, ascending.
    cells : (F,) int64 ndarray
        The cell of each face, ascending.
    """
    cell_types = np.asarray(grid.celltypes)
    if not len(cell_types):
        raise RosyError(f"{name}: contains no cells")
    if np.isin(cell_types, list(_CORNERS_OF_SURFACE_CELL)).any():
        corner_point, face_start, cells = _surface_cells(grid, cell_types)
    elif np.isin(cell_types, [*_LINEAR_VOLUME_CELL, _POLYHEDRON]).any():
        corner_point, face_start, cells = _boundary(grid, cell_types)
    else:
        raise RosyError(
            f"{name}: has no surface: none of its {counted(len(cell_types), 'cell')} is a face or a volume"
        )
    points = np.unique(corner_point)
    polygons = Polygons(
        np.asarray(grid.points)[points], np.searchsorted(points, corner_point), face_start
    )
    return polygons, points, cells


def _surface_cells(grid: Any, cell_types: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the surface cells of a grid as polygons of points, in the order of the cells.

    Returns
    -------
    corner_point : (C,) int64 ndarray
    face_start : (F + 1,) int64 ndarray
    face_cell : (F,) int64 ndarray
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
    # Every other triangle of a strip is clockwise. The points of a pixel are in rows.
    is_turned = np.repeat(in_strip & (rank % 2 == 1), sizes) & (position > 0)
    position = np.where(is_turned, 3 - position, position)
    position += np.repeat(np.where(in_strip, rank, 0), sizes)
    in_pixel = np.repeat(cell_types[face_cell] == _PIXEL, sizes) & (position > 1)
    position = np.where(in_pixel, 5 - position, position)
    corner_point = connectivity[np.repeat(offset[face_cell], sizes) + position]
    return corner_point.astype(np.int64), face_start, face_cell


def _boundary(grid: Any, cell_types: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the boundary of the volume cells of a grid, in the form of `_surface_cells`."""
    import pyvista
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    volume_cells = np.arange(len(cell_types))
    if not (cell_types == _POLYHEDRON).any():
        # VTK confuses the points of cells of second order.
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
    # Cells may be inside out, so faces are turned away from the centers of their cells.
    outward = mean_per_face(points[corner_point], face_start) - cell_center
    area_vectors = face_area_vectors(*Polygons(points, corner_point, face_start))
    is_inward = dot(area_vectors, outward) < 0
    # VTK's order of the faces is not documented.
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
    """Return the number of each element in its run from 0, given the first elements of the runs, and the end."""
    return np.arange(start[-1]) - np.repeat(start[:-1], np.diff(start))


def _linear_volume_cells(grid: Any, cell_types: np.ndarray) -> tuple[np.ndarray, Any]:
    """Return the volume cells of a grid, and a grid of these cells reduced to their corners."""
    import pyvista

    cells = np.flatnonzero(np.isin(cell_types, list(_LINEAR_VOLUME_CELL)))
    linear_type = np.zeros(len(cells), dtype=np.uint8)
    sizes = np.zeros(len(cells), dtype=np.int64)
    for cell_type, (linear, count) in _LINEAR_VOLUME_CELL.items():
        is_type = cell_types[cells] == cell_type
        linear_type[is_type], sizes[is_type] = linear, count
    # In front of its points, each cell has their number.
    start = offsets_from_sizes(sizes + 1)
    first = np.repeat(np.asarray(grid.offset)[cells], sizes + 1)
    position = np.maximum(_ranks(start) - 1, 0)
    connectivity = np.asarray(grid.cell_connectivity)[first + position]
    connectivity[start[:-1]] = sizes
    return cells, pyvista.UnstructuredGrid(connectivity, linear_type, np.asarray(grid.points))
