"""The renderer on the graphics card: shaders, and the numpy data they work on."""
