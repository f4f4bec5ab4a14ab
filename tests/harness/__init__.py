"""Measurements and devices that tests and benchmarks share."""
