"""From a planner's reference to the car's command.

A planner finds a goal or a reference (planner). All planners of a batch then decide by the same stages (planner_batch,
decision): steering by pure pursuit (steering), speed by the laws of the scan and of friction (speed), then what is in
`safety`, and at last the friction limiter and the motor. Optional stages are registered in `stages`. The
settings of a planner say what they accept and how they depend on the car (planner_settings).
"""
