"""Studies: many races at once, and what they say together.

    rollout/         thousands of worlds that differ in parameters drawn from seeds
    comparison/      every planner on every course with every seed
    drives/          drives that a car recorded, from CSV files, bags and run folders
    friction_lab/    experiments on the tires and the speed laws, against closed forms
    identification/  the tires and the steering of a car, from a drive that it recorded
    overtaking/      every planner behind slower opponents
    racelines/       the fastest line of a circuit, with its speeds
    validation/      how well a car agrees with recorded drives

`grid_study` drives a grid of runs and writes their tables, and says how to add such a study. `store` keeps the finished
parts of a study in its folder. `workers` works on its parts. `intervals` says how sure the figures of a study are.
"""
