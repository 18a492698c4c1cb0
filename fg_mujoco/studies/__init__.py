"""Studies: many races at once, and what they say together.

    rollout/         thousands of worlds that differ in parameters drawn from seeds
    comparison/      every planner on every course with every seed
    friction_lab/    experiments on the tires and the speed laws, against closed forms
    identification/  the tires and the steering of a car, from a drive that it recorded

`folders` writes the files of a study, and `worker_processes` drives work in processes of their own. `intervals` says
how sure the figures of a study are.
"""
