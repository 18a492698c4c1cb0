"""All targets, by their names. Each writes inputs that are right once, and for each try changes them and uses them."""

from . import driving_targets, file_targets, planner_targets

TARGETS = file_targets.TARGETS | planner_targets.TARGETS | driving_targets.TARGETS
