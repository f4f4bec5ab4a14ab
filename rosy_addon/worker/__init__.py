"""Helper processes: long numeric work beside Blender, and large pictures on several cores.

job            jobs: read, have results computed, apply them
step_runner    runs the steps of a job one by one
helper         a process that makes calls: this package, started as a program (`__main__`)
pool           several helpers that share calls
channel        messages between processes
start          starts processes that end with this one
program        other programs, as parts of jobs
frame_workers  a command for many frames, in several processes
"""
