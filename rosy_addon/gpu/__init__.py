"""The G-buffer and the sheets compositor once more, on the graphics card."""
