"""Studies: many runs, driven in parallel, kept in a folder and gone on with after an interruption.

`rollout` drives many worlds that differ by random parameters. `comparison` drives every planner on every course with
every seed. `friction_lab` measures how far the speed law and the tires hold. `worker_processes` runs work in processes.
"""
