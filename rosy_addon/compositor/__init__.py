"""From G-buffer to picture: line integral convolution, hatching, color, light; numpy only.

Where a method, equation or figure of "the paper" is named, the paper is J. Palacios and E. Zhang,
"Interactive Visualization of Rotational Symmetry Fields on Surfaces", IEEE TVCG 17(7), 2011.
"""
