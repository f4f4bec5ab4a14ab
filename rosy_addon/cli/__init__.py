"""The command line, the same in Blender and in plain Python.

``render``, ``turntable``, ``field``, ``info``, ``presets`` and ``strokes`` of mesh files need numpy
only. ``bake`` and ``strokes`` of .blend files need Blender or its Python module.

Each command has its options and its function in one module. An option for a function of `api` has the name and
the default of a parameter, or says so by its ``dest``: `Options.api_arguments` passes it on. Modules in order of
dependence:

    streams                                          safe output
    options, mesh_field                              options that several commands share
    scene                                            Blender files
    pictures, strokes, field, bake, presets          the commands
    parser                                           the parser of all commands, and `main`
"""
