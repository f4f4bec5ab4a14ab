"""Rendering: what a renderer is given, what a renderer is, and the renderer that uses numpy."""
