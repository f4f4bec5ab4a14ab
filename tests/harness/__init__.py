"""Measurements, planar pictures and devices that tests, benchmarks and figures share."""
