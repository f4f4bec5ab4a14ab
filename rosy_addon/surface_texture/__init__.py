"""Textures of the surface: the field drawn in a UV map, without seams."""
