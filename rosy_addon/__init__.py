"""RoSy: draw N-way rotational symmetry fields on meshes, as LIC pictures and hatching.

A package imports only from those above it::

    field                 surfaces and fields: formats, generation, analysis, editing
    projection            cameras, rasterizer, G-buffer and shadow maps
    compositor            pictures from G-buffers
    line_drawing          streamlines on surfaces, as strokes
    rendering, image_io   the renderer interface and its numpy renderer; image files
    gpu, presets          the renderer on the graphics card; stored looks and stroke settings
    scene                 reading and writing Blender data
    viewport              the live preview in the 3D view
    ui                    properties, panels, preferences and overlay
    cli                   the command line

The modules outside the packages are of two kinds. The base modules, such as `errors`, `progress`,
`cache` and `settings`, are imported by many packages. The main jobs are run by operators and by the
command line: `bake`, `animation`, `draw_strokes` and `turntable_video`.

``field``, ``projection``, ``compositor``, ``line_drawing``, ``rendering``, ``image_io`` and
``presets`` do not import bpy and need only numpy.
"""
