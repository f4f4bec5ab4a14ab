"""Annotation: what is drawn over a picture to explain it, such as singularities, arrowheads and keys."""
