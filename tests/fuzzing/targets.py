"""All targets, by their names. Each writes inputs that are right once, and for each try changes them and uses them."""

from . import course_targets, document_targets, driving_targets, folder_targets, other_targets, planner_targets

TARGETS = (
    course_targets.TARGETS | planner_targets.TARGETS | folder_targets.TARGETS | driving_targets.TARGETS
    | document_targets.TARGETS | other_targets.TARGETS
)  # fmt: skip
