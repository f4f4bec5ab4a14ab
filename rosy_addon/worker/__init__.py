"""Helper processes: long numeric work beside Blender, and large pictures on several cores.

`job` describes work that reads, has something computed, and applies it; `step_runner` runs it bit by bit. A `helper` is a
process that computes: this package, started as a program (`__main__`). A `pool` shares calls among several. They talk
through a `channel`. `start` starts all processes, and sees to it that none outlives this one; `program` runs others.
"""
