"""Redraw the figures of Palacios and Zhang 2011, measure them, and write docs/gallery.

`python -m tools.gallery` draws all figures, `python -m tools.gallery figure-05` one of them.
"""
