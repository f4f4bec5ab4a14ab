"""Rendering: the input of renderers, their protocols, and the numpy renderer."""
