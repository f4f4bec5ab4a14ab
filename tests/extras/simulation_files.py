"""Files of simulations that neither pyvista nor meshio write, or not as other programs read them."""

from pathlib import Path

import netCDF4
import numpy as np


def parts_text(array: str, kind: str = "UnstructuredGrid") -> str:
    """Return a .pvtu or .pvtp file of the parts 0.vtu and 1.vtu, which have vectors at their points."""
    return f"""<VTKFile type="P{kind}"><P{kind} GhostLevel="0">
<PPointData><PDataArray {array} NumberOfComponents="3"/></PPointData>
<PPoints><PDataArray type="Float64" NumberOfComponents="3"/></PPoints>
<Piece Source="0.vtu"/><Piece Source="1.vtu"/></P{kind}></VTKFile>"""


def collection_text(*steps: tuple[float, str]) -> str:
    """Return a .pvd file that lists files, given by their times and names."""
    entries = "".join(f'<DataSet timestep="{time}" file="{name}"/>' for time, name in steps)
    return f'<VTKFile type="Collection"><Collection>{entries}</Collection></VTKFile>'


def write_exodus(
    path: Path, points: np.ndarray, tetrahedra: np.ndarray, times: list[float], velocity: np.ndarray
) -> None:
    """Write one block of tetrahedra, with (times, n, 3) velocities at the n points."""
    with netCDF4.Dataset(path, "w", format="NETCDF3_64BIT_OFFSET") as file:
        file.api_version = file.version = np.float32(5.1)
        file.floating_point_word_size, file.file_size, file.title = 8, 1, "velocity"
        sizes = {"len_string": 33, "len_line": 81, "four": 4, "num_dim": 3, "time_step": None}
        sizes |= {"num_nodes": len(points), "num_elem": len(tetrahedra), "num_el_blk": 1}
        sizes |= {"num_el_in_blk1": len(tetrahedra), "num_nod_per_el1": 4, "num_nod_var": 3}
        for name, size in sizes.items():
            file.createDimension(name, size)
        file.createVariable("time_whole", "f8", ("time_step",))[:] = times
        for axis, column in zip("xyz", points.T, strict=True):
            file.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = column
        file.createVariable("eb_status", "i4", ("num_el_blk",))[:] = 1
        block = file.createVariable("eb_prop1", "i4", ("num_el_blk",))
        block[:] = 1
        block.setncattr("name", "ID")
        connect = file.createVariable("connect1", "i4", ("num_el_in_blk1", "num_nod_per_el1"))
        connect[:], connect.elem_type = tetrahedra + 1, "TETRA"
        names = file.createVariable("name_nod_var", "S1", ("num_nod_var", "len_string"))
        for number, axis in enumerate("xyz"):
            word = f"velocity_{axis}".ljust(33, "\0")
            names[number] = np.array(list(word), dtype="S1")
            values = file.createVariable(
                f"vals_nod_var{number + 1}", "f8", ("time_step", "num_nodes")
            )
            values[:] = velocity[..., number]
