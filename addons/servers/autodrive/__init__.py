"""AutoDRIVE, whose simulator the RoboRacer Sim Racing League races in: its bridge to a DevKit, as a planner."""
