"""Racing: one planner on one course, and the run folder that a race leaves.

`race` has race, the closed loop for one car, and `result` its RaceResult. `run_folder` writes and reads run folders.
`resimulation` simulates a run again from its recorded controls, and `replay` checks that every bit is the same. `crash`
and `rollover` say where a race ended so, and `hints` what a race shows of a mistake in its planner. `planner_texts`
reads the texts that name planners, `planner_sources` finds them, `planner_loading` builds them, `planner_origin`
describes them, and `planner_choice` reads `NAME[SETTING=VALUE,...]`.
"""
