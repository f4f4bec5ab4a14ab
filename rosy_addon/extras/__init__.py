"""The command line of the Python package, with commands that the extension for Blender lacks.

command_line   the commands
film           the command `film`: the steps of a simulation as a video
cluster        Dask: frames on a cluster
blender        Blender: .blend files, and videos
"""
