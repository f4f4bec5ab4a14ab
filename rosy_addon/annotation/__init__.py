"""Annotation: what explains a picture, drawn over it: singularities and their indices, arrowheads, keys."""
