"""Looks that the pages share."""

from rosy_addon.compositor.look import Look

#: What pictures in the plane are drawn with for the eye, at twice the size and averaged.
PLANE = Look(method="members", length=60, grain=2.0, gain=3.0)

#: What pictures in the plane are drawn with to be measured, pixel by pixel: half of the noise is
#: bright, as in the paper.
MEASURED = Look(method="members", length=40, grain=2.0, gain=1.0, density=0.5)

#: What surfaces are drawn with.
SOLID = Look(method="members", length=50, grain=2.0, gain=2.5, shading=0.8, supersampling=2)

RED, BLUE = (214, 39, 40), (31, 119, 180)
