"""What needs other libraries or programs. It is in the Python package, not in the extension for Blender.

Each module says so if something is missing; for `matplotlib_figure`, which imports matplotlib, `api.figures` does::

    ffmpeg             ffmpeg: videos in .mp4 files
    matplotlib_figure  matplotlib: figures
    simulation_files   pyvista and meshio: meshes with arrays in the files of simulations
"""

#: What is wrong where matplotlib cannot be imported.
MATPLOTLIB_MISSING = "figures are drawn by matplotlib: pip install rosyfields[figures]"
