"""Adapters to other libraries and programs, in the Python package only.

If the library of a module is missing, a `RosyError` is raised: by the module, or for `matplotlib_figure` by
`api.figures`::

    ffmpeg             encodes .mp4 videos with ffmpeg
    matplotlib_figure  draws figures with matplotlib
    gmsh_file          reads .msh files of Gmsh, with pyvista
    reading_process    calls functions that read files in a helper process, with limits of time and memory
    simulation_files   reads meshes with arrays from files of simulations, with pyvista and meshio
    vtk_surface        extracts the surface of VTK datasets, with pyvista
"""

#: Message if matplotlib cannot be imported.
MATPLOTLIB_MISSING = "figures are drawn by matplotlib: pip install rosyfields[figures]"
