"""Add-ons: what a testbed does not need, each in a folder of its own that the core does not import.

    ros       nodes of ROS as planners, and the bags of runs
    servers   nodes of ROS 2, Foxglove and AutoDRIVE's bridge
    gym2d     scripts that were written for f1tenth_gym
    learn     training, and policies from files
    arena     study, compare, bench, tune; race control; scenes, tight circuits
    realcar   drives and bags of real cars: identify, validate, bags; measured floors and LiDARs
    look      the report of a run, its debug page, the live view
    formats   courses, lines and cars in the files that teams have
    drivers   planners that follow a line of a map or overtake; racelines

The tables below name what users name, as "addon.module:attribute"; `fg_mujoco.registry.added` reads them. What the core
itself asks for is in `fg_mujoco.from_addons`. Nothing is imported before it is used. An add-on imports the core, and
from other add-ons only those that pyproject.toml has below it.
"""

COMMANDS = {
    "bench": "arena.commands:bench_command",
    "compare": "arena.commands:compare_command",
    "study": "arena.commands:study_command",
    "tune": "arena.commands:tune_command",
    "train": "learn.commands:train_command",
    "identify": "realcar.commands:identify_command",
    "validate": "realcar.commands:validate_command",
    "export": "realcar.commands:export_command",
    "bag": "realcar.commands:bag_command",
    "replay-scans": "realcar.commands:replay_scans_command",
    "raceline": "drivers.commands:raceline_command",
    "car": "formats.commands:car_command",
    "report": "look.commands:report_command",
    "debug": "look.commands:debug_command",
    "view": "look.commands:view_command",
    "serve": "servers.commands:SERVE",
}
"""Commands of `fg-mujoco` that add-ons have, in the order of the help."""

NAMES = {
    "Dataset": "learn.dataset:Dataset",
    "Study": "arena.study.store:Study",
    "compare": "arena.study.functions:compare",
    "debug": "look.debug:debug",
    "generate_track": "arena.random_courses.generator:generate_track",
    "identify": "realcar.bag_drive:identify",
    "parallel_env": "learn.parallel:parallel_env",
    "read_dataset": "learn.dataset:read_dataset",
    "tune": "arena.tuning:tune",
}
"""Public names of `fg_mujoco` that add-ons have."""

PLANNERS = {
    "overtaker": "drivers.overtaker:Overtaker",
    "pure_pursuit": "drivers.pure_pursuit:PurePursuit",
}
"""Planners by name."""

SCENES = {
    "corridor_sparse": "arena.bundled_scenes:corridor_sparse",
    "corridor_dense": "arena.bundled_scenes:corridor_dense",
    "cylinder_field": "arena.bundled_scenes:cylinder_field",
    "narrow_gap_120": "arena.bundled_scenes:narrow_gap_120",
    "narrow_gap_150": "arena.bundled_scenes:narrow_gap_150",
    "narrow_gap_200": "arena.bundled_scenes:narrow_gap_200",
    "square_corner": "arena.bundled_scenes:square_corner",
    "dead_end": "arena.bundled_scenes:dead_end",
    "u_turn_trap": "arena.bundled_scenes:u_turn_trap",
    "wrong_side_chicane": "arena.bundled_scenes:wrong_side_chicane",
    "crossing_box": "arena.bundled_scenes:crossing_box",
    "slow_leader": "arena.bundled_scenes:slow_leader",
}
"""Scenes by name."""

SCHEMES = {
    "policy": "learn.policy_planner:POLICIES",
    "ros": "ros.node_host.ros_planner:NODES",
}
"""What stands before a colon in the text of a planner -> what loads such planners."""
