"""The figures of Palacios and Zhang 2011 redrawn, measured and written as pages of docs/gallery.

`python -m tools.gallery` draws all of them, `python -m tools.gallery figure-05` one.
"""
