"""RoSy fields and meshes: read, generate, convert, analyze and write them (numpy only)."""
