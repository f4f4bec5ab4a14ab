"""The command line of the Python package, and what it has besides those of the extension for Blender.

command_line   the commands
cluster        Dask: frames on a cluster
"""
