"""Helper processes: long numeric work beside Blender, and large pictures on several cores.

job            jobs: generators that read data, yield function calls, and apply their results
step_runner    runs a job step by step, with its function calls in a helper process
helper         a helper process, which calls functions: this package as a program (`__main__`)
pool           several helper processes that share function calls
channel        messages between processes
start          starts processes that end with this one
program        runs other programs as parts of jobs
frame_workers  runs a command for many frames in several processes
"""
