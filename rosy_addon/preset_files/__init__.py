"""Presets of looks: finding, reading and writing their files, and preview pictures; numpy only."""
