"""Helper processes, for long computations beside Blender and for large pictures on several cores.

job            defines jobs: generators that read data, yield function calls, and apply their results
step_runner    runs a job step by step, with its function calls in a helper process
helper         controls a helper process, which calls functions for this process. It runs `__main__`
pool           distributes function calls to several helper processes
channel        sends messages between processes
start          starts processes of this package with a connection to them
guard          is the program of a process that kills programs and removes a folder when its parent has ended
lifeline       starts programs that are killed, and makes a folder that is removed, when this process ends
program        runs other programs as parts of jobs
frame_workers  runs a command for many frames in several processes
"""
