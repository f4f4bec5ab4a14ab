"""Helper processes: long numeric work beside Blender, and large pictures on several cores.

`job` describes work that reads, computes elsewhere and applies; `helper` is a process that computes; `pool` maps
a function over several of them; `channel` is what they talk through. A helper is this package, started as a
program (`__main__`) by the Python that runs now.
"""
