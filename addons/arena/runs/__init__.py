"""The runs of a study: a race, a duel behind a slower car, or a drive that gives points. Each becomes a row.

run                a race, what it depends on, and the figures of its car
duels, slower_cars the planner behind a slower car
graded_drive       a drive of a student's planner, judged by `checks` from its `recorded_commands`
"""
