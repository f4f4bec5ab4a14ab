"""RoSy (N-way rotational symmetry) fields and meshes: read, generate, convert, analyze and write them."""
