"""Jobs of the extension. Each reads the scene, has a picture or strokes drawn, and applies the result."""
