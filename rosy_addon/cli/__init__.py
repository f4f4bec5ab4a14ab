"""The command line. It is the same in Blender and in Python without Blender.

The commands ``render``, ``turntable``, ``field``, ``info`` and ``presets``, and ``strokes`` for mesh files,
need only numpy. ``bake``, and ``strokes`` for .blend files, need Blender or its Python module.

The options and the function of a command are in the same module. `Options.api_arguments` passes an option
on to a function of `api` if the function has a parameter of the same name (or with the name of its
``dest``). The parameter also sets the default. Modules in order of dependence:

    streams                                          output that is safe on any terminal
    options, mesh_field                              options that several commands share
    scene                                            access to .blend files
    pictures, strokes, field, bake, presets          the commands
    parser                                           the parser of all commands, and `main`
"""
