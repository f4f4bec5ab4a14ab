"""Adapters to other libraries and programs, in the Python package only.

Each module raises a `RosyError` if its library is missing; for `matplotlib_figure`, `api.figures` does::

    ffmpeg             ffmpeg: videos in .mp4 files
    matplotlib_figure  matplotlib: figures
    simulation_files   pyvista and meshio: meshes with arrays in the files of simulations
    vtk_surface        pyvista: the surface of VTK's datasets
"""

#: Message if matplotlib cannot be imported.
MATPLOTLIB_MISSING = "figures are drawn by matplotlib: pip install rosyfields[figures]"
