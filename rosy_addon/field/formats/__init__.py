"""The mesh formats, one module each: every one returns vertices and polygons as flat arrays."""
