"""Rendering: the input and the interface of renderers, and the numpy renderer."""
