"""Strokes: evenly spaced streamlines on surfaces, as curves and files. Numpy only."""
