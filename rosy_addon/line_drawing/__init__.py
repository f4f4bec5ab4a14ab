"""Hatching: evenly spaced streamlines on surfaces, drawn as strokes. Numpy only."""
