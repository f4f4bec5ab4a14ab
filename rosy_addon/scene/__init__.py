"""The one room that reads and writes Blender's data."""
