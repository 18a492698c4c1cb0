"""Racing: one planner on one course, and the run folder that a race leaves.

`race` has race, the closed loop for one car, `result` its RaceResult, and `summary` the JSON object of one.
`run_folder` writes and reads run folders.
`resimulation` simulates a run again from its recorded controls, and `replay` checks that every bit is the same. `crash`
says where a car crashed or rolled over, `off_the_wheels` where it jumped or is stuck. `planners` reads the texts that
name planners, finds and builds them; `planner_origin` tells where a planner comes from and which files it reads.
"""
