"""RoSy: N-way rotational symmetry fields made visible on meshes.

The rooms, each importing only from those before it::

    field -> projection -> compositor -> scene -> bake, ui -> cli

``field``, ``projection`` and ``compositor`` need numpy alone.
"""
