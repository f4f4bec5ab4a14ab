"""Benchmarks: one script for each claim about speed, which prints ratios."""
