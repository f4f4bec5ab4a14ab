"""What the Python package has and the extension for Blender has not: what reaches outside of RoSy.

Each module needs another program or library, and says so if it is missing::

    cluster     Dask: frames on a cluster
    ffmpeg      ffmpeg: videos in .mp4 files
"""
