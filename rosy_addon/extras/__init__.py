"""The command line of the Python package, with commands that the extension for Blender lacks.

command_line   runs the commands
film           is the command `film`, which draws the steps of a simulation as a video
cluster        draws frames on a cluster, with Dask
blender        runs Blender, for .blend files and to encode videos
"""
