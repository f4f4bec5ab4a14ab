"""From G-buffer to picture: line integral convolution, hatching, color, light; numpy only."""
