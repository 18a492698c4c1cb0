"""The arena: planners that are compared, by many races that are judged together.

    comparison/     every planner on every course with every seed
    overtaking/     every planner behind slower opponents, and scenarios among other cars
    league/         every planner against every other, in heats
    labs/           planners of students, graded by the checks of a lab
    tight_courses/  tight circuits from a seed
    random_courses/ circuits from a seed, and things that move
    scenes/         the bundled scenes
    race_control/   contacts and whose fault they were, overtakes, rules

`grid_study` drives a grid of runs and writes their tables, and says how to add such a study. `intervals` says how sure
the figures of a study are. `evaluation` compares planners over friction coefficients, and `turn` tells whose
planner ended a worker process. `commands` has the commands. Worker processes and stores of results are those of
`fg_mujoco.rollouts`.
"""
