"""Basics that every room (subpackage) may import: errors, progress, settings, cache, files, memory, color."""
