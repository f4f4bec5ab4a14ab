"""Cameras, rasterizer, G-buffer and shadow maps: the visible pixels of meshes; numpy only."""
