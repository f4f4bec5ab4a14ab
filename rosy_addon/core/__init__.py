"""Basics that every room may import: errors, progress, settings of looks, files, memory, color."""
