"""The command line, the same in Blender and in plain Python.

``render``, ``turntable``, ``field``, ``info``, ``presets`` and ``strokes`` of mesh files need numpy
only. ``bake`` and ``strokes`` of .blend files need Blender or its Python module.

Each command has its options and its function in one module. Modules in order of dependence:

    streams                                          safe output
    options, view, mesh_field, look, stroke_style    options that several commands share
    extras                                           what the Python package adds
    scene, bake_workers                              Blender files, and processes for frames
    render, strokes, field, bake, presets            the commands
    parser                                           the parser of all commands, and `main`
"""
