"""Read surfaces with arrays from files of simulations, with pyvista and meshio.

`Surface` takes the `MeshArrays` that these functions return, and `field.array_field` makes a field from
one of the arrays.
"""

import contextlib
import io
import json
import math
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
from ..field.mesh_arrays import MeshArrays
from ..field.mesh_io import must_end_in
from .gmsh_file import is_gmsh, read_gmsh
from .reading_process import read_in_helper
from .vtk_surface import surface_arrays

#: Suffixes of files that VTK reads. Files of the second and third format may hold several time steps.
VTK_SUFFIXES = (
    ".vtk", ".vtu", ".vtp", ".vts", ".vtr", ".vti", ".vtm", ".pvtu", ".pvtp", ".glb", ".gltf"
)  # fmt: skip
XDMF_SUFFIXES = (".xdmf", ".xmf")
EXODUS_SUFFIXES = (".exo", ".ex2", ".e", ".g")

#: Suffixes of files that meshio reads. VTK also reads .inp files, but these have another format.
MESHIO_SUFFIXES = (".msh", ".med", ".inp", ".mesh")

#: Suffixes of files that list the files of a series.
SERIES_SUFFIXES = (".pvd", ".series")

SUFFIXES = (*VTK_SUFFIXES, *XDMF_SUFFIXES, *EXODUS_SUFFIXES, *MESHIO_SUFFIXES, *SERIES_SUFFIXES)

#: Suffixes of files whose mesh is stored in parts. Points along the cuts are stored in several parts.
PARTED_SUFFIXES = (".pvtu", ".pvtp")

#: The first bytes of an HDF5 file.
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Step:
    """A time step of a simulation.

    Attributes
    ----------
    paths : tuple of Path
        The files of the step. There are several if the step is stored in parts.
    index : int or None
        Number of the step in its file, from 0, if the file has several steps. None otherwise.
    time : float or None
        Time of the step; None if the files do not state it.
    """

    paths: tuple[Path, ...]
    index: int | None = None
    time: float | None = None

    @property
    def name(self) -> str:
        """Name of the step for messages, such as "flow.xdmf, step 3"."""
        name = str(self.paths[0])
        return name if self.index is None else f"{name}, step {self.index + 1}"

    def read(self) -> MeshArrays:
        """Read the surface of the step, with the arrays at its points and cells."""
        return read_in_helper(self.paths, _read_step, self)


def _read_step(step: Step) -> MeshArrays:
    """Read the surface of a step in this process; see `Step.read`."""
    datasets = [_read_dataset(path, step.index) for path in step.paths]
    suffix = step.paths[0].suffix.lower()
    has_parts, repeats_blocks = suffix in PARTED_SUFFIXES, suffix in XDMF_SUFFIXES
    with _reporting(step.paths[0]):
        arrays = surface_arrays(datasets, step.name, has_parts, repeats_blocks)
    return _without_gaps(arrays, step.name) if suffix == ".msh" else arrays


def _without_gaps(arrays: MeshArrays, name: str) -> MeshArrays:
    """Replace rows of NaN in the arrays of vectors and tensors of a Gmsh file by 0, which means undefined.

    Gmsh files may have no data at some vertices or faces, where their rows are NaN. `MeshArrays.note` of the
    result says at how many, and begins with `name`.
    """
    notes = []
    for data in (arrays.vertex_data, arrays.face_data):
        for key, values in data.items():
            if values.ndim != 2 or values.shape[1] < 3 or values.dtype.kind != "f":
                continue
            missing = np.isnan(values).all(axis=1)
            if missing.any():
                data[key] = np.where(missing[:, None], 0.0, values)
                notes.append(
                    f"'{key}' has no data at {missing.sum():,} of {len(values):,} elements: undefined there"
                )
    return replace(arrays, note=f"{name}: {'; '.join(notes)}" if notes else arrays.note)


def read_simulation(path: str | os.PathLike[str], step: int | None = None) -> MeshArrays:
    """Read the surface in a file of a simulation.

    ==================================  =======================================================
    ``.vtk``                            VTK's legacy format, any dataset
    ``.vtu .vtp .vts .vtr .vti .vtm``   VTK's XML formats
    ``.pvtu .pvtp``                     VTK's XML formats in parts, which are joined
    ``.xdmf .xmf``                      XDMF, with the numbers in XML or HDF5
    ``.exo .ex2 .e .g``                 Exodus II
    ``.msh``                            Gmsh
    ``.med``                            Salome
    ``.inp``                            Abaqus, the mesh only
    ``.mesh``                           Medit
    ``.glb .gltf``                      glTF, the meshes of all nodes
    ``.pvd .series``                    lists of files, one for each step
    ==================================  =======================================================

    If a file has surface cells, the mesh consists of these. Otherwise the mesh is the boundary of the
    volume cells, and each face has the values of the cell behind it. Cells of second and higher order
    are reduced to their corners. Triangle strips are split into triangles. If a file has several blocks,
    an array is kept only if all blocks have it. VTK's normals are not read. VTK's texture
    coordinates become the texture coordinates of the mesh.

    Parameters
    ----------
    path : path-like
    step : int, optional
        Number of the time step, from 1, if the file has several. By default, the last step is read.

    Returns
    -------
    MeshArrays
        Its vertices are those points of the file that a face uses, in the order of the file. Arrays have the
        dtype that they have in the file.

    Raises
    ------
    RosyError
        If the file is missing, damaged or of another format, has no surface or no such step, or the
        libraries that read it are not installed.

    Examples
    --------
    >>> arrays = read_simulation("flow.vtu")
    >>> sorted(arrays.vertex_data)
    ['p', 'velocity']
    """
    path = Path(path)
    steps = list_steps([path])
    if step is not None and not 1 <= step <= len(steps):
        raise RosyError(f"{path}: has no step {step}, only {counted(len(steps), 'step')}, from 1")
    number = len(steps) if step is None else step
    arrays = steps[number - 1].read()
    if len(steps) == 1 or step is not None:
        return arrays
    time = steps[-1].time
    text = "" if time is None else f", time {time:g}"
    return replace(arrays, note=f"{path}: the last of {len(steps)} steps was read{text}")


def read_object(mesh: Any, name: str) -> MeshArrays:
    """Read the surface of a data set of PyVista or a mesh of meshio, with its arrays.

    The surface is found in the same way as the surface in a file; see `read_simulation`.

    Parameters
    ----------
    mesh : pyvista.DataSet or meshio.Mesh
    name : str
        Name of the object, for messages.

    Raises
    ------
    RosyError
        If the object has no surface, or PyVista is not installed.
    """
    with _reporting(Path(name)):
        import pyvista

        dataset = mesh if hasattr(mesh, "extract_surface") else pyvista.from_meshio(mesh)
        return surface_arrays([dataset], name, False, False)


def list_steps(paths: Sequence[str | os.PathLike[str]]) -> list[Step]:
    """Return the steps of a series, without reading their meshes.

    Parameters
    ----------
    paths : sequence of path-like
        Files with one or more steps each. If their names differ only in numbers, the files are sorted by
        these numbers. Otherwise they stay in the given order.

    Returns
    -------
    list of Step

    Raises
    ------
    RosyError
        For the same reasons as `read_simulation`, or if a list of files is empty.
    """
    steps = [step for path in in_order([Path(path) for path in paths]) for step in _steps_of(path)]
    for step in steps:
        for path in step.paths:
            check_readable(path)
    return steps


def in_order(paths: list[Path]) -> list[Path]:
    """Return paths sorted by the numbers in them. If they also differ in other text, keep the given order."""
    parts = [re.split(r"(\d+)", str(path)) for path in paths]
    if len({tuple(part[::2]) for part in parts}) > 1:
        return paths
    return sorted(paths, key=lambda path: [int(n) for n in re.findall(r"\d+", str(path))])


def _steps_of(path: Path) -> list[Step]:
    """Return the steps of one file."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise RosyError(f"{path}: is not a file of a simulation: {must_end_in(SUFFIXES)}")
    check_readable(path)
    if suffix in SERIES_SUFFIXES:
        return _listed_steps(path)
    times: Sequence[float] = ()
    if suffix in (*XDMF_SUFFIXES, *EXODUS_SUFFIXES):
        times = read_in_helper([path], _read_times, path)
    if len(times) > 1:
        return [Step((path,), index, float(time)) for index, time in enumerate(times)]
    return [Step((path,), time=float(times[0]) if len(times) else None)]


def _read_times(path: Path) -> Sequence[float]:
    """Return the times of the steps in an XDMF or Exodus II file, read in this process."""
    with _reporting(path):
        return _times(_time_reader(path))


def _listed_steps(path: Path) -> list[Step]:
    """Return the steps of a .pvd or .series file of ParaView. Files with the same time form one step."""
    text = read_bytes(path)
    try:
        if path.suffix.lower() == ".pvd":
            datasets = ElementTree.fromstring(text).iter("DataSet")
            entries = [(entry.get("timestep", "0"), entry.attrib["file"]) for entry in datasets]
        else:
            entries = [(entry["time"], entry["name"]) for entry in json.loads(text)["files"]]
        parts: dict[float, list[Path]] = {}
        for time, name in entries:
            if not math.isfinite(number := float(time)):
                raise ValueError
            parts.setdefault(number, []).append(path.parent / name)
    except (
        ElementTree.ParseError,
        ArithmeticError,
        LookupError,
        ValueError,
        TypeError,
        RecursionError,
    ):
        raise RosyError(f"{path}: is damaged, or not one of ParaView's lists of files") from None
    if not parts:
        raise RosyError(f"{path}: lists no files")
    return [Step(tuple(files), time=time) for time, files in sorted(parts.items())]


def _time_reader(path: Path) -> Any:
    """Return VTK's reader for an XDMF or Exodus II file. It has already read the metadata, such as times."""
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
    """Check the HDF5 files that an .xdmf file refers to. If one is missing, VTK would crash.

    Raises
    ------
    RosyError
        If one of these files is missing, or is not an HDF5 file.
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
    """Return the times of the steps in a file; empty if the file states no times."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    return reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or ()


def _read_dataset(path: Path, index: int | None) -> Any:
    """Return the contents of a file as one of pyvista's datasets.

    `index` is the number of the time step, from 0, or None if the file has no steps.
    """
    suffix = path.suffix.lower()
    check_readable(path)
    with _reporting(path):
        import pyvista

        if suffix in MESHIO_SUFFIXES:
            import meshio

            if suffix == ".msh" and is_gmsh(path):
                return read_gmsh(path)
            dataset = pyvista.from_meshio(meshio.read(path))
            if suffix == ".med":
                _name_components(dataset, path)
            return dataset
        if suffix in VTK_SUFFIXES:
            return pyvista.read(str(path))
        reader = _time_reader(path)
        times = _times(reader)
        if len(times):
            reader.UpdateTimeStep(times[index or 0])
        else:
            reader.Update()
        return pyvista.wrap(reader.GetOutputDataObject(0))


def _name_components(dataset: Any, path: Path) -> None:
    """Give the arrays of a .med file the names of their components, which meshio does not keep."""
    import h5py

    with h5py.File(path) as file:
        fields = file.get("CHA", {})
        names = {name: field.attrs.get("NOM", b"").split() for name, field in fields.items()}
    for attributes in (dataset.point_data, dataset.cell_data):
        for key in attributes:
            # meshio appends the step to the name of a field.
            for k, name in enumerate(names.get(key.partition("[")[0], ())):
                attributes.VTKObject.GetAbstractArray(key).SetComponentName(k, name.decode())


@contextlib.contextmanager
def _reporting(path: Path) -> Iterator[None]:
    """Context manager: raise errors of the libraries as a `RosyError` of one line. Discard all other output.

    It catches exceptions, errors that VTK prints before it continues, and the exit of meshio, which prints
    its errors first. Warnings are discarded.
    """
    reason = None
    with _discarded_output() as printed:
        try:
            import pyvista

            catcher = pyvista.VtkErrorCatcher(send_to_logging=False)
            with warnings.catch_warnings(), np.errstate(all="ignore"), catcher:
                warnings.simplefilter("ignore")
                yield
        except (RosyError, MemoryError):
            raise
        except ModuleNotFoundError as error:
            raise RosyError(f"{path}: needs {error.name}: pip install rosyfields[io]") from None
        except (Exception, SystemExit) as error:
            text = "" if isinstance(error, SystemExit) else str(error)
            reason = text or printed() or type(error).__name__
    alerts = [event.alert for event in catcher.events if event.kind.upper().startswith("ERR")]
    if alerts:
        # Messages with memory addresses tell only which class of VTK failed, not why.
        telling = [alert for alert in alerts if "(0x" not in alert]
        reason = (telling or ["it is damaged, or another kind of file"])[0]
    if reason is not None:
        line = next((line for line in reason.splitlines() if line.strip()), "no reason was given")
        raise RosyError(f"{path}: cannot be read: {line.strip()[:200]}")


@contextlib.contextmanager
def _discarded_output() -> Iterator[Any]:
    """Context manager: discard everything that is printed to the standard streams, also by C libraries.

    Yields
    ------
    function
        Function that returns what Python code (but not C code) has printed so far, as text.
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
