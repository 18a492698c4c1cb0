"""From a planner's reference to the car's command.

A planner finds a goal or a reference (planner), which becomes a safe command in one place for all planners (driving):
steering by pure pursuit (steering), speed by the laws of the scan and of friction (speed), then the rooms of
`safety`. Settings say of themselves what they accept, and how they depend on the car (settings). Lines through a map
and the speeds at which they can be driven are in racelines.
"""
