"""The arena: planners that are compared, by many races that are judged together.

    study/          suites, what drives them, the table and its page; the functions study and compare
    runs/           a run of a study: a race, a duel behind a slower car, a drive that gives points
    tight_courses/  tight circuits from a seed
    random_courses/ circuits from a seed, and things that move
    race_control/   contacts and whose fault they were, overtakes, rules

`commands` has the commands, `bundled_scenes` the scenes. Worker processes and stores are
those of `fg_mujoco.rollouts`.
"""
