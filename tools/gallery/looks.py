"""Looks that the pages share."""

from rosy_addon.compositor.look import Look

#: Look of planar pictures that pages show. They are drawn at twice the size and averaged.
PLANE = Look(method="members", length=60, line_width=2.0, gain=3.0)

#: Look of planar pictures for measurements: half of the noise cells are bright, as in the paper.
MEASURED = Look(method="members", length=40, line_width=2.0, gain=1.0, density=0.5)

#: Looks of surfaces: gray streaks, and colored streaks that look woven.
SOLID = Look(method="members", length=50, line_width=2.0, gain=2.5, shading=0.8, supersampling=2)
PLAID = SOLID.with_settings({"hue": "noise", "line_width": 3.0, "gain": 3.0, "length": 60})

RED = (214, 39, 40)
