"""Readers and writers of mesh and field files, one module for each format."""
