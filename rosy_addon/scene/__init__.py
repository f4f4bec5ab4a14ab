"""Blender scenes as arrays and back: meshes, fields, cameras, lights, images and strokes."""
