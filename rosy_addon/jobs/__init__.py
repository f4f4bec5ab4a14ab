"""The jobs: each reads the scene, has a picture or strokes drawn, and applies the result."""
